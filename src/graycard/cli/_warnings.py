# SPDX-License-Identifier: Apache-2.0
"""Warnings of scores as a terminal tells them: each once, with all the scores that it concerns."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from graycard.records import HOLDS_NOISE, JobResult, RunRecord, ScoreSheet

FOLDER = "the whole folder"
"""Stands in the place of a score for a warning that concerns none."""
_VIEW = re.compile(r"([\w./-]+): ")
_NUMBER = re.compile(r"(?<![\w.+-])[-+]?(\d+(\.\d+)?(e[-+]?\d+)?|inf)(?!\w)")
_FEW = 2
"""Scenes of a track up to which each is named even where they are all."""


@dataclass(slots=True)
class Warned:
    """One warning of a sheet."""

    says: str
    """The text, of the first view where views have their own."""
    scores: list[str] = field(default_factory=list)
    """Metrics, or protocols, that it concerns."""
    views: list[str] = field(default_factory=list)
    """Views that say it."""
    numbers: bool = False
    """True if some scores say so with other numbers."""

    def lines(self) -> tuple[str, str]:
        """Return the text, and all that it concerns."""
        first = f" ({self.scores[0]}; with other numbers the others)" if self.numbers else ""
        views = f"; views: {', '.join(self.views)}" if self.views[1:] else ""
        return self.says + first, f"of {', '.join(self.scores)}{views}"


def warned(sheet: ScoreSheet) -> tuple[Warned, ...]:
    """Return the warnings of a sheet, each once, in the order of its scores.

    Scores and views that say the same but for numbers are one warning, which has the numbers of the first.
    """
    found: dict[str, Warned] = {}
    for name, says in _told(sheet):
        view, rest = _parted(says)
        entry = found.setdefault(_alike(rest), Warned(says))
        if name not in entry.scores:
            entry.scores.append(name)
            entry.numbers |= _parted(entry.says) != (view, rest)
        if view and view not in entry.views:
            entry.views.append(view)
    return tuple(found.values())


def run_lines(record: RunRecord) -> list[list[str]]:
    """Return the warnings of a run: the text, the scores, then rows and scenes, a line each.

    Warnings that are the same but for numbers and views are told once, with the text of the first.
    """
    handed = {method.name for method in record.methods if method.sees}
    texts: dict[tuple[str, tuple[str, ...]], str] = {}
    places: dict[tuple[str, tuple[str, ...]], dict[str, list[str]]] = defaultdict(dict)
    for result in (r for r in record.results if r.sheet):
        for alike, (text, scores) in _of_result(result, handed).items():
            texts.setdefault((alike, tuple(scores)), text)
            scenes = places[alike, tuple(scores)].setdefault(result.job.method, [])
            if (scene := f"{result.job.track}/{result.job.scene}") not in scenes:
                scenes.append(scene)
    every = _scenes_by_row(record.results)
    return [
        [
            texts[key],
            ", ".join(key[1]),
            "; ".join(f"{row} on {_among(s, every[row])}" for row, s in of.items()),
        ]
        for key, of in places.items()
    ]


def _of_result(result: JobResult, handed: Collection[str]) -> dict[str, tuple[str, list[str]]]:
    """Return text and scores of the warnings of a fit, by the part that is the same of those alike."""
    assert result.sheet is not None
    found: dict[str, tuple[str, list[str]]] = {}
    for name, says in _told(result.sheet):
        if says.endswith(HOLDS_NOISE) and result.job.method in handed:
            continue  # that the truth is too good is no news
        _, scores = found.setdefault(_alike(_parted(says)[1]), (says, []))
        if name not in scores:
            scores.append(name)
    return found


def _told(sheet: ScoreSheet) -> Iterator[tuple[str, str]]:
    """Yield each warning: the score that it concerns, and its text."""
    yield from ((FOLDER, says) for says in sheet.warnings)
    for name, score in [(s.metric, s) for s in sheet.scores] + [(s.protocol, s) for s in sheet.protocols]:
        yield from ((name, says) for says in score.warnings)


def _parted(says: str) -> tuple[str, str]:
    """Return the view that a text begins with, or nothing, and the rest."""
    view = _VIEW.match(says)
    return (view[1], says[view.end() :]) if view else ("", says)


def _alike(says: str) -> str:
    """Return the part of a text that is the same whatever its numbers; names keep theirs."""
    return _NUMBER.sub("#", says)


def _scenes_by_row(results: Sequence[JobResult]) -> Mapping[str, list[str]]:
    """Return the scenes that each row of a run was fitted on."""
    every: dict[str, list[str]] = defaultdict(list)
    for result in results:
        every[result.job.method].append(f"{result.job.track}/{result.job.scene}")
    return every


def _among(scenes: Sequence[str], every: Sequence[str]) -> str:
    """Name scenes; those of a track in one word where they are all that a row was fitted on, and many."""
    words = []
    for track in dict.fromkeys(scene.partition("/")[0] for scene in scenes):
        own, whole = ([s for s in dict.fromkeys(x) if s.startswith(f"{track}/")] for x in (scenes, every))
        words += [f"all {len(own)} scenes of {track}"] if _FEW < len(own) == len(whole) else own
    return ", ".join(words)

# SPDX-License-Identifier: Apache-2.0
"""The verb that scores predictions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.table import Table

from graycard.cli._options import Json
from graycard.cli._terminal import FAILED, OK, Terminal, new_table, write_optional_json
from graycard.cli._warnings import Warned, warned
from graycard.cli.adoption._captures import score_captured
from graycard.records import Score, ScoreSheet


@dataclass(frozen=True)
class ScoreCommand:
    """Score a predictions folder, from any code, against the truth of its scene. An imported capture has
    none: its held-out photographs are scored, apart from all scores with truth.
    """

    predictions: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="PREDICTIONS")]
    """The folder: docs/reference/formats.md says what is in it."""
    scene: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")]
    """DATASET/<track>/<scene>."""
    protocol: Annotated[str, tyro.conf.arg(metavar="NAME")] = "graycard"
    """A published protocol, a group such as albedo, appearance or relighting, or all."""
    all: bool = False
    """Also list metrics that the predictions do not provide."""
    json: Json = None
    """Also write the scores to this file."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Score; a score that failed makes the exit code 1."""
        from graycard.dataset import check_scene, is_imported
        from graycard.eval import score_predictions

        check_scene(self.scene)
        if is_imported(self.scene):
            return score_captured(terminal, self.predictions, self.scene, self.protocol, self.json)
        sheet = score_predictions(self.predictions, self.scene, self.protocol)
        self._show(terminal, sheet)
        write_optional_json(self.json, sheet)
        return _conclude(sheet, terminal)

    def _show(self, terminal: Terminal, sheet: ScoreSheet) -> None:
        """Print all tables, then the warnings by the numbers that stand beside the scores."""
        from graycard.eval import NEIGHBOURS

        told = warned(sheet)
        self._show_scores(terminal, sheet, told)
        if any(score.breakdown.keys() & NEIGHBOURS for score in sheet.scores):
            terminal.out.print(_breakdown_table(sheet, NEIGHBOURS))
        if any(score.breakdown.keys() - NEIGHBOURS for score in sheet.scores):
            terminal.out.print(_parts_table(sheet, NEIGHBOURS))
        if sheet.protocols:
            terminal.out.print(_protocol_table(sheet))
            _say_spread(sheet, terminal)
        for number, entry in enumerate(told, 1):
            first, more = entry.lines()
            terminal.say(f"warning {number}: {first}", more)

    def _show_scores(self, terminal: Terminal, sheet: ScoreSheet, told: Sequence[Warned]) -> None:
        shown = [score for score in sheet.scores if self.all or score.status != "not provided"]
        if shown:
            terminal.out.print(_score_table(shown, told))
        if left := len(sheet.scores) - len(shown):
            what = "1 metric is" if left == 1 else f"{left} metrics are"
            terminal.out.print(f"{what} not provided by these predictions: --all lists them")
        for note in _notes(shown):
            terminal.out.print(note)
        for advice, names in _lacking().items() if sheet.scores else ():
            terminal.advise(f"{advice} to score {', '.join(names)} as well")


def _conclude(sheet: ScoreSheet, terminal: Terminal) -> int:
    """Print why scores failed and how many did, and return the exit code."""
    scores = (*sheet.scores, *sheet.protocols)
    failed = [score for score in scores if score.status == "failed"]
    for reason in dict.fromkeys(score.reason for score in failed):
        terminal.err.print(f"failed: {reason}")
    scored = sum(score.status == "scored" for score in scores)
    if not scored and not failed:
        terminal.err.print("nothing was scored: docs/reference/formats.md lists the layers that are")
    terminal.out.print(
        f"score: {sheet.method} on {sheet.track}/{sheet.scene}: {scored} scored, {len(failed)} failed, "
        f"{len(scores) - scored - len(failed)} not provided"
    )
    return OK if scored and not failed else FAILED


def _notes(scores: Sequence[Score]) -> list[str]:
    """Return what a reader must know of some metrics, each note once."""
    from graycard.eval import find_metric

    return [note for note in dict.fromkeys(find_metric(score.metric).note for score in scores) if note]


def _lacking() -> dict[str, list[str]]:
    """Return the metrics that lack what they need on this machine, by the advice how to get it."""
    from graycard.eval import unavailable

    found: dict[str, list[str]] = {}
    for name, advice in unavailable().items():
        found.setdefault(advice, []).append(name)
    return found


def _score_table(scores: Sequence[Score], told: Sequence[Warned]) -> Table:
    """Return a row for each score, with the numbers of its warnings if any score has some."""
    table = new_table(
        "metric", "score", "unit", "optimum", "ceiling", "views", "gauge", *["warning"] * bool(told)
    )
    for score in scores:
        numbers = ", ".join(str(n) for n, entry in enumerate(told, 1) if score.metric in entry.scores)
        value = f"{score.value:.4g}" if score.value is not None else score.status
        ceiling = f"{score.noise_ceiling:.4g}" if score.noise_ceiling is not None else ""
        gauge = " ".join(f"{g:.4g}" for g in score.gauge) if score.gauge else ""
        counts = f"{score.scored}/{score.expected}"
        cells = score.unit, f"{score.optimum:g}", ceiling, counts, gauge
        table.add_row(score.metric, value, *cells, *[numbers] * bool(told))
    return table


def _breakdown_table(sheet: ScoreSheet, columns: Sequence[str]) -> Table:
    """Return the same numbers by neighbouring rules, a column each."""
    names = [n for n in columns if any(n in score.breakdown for score in sheet.scores)]
    table = new_table("the same", *(name.replace("_", " ") for name in names))
    for score in sheet.scores:
        if score.breakdown.keys() & names:
            found = (score.breakdown.get(name) for name in names)
            table.add_row(score.metric, *("" if x is None else f"{x:.4g}" for x in found))
    return table


def _parts_table(sheet: ScoreSheet, columns: Sequence[str]) -> Table:
    """Return the same numbers of each edit, of regions, or by other names of the metric's own."""
    table = new_table("in parts", "")
    for score in sheet.scores:
        if parts := {name: x for name, x in score.breakdown.items() if name not in columns}:
            table.add_row(score.metric, ", ".join(f"{name} {x:.4g}" for name, x in parts.items()))
    return table


def _protocol_table(sheet: ScoreSheet) -> Table:
    """One row for each protocol, with what it does."""
    from graycard.eval import find_protocols

    table = new_table("protocol", "score", "unit", "pixels", "factors", "fitted on", "space", "pooling")
    for score in _by_protocols(sheet):
        (protocol,) = find_protocols(score.protocol)
        rules = protocol.rules_of(score.metric)
        value = f"{score.value:.4g}" if score.value is not None else score.status
        cells = rules.pixels, rules.gauge, rules.fitted_on, rules.space, rules.pooling
        table.add_row(score.protocol, value, score.unit, *cells)
    return table


def _say_spread(sheet: ScoreSheet, terminal: Terminal) -> None:
    """Say how far apart the protocols put the albedo, where more than one gave a number in dB."""
    albedo = (s for s in _by_protocols(sheet) if s.unit == "dB" and s.metric.startswith("albedo."))
    found = [(score.value, score.protocol) for score in albedo if score.value is not None]
    if len(found) > 1:
        (low, lowest), (high, highest) = min(found), max(found)
        apart = 0.0 if low == high else high - low
        terminal.out.print(
            f"spread: one prediction has {low:.1f} dB by {lowest} and {high:.1f} dB by {highest}, "
            f"{apart:.1f} dB apart"
        )


def _by_protocols(sheet: ScoreSheet) -> Iterator[Score]:
    """Yield graycard's own PSNRs of albedo, where there are some, and the published scores."""
    from graycard.eval import find_metric

    own = (score for score in sheet.scores if score.unit == "dB")
    yield from (score for score in own if find_metric(score.metric).layer == "base_color")
    yield from sheet.protocols

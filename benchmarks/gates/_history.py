# SPDX-License-Identifier: Apache-2.0
"""The history of a gate over commits: what each reached, and a page with a sparkline a metric."""

import math
from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from graycard.benchmarks.gates._gate import GateVerdict
from graycard.io import (
    Label,
    Name,
    check_version,
    from_builtins,
    markdown_text,
    read_json,
    write_bytes,
    write_json,
)
from graycard.records import RunRecord

RECORDS, PAGE = "gate-history.json", "README.md"
HISTORY_VERSION = 1
SHOWN = 30
"""Commits that a sparkline shows: the last ones."""
_BARS = "▁▂▃▄▅▆▇█"


@dataclass(frozen=True, slots=True)
class Mean:
    """The mean of one metric of one row over the scenes of a track."""

    track: Name
    row: Label
    metric: Label
    unit: Label
    higher_is_better: bool
    headline: bool
    value: float
    scenes: int

    @property
    def key(self) -> tuple[str, str, str]:
        """Key of the line that it is a point of."""
        return self.track, self.row, self.metric


@dataclass(frozen=True, slots=True)
class Entry:
    """Scores that one commit reached."""

    suite: Name
    suite_version: int
    commit: Label
    date: Label
    """UTC, ISO 8601."""
    exit_code: Literal[0, 1, 2]
    says: str
    means: tuple[Mean, ...]


@dataclass(frozen=True, slots=True)
class GateHistory:
    """Scores of all commits, the first first: ``gate-history.json``."""

    entries: tuple[Entry, ...] = ()
    format: Literal["graycard-gate-history"] = "graycard-gate-history"
    format_version: int = HISTORY_VERSION


def entry_of(run: RunRecord, watched: Collection[str], verdict: GateVerdict, commit: str) -> Entry:
    """Return what the watched rows of a run reached."""
    values: dict[tuple[str, str, str], list[float]] = defaultdict(list)
    for result in run.results:
        for score in result.sheet.scores if result.sheet else ():
            if score.value is not None and math.isfinite(score.value) and result.job.method in watched:
                values[result.job.track, result.job.method, score.metric].append(score.value)
    known = {metric.id: metric for metric in run.metrics}
    means = (
        Mean(*key, m.unit, m.higher_is_better, m.headline, round(sum(found) / len(found), 6), len(found))
        for key, found in values.items()
        if (m := known.get(key[2])) is not None
    )
    date = datetime.now(UTC).isoformat(timespec="seconds")
    told = run.suite, run.suite_version, commit or "unknown", date
    return Entry(*told, verdict.exit_code, verdict.says, tuple(means))


def read_history(folder: Path) -> GateHistory:
    """Return the history in a folder; an empty one where there is none.

    Raises:
        RecordError: It is damaged, misspelt, or of a newer format.
    """
    path = folder / RECORDS
    if not path.exists():
        return GateHistory()
    data = read_json(path)
    check_version(data, HISTORY_VERSION, path)
    return from_builtins(GateHistory, data, source=str(path))


def add_entry(folder: Path, entry: Entry) -> Path:
    """Add what a commit reached to the history in a folder, and write its page anew.

    A commit that is there already has its entry of that suite replaced.

    Returns:
        The page.

    Raises:
        RecordError: The history is damaged, misspelt, or of a newer format.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    before = read_history(folder)
    others = [e for e in before.entries if (e.suite, e.commit) != (entry.suite, entry.commit)]
    history = replace(before, entries=(*others, entry))
    write_json(folder / RECORDS, history)
    write_bytes(folder / PAGE, page(history).encode())
    return folder / PAGE


def page(history: GateHistory) -> str:
    """Return the history as Markdown: a table a suite and track, a row for each metric of each row."""
    parts = ["# Accuracy over commits"]
    for suite in dict.fromkeys(entry.suite for entry in history.entries):
        parts += _suite([entry for entry in history.entries if entry.suite == suite])
    return "\n\n".join(parts) + "\n"


def _suite(entries: Sequence[Entry]) -> Iterator[str]:
    last = entries[-1]
    mark = "✅" if last.exit_code == 0 else "❌"
    commit, date, says = map(markdown_text, (last.commit[:12], last.date, last.says))
    yield f"## Suite {markdown_text(last.suite)}"
    yield (
        f"{mark} {commit}, {date}: {says}. {len(entries)} commit{'s' * (len(entries) != 1)}; lines show the "
        f"last {SHOWN}, the newest at the right."
    )
    for track in dict.fromkeys(mean.track for mean in last.means):
        means = [mean for mean in last.means if mean.track == track]
        first = [mean for mean in means if mean.headline]
        yield f"### {markdown_text(track)}"
        if first:
            yield _table(first, entries)
        if rest := [mean for mean in means if not mean.headline]:
            yield f"<details><summary>{len(rest)} more</summary>\n\n{_table(rest, entries)}\n\n</details>"


def _table(means: Sequence[Mean], entries: Sequence[Entry]) -> str:
    heads, sides = ("row", "metric", "", "now", "before", "best", "better is"), ("---",) * 3 + ("---:",) * 3
    head = f"| {' | '.join(heads)} |\n| {' | '.join((*sides, '---'))} |\n"
    return head + "\n".join(_row(mean, entries) for mean in means)


def _row(now: Mean, entries: Sequence[Entry]) -> str:
    found = [next((m.value for m in e.means if m.key == now.key), None) for e in entries]
    values = [value for value in found if value is not None]
    best = max(values) if now.higher_is_better else min(values)
    unit = "" if now.unit == "1" else f" {now.unit}"
    before = f"{values[-2]:.4g}" if len(values) > 1 else ""
    cells = (
        now.row, now.metric, sparkline(found[-SHOWN:]), f"{now.value:.4g}{unit}", before, f"{best:.4g}",
        "higher" if now.higher_is_better else "lower",
    )  # fmt: skip
    return "| " + " | ".join(map(markdown_text, cells)) + " |"


def sparkline(values: Sequence[float | None]) -> str:
    """Return values as bars of a line of text, the largest the highest; a value that lacks is a gap."""
    known = [value for value in values if value is not None and math.isfinite(value)]
    low, high = min(known, default=0.0), max(known, default=0.0)
    return "".join(
        "·" if value is None or not math.isfinite(value) else _BARS[_height(value, low, high)]
        for value in values
    )


def _height(value: float, low: float, high: float) -> int:
    span = high - low
    if not 0 < span < math.inf:
        return len(_BARS) // 2
    return round((value - low) / span * (len(_BARS) - 1))

# SPDX-License-Identifier: Apache-2.0
"""The gate: a run against a baseline. It fails when accuracy drops, and when nothing was measured."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from graycard import RecordError, RunRecord, Score, decode, read_json, write_json

BASELINE_VERSION = 1


@dataclass(frozen=True, slots=True)
class Expected:
    """One score that a baseline expects."""

    track: str
    scene: str
    method: str
    seed: int
    metric: str
    protocol: str
    value: float
    tolerance: float
    """By how much it may get worse, in the unit of the metric."""

    @property
    def key(self) -> tuple[str, str, str, int, str, str]:
        """What identifies the score."""
        return self.track, self.scene, self.method, self.seed, self.metric, self.protocol


@dataclass(frozen=True, slots=True)
class Baseline:
    """The scores that a run must reach."""

    suite: str
    scores: tuple[Expected, ...]
    format: Literal["graycard-baseline"] = "graycard-baseline"
    format_version: int = BASELINE_VERSION


@dataclass(frozen=True, slots=True)
class Change:
    """A score against its baseline."""

    expected: Expected
    found: float | None
    """None if the run has no such score."""
    unit: str = ""
    reason: str = ""

    def __str__(self) -> str:
        """One line: which score, both values, the tolerance."""
        e = self.expected
        head = f"{e.track}/{e.scene} {e.method} {e.metric}"
        if self.found is None:
            return f"{head}: expected {e.value:.4g}, got no score ({self.reason})"
        return f"{head}: expected {e.value:.4g} {self.unit} (tolerance {e.tolerance:g}), got {self.found:.4g}"


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the gate says."""

    worse: tuple[Change, ...]
    missing: tuple[Change, ...]
    better: tuple[Change, ...]
    compared: int

    @property
    def exit_code(self) -> int:
        """0 nothing is worse; 1 a score is worse; 2 scores are missing, or nothing was measured."""
        if self.missing or not self.compared:
            return 2
        return 1 if self.worse else 0


def make_baseline(run: RunRecord) -> Baseline:
    """The scores of a run as a baseline, each with the tolerance of its metric.

    Raises:
        RecordError: The run has no score.
    """
    tolerance = {metric.id: metric.tolerance for metric in run.metrics}
    expected = tuple(
        Expected(*key[:4], score.metric, score.protocol, score.value, tolerance[score.metric])
        for key, score in _scores(run)
        if score.value is not None
    )
    if not expected:
        raise RecordError("expected a run with scores to make a baseline of, got one without any")
    return Baseline(run.suite, expected)


def write_baseline(path: Path, baseline: Baseline) -> None:
    """Write a baseline as JSON.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    write_json(path, baseline)


def read_baseline(path: Path) -> Baseline:
    """A baseline from JSON.

    Raises:
        RecordError: It is missing, damaged, misspelt, of a newer version, or expects nothing.
    """
    baseline = decode(Baseline, read_json(path), RecordError, str(path))
    if baseline.format_version > BASELINE_VERSION:
        raise RecordError(
            f"expected a baseline of version {BASELINE_VERSION} in {path}, got {baseline.format_version}. "
            "Install a newer graycard"
        )
    return baseline


def judge(run: RunRecord, baseline: Baseline) -> Verdict:
    """Compare each score that the baseline expects; scores that it does not name do not count."""
    found = {(*key, score.metric, score.protocol): score for key, score in _scores(run)}
    changes = [_change(expected, found.get(expected.key)) for expected in baseline.scores]
    directions = {metric.id: metric.higher_is_better for metric in run.metrics}
    measured = [c for c in changes if c.found is not None]
    return Verdict(
        worse=tuple(c for c in measured if _loss(c, directions) > c.expected.tolerance),
        missing=tuple(c for c in changes if c.found is None),
        better=tuple(c for c in measured if _loss(c, directions) < -c.expected.tolerance),
        compared=len(measured),
    )


def _change(expected: Expected, score: Score | None) -> Change:
    if score is None:
        return Change(expected, None, reason="not in the run")
    if score.value is None or math.isnan(score.value):
        return Change(expected, None, score.unit, score.reason or score.status)
    return Change(expected, score.value, score.unit)


def _loss(change: Change, higher_is_better: dict[str, bool]) -> float:
    """By how much a score is worse than expected; negative if it is better."""
    expected, found = change.expected.value, change.found
    if found is None or found == expected:  # equal infinities have no difference
        return 0.0
    return expected - found if higher_is_better[change.expected.metric] else found - expected


def _scores(run: RunRecord) -> Iterable[tuple[tuple[str, str, str, int], Score]]:
    for result in run.results:
        for score in result.sheet.scores if result.sheet else ():
            yield (result.job.track, result.job.scene, result.job.method, result.job.seed), score

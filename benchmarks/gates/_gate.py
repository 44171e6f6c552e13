# SPDX-License-Identifier: Apache-2.0
"""The gate: a run against a baseline. It fails when accuracy drops, and when nothing was measured."""

import math
from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from graycard import GraycardError, RecordError, UnknownNameError
from graycard.io import Label, Name, check_version, from_builtins, read_json, write_json
from graycard.records import RunRecord, Score

BASELINE_VERSION = 1
_OWN = Path(__file__).parents[1] / "baselines"
"""Baselines that come with graycard, by the name of their suite."""


@dataclass(frozen=True, slots=True)
class Expected:
    """One score that a baseline expects."""

    track: Name
    scene: Name
    method: Label
    seed: int
    metric: Label
    protocol: Label
    value: float
    tolerance: float
    """By how much it may get worse, in the unit of the metric."""

    @property
    def key(self) -> tuple[str, str, str, int, str, str]:
        """Key of the score."""
        return self.track, self.scene, self.method, self.seed, self.metric, self.protocol


@dataclass(frozen=True, slots=True)
class Baseline:
    """The scores that a run must reach."""

    suite: Name
    suite_version: int
    scores: tuple[Expected, ...]
    departs: str = ""
    """Steps and size of the run that are other than its suite asks for, in words; empty for none."""
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
    higher_is_better: bool = True

    @property
    def change(self) -> float | None:
        """By how much the score differs from what was expected; None without a score."""
        return None if self.found is None else -self.loss if self.higher_is_better else self.loss

    @property
    def excess(self) -> float:
        """The loss in tolerances: above 1 it fails."""
        tolerance = self.expected.tolerance
        return self.loss / tolerance if tolerance else math.copysign(math.inf, self.loss)

    @property
    def place(self) -> str:
        """Key of the score, in words."""
        e = self.expected
        return f"{e.track}/{e.scene} {e.method} {e.metric}"

    @property
    def loss(self) -> float:
        """By how much the score is worse than expected; negative if it is better."""
        expected, found = self.expected.value, self.found
        if found is None or found == expected:  # equal infinities have no difference
            return 0.0
        return expected - found if self.higher_is_better else found - expected

    def __str__(self) -> str:
        """One line: which score, both values, the tolerance."""
        e, unit = self.expected, "" if self.unit == "1" else f" {self.unit}"
        if self.found is None or self.change is None:
            return f"{self.place}: expected {e.value:.4g}, got no score ({self.reason})"
        told = f"(tolerance {e.tolerance:g}), got {self.found:.4g}"
        return f"{self.place}: expected {e.value:.4g}{unit} {told}, {self.change:+.3g}{unit}"


@dataclass(frozen=True, slots=True)
class GateVerdict:
    """Verdict of the gate."""

    worse: tuple[Change, ...]
    """The largest loss first, in tolerances."""
    missing: tuple[Change, ...]
    better: tuple[Change, ...]
    compared: int
    kept: tuple[Change, ...] = ()
    """Those that changed by no more than their tolerance."""

    @property
    def says(self) -> str:
        """One line: passed or failed, why, and the counts."""
        reasons = ["accuracy dropped"] * bool(self.worse)
        reasons += ["scores are missing"] * bool(self.missing)
        reasons += ["nothing was compared"] * (not self.compared and not self.missing)
        verdict = f"failed: {' and '.join(reasons)}" if reasons else "passed"
        return (
            f"{verdict} ({self.compared} compared, {len(self.worse)} worse, {len(self.missing)} missing, "
            f"{len(self.better)} better)"
        )

    @property
    def exit_code(self) -> Literal[0, 1, 2]:
        """0 nothing is worse; 1 a score is worse; 2 scores are missing, or nothing was measured."""
        if self.missing or not self.compared:
            return 2
        return 1 if self.worse else 0


def make_baseline(run: RunRecord, rows: Collection[str] = ()) -> Baseline:
    """Return the scores of a run as a baseline, each with the tolerance of its metric times the slack of its
    method.

    Args:
        run: What was reached.
        rows: Rows that are to be watched; all without any.

    Raises:
        RecordError: The run has no score, or one of a metric that it does not describe.
        UnknownNameError: The run has no such row.
    """
    _check_rows(rows, [method.name for method in run.methods])
    tolerance = {metric.id: metric.tolerance for metric in run.metrics}
    unknown = sorted({score.metric for _, score in _scores(run)} - tolerance.keys())
    if unknown:
        raise RecordError(
            f"expected a run that says what its metrics are, got none of {unknown[0]}. Make the baseline "
            "of a run by this graycard"
        )
    slack = {method.name: method.slack for method in run.methods}
    expected = tuple(
        Expected(
            *key,
            score.metric,
            score.protocol,
            score.value,
            round(tolerance[score.metric] * slack.get(key[2], 1.0), 9),
        )
        for key, score in _scores(run)
        if score.value is not None and (not rows or key[2] in rows)
    )
    if not expected:
        raise RecordError("expected a run with scores to make a baseline of, got one without any")
    return Baseline(run.suite, run.suite_version, expected, run.departs)


def _kind(suite: str, version: int, departs: str) -> str:
    """Return what runs share that are compared, in words."""
    return f"{suite!r} version {version}" + (f" at {departs}" if departs else "")


def _check_rows(rows: Collection[str], known: Collection[str]) -> None:
    for row in rows:
        if row not in known:
            raise UnknownNameError("row", row, {*known})


def find_baseline(named: str) -> Path:
    """Return the file of a baseline: a path, or the name of a suite whose baseline comes with graycard.

    Raises:
        UnknownNameError: It is no file, and none of that name comes along.
    """
    if Path(named).suffix or Path(named).exists():
        return Path(named)
    own = {path.stem: path for path in _OWN.glob("*.json")}
    if named not in own:
        raise UnknownNameError("baseline", named, own, "One of your own: a path that ends in .json")
    return own[named]


def write_baseline(path: Path, baseline: Baseline) -> None:
    """Write a baseline as JSON.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    write_json(path, baseline)


def read_baseline(path: Path) -> Baseline:
    """Return a baseline from JSON.

    Raises:
        RecordError: It is missing, damaged, misspelt, of a newer version, or has a value that is none.
    """
    data = read_json(path)
    check_version(data, BASELINE_VERSION, path)
    baseline = from_builtins(Baseline, data, RecordError, str(path))
    for e in baseline.scores:
        if math.isnan(e.value) or not 0 <= e.tolerance < math.inf:
            raise RecordError(
                f"expected a value and a tolerance of 0 or more for {e.method} {e.metric} in {path}, got "
                f"{e.value} and {e.tolerance}"
            )
    return baseline


def judge(run: RunRecord, baseline: Baseline, rows: Collection[str] = (), slack: float = 1.0) -> GateVerdict:
    """Compare each score that the baseline expects; scores that it does not name do not count.

    Args:
        run: What was reached.
        baseline: What was expected.
        rows: Rows that are compared; all of the baseline without any.
        slack: Factor on all tolerances.

    Raises:
        RecordError: The baseline is of another suite, whose scenes may bear the same names.
        UnknownNameError: The baseline has no such row.
        GraycardError: The slack is negative or not finite.
    """
    if not 0 <= slack < math.inf:
        raise GraycardError(f"expected a factor of 0 or more on tolerances, got {slack}. Mend --tolerance")
    _check_rows(rows, {expected.method for expected in baseline.scores})
    wanted_kind = _kind(baseline.suite, baseline.suite_version, baseline.departs)
    if (kind := _kind(run.suite, run.suite_version, run.departs)) != wanted_kind:
        raise RecordError(f"expected a run of suite {wanted_kind}, as the baseline is, got one of {kind}")
    found = {(*key, score.metric, score.protocol): score for key, score in _scores(run)}
    wanted = [
        replace(expected, tolerance=expected.tolerance * slack)
        for expected in baseline.scores
        if not rows or expected.method in rows
    ]
    changes = [_change(expected, found.get(expected.key)) for expected in wanted]
    measured = [c for c in changes if c.found is not None]
    return GateVerdict(
        worse=tuple(sorted((c for c in measured if c.loss > c.expected.tolerance), key=lambda c: -c.excess)),
        missing=tuple(c for c in changes if c.found is None),
        better=tuple(c for c in measured if c.loss < -c.expected.tolerance),
        compared=len(measured),
        kept=tuple(c for c in measured if abs(c.loss) <= c.expected.tolerance),
    )


def _change(expected: Expected, score: Score | None) -> Change:
    if score is None:
        return Change(expected, None, reason="not in the run")
    if score.value is None or math.isnan(score.value):
        return Change(expected, None, score.unit, score.reason or score.status)
    return Change(expected, score.value, score.unit, higher_is_better=score.higher_is_better)


def _scores(run: RunRecord) -> Iterable[tuple[tuple[str, str, str, int], Score]]:
    for result in run.results:
        for score in result.sheet.scores if result.sheet else ():
            yield (result.job.track, result.job.scene, result.job.method, result.job.seed), score

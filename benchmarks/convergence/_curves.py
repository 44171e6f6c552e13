# SPDX-License-Identifier: Apache-2.0
"""Scores of one method over a growing budget, from rows of a run that differ in that budget alone."""

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from graycard import RecordError
from graycard.records import JobResult, RunRecord

AXES = ("iterations", "surfels")
"""Settings that are budgets."""
ENOUGH = {"novel_view.psnr": 0.2, "albedo.psnr.channel": 0.3}
"""Gain of a doubling below which a score has converged, dB, by metric."""
WATCHED = (
    "novel_view.psnr",
    "training_view.psnr",
    "albedo.psnr.channel",
    "albedo.leakage",
    "albedo.leakage.shadow",
    "normal.mean_angle",
    "counterfactual.psnr",
    "counterfactual.psnr.footprint",
    "counterfactual.psnr.rest",
    "counterfactual.residual.mirror",
    "light.position",
    "light.missing",
    "light.extra",
)
"""Metrics that a record of convergence shows, where a method provides them."""


@dataclass(frozen=True, slots=True)
class Point:
    """A method at one budget."""

    budget: int
    """Number of steps or surfels."""
    scores: Mapping[str, Mapping[str, float]]
    """By metric and scene: the mean over seeds, in the unit of the metric."""
    wall_s: float
    """Mean time of a fit, seconds; NaN where none was kept."""

    def mean(self, metric: str) -> float | None:
        """Return the mean of a metric over the scenes that have it; None where none has."""
        found = [*self.scores.get(metric, {}).values()]
        return float(np.mean(found)) if found else None


@dataclass(frozen=True, slots=True)
class Gain:
    """Gain of a score for each doubling of the budget between two points."""

    metric: str
    start: int
    end: int
    mean: float
    """Mean gain over scenes for each doubling, in the unit of the metric."""
    error: float
    """Standard error of the mean over scenes; NaN with one scene."""
    scenes: int

    @property
    def is_small(self) -> bool:
        """Tell whether it is less than what counts."""
        return self.mean < ENOUGH[self.metric]


@dataclass(frozen=True, slots=True)
class Curve:
    """A method over one budget, all else equal."""

    track: str
    method: str
    """The row with the least budget, or the name of the method where rows are called after it."""
    axis: str
    """One of :data:`AXES`."""
    fixed: Mapping[str, int]
    """The other budgets."""
    points: tuple[Point, ...]
    """In the order of the budget; two or more."""

    def gains(self, metric: str) -> list[Gain]:
        """Return what a doubling gains from each point to the next, paired by scene."""
        return [gain for a, b in pairwise(self.points) if (gain := _gain(metric, a, b)) is not None]

    @property
    def converged_at(self) -> int | None:
        """The least budget from which on no doubling gains what counts; None if the last one still does.

        Only budgets are meant from which a larger one was tried.
        """
        gains = [gain for metric in ENOUGH for gain in self.gains(metric)]
        for point in self.points[:-1]:
            later = [gain for gain in gains if gain.start >= point.budget]
            if later and all(gain.is_small for gain in later):
                return point.budget
        return None

    def slope(self, metric: str) -> Gain | None:
        """Return the gain of the last doubling; None where the metric is not provided."""
        found = self.gains(metric)
        return found[-1] if found else None


def curves_of(run: RunRecord) -> list[Curve]:
    """Return a curve for each track, method and budget of which a run has two or more values.

    Rows belong to one curve where method, priors and all settings but that budget are equal. A scene counts
    at all points of a curve or at none, so that points differ in their budget alone.

    Args:
        run: Rows that failed on a scene leave that scene out of their curve.

    Raises:
        RecordError: No two rows of the run differ in a budget alone.
    """
    found = []
    for axis in AXES:
        groups: dict[str, list[JobResult]] = defaultdict(list)
        for result in run.results:
            if result.status == "done" and result.sheet and axis in result.job.settings:
                groups[_rest(result, axis)].append(result)
        curves = (_curve(results, axis) for results in groups.values())
        found += [curve for curve in curves if curve is not None]
    if not found:
        raise RecordError(
            f"expected rows of run {run.suite!r} that differ in {' or '.join(AXES)} alone, got none. Give a "
            "method of its suite sweep = { iterations = [500, 1000, 2000] }"
        )
    return sorted(found, key=lambda curve: (curve.track, curve.axis))


def _rest(result: JobResult, axis: str) -> str:
    """Return all that rows of one curve share, as text."""
    job = result.job
    others: dict[str, Any] = {k: v for k, v in sorted(job.settings.items()) if k != axis}
    return repr((job.track, job.entry, others, sorted(job.priors.items())))


def _curve(results: Sequence[JobResult], axis: str) -> Curve | None:
    """Return the curve of results that differ in one budget; None where there is one value, or no scene."""
    by_budget: dict[int, list[JobResult]] = defaultdict(list)
    for result in results:
        by_budget[int(result.job.settings[axis])].append(result)
    shared = set.intersection(*({r.job.scene for r in found} for found in by_budget.values()))
    if len(by_budget) < 2 or not shared:
        return None
    job = min(results, key=lambda result: len(result.job.method)).job
    fixed = {other: int(job.settings[other]) for other in AXES if other != axis and other in job.settings}
    kept = {budget: [r for r in by_budget[budget] if r.job.scene in shared] for budget in sorted(by_budget)}
    points = tuple(_point(budget, found) for budget, found in kept.items())
    return Curve(job.track, job.method, axis, fixed, points)


def _point(budget: int, results: Sequence[JobResult]) -> Point:
    values: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for result in results:
        for score in result.sheet.scores if result.sheet else ():
            if score.metric in WATCHED and score.value is not None and math.isfinite(score.value):
                values[score.metric][result.job.scene].append(score.value)
    means = {m: {scene: float(np.mean(v)) for scene, v in found.items()} for m, found in values.items()}
    times = [result.cost.wall_s for result in results if result.cost]
    return Point(budget, means, float(np.mean(times)) if times else math.nan)


def _gain(metric: str, a: Point, b: Point) -> Gain | None:
    """Return the gain of a doubling between two points; None where no scene has the metric at both."""
    first, second = a.scores.get(metric, {}), b.scores.get(metric, {})
    doublings = math.log2(b.budget / a.budget)
    changes = [(second[scene] - first[scene]) / doublings for scene in sorted({*first} & {*second})]
    if not changes:
        return None
    error = float(np.std(changes, ddof=1) / math.sqrt(len(changes))) if len(changes) > 1 else math.nan
    return Gain(metric, a.budget, b.budget, float(np.mean(changes)), error, len(changes))

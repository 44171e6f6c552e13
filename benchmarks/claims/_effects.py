# SPDX-License-Identifier: Apache-2.0
"""From the rows of a check to one effect a scene, and from those to an estimate with an interval.

Effects are positive (of a ratio: above 1) in the claimed sense. Ratios are compared by their logarithms.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from graycard import RecordError
from graycard.benchmarks.claims._claim import Along, Check
from graycard.benchmarks.claims._readings import Reading, Readings, knob_of
from graycard.eval.statistics import LEVEL, Ends, locate, location_p, locations, locations_at
from graycard.records import SceneRecord

LEAST_ON_LINE = 3
"""The fewest scenes through which a line has an error of its own."""
LEAST_AT_END = 3
"""The fewest scenes at either end of a line that decides."""

Interval = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Levels:
    """Levels of the intervals of a check."""

    usual: float = LEVEL
    """Level of the interval that is shown, and of words that every deciding check has to agree on."""
    strict: float = LEVEL
    """Level of words that one of several checks is enough for; the chance that any of them errs stays
    bounded."""


@dataclass(frozen=True, slots=True)
class Sample:
    """The effects of a check as they are averaged: differences, or logarithms of ratios."""

    check: Check
    scenes: tuple[SceneRecord, ...]
    effects: np.ndarray
    """Shape ``(scenes,)``: means over seeds."""
    steps: np.ndarray
    """Shape ``(scenes, steps)``: change from each level to the next; no steps but for ``monotone``."""
    by_seed: np.ndarray
    """Shape ``(scenes, seeds)``; one column where the run has one seed, or rows differ in theirs."""
    rows: np.ndarray
    """Shape ``(rows and minus,)``: means over scenes, not as logarithms."""

    @property
    def places(self) -> np.ndarray | None:
        """Return where each scene stands along the check's knob; None without one."""
        along = self.check.along
        return None if along is None else np.array([knob_of(scene, along.knob) for scene in self.scenes])

    @property
    def centre(self) -> np.ndarray | float:
        """Return what single scenes scatter about: the estimate, or the line along a knob."""
        places = self.places
        if places is None:
            return locate(self.effects).estimate
        centred = places - places.mean()
        return self.effects.mean() + centred * (centred @ self.effects) / (centred @ centred)

    def back(self, value: float) -> float:
        """Return a number in the unit of the quantity, or as a ratio."""
        return _exponential(value) if self.check.scale == "ratio" else float(value)

    def all_back(self, values: np.ndarray) -> np.ndarray:
        """Return many such numbers at once; the last bit may differ from that of :meth:`back`."""
        if self.check.scale != "ratio":
            return values
        with np.errstate(over="ignore"):
            return np.exp(values)


@dataclass(frozen=True, slots=True)
class Effect:
    """The summary of a sample, in the unit of the quantity or as a ratio."""

    estimate: float
    interval: Interval
    strict: Interval
    """At the stricter level."""
    steps: tuple[tuple[float, float], ...] = ()
    """Estimate and upper end of each step of a ``monotone`` check, at the stricter level."""


@dataclass(frozen=True, slots=True)
class Effects:
    """Intervals and steps of many samples of the same scenes, as in :class:`Effect`; arrays of shape
    ``(K,)``.
    """

    interval: tuple[np.ndarray, np.ndarray]
    strict: tuple[np.ndarray, np.ndarray]
    steps: Sequence[tuple[np.ndarray, np.ndarray]] = ()


def sample_of(check: Check, track: str, readings: Readings) -> Sample:
    """Return the effects of a check.

    Raises:
        RecordError: It cannot be made from this run; the text says why.
    """
    scenes, values = _table(check, track, readings)
    if check.along and len(scenes) < LEAST_ON_LINE:
        names = ", ".join(scene.scene for scene in scenes)
        raise RecordError(f"a line needs {LEAST_ON_LINE} scenes, got {len(scenes)}: {names}")
    places = {knob_of(scene, check.along.knob) for scene in scenes} if check.along else {0.0, 1.0}
    if check.along and len(places) < 2:
        raise RecordError(f"expected scenes that differ in {check.along.knob}, got {min(places):g} in all")
    courses = courses_of(check, values)
    return Sample(
        check,
        scenes,
        effects_of(check, courses.mean(axis=1)),
        np.diff(courses.mean(axis=1), axis=1) if check.rule == "monotone" else np.empty((len(scenes), 0)),
        effects_of(check, courses),
        values.mean(axis=(0, 1)),
    )


def summarise(sample: Sample, levels: Levels) -> Effect:
    """Return estimate and intervals of a sample."""
    ends = effects_at(sample, sample.effects[:, None], levels)
    steps = [step_at(step[:, None], levels) for step in sample.steps.T]
    (estimate, *usual), (_, *strict) = ([sample.back(float(end[0])) for end in found] for found in ends)
    return Effect(
        estimate,
        (usual[0], usual[1]),
        (strict[0], strict[1]),
        tuple((float(middle[0]), float(high[0])) for middle, high in steps),
    )


def effect_in(readings: Readings, check: Check, track: str, levels: Levels) -> Effect | None:
    """Return the effect of a check in a run; None where the run lacks it."""
    try:
        return summarise(sample_of(check, track, readings), levels)
    except RecordError:
        return None


def effects_at(sample: Sample, drawn: np.ndarray, levels: Levels) -> tuple[Ends, Ends]:
    """Return estimates and ends at both levels for many samples of the same scenes.

    Args:
        sample: Whose scenes they are.
        drawn: Shape ``(scenes, K)``.
        levels: Of the intervals.
    """
    if sample.check.along is None:
        usual, strict = locations_at(drawn, levels.usual, levels.strict)
        return usual, strict
    places = sample.places
    assert places is not None, "there is a knob"
    usual = changes_along(sample.check.along, places, drawn, levels.usual)
    if levels.strict == levels.usual:
        return usual, usual
    return usual, changes_along(sample.check.along, places, drawn, levels.strict)


def step_at(drawn: np.ndarray, levels: Levels) -> tuple[np.ndarray, np.ndarray]:
    """Return estimates and upper ends of a step between two levels; one that falls refutes the course."""
    middle, _, high = locations(drawn, levels.strict)
    return middle, high


def spread_of(sample: Sample) -> float:
    """Return the standard deviation of the effects about what they scatter about, scenes and fits
    together.
    """
    rest = sample.effects - sample.centre
    rest = rest - rest.mean()
    return math.sqrt(float(rest @ rest) / max(1, len(rest) - (2 if sample.check.along else 1)))


def p_of(sample: Sample) -> float | None:
    """Return the exact signed-rank p against no effect; None along a knob, where ranks say nothing."""
    return None if sample.check.along else location_p(sample.effects)


def courses_of(check: Check, values: np.ndarray) -> np.ndarray:
    """Return values of the rows as they are averaged, in the claimed sense, less those of ``minus``.

    Args:
        check: With its rows.
        values: Shape ``(scenes, seeds, rows and minus)``.

    Returns:
        Shape ``(scenes, seeds, rows)``.

    Raises:
        RecordError: A ratio of values that are not above 0.
    """
    count = len(check.rows)
    if check.scale == "ratio":
        if (values <= 0).any():
            raise RecordError("a ratio needs values above 0")
        values = np.log(values)
    sign = 1.0 if check.expects == "higher" else -1.0
    return sign * (values[..., :count] - (values[..., count:] if check.minus else 0.0))


def effects_of(check: Check, courses: np.ndarray) -> np.ndarray:
    """Return one number for each course: a row less what it is judged by, or the change along the levels."""
    effects = courses @ weights_of(check)
    if check.rule == "monotone" or len(check.rows) == 2:
        return effects
    against = math.log(check.against) if check.scale == "ratio" and check.against > 0 else check.against
    return effects - (against if check.expects == "higher" else -against)


def weights_of(check: Check) -> np.ndarray:
    """Return how much each row of a course adds to the effect, shape ``(rows,)``."""
    if check.rule != "monotone":
        return np.array([1.0, -1.0][: len(check.rows)])
    centred = np.array(check.places) - np.mean(check.places)
    return centred / (centred @ centred) * (check.places[-1] - check.places[0])


def parts_of(check: Check, rows: Iterable[str]) -> dict[str, float]:
    """Return how much each of some rows adds to the effect, with its sign; a row that stands twice adds
    once.
    """
    return _parts(check, weights_of(check), rows)


def step_parts_of(check: Check, step: int, rows: Iterable[str]) -> dict[str, float]:
    """Return how much each of some rows adds to a step from one level to the next, with its sign."""
    weights = np.zeros(len(check.rows))
    weights[step], weights[step + 1] = -1, 1
    return _parts(check, weights, rows)


def _parts(check: Check, weights: np.ndarray, rows: Iterable[str]) -> dict[str, float]:
    sign = 1.0 if check.expects == "higher" else -1.0
    found = dict.fromkeys(rows, 0.0)
    for names, turn in ((check.rows, sign), (check.minus, -sign)):
        for row, weight in zip(names, weights, strict=False):
            if row in found:
                found[row] += turn * float(weight)
    return found


def changes_along(along: Along, places: np.ndarray, drawn: np.ndarray, level: float) -> Ends:
    """Return the change between two values of a knob by least squares, with Student's interval.

    Ends are infinite where too few scenes stand towards either value: a line through one that stands out
    there tells of that scene.
    """
    from scipy import special

    centred = places - places.mean()
    slopes = centred @ drawn / (centred @ centred)
    rest = drawn - drawn.mean(axis=0) - centred[:, None] * slopes
    errors = np.sqrt((rest**2).sum(axis=0) / (len(places) - 2) / (centred @ centred))
    reach = along.high - along.low
    half = -special.stdtrit(len(places) - 2, (1 - level) / 2) * errors * reach
    if not is_spanned(along, places):
        half = np.full_like(half, math.inf)
    return slopes * reach, slopes * reach - half, slopes * reach + half


def is_spanned(along: Along, places: np.ndarray) -> bool:
    """Tell if three scenes or more stand in each outer third between two values of a knob, or beyond."""
    third = (along.high - along.low) / 3
    low, high = (places <= along.low + third).sum(), (places >= along.high - third).sum()
    return bool(min(low, high) >= LEAST_AT_END)


def _table(check: Check, track: str, readings: Readings) -> tuple[tuple[SceneRecord, ...], np.ndarray]:
    """Return the scenes that have the quantity, and the values of all rows, shape ``(scenes, seeds,
    rows)``.
    """
    rows = *check.rows, *check.minus
    if missing := readings.missing_rows(rows):
        raise RecordError(f"the run has no row {', '.join(missing)}")
    readings.record(check.quantity)
    wanted = readings.scenes(track, check.scenes)
    found = [(scene, [readings.by_seed(row, scene, check.quantity) for row in rows]) for scene in wanted]
    having = [(scene, row) for scene, row in found if not all(r.absent for seeds in row for r in seeds)]
    if not having:
        raise RecordError(f"the run has no {check.quantity.metric} on scenes that this is about")
    _refuse_gaps(rows, [row for _, row in having])
    values = _even([row for _, row in having], ["iterations" in readings.settings(row) for row in rows])
    if not np.isfinite(values).all():
        raise RecordError("a score is infinite, and infinite scores have no mean")
    return tuple(scene for scene, _ in having), values


def _even(found: Sequence[Sequence[Sequence[Reading]]], fitted: Sequence[bool]) -> np.ndarray:
    """Return values of as many seeds for each row and scene.

    A row that is not fitted is the same with every seed. Where fitted rows differ in their numbers of seeds,
    means stand for all.

    Args:
        found: By scene, row and seed.
        fitted: If each row is.
    """
    values = [[[float(r.value) for r in seeds if r.value is not None] for seeds in row] for row in found]
    counts = {len(row[k]) for row in values for k, is_fitted in enumerate(fitted) if is_fitted}
    seeds = counts.pop() if len(counts) == 1 else 1
    if all(len(each) == len(values[0][0]) for row in values for each in row):
        return np.moveaxis(np.array(values, np.float64), 1, 2)
    even = [
        [each if len(each) == seeds else [math.fsum(each) / len(each)] * seeds for each in row]
        for row in values
    ]
    return np.moveaxis(np.array(even, np.float64), 1, 2)


def _refuse_gaps(rows: Sequence[str], found: Sequence[Sequence[Sequence[Reading]]]) -> None:
    """Refuse a row without a value on a scene. It is not left out: its hard scenes would be."""
    gaps = dict.fromkeys(
        f"{row} {reading.reason}"
        for scene in found
        for row, seeds in zip(rows, scene, strict=True)
        for reading in seeds
        if reading.value is None
    )
    if gaps:
        more = f" (and {len(gaps) - 1} more)" if len(gaps) > 1 else ""
        raise RecordError(f"{next(iter(gaps))}{more}")


def _exponential(value: float) -> float:
    """Return the exponential function, infinite where floats end."""
    return math.exp(value) if value < 709 else math.inf

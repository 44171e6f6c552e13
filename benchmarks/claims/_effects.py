# SPDX-License-Identifier: Apache-2.0
"""From the rows of a check to one effect a scene, and from those to a mean with an interval.

Effects are positive (of a ratio: above 1) in the claimed sense. Ratios are averaged by their logarithms.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from graycard import RecordError
from graycard.benchmarks.claims._claim import Along, Check
from graycard.benchmarks.claims._readings import Reading, Readings, knob_of
from graycard.eval.statistics import LEVEL, mean_interval, mean_p, signed_rank_p
from graycard.records import SceneRecord

LEAST_SCENES = 3
"""The fewest of which an interval says anything (:func:`graycard.eval.statistics.mean_interval`)."""


@dataclass(frozen=True, slots=True)
class Effect:
    """What a check comes to."""

    scenes: Mapping[str, float]
    """By scene."""
    mean: float
    interval: tuple[float, float]
    p_mean: float | None
    p_rank: float | None
    means: Mapping[str, float]
    """Of each compared row over these scenes."""
    course: tuple[float, ...] = ()
    """By level: the mean over scenes of what is compared, in the claimed sense; of ``monotone`` alone."""


@dataclass(frozen=True, slots=True)
class Table:
    """Values by scene, in the order of the rows."""

    scenes: tuple[SceneRecord, ...]
    values: np.ndarray
    """Shape ``(scenes, rows and minus)``, finite."""


def effect_of(check: Check, track: str, readings: Readings) -> Effect:
    """The effect of a check.

    Raises:
        RecordError: It cannot be made from this run; the text says why.
    """
    table = _table(check, track, readings)
    count = len(check.rows)
    sign = 1.0 if check.expects == "higher" else -1.0
    values, back = _scaled(check, table.values)
    courses = sign * (values[:, :count] - (values[:, count:] if check.minus else 0.0))
    effects = _effects(check, courses, sign)
    names = [scene.scene for scene in table.scenes]
    if len(effects) < LEAST_SCENES:
        raise RecordError(f"an interval needs {LEAST_SCENES} scenes, got {len(effects)}: {', '.join(names)}")
    mean, interval, p_mean, p_rank = _summary(check.along, table.scenes, effects)
    return Effect(
        dict(zip(names, map(back, effects), strict=True)),
        back(mean),
        (back(interval[0]), back(interval[1])),
        p_mean,
        p_rank,
        dict(zip((*check.rows, *check.minus), map(float, table.values.mean(axis=0)), strict=True)),
        tuple(map(float, courses.mean(axis=0))) if check.rule == "monotone" else (),
    )


def _table(check: Check, track: str, readings: Readings) -> Table:
    """The values of all rows on the scenes that have the quantity."""
    rows = *check.rows, *check.minus
    if missing := readings.missing_rows(rows):
        raise RecordError(f"the run has no row {', '.join(missing)}")
    readings.record(check.quantity)
    wanted = readings.scenes(track, check.scenes)
    found = [(scene, [readings.value(row, scene, check.quantity) for row in rows]) for scene in wanted]
    having = [(scene, row) for scene, row in found if not all(reading.absent for reading in row)]
    if not having:
        raise RecordError(f"the run has no {check.quantity.metric} on scenes that this is about")
    _refuse_gaps(rows, [row for _, row in having])
    values = np.array([[reading.value for reading in row] for _, row in having], np.float64)
    if not np.isfinite(values).all():
        raise RecordError("a score is infinite, and infinite scores have no mean")
    return Table(tuple(scene for scene, _ in having), values)


def _refuse_gaps(rows: Sequence[str], found: Sequence[Sequence[Reading]]) -> None:
    """A row without a value on a scene is not left out: its hard scenes would be."""
    gaps = dict.fromkeys(
        f"{row} {reading.reason}"
        for readings in found
        for row, reading in zip(rows, readings, strict=True)
        if reading.value is None
    )
    if gaps:
        more = f" (and {len(gaps) - 1} more)" if len(gaps) > 1 else ""
        raise RecordError(f"{next(iter(gaps))}{more}")


def _scaled(check: Check, values: np.ndarray) -> tuple[np.ndarray, Callable[[float], float]]:
    """Values as they are averaged, and the way back."""
    if check.scale == "difference":
        return values, float
    if (values <= 0).any():
        raise RecordError("a ratio needs values above 0")
    return np.log(values), lambda value: math.exp(float(value))


def _effects(check: Check, courses: np.ndarray, sign: float) -> np.ndarray:
    """One number a scene: a row less what it is judged by, or the change along the levels."""
    if check.rule != "monotone":
        against = math.log(check.against) if check.scale == "ratio" and check.against > 0 else check.against
        return courses[:, 0] - (courses[:, 1] if courses.shape[1] == 2 else sign * against)
    places = np.array(check.places)
    centred = places - places.mean()
    return courses @ centred / (centred @ centred) * (places[-1] - places[0])


def _summary(
    along: Along | None, scenes: Sequence[SceneRecord], effects: np.ndarray
) -> tuple[float, tuple[float, float], float | None, float | None]:
    """Mean, interval and both p values."""
    if along is not None:
        return *_change_along(along, [knob_of(scene, along.knob) for scene in scenes], effects), None
    interval = mean_interval(effects)
    assert interval is not None, "three or more finite values have one"
    return float(effects.mean()), interval, mean_p(effects), signed_rank_p(effects)


def _change_along(
    along: Along, places: Sequence[float], effects: np.ndarray
) -> tuple[float, tuple[float, float], float]:
    """The change of an effect between two values of a knob, by least squares; Student's interval."""
    from scipy import stats  # takes a second to import

    if len(set(places)) < 2:
        raise RecordError(f"expected scenes that differ in {along.knob}, got {places[0]:g} in all of them")
    line: Any = stats.linregress(places, effects)
    reach = along.high - along.low
    half = float(stats.t.isf((1 - LEVEL) / 2, len(effects) - 2) * line.stderr) * reach
    change = float(line.slope) * reach
    return change, (change - half, change + half), float(line.pvalue)

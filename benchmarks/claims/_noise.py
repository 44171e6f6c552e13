# SPDX-License-Identifier: Apache-2.0
"""Spread of an effect between fits of the same scene with different seeds."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Final, Literal

import numpy as np

from graycard.benchmarks.claims._claim import Check, Quantity, Scenes
from graycard.benchmarks.claims._effects import Sample, courses_of, effects_of, parts_of, spread_of
from graycard.benchmarks.claims._readings import Readings
from graycard.eval.statistics import split_variance
from graycard.records import SceneRecord, read_run

FOLDER: Final = Path(__file__).parent / "noise"
"""Runs of the suites ``noise-<track>`` and ``noise-<track>-<what>`` on tuning scenes, each scene fitted with
several seeds; without single views."""


_BUDGET: Final = ("iterations", "surfels")
"""Settings that say how long a fit is: others with these are fits of another noise."""
Origin = Literal["these fits", "same rows", "other rows"]


@dataclass(frozen=True, slots=True)
class FitNoise:
    """The spread of an effect between fits."""

    sd: float
    """Standard deviation for one fit of each row, in the unit of the effect; of ratios that of the
    logarithm."""
    source: str
    """Origin in words: the rows and their run."""
    seeds: int = 1
    """Fits over which each scene's effect was averaged."""
    freedom: float = math.inf
    """Degrees of freedom of its variance; infinite where that is known."""
    rows: frozenset[str] = frozenset()
    """Fitted rows, whose fits make it."""
    origin: Origin = "these fits"
    """Fits that it was measured on: these very ones, others of the same rows, or those of other rows."""

    @property
    def sd_of_mean(self) -> float:
        """Standard deviation of a scene's effect as it was averaged."""
        return self.sd / math.sqrt(self.seeds)


@dataclass(frozen=True, slots=True)
class _Measured:
    """A run that fitted the scenes of a track with several seeds."""

    readings: Readings
    scenes: tuple[SceneRecord, ...]

    def by_seed(self, rows: Sequence[str], quantity: Quantity) -> np.ndarray | None:
        """Values of rows, shape ``(scenes, seeds, rows)``, on the scenes where all have as many; None without
        any.
        """
        found = [
            [[r.value for r in self.readings.by_seed(row, scene, quantity)] for row in rows]
            for scene in self.scenes
        ]
        whole = [scene for scene in found if all(None not in seeds for seeds in scene)]
        longest = max((len(seeds) for scene in whole for seeds in scene), default=0)
        even = [scene for scene in whole if all(len(seeds) == longest for seeds in scene)]
        if not even or longest < 2:
            return None
        values = np.moveaxis(np.array(even, np.float64), 1, 2)
        return values if np.isfinite(values).all() else None

    def fitted_alike(self, row: str, run: Readings) -> bool:
        """Tell whether a row was measured with the budget, and at the size, that it has in a run."""
        of_suite = run.size.width is None and run.size.train_views is None
        if row not in self.readings.rows or not of_suite:
            return False
        here, there = run.settings(row), self.readings.settings(row)
        return all(here[name] == there[name] for name in _BUDGET if name in here and name in there)

    def stand_ins(self, row: str, run: Readings) -> list[str]:
        """Measured rows that may stand in for one: itself, those of its method, or all."""
        rows = sorted(self.readings.rows)
        alike = [name for name in rows if self.readings.entry(name) == run.entry(row)]
        return [row] if row in rows else alike or rows


def noise_of(sample: Sample, track: str, readings: Readings) -> FitNoise | None:
    """Return the fit noise of a check: from the run's own seeds, or from measured rows; None where nobody
    measured it.

    Args:
        sample: The effects of the check in the run.
        track: Of the run's scenes.
        readings: The run.
    """
    check, seeds = sample.check, sample.by_seed.shape[1]
    rows = _once((*check.rows, *check.minus))
    fitted = [row for row in rows if "iterations" in readings.settings(row)]
    if seeds > 1:
        found = split_variance(sample.by_seed.tolist()).seed_sd
        assert found is not None, "scenes have several seeds"
        freedom = len(sample.by_seed) * (seeds - 1)
        return FitNoise(found, f"{seeds} seeds of this run", seeds, freedom, frozenset(fitted or rows))
    if not fitted:
        return FitNoise(0.0, "nothing is fitted")
    runs = _measured(track)
    alike = [run for run in runs if all(run.fitted_alike(row, readings) for row in fitted)]
    if alike:
        direct = (_direct(check, fitted, run) for run in alike)
        return next((noise for noise in direct if noise is not None), None)
    return _by_stand_ins(sample, fitted, readings, runs[0]) if runs else None


@cache
def _measured(track: str) -> tuple[_Measured, ...]:
    """Return the runs on tuning scenes of a track in the order of their names: ``<track>`` is the first.

    Rows stand in for others in the first alone. The others have few rows.
    """
    folders = sorted(path.parent for path in FOLDER.glob("*/run.json"))
    runs = [Readings(read_run(folder)) for folder in folders if folder.name.split("-")[0] == track]
    return tuple(_Measured(run, tuple(run.scenes(track, Scenes()))) for run in runs)


def _direct(check: Check, fitted: Sequence[str], measured: _Measured) -> FitNoise | None:
    """Return the spread of the effect itself; rows that are not fitted have none."""
    found = measured.by_seed(fitted, check.quantity)
    if found is None or (check.scale == "ratio" and (found <= 0).any()):
        return None
    columns = dict(zip(fitted, np.moveaxis(found, 2, 0), strict=True))
    even = np.ones_like(found[..., 0])
    values = np.stack([columns.get(row, even) for row in (*check.rows, *check.minus)], axis=-1)
    effects = effects_of(check, courses_of(check, values))
    source = f"{', '.join(fitted)} in {measured.readings.suite}"
    return FitNoise(_pooled(effects), source, 1, _freedom(effects), frozenset(fitted), "same rows")


def _by_stand_ins(
    sample: Sample, fitted: Sequence[str], run: Readings, measured: _Measured
) -> FitNoise | None:
    """Return the noise by the sum of the rows' variances: of each row itself, or the largest of those that
    stand in for it.
    """
    parts = parts_of(sample.check, fitted)
    variance, used, freedom = 0.0, list[str](), math.inf
    for row in fitted:
        spreads = _spreads(sample.check, measured.stand_ins(row, run), measured)
        if not spreads:
            return None
        largest = max(spreads, key=lambda name: spreads[name][0])
        variance += (parts[row] * spreads[largest][0]) ** 2
        freedom = min(freedom, spreads[largest][1])
        used.append(largest)
    rows = ", ".join(_once(used))
    source = f"{rows} in {measured.readings.suite}, standing in for these rows"
    noise = FitNoise(math.sqrt(variance), source, 1, freedom, frozenset(fitted), "other rows")
    return _capped(noise, sample)


def _spreads(check: Check, names: Sequence[str], measured: _Measured) -> dict[str, tuple[float, float]]:
    """Return the standard deviation of single rows between fits, and its degrees of freedom."""
    found: dict[str, tuple[float, float]] = {}
    for name in names:
        values = measured.by_seed([name], check.quantity)
        if values is None or (check.scale == "ratio" and (values <= 0).any()):
            continue
        column = np.log(values[..., 0]) if check.scale == "ratio" else values[..., 0]
        found[name] = _pooled(column), _freedom(column)
    return found


def _capped(noise: FitNoise, sample: Sample) -> FitNoise:
    """Return noise of stand-ins that is no larger than the whole spread of the effects.

    Fits of two variants begin with the same seed and may err alike, which the sum of their variances does not
    know. The scenes do: their effects spread by the noise and by what the scenes differ in.
    """
    spread = spread_of(sample)
    if noise.sd <= spread:
        return noise
    source = f"all of the spread between scenes, which is below that of {noise.source}"
    return replace(noise, sd=spread, source=source, freedom=math.inf)


def _freedom(values: np.ndarray) -> float:
    return float(values.size - len(values))


def _once(rows: Sequence[str]) -> list[str]:
    """Return each row once, in order."""
    return list(dict.fromkeys(rows))


def _pooled(values: np.ndarray) -> float:
    """Return the standard deviation within scenes."""
    return float(np.sqrt(values.var(axis=1, ddof=1).mean()))

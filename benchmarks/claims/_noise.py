# SPDX-License-Identifier: Apache-2.0
"""How far an effect differs between fits of the same scene that begin with different seeds."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np

from graycard.benchmarks.claims._claim import Check, Quantity, Scenes
from graycard.benchmarks.claims._effects import Sample, courses_of, effects_of, spread_of, weights_of
from graycard.benchmarks.claims._readings import Readings
from graycard.eval.statistics import split_variance
from graycard.records import SceneRecord, read_run

FOLDER: Final = Path(__file__).parent / "noise"
"""Runs of the suites ``noise-<track>`` on tuning scenes, each scene fitted with several seeds; without single
views."""


@dataclass(frozen=True, slots=True)
class FitNoise:
    """The spread of an effect between fits."""

    sd: float
    """Of one fit of each row, in the unit of the effect; of ratios, of their logarithm."""
    source: str
    """Where it comes from, in words."""
    seeds: int = 1
    """Fits over which each scene's effect was averaged."""

    @property
    def sd_of_mean(self) -> float:
        """Of a scene's effect as it was averaged."""
        return self.sd / math.sqrt(self.seeds)


@dataclass(frozen=True, slots=True)
class _Measured:
    """A run that fitted the scenes of a track with several seeds."""

    readings: Readings
    scenes: tuple[SceneRecord, ...]

    def by_seed(self, row: str, quantity: Quantity) -> np.ndarray | None:
        """Values of a row, shape ``(scenes, seeds)``, on the scenes that have them; None where none has."""
        found = [[r.value for r in self.readings.by_seed(row, s, quantity)] for s in self.scenes]
        whole = [values for values in found if None not in values]
        longest = max((len(values) for values in whole), default=0)
        values = np.array([values for values in whole if len(values) == longest], np.float64)
        return values if longest > 1 and np.isfinite(values).all() else None

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
    seeds = sample.by_seed.shape[1]
    if seeds > 1:
        found = split_variance(sample.by_seed.tolist()).seed_sd
        assert found is not None, "scenes have several seeds"
        return FitNoise(found, f"{seeds} seeds of this run", seeds)
    check = sample.check
    fitted = [row for row in (*check.rows, *check.minus) if "iterations" in readings.settings(row)]
    if not fitted:
        return FitNoise(0.0, "nothing is fitted")
    measured = _measured(track)
    if measured is None:
        return None
    if set(fitted) <= measured.readings.rows:
        return _direct(check, fitted, measured)
    return _by_stand_ins(sample, fitted, readings, measured)


@cache
def _measured(track: str) -> _Measured | None:
    """Return the run on tuning scenes of a track; None where there is none."""
    folder = FOLDER / track
    if not folder.is_dir():
        return None
    readings = Readings(read_run(folder))
    return _Measured(readings, tuple(readings.scenes(track, Scenes())))


def _direct(check: Check, fitted: Sequence[str], measured: _Measured) -> FitNoise | None:
    """Return the spread of the effect itself; rows that are not fitted have none."""
    columns: dict[str, np.ndarray] = {}
    for row in fitted:
        column = measured.by_seed(row, check.quantity)
        if column is None:
            return None
        columns[row] = column
    if len({column.shape for column in columns.values()}) > 1:
        return None
    even = np.ones_like(columns[fitted[0]])
    values = np.stack([columns.get(row, even) for row in (*check.rows, *check.minus)], axis=-1)
    effects = effects_of(check, courses_of(check, values))
    return FitNoise(_pooled(effects), f"{', '.join(_once(fitted))} in {measured.readings.suite}")


def _by_stand_ins(
    sample: Sample, fitted: Sequence[str], run: Readings, measured: _Measured
) -> FitNoise | None:
    """Return the noise by the sum of the rows' variances: of each row itself, or the largest of those that
    stand in for it.
    """
    check = sample.check
    weights = dict(zip(check.rows, weights_of(check), strict=True))
    weights |= dict(zip(check.minus, weights_of(check), strict=False))
    variance, used = 0.0, list[str]()
    for row in fitted:
        spreads = {
            name: _pooled(np.log(values) if check.scale == "ratio" else values)
            for name in measured.stand_ins(row, run)
            if (values := measured.by_seed(name, check.quantity)) is not None
        }
        if not spreads:
            return None
        largest = max(spreads, key=spreads.__getitem__)
        variance += (weights[row] * spreads[largest]) ** 2
        used.append(largest)
    rows = ", ".join(_once(used))
    source = f"{rows} in {measured.readings.suite}, standing in for these rows"
    return _capped(FitNoise(math.sqrt(variance), source), sample)


def _capped(noise: FitNoise, sample: Sample) -> FitNoise:
    """Return noise of stand-ins that is no larger than the whole spread of the effects.

    Fits of two variants begin with the same seed and may err alike, which the sum of their variances does not
    know. The scenes do: their effects spread by the noise and by what the scenes differ in.
    """
    spread = spread_of(sample)
    if noise.sd <= spread:
        return noise
    return FitNoise(spread, f"all of the spread between scenes, which is below that of {noise.source}")


def _once(rows: Sequence[str]) -> list[str]:
    """Return each row once, in order."""
    return list(dict.fromkeys(rows))


def _pooled(values: np.ndarray) -> float:
    """Return the standard deviation within scenes."""
    return float(np.sqrt(values.var(axis=1, ddof=1).mean()))

# SPDX-License-Identifier: Apache-2.0
"""Scores of the predicted lights of a scene; environments have no place and are not counted."""

from collections.abc import Sequence

import numpy as np

import graycard as gc
from graycard.eval._light_errors import LightMatch, intensity_error, match_lights
from graycard.eval._metrics import LIGHT_METRICS
from graycard.eval.protocols import PROTOCOL

_INDEX = "lights.json"
_NEEDS_PAIRS = ("light.position", "light.intensity")


def score_lights(predictions: gc.Predictions, truth: gc.Truth) -> list[gc.Score]:
    """All light scores, in the order of the table.

    A scene without local lights has no errors of position and intensity, only counts.

    Args:
        predictions: What is scored.
        truth: What it is scored by.

    Raises:
        DatasetError: The true lights are missing or broken.
    """
    true = _local(truth.lights())
    records = [r for r in LIGHT_METRICS if true or r.id not in _NEEDS_PAIRS]
    try:
        lights = _predicted_lights(predictions)
    except gc.PredictionError as cause:
        return [_score(r, len(true), "failed", reason=str(cause)) for r in records]
    if lights is None:
        return [_score(r, len(true), "not provided", reason=f"there is no {_INDEX}") for r in records]
    cameras = [v.camera for v in truth.views if v.split == "test"]
    predicted = _local(lights)
    match = match_lights(predicted, true, cameras)
    return [_judge(r, match, predicted, true, truth.diameter) for r in records]


def _predicted_lights(predictions: gc.Predictions) -> tuple[gc.Light, ...] | None:
    lights = predictions.lights()
    for light in _local(lights or ()):
        _check(light)
    return lights


def _check(light: gc.LocalLight) -> None:
    for name, values in (("position", light.position), ("intensity", light.axial_intensity)):
        if not np.isfinite(values).all():
            raise gc.PredictionError(
                f"expected light {light.name!r} with a finite {name}, got {np.asarray(values).tolist()}. "
                f"Mend {_INDEX}"
            )


def _local(lights: Sequence[gc.Light]) -> list[gc.LocalLight]:
    return [light for light in lights if not isinstance(light, gc.EnvironmentLight)]


def _judge(
    record: gc.MetricRecord,
    match: LightMatch,
    predicted: Sequence[gc.LocalLight],
    true: Sequence[gc.LocalLight],
    diameter: float,
) -> gc.Score:
    if record.id == "light.intensity" and not match.pairs:
        reason = f"expected local lights to match with {len(true)} true ones, got none in {_INDEX}"
        return _score(record, len(true), "failed", reason=reason)
    try:
        value = _value(record, match, predicted, true, diameter)
    except gc.PredictionError as cause:
        return _score(record, len(true), "failed", reason=str(cause))
    unmatched = ()
    if record.id == "light.intensity" and match.missing:
        unmatched = (f"{match.missing} of {len(true)} lights have no partner and are not in the mean",)
    return _score(record, len(true), "scored", value=value, scored=len(match.pairs), warnings=unmatched)


def _value(
    record: gc.MetricRecord,
    match: LightMatch,
    predicted: Sequence[gc.LocalLight],
    true: Sequence[gc.LocalLight],
    diameter: float,
) -> float:
    match record.id:
        case "light.position":
            near = [min(distance / diameter, 1.0) for distance in match.distances]
            unmatched = match.missing + match.extra
            return 100 * (sum(near) + unmatched) / (len(near) + unmatched)
        case "light.intensity":
            return float(np.mean([intensity_error(predicted[i], true[j]) for i, j in match.pairs]))
        case "light.missing":
            return float(match.missing)
        case _:
            return float(match.extra)


def _score(
    record: gc.MetricRecord,
    expected: int,
    status: gc.Status,
    *,
    value: float | None = None,
    scored: int = 0,
    reason: str = "",
    warnings: tuple[str, ...] = (),
) -> gc.Score:
    return gc.Score(
        record.id,
        PROTOCOL,
        status,
        value,
        record.unit,
        record.higher_is_better,
        record.optimum,
        expected=expected,
        scored=scored,
        reason=reason,
        warnings=warnings,
    )

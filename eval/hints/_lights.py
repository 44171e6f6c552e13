# SPDX-License-Identifier: Apache-2.0
"""Hints about lights: another frame, another unit, or intensities that belong to one another's lights."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations

import numpy as np

from graycard import Camera, LocalLight, PredictionError, Predictions, Truth
from graycard.eval.lights._errors import match_lights
from graycard.eval.lights._read import local, predicted_lights

_RATIO = 0.3
_NEAR = 0.02
"""Share of the scene's diameter within which a light is where it should be."""
_UNITS = {
    "π": np.pi,
    "1/π": 1 / np.pi,
    "4π (the power in W of a point light)": 4 * np.pi,
    "1/(4π)": 1 / (4 * np.pi),
}
_SAME = 0.1
"""Difference of natural logarithms up to which factors are the same."""
_MOST = 6
"""Lights up to which all exchanges are tried."""


def light_hints(predictions: Predictions, truth: Truth) -> list[tuple[str, str]]:
    """Return ids of light scores, each with a hint; nothing for lights that cannot be read."""
    try:
        found = local(predicted_lights(predictions) or ())
    except PredictionError:
        return []
    true = local(truth.lights())
    if not found or not true:
        return []
    cameras = [v.camera for v in truth.views if v.split == "test"]
    frames = _frame(found, true, cameras, truth.diameter)
    pairs = [(found[i], true[j]) for i, j in match_lights(found, true, cameras).pairs]
    ratios = _log_ratios(pairs)
    return frames + ([] if ratios is None else [*_unit(ratios), *_exchanged(pairs)])


def _frame(
    found: Sequence[LocalLight], true: Sequence[LocalLight], cameras: list[Camera], diameter: float
) -> list[tuple[str, str]]:
    """Return a hint if the same numbers in another frame are where the lights are."""
    ways = {
        'like the world\'s axes: set "frame": "world"': [replace(x, frame="world") for x in found],
        'like the camera\'s axes: set "frame": "camera"': [replace(x, frame="camera") for x in found],
        "like camera axes with y up and z back: negate y and z": [
            replace(x, frame="camera", position=(x.position[0], -x.position[1], -x.position[2]))
            for x in found
        ],
    }
    before = _off(found, true, cameras)
    after = {says: _off(lights, true, cameras) for says, lights in ways.items()}
    best = min(after, key=lambda says: after[says])
    if before > _NEAR * diameter and after[best] < _RATIO * before:
        return [("light.position", f"positions look {best}")]
    return []


def _off(found: Sequence[LocalLight], true: Sequence[LocalLight], cameras: list[Camera]) -> float:
    return float(np.mean(match_lights(found, true, cameras).distances))


def _log_ratios(pairs: Sequence[tuple[LocalLight, LocalLight]]) -> np.ndarray | None:
    """Logarithms of predicted over true intensities, shape ``(pairs, 3)``; None where a channel is dark."""
    p, t = (np.array([pair[i].axial_intensity for pair in pairs]) for i in (0, 1))
    return np.log(p / t) if (p > 0).all() and (t > 0).all() else None


def _unit(ratios: np.ndarray) -> list[tuple[str, str]]:
    for name, factor in _UNITS.items():
        if (np.abs(ratios - np.log(factor)) < _SAME).all():
            return [("light.intensity", f"intensities look multiplied by {name}: write W/sr")]
    return []


def _exchanged(pairs: Sequence[tuple[LocalLight, LocalLight]]) -> list[tuple[str, str]]:
    """Return a hint if each light has the intensity of another one."""
    if not 2 <= len(pairs) <= _MOST:
        return []
    p, t = (np.log([pair[i].axial_intensity for pair in pairs]) for i in (0, 1))
    costs = np.abs(p[:, None] - t[None]).mean(axis=-1)
    orders = {
        order: float(costs[range(len(pairs)), order].sum()) for order in permutations(range(len(pairs)))
    }
    same, best = tuple(range(len(pairs))), min(orders, key=lambda order: orders[order])
    if orders[same] < len(pairs) * _SAME or not orders[best] < _RATIO * orders[same]:
        return []
    named = ", ".join(
        f"{pairs[i][0].name} has that of {pairs[j][1].name}" for i, j in enumerate(best) if i != j
    )
    return [("light.intensity", f"intensities look exchanged: {named}")]

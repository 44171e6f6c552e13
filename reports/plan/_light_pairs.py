# SPDX-License-Identifier: Apache-2.0
"""Light pairs: which predicted light stands for which true one: pairs with the least sum of distances, as
in scores.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from graycard import Camera, EnvironmentLight, Light, LocalLight, world_position


@dataclass(frozen=True, slots=True)
class LightPair:
    """A predicted light and the true one that it stands for."""

    predicted: LocalLight
    true: LocalLight
    distance: float
    """Metres, the mean over the test cameras."""


@dataclass(frozen=True, slots=True)
class Pairing:
    """The lights of one method against the true ones."""

    pairs: tuple[LightPair, ...]
    missing: tuple[LocalLight, ...]
    """True lights that no predicted one is left for."""
    extra: tuple[LocalLight, ...]
    """Predicted lights that no true one is left for."""


def local_lights(lights: Sequence[Light]) -> list[LocalLight]:
    """Return the lights that stand somewhere."""
    return [light for light in lights if not isinstance(light, EnvironmentLight)]


def places_of(light: LocalLight, cameras: Sequence[Camera]) -> np.ndarray:
    """Return where a light is in the world, shape ``(N, 3)``: once, or on the camera once for each camera."""
    if light.frame == "world":
        return np.array([light.position])
    return np.array([world_position(light, camera) for camera in cameras]).reshape(-1, 3)


def pair_lights(predicted: Sequence[Light], true: Sequence[Light], cameras: Sequence[Camera]) -> Pairing:
    """Return the one-to-one pairs with the least sum of distances (Kuhn 1955); environments stand nowhere.

    A predicted light without a finite position has no distance, and is extra. Without cameras a light that
    is mounted on them stands nowhere, and no pairs are made.
    """
    rows, columns = local_lights(predicted), local_lights(true)
    finite = [light for light in rows if np.isfinite(light.position).all()] if cameras else []
    distances = np.array([[_distance(p, t, cameras) for t in columns] for p in finite])
    found = zip(*linear_sum_assignment(distances), strict=True) if distances.size else ()
    pairs = tuple(LightPair(finite[i], columns[j], float(distances[i, j])) for i, j in found)
    return Pairing(
        pairs,
        tuple(t for t in columns if not any(t is pair.true for pair in pairs)),
        tuple(p for p in rows if not any(p is pair.predicted for pair in pairs)),
    )


def _distance(predicted: LocalLight, true: LocalLight, cameras: Sequence[Camera]) -> float:
    apart = places_of(predicted, cameras) - places_of(true, cameras)
    return float(np.linalg.norm(apart, axis=-1).mean())

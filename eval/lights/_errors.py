# SPDX-License-Identifier: Apache-2.0
"""Matching of predicted with true lights, and errors of place and intensity."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from graycard import Camera, LocalLight, PredictionError, world_position


@dataclass(frozen=True, slots=True)
class LightMatch:
    """The assignment of predicted to true lights with the least sum of distances."""

    pairs: tuple[tuple[int, int], ...]
    """Indices (predicted, true)."""
    distances: tuple[float, ...]
    """Metres, for each pair."""
    missing: int
    """True lights without a partner."""
    extra: int
    """Predicted lights without a partner."""


def light_distances(
    predicted: Sequence[LocalLight], true: Sequence[LocalLight], cameras: Sequence[Camera]
) -> np.ndarray:
    """Distance of each predicted light from each true one, shape ``(P, T)``, metres.

    A light that is mounted on the camera is placed by each camera in turn; the distance is the mean
    over the cameras.

    Raises:
        ValueError: There is no camera.
    """
    if not cameras:
        raise ValueError("expected cameras to place the lights by, got none")
    p, t = _places(predicted, cameras), _places(true, cameras)
    return np.linalg.norm(p[:, :, None] - t[:, None, :], axis=-1).mean(axis=0)


def match_lights(
    predicted: Sequence[LocalLight], true: Sequence[LocalLight], cameras: Sequence[Camera]
) -> LightMatch:
    """Match lights one to one so that the sum of their distances is least (Kuhn 1955).

    As many pairs are made as there are lights on the shorter side; order and names do not matter.

    Raises:
        ValueError: There is no camera.
    """
    from scipy.optimize import linear_sum_assignment

    distances = light_distances(predicted, true, cameras)
    rows, columns = linear_sum_assignment(distances)
    pairs = tuple((int(i), int(j)) for i, j in zip(rows, columns, strict=True))
    return LightMatch(
        pairs,
        tuple(float(distances[pair]) for pair in pairs),
        missing=len(true) - len(pairs),
        extra=len(predicted) - len(pairs),
    )


def intensity_error(
    predicted: LocalLight, true: LocalLight, gauge: tuple[float, float, float] = (1.0, 1.0, 1.0)
) -> float:
    """Mean over channels of |log2(gauge · predicted / true)| of the axial radiant intensity, in stops.

    A channel in which the true light is dark has no ratio and does not enter.

    Args:
        predicted: A light.
        true: The one that it stands for.
        gauge: Factors (R, G, B) on the predicted intensity.

    Raises:
        PredictionError: The predicted intensity is not positive where the true one is.
    """
    lit = true.axial_intensity > 0
    p, t = predicted.axial_intensity[lit], true.axial_intensity[lit]
    if (p <= 0).any():
        raise PredictionError(
            f"expected light {predicted.name!r} with a positive intensity in each channel in which "
            f"{true.name!r} shines, got {predicted.axial_intensity.tolist()} W/sr. A light that is off "
            "is to be left out of lights.json"
        )
    return float(np.abs(np.log2(np.array(gauge)[lit] * p / t)).mean()) if lit.any() else 0.0


def _places(lights: Sequence[LocalLight], cameras: Sequence[Camera]) -> np.ndarray:
    """World positions, shape ``(cameras, lights, 3)``, metres."""
    return np.array([[world_position(light, camera) for light in lights] for camera in cameras]).reshape(
        len(cameras), len(lights), 3
    )

# SPDX-License-Identifier: Apache-2.0
"""Errors of a light's direction, size and colour."""

from collections.abc import Sequence

import numpy as np

from graycard import (
    Camera,
    GaussianLight,
    LocalLight,
    PredictionError,
    RectangleLight,
    SphereLight,
    SpotLight,
    angles,
)


def axis_of(light: LocalLight) -> np.ndarray:
    """Return the direction in which a light shines most, in its frame, of any length; zero where it has none.

    Returns:
        Shape ``(3,)``: a spot's axis, a rectangle's normal, the brightest lobe's axis of a sum of Gaussians.
    """
    match light:
        case SpotLight():
            return np.array(light.direction, np.float64)
        case RectangleLight():
            return np.cross(light.half_u, light.half_v)
        case GaussianLight():
            lobe = max(light.lobes, key=lambda lobe: sum(lobe.amplitude))
            return np.array(lobe.axis) if lobe.sharpness > 0 else np.zeros(3)
        case _:
            return np.zeros(3)


def radius_of(light: LocalLight) -> float:
    """Radius of the disc that has the area which a light shows where it shows most, metres; 0 for a point."""
    match light:
        case RectangleLight():
            return float(np.sqrt(4 * np.linalg.norm(np.cross(light.half_u, light.half_v)) / np.pi))
        case SphereLight():
            return light.radius
        case _:
            return 0.0


def direction_error(predicted: LocalLight, true: LocalLight, cameras: Sequence[Camera]) -> float:
    """Angle between the axes of two lights in the world, mean over cameras, degrees; 90 without an axis.

    Raises:
        PredictionError: The predicted axis is not finite.
    """
    if not np.isfinite(axis_of(predicted)).all():
        raise PredictionError(
            f"expected light {predicted.name!r} with a finite direction, got {axis_of(predicted).tolist()}. "
            "Mend lights.json"
        )
    p, t = (np.array([_world(light, camera) for camera in cameras]) for light in (predicted, true))
    return float(angles(p, t).mean())


def extent_error(predicted: LocalLight, true: LocalLight) -> float:
    """100 |r_p - r_t| / max(r_p, r_t) of the radii by :func:`radius_of`, %: 100 for a point.

    Raises:
        PredictionError: The predicted extent is not finite.
    """
    p, t = radius_of(predicted), radius_of(true)
    if not np.isfinite(p):
        raise PredictionError(
            f"expected light {predicted.name!r} with a finite extent, got {p} m. Mend lights.json"
        )
    return 100 * abs(p - t) / max(p, t)


def chromaticity_error(predicted: LocalLight, true: LocalLight) -> float:
    """Angle between the axial radiant intensities as vectors (R, G, B), degrees.

    Also known as the angular error of illuminant estimation (Hordley and Finlayson 2006).

    Raises:
        PredictionError: The predicted light is black, or negative in a channel.
    """
    p = predicted.axial_intensity
    if (p < 0).any() or not p.any():
        raise PredictionError(
            f"expected light {predicted.name!r} with a colour, got {p.tolist()} W/sr. A light that is off is "
            "to be left out of lights.json"
        )
    return float(angles(p, true.axial_intensity))


def _world(light: LocalLight, camera: Camera) -> np.ndarray:
    axis = axis_of(light)
    return axis if light.frame == "world" else camera.camera_to_world[:3, :3] @ axis

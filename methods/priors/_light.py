# SPDX-License-Identifier: Apache-2.0
"""Errors in the calibration of a lamp: place, direction, width of the beam, strength.

No network tells these: photographs of a known target in a dark room do (DarkGS, Zhang et al. 2024).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from graycard import Light, MethodError, PointLight, SpotLight
from graycard.methods._priors import Lamp
from graycard.methods.priors._draws import draws_of, gains

WIDEST = 180.0
"""Degrees: half the angle of a cone that is everything."""


@dataclass(frozen=True, slots=True)
class LightErrors:
    """Errors in the calibration of a lamp."""

    translation: float = 0.0
    """Root mean square of how far off its place is, metres."""
    rotation: float = 0.0
    """Standard deviation of the rotation of the beam about a random axis, degrees."""
    width: float = 0.0
    """Standard deviation of the log of a factor of the beam's angles."""
    intensity: float = 0.0
    """Standard deviation of the log of a factor of each channel."""


LEVELS = (
    LightErrors(),
    LightErrors(0.005, 0.5, 0.02, 0.02),
    LightErrors(0.01, 1.0, 0.04, 0.05),
    LightErrors(0.03, 3.0, 0.08, 0.10),
    LightErrors(0.08, 6.0, 0.15, 0.20),
    LightErrors(0.20, 12.0, 0.30, 0.40),
)
"""By severity: from a calibration with a target (millimetres) to a lamp that was moved since (decimetres)."""


def calibrated(lights: Sequence[Light], errors: LightErrors, seed: int) -> Lamp:
    """Return what a calibration says about the one lamp on the camera.

    Args:
        lights: The true lights of the scene; those that stand in the room do not matter.
        errors: How wrong.
        seed: Of the draws.

    Raises:
        MethodError: There is no lamp on the camera, or more than one, or it is of no kind that is calibrated.
    """
    mounted = [light for light in lights if getattr(light, "frame", "world") == "camera"]
    if len(mounted) != 1 or not isinstance(mounted[0], Lamp):
        found = ", ".join(f"{light.name} ({type(light).__name__})" for light in mounted) or "none"
        raise MethodError(
            f"expected one point or spot light on the camera to calibrate, got {found}. Leave the prior for "
            "light out, or take a capture with one lamp on its camera"
        )
    return corrupt_light(mounted[0], errors, seed)


def corrupt_light(lamp: Lamp, errors: LightErrors, seed: int) -> Lamp:
    """Return a lamp as a calibration has it.

    Args:
        lamp: As it is, in camera axes.
        errors: How wrong.
        seed: Of the draws, which are the same for each severity: errors grow in place.
    """
    from scipy.spatial.transform import Rotation  # SciPy takes long to import

    draws = draws_of(seed, "light", "")
    aside, turn = draws.standard_normal(3) / np.sqrt(3), draws.standard_normal(3) / np.sqrt(3)
    widening = float(np.exp(errors.width * draws.standard_normal()))
    x, y, z = (np.array(lamp.position) + errors.translation * aside).tolist()
    red, green, blue = (np.array(lamp.intensity) * gains(draws, errors.intensity)).tolist()
    moved = replace(lamp, position=(x, y, z), intensity=(red, green, blue))
    if isinstance(moved, PointLight):
        return moved
    turned = Rotation.from_rotvec(np.radians(errors.rotation) * turn).apply(np.array(moved.direction))
    return _widened(replace(moved, direction=tuple(turned.tolist())), widening)


def _widened(lamp: SpotLight, factor: float) -> SpotLight:
    beam, cutoff = (min(angle * factor, WIDEST) for angle in (lamp.beam_width, lamp.cutoff_angle))
    return replace(lamp, beam_width=beam, cutoff_angle=cutoff)

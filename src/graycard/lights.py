# SPDX-License-Identifier: Apache-2.0
"""Lights with their exact position and strength; colours are scene-linear Rec.709.

Each kind of light is a type of its own. On disk a light is a JSON object whose ``type`` names it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from graycard._camera import Camera
from graycard._errors import DatasetError, GraycardError, UnknownNameError
from graycard.io import Label, Name, RelativePath, from_builtins, read_json, to_builtins, write_json

Vector = tuple[float, float, float]
Frame = Literal["world", "camera"]

MOST_LIGHTS = 1024
"""Lights that a file may hold: to judge them takes time with each pair."""
_UNIT_TOLERANCE = 1e-5
"""Rounding error of float32, a few times over."""


@dataclass(frozen=True, slots=True)
class PointLight:
    """A light without extent that shines equally in all directions."""

    name: Label
    position: Vector
    """Metres, in ``frame``."""
    intensity: Vector
    """Radiant intensity per channel, W/sr."""
    frame: Frame = "world"
    """``camera``: the light is mounted on the camera and ``position`` is in camera axes (OpenCV)."""

    @property
    def axial_intensity(self) -> np.ndarray:
        """Radiant intensity along the brightest direction, shape ``(3,)``, W/sr."""
        return np.array(self.intensity)


@dataclass(frozen=True, slots=True)
class SpotLight:
    """A light without extent whose intensity falls to zero outside a cone.

    Full intensity inside ``beam_width`` of the axis, then linear in the angle down to zero at
    ``cutoff_angle`` (both half angles, degrees).
    """

    name: Label
    position: Vector
    """Metres, in ``frame``."""
    direction: Vector
    """Axis of the cone away from the light, in ``frame``."""
    intensity: Vector
    """Radiant intensity on the axis per channel, W/sr."""
    beam_width: float
    cutoff_angle: float
    frame: Frame = "world"

    def __post_init__(self) -> None:
        if not 0 <= self.beam_width <= self.cutoff_angle <= 180:
            raise ValueError(
                f"expected 0 <= beam_width <= cutoff_angle <= 180, got {self.beam_width}, {self.cutoff_angle}"
            )

    @property
    def axial_intensity(self) -> np.ndarray:
        """Radiant intensity along the brightest direction, shape ``(3,)``, W/sr."""
        return np.array(self.intensity)


@dataclass(frozen=True, slots=True)
class SphericalGaussian:
    """One lobe of a function over directions: ``a exp(sharpness (w . axis - 1))``.

    Raises:
        ValueError: The axis is not of unit length, the sharpness or an amplitude is negative or not finite.
    """

    axis: Vector
    """Unit vector in which the lobe is brightest."""
    sharpness: float
    """0 is the same in all directions; at 1 / sharpness below 1 in the cosine, the lobe falls to 1/e."""
    amplitude: Vector
    """Value on the axis per channel."""

    def __post_init__(self) -> None:
        length = float(np.linalg.norm(self.axis))
        if not abs(length - 1) <= _UNIT_TOLERANCE:
            raise ValueError(f"expected an axis of unit length, got {self.axis} of length {length:g}")
        if not 0 <= self.sharpness < np.inf:
            raise ValueError(f"expected a finite sharpness of 0 or more, got {self.sharpness}")
        if not all(0 <= a < np.inf for a in self.amplitude):
            raise ValueError(f"expected finite amplitudes of 0 or more, got {self.amplitude}")


@dataclass(frozen=True, slots=True)
class GaussianLight:
    """A light without extent whose intensity over directions is a sum of spherical Gaussians.

    The local light of GS-ID. Towards the unit direction ``w``, away from the light, it has the radiant
    intensity ``I(w) = sum_k a_k exp(s_k (w . m_k - 1))`` with the lobes' amplitudes ``a_k`` in W/sr,
    sharpnesses ``s_k`` and axes ``m_k``.

    Raises:
        ValueError: It has no lobe.
    """

    name: Label
    position: Vector
    """Metres, in ``frame``."""
    lobes: tuple[SphericalGaussian, ...]
    """Axes in ``frame``, amplitudes in W/sr."""
    frame: Frame = "world"

    def __post_init__(self) -> None:
        if not self.lobes:
            raise ValueError(f"expected one lobe or more in the light {self.name!r}, got none")

    def intensity_towards(self, directions: np.ndarray) -> np.ndarray:
        """Radiant intensity in unit directions away from the light.

        Args:
            directions: Shape ``(..., 3)``, in ``frame``.

        Returns:
            Shape ``(..., 3)``, W/sr per channel.
        """
        axes = np.array([lobe.axis for lobe in self.lobes])
        sharpness = np.array([lobe.sharpness for lobe in self.lobes])
        amplitudes = np.array([lobe.amplitude for lobe in self.lobes])
        return np.exp(sharpness * (np.asarray(directions) @ axes.T - 1)) @ amplitudes

    @property
    def axial_intensity(self) -> np.ndarray:
        """Radiant intensity along the brightest of the lobes' axes, shape ``(3,)``, W/sr.

        The brightest has the largest sum of channels. For one lobe this is the maximum over all
        directions; lobes that overlap may be brighter between their axes.
        """
        along = self.intensity_towards(np.array([lobe.axis for lobe in self.lobes]))
        return along[np.argmax(along.sum(axis=-1))]


@dataclass(frozen=True, slots=True)
class RectangleLight:
    """A one-sided, diffusely emitting rectangle, ``position ± half_u ± half_v``; it shines along u x v."""

    name: Label
    position: Vector
    """Centre in the world, metres."""
    half_u: Vector
    half_v: Vector
    radiance: Vector
    """W/m²/sr per channel."""
    frame: Frame = "world"

    @property
    def axial_intensity(self) -> np.ndarray:
        """Radiant intensity along the brightest direction, shape ``(3,)``, W/sr: radiance x area."""
        area = 4 * np.linalg.norm(np.cross(self.half_u, self.half_v))
        return np.array(self.radiance) * area


@dataclass(frozen=True, slots=True)
class SphereLight:
    """A diffusely emitting sphere."""

    name: Label
    position: Vector
    """Centre in the world, metres."""
    radius: float
    """Metres."""
    radiance: Vector
    """W/m²/sr per channel."""
    frame: Frame = "world"

    def __post_init__(self) -> None:
        if not self.radius > 0:
            raise ValueError(f"expected a radius above 0, got {self.radius}")

    @property
    def axial_intensity(self) -> np.ndarray:
        """Radiant intensity, the same in all directions, shape ``(3,)``, W/sr: radiance x disc area."""
        return np.array(self.radiance) * np.pi * self.radius**2


@dataclass(frozen=True, slots=True)
class EnvironmentLight:
    """Light from infinitely far away, as a latitude-longitude image.

    Row ``i`` of ``H``, column ``j`` of ``W`` holds the radiance from the world direction
    ``(sin t cos p, sin t sin p, cos t)`` with ``t = pi (i + 0.5) / H`` and ``p = 2 pi (j + 0.5) / W``.
    """

    name: Name
    image: RelativePath
    """EXR file of R, G, B radiance in W/m²/sr, relative to the file that lists the lights."""


LocalLight = PointLight | SpotLight | GaussianLight | RectangleLight | SphereLight
Light = LocalLight | EnvironmentLight

_TYPES: dict[str, type[Light]] = {
    "point": PointLight,
    "spot": SpotLight,
    "spherical-gaussians": GaussianLight,
    "rectangle": RectangleLight,
    "sphere": SphereLight,
    "environment": EnvironmentLight,
}


def world_position(light: LocalLight, camera: Camera) -> np.ndarray:
    """Return where a light is in the world while ``camera`` looks, shape ``(3,)``, metres."""
    local = np.array(light.position, dtype=np.float64)
    if light.frame == "world":
        return local
    return camera.camera_to_world[:3, :3] @ local + camera.position


def light_to_json(light: Light) -> dict[str, Any]:
    """Return a light as JSON data with its ``type``."""
    kind = next(name for name, cls in _TYPES.items() if isinstance(light, cls))
    return {"type": kind, **to_builtins(light)}


def light_from_json(data: Any, error: type[GraycardError] = DatasetError, source: str = "") -> Light:
    """Return a light from JSON data; strict.

    Raises:
        UnknownNameError: The ``type`` is none that exists.
        DatasetError: (or ``error``) A key is unknown or missing, or has a value of another type.
    """
    if not isinstance(data, dict) or "type" not in data:
        raise error(f"expected a light as an object with a 'type' in {source}, got {data!r}")
    kind = str(data["type"])
    if kind not in _TYPES:
        raise UnknownNameError("light type", kind, _TYPES)
    return from_builtins(_TYPES[kind], {k: v for k, v in data.items() if k != "type"}, error, source)


def check_finite(lights: Sequence[Light], source: str) -> None:
    """Refuse lights of a truth with a number that is infinite or none; a predicted light may fail by itself.

    Raises:
        DatasetError: There is one.
    """
    for light in lights:
        if not _all_finite(data := to_builtins(light)):
            raise DatasetError(
                f"expected finite numbers of light {light.name!r} in {source}, got {data!r}. Render it anew"
            )


def _all_finite(data: Any) -> bool:
    """Tell whether no number of JSON data is infinite or not a number: those are texts there."""
    match data:
        case dict():
            return all(_all_finite(value) for key, value in data.items() if key not in ("name", "image"))
        case list():
            return all(map(_all_finite, data))
        case str():
            return data not in ("inf", "-inf", "nan")
    return True


def read_lights(path: Path) -> tuple[Light, ...]:
    """Return the lights in a JSON list.

    Raises:
        DatasetError: The file is missing or broken, holds too many, or a light has an unknown key or type.
    """
    data = read_json(path, DatasetError)
    if not isinstance(data, list):
        raise DatasetError(f"expected a JSON list of lights in {path}, got {type(data).__name__}")
    if len(data) > MOST_LIGHTS:
        raise DatasetError(f"expected at most {MOST_LIGHTS} lights in {path}, got {len(data)}")
    return tuple(light_from_json(item, DatasetError, str(path)) for item in data)


def write_lights(path: Path, lights: tuple[Light, ...]) -> None:
    """Write lights as a JSON list.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    write_json(path, [light_to_json(light) for light in lights])

# SPDX-License-Identifier: Apache-2.0
"""Shared parts of the rooms of the multilight track: their knobs, and up to eight local lights made from
them.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle

import numpy as np

from graycard import (
    EnvironmentLight,
    GaussianLight,
    LocalLight,
    PointLight,
    RectangleLight,
    SphereLight,
    SphericalGaussian,
    SpotLight,
    View,
    look_at,
)
from graycard.synth._scene import (
    MATERIALS,
    Scene,
    Thing,
    surface_of,
    triple,
)
from graycard.synth._spectra import Vector, blackbody
from graycard.synth._stream import stream
from graycard.synth.families._family import Knobs, choice, count, knob
from graycard.synth.families._gloss import PartlyGlossy

MOST_LIGHTS = 8

IRRADIANCE = 3.0
"""Irradiance: what all local lights together send to what they are aimed at, W/m², luminance; however many
they are."""

KINDS = ("rectangle", "sphere", "spot", "point")
"""Kinds of "mixed" lights, in turn."""

_JITTER = 0.12
"""Range: how far a seed moves a lamp and its aim along each axis, metres."""


@dataclass(frozen=True, slots=True)
class Stand:
    """Place where a lamp hangs, what it is aimed at (metres, before the seed moves both), and its colour."""

    position: Vector
    aim: Vector
    kelvin: float


@dataclass(frozen=True, slots=True)
class Spots:
    """Places on the floor, which a seed moves a little."""

    places: Mapping[str, tuple[float, float]]
    """x and y by name before they are moved, metres."""
    reach: float
    """Range: how far a seed moves them along each axis, metres."""

    def at(self, name: str, seed: int) -> tuple[float, float]:
        """Return x and y of a place for a seed, metres."""
        x, y = stream(seed, f"spot of {name}").uniform(-self.reach, self.reach, size=2)
        return float(self.places[name][0] + x), float(self.places[name][1] + y)


@dataclass(frozen=True, slots=True)
class ManyLights(PartlyGlossy, Knobs):
    """Knobs of a room under several local lights and dim surroundings.

    Raises:
        ValueError: A knob is out of its range.
    """

    lights: int = count(4, 1, MOST_LIGHTS)
    """Number of local lights. Together they are as bright whatever their number."""
    emitters: str = choice("mixed", "gaussian")
    """mixed: rectangles, spheres, spots and points in turn. gaussian: points whose intensity is a sum of
    spherical Gaussians, all inside the light model of GS-ID."""
    brightness: float = knob(3.0, 1.0, 30.0)
    """Ratio: how many times the brightest local light is as bright as the dimmest."""
    color: float = knob(1.0, 0.0, 1.0)
    """Saturation of the local lights: 0 all white, 1 black bodies from 2300 K to 12000 K."""
    size: float = knob(1.0, 0.5, 2.0)
    """Factor on the extents of rectangles and spheres; their intensity stays."""
    daylight: float = knob(1.0, 0.0, 10.0)
    """Factor on the surroundings."""
    gloss: float = knob(0.6, 0.0, 1.0)
    """Share of the objects that shine; at 0 no metal is left."""
    metal_roughness: float = knob(0.42, 0.1, 1.0)
    """Roughness of what is made of metal: square root of the GGX alpha. Below about 0.35 metal focuses
    lamps into caustics, whose noise lowers the noise ceiling of the truth by several dB."""
    material: str = choice(*MATERIALS)
    """Material of what shines: the papers' material, or Disney's."""

    def lamps(self, seed: int, stands: Sequence[Stand]) -> tuple[LocalLight, ...]:
        """Return the local lights ``lamp-1``, ``lamp-2`` ... of a seed, on the first of the stands."""
        shares = _shares(self.lights, self.brightness, seed)
        made = zip(range(1, self.lights + 1), stands, cycle(KINDS), shares, strict=False)
        return tuple(self._lamp(seed, n, stand, kind, share) for n, stand, kind, share in made)

    def _lamp(self, seed: int, number: int, stand: Stand, kind: str, share: float) -> LocalLight:
        rng, name = stream(seed, f"lamp {number}"), f"lamp-{number}"
        position = np.array(stand.position) + rng.uniform(-_JITTER, _JITTER, size=3)
        forward = np.array(stand.aim) + rng.uniform(-_JITTER, _JITTER, size=3) - position
        hue = 1 + self.color * (np.array(blackbody(stand.kelvin)) - 1)
        intensity = hue * share * IRRADIANCE * (forward @ forward)
        if self.emitters == "gaussian":
            return gaussian_light(name, position, forward, intensity, rng)
        if kind == "rectangle":
            return _rectangle(name, position, forward, intensity, self.size)
        if kind == "sphere":
            radius = 0.13 * self.size
            return SphereLight(name, triple(position), radius, triple(intensity / (np.pi * radius**2)))
        if kind == "spot":
            return SpotLight(name, triple(position), triple(forward), triple(intensity), 16.0, 34.0)
        return PointLight(name, triple(position), triple(intensity))


def lit(
    things: Iterable[Thing], lamps: Sequence[LocalLight], views: tuple[View, ...], sky: np.ndarray
) -> Scene:
    """Return the scene of these things under lamps, whose surfaces are things too, and surroundings called
    ``sky``.

    Args:
        things: All that does not emit.
        lamps: The local lights.
        views: Of the scene.
        sky: Radiance of the surroundings on the sky grid, W/m²/sr.
    """
    surfaces = (surface_of(x) for x in lamps if isinstance(x, RectangleLight | SphereLight))
    lights = *lamps, EnvironmentLight("sky", "environment.exr")
    return Scene((*things, *surfaces), lights, views, sky, light_weights=_light_weights(lamps))


def gaussian_light(
    name: str, position: np.ndarray, forward: np.ndarray, intensity: np.ndarray, rng: np.random.Generator
) -> GaussianLight:
    """Return a light of a beam along ``forward`` and a broad glow to one side.

    Args:
        name: Of the light.
        position: Metres.
        forward: Axis of the beam, of any length.
        intensity: What it sends along ``forward``, W/sr per channel.
        rng: Source of the sharpnesses and of the glow's axis.
    """
    axis = forward / np.linalg.norm(forward)
    aside = axis + 0.8 * rng.normal(size=3)
    aside /= np.linalg.norm(aside)
    beam, glow = rng.uniform(3, 9), rng.uniform(0.6, 1.6)
    share = 0.3 * np.exp(glow * (axis @ aside - 1))
    lobes = (axis, beam, 1 - share), (aside, glow, 0.3)
    return GaussianLight(
        name,
        triple(position),
        tuple(SphericalGaussian(triple(m), float(s), triple(a * intensity)) for m, s, a in lobes),
    )


def _rectangle(
    name: str, position: np.ndarray, forward: np.ndarray, intensity: np.ndarray, size: float
) -> RectangleLight:
    pose = look_at(position, position + forward)
    right, down = 0.36 * size * pose[:3, 0], 0.28 * size * pose[:3, 1]
    radiance = intensity / (4 * 0.36 * 0.28 * size**2)
    return RectangleLight(name, triple(position), triple(right), triple(down), triple(radiance))


def _shares(lights: int, ratio: float, seed: int) -> np.ndarray:
    """Shares of the lights in the sum, evenly spaced in their logarithm, in an order of the seed's."""
    rank = stream(seed, "brightness").permutation(lights) / max(lights - 1, 1)
    share = ratio**-rank
    return share / share.sum()


def _light_weights(lamps: Sequence[LocalLight], sky: float = 0.5) -> dict[str, float]:
    """Return samples in proportion to the root of what a light sends: between equal noise and equal
    effort.
    """
    level = np.array([float(lamp.axial_intensity.sum()) for lamp in lamps])
    weights = np.sqrt(level / level.mean())
    names = (lamp.name for lamp in lamps)
    return dict(zip(names, weights.tolist(), strict=True)) | {"sky": sky * float(weights.sum()) / len(lamps)}

# SPDX-License-Identifier: Apache-2.0
"""Local lamps: points whose intensity over directions is a sum of spherical Gaussians.

The light of such a point needs no integral: a surface that faces the lamp from the distance ``d`` in its
direction ``w`` receives ``sum_k a_k exp(s_k (w . m_k - 1)) / d²``. That is the truth's own Gaussian light.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import torch
from torch.nn.functional import normalize

from graycard import GaussianLight, PointLight, SphericalGaussian
from graycard.methods.shading._material import Lobes, Material, scattering

_NEAREST = 1e-12
"""Square metres: at the lamp itself the direction to it has no value."""


@dataclass(frozen=True, eq=False)
class Lamps:
    """K lamps of L lobes each; differentiable. Axes of any length: they are brought to length 1."""

    positions: torch.Tensor
    """Shape ``(K, 3)``, metres."""
    axes: torch.Tensor
    """Shape ``(K, L, 3)``: away from the lamp, in the axes of the positions."""
    sharpness: torch.Tensor
    """Shape ``(K, L)``, 0 or more."""
    amplitudes: torch.Tensor
    """Shape ``(K, L, 3)``, W/sr on the axis, 0 or more."""

    def __post_init__(self) -> None:
        lobes = tuple(self.sharpness.shape)
        expected = ((*lobes[:1], 3), (*lobes, 3), (*lobes, 3))
        got = tuple(tuple(x.shape) for x in (self.positions, self.axes, self.amplitudes))
        if len(lobes) != 2 or got != expected:
            raise ValueError(
                f"expected positions (K, 3), axes (K, L, 3), sharpness (K, L) and amplitudes (K, L, 3), "
                f"got {got[0]}, {got[1]}, {lobes} and {got[2]}"
            )

    def __len__(self) -> int:
        """Return the number of lamps."""
        return len(self.positions)

    def __getitem__(self, index: torch.Tensor | slice) -> "Lamps":
        """Only some lamps, by index, mask or slice."""
        return Lamps(self.positions[index], self.axes[index], self.sharpness[index], self.amplitudes[index])

    def intensity(self, away: torch.Tensor) -> torch.Tensor:
        """Radiant intensity in directions away from the lamps.

        Args:
            away: Shape ``(..., K, 3)``, unit.

        Returns:
            Shape ``(..., K, 3)``, W/sr.
        """
        # -|w - m|² / 2 is w . m - 1, which float32 knows better where a lobe is sharp
        aside = (away[..., None, :] - normalize(self.axes, dim=-1)).square().sum(dim=-1)
        return torch.einsum("...kl,klc->...kc", torch.exp(-0.5 * self.sharpness * aside), self.amplitudes)

    def flux(self) -> torch.Tensor:
        """All that they send, shape ``(K, 3)``, W: ``sum_k 2 pi a_k (1 - exp(-2 s_k)) / s_k``."""
        return 2 * torch.pi * (_spread(self.sharpness)[..., None] * self.amplitudes).sum(dim=1)


def _spread(sharpness: torch.Tensor) -> torch.Tensor:
    """``(1 - exp(-2 s)) / s``, 2 at 0, with a slope there."""
    small = sharpness < 1e-3
    safe = torch.where(small, 1.0, sharpness)
    return torch.where(small, 2 - 2 * sharpness, -torch.expm1(-2 * safe) / safe)


class Arrival(NamedTuple):
    """Light of K lamps where it arrives."""

    toward: torch.Tensor
    """Directions to the lamps, shape ``(..., K, 3)``, unit."""
    facing: torch.Tensor
    """Irradiance of surfaces that face them, unhindered, shape ``(..., K, 3)``, W/m²."""
    distance: torch.Tensor
    """Shape ``(..., K)``, metres."""


class Shining(Protocol):
    """K points that send light."""

    @property
    def positions(self) -> torch.Tensor:
        """Shape ``(K, 3)``, metres."""
        ...

    def intensity(self, away: torch.Tensor) -> torch.Tensor:
        """Radiant intensity in unit directions away from them, ``(..., K, 3)`` of ``(..., K, 3)``, W/sr."""
        ...


def arriving(lamps: Shining, points: torch.Tensor, soften: float = 0.0) -> Arrival:
    """Light of lamps at points.

    Args:
        lamps: K of them, :class:`Lamps` or others.
        points: Shape ``(..., 3)``, metres.
        soften: Metres, squared and added to the squared distance: a lamp inside a surface is not infinitely
            bright. 0 is the light of a point.
    """
    to_lamp = lamps.positions - points[..., None, :]
    squared = to_lamp.square().sum(dim=-1).clamp(min=_NEAREST)
    distance = squared.sqrt()
    toward = to_lamp / distance[..., None]
    return Arrival(toward, lamps.intensity(-toward) / (squared + soften**2)[..., None], distance)


def lit_by_lamps(material: Material, normal: torch.Tensor, eye: torch.Tensor, arrival: Arrival) -> Lobes:
    """Radiance that surfaces return of each lamp, nothing in the way, each lobe of shape ``(..., K, 3)``.

    Args:
        material: Of surfaces of shape ``(...)``.
        normal: Shape ``(..., 3)``, unit.
        eye: Shape ``(..., 3)``, unit, from the surface to the eye.
        arrival: Of :func:`arriving` at these surfaces.
    """
    each = Material(
        material.base_color[..., None, :], material.roughness[..., None], material.metallic[..., None]
    )
    lobes = scattering(each, normal[..., None, :], eye[..., None, :], arrival.toward)
    return Lobes(lobes.diffuse * arrival.facing, lobes.specular * arrival.facing)


def lamps_of(lights: Sequence[GaussianLight | PointLight], dtype: torch.dtype = torch.float32) -> Lamps:
    """Lamps of known lights; those with fewer lobes get dark ones.

    Args:
        lights: One or more; positions and axes are taken as they are, in whatever frame.
        dtype: Of the tensors.

    Raises:
        ValueError: There is no light.
    """
    if not lights:
        raise ValueError("expected one light or more, got none")
    lobes = [_lobes_of(light) for light in lights]
    most = max(len(found) for found in lobes)
    dark = SphericalGaussian((0.0, 0.0, 1.0), 0.0, (0.0, 0.0, 0.0))
    filled = [(*found, *[dark] * (most - len(found))) for found in lobes]

    def tensor(values: list) -> torch.Tensor:
        return torch.tensor(values, dtype=dtype)

    return Lamps(
        tensor([light.position for light in lights]),
        tensor([[lobe.axis for lobe in found] for found in filled]),
        tensor([[lobe.sharpness for lobe in found] for found in filled]),
        tensor([[lobe.amplitude for lobe in found] for found in filled]),
    )


def _lobes_of(light: GaussianLight | PointLight) -> tuple[SphericalGaussian, ...]:
    if isinstance(light, GaussianLight):
        return light.lobes
    return (SphericalGaussian((0.0, 0.0, 1.0), 0.0, light.intensity),)


def lights_of(lamps: Lamps, names: Sequence[str]) -> tuple[GaussianLight, ...]:
    """Return the lamps as lights of the world, one a name, with unit axes in float64.

    Raises:
        ValueError: There are not as many names as lamps.
    """
    if len(names) != len(lamps):
        raise ValueError(f"expected {len(lamps)} names, got {len(names)}")
    return tuple(_light_of(lamps, number, name) for number, name in enumerate(names))


def _light_of(lamps: Lamps, number: int, name: str) -> GaussianLight:
    axes = lamps.axes[number].detach().double().numpy()
    axes = axes / np.linalg.norm(axes, axis=-1, keepdims=True)
    rows = zip(
        axes.tolist(),
        lamps.sharpness[number].tolist(),
        lamps.amplitudes[number].tolist(),
        strict=True,
    )
    lobes = tuple(SphericalGaussian(_triple(m), float(s), _triple(a)) for m, s, a in rows)
    return GaussianLight(name, _triple(lamps.positions[number].tolist()), lobes)


def _triple(values: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = values
    return float(x), float(y), float(z)

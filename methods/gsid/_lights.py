# SPDX-License-Identifier: Apache-2.0
"""The lights as parameters: lamps of spherical Gaussians, and a cubemap."""

from collections.abc import Mapping

import torch

from graycard.methods.gsid._candidates import SHAPES, FirstLights
from graycard.methods.gsid._settings import GsidSettings
from graycard.methods.shading import Lamps

POSITIONS, AXES, SHARPNESS, AMPLITUDES = (
    "lamp positions",
    "lamp axes",
    "log lamp sharpness",
    "log lamp amplitudes",
)
"""Names of the parameters: shapes ``(K, 3)``, ``(K, L, 3)``, ``(K, L)`` and ``(K, L, 3)``; metres, and W/sr
times the exposure."""
SKY = "log sky"
"""Cubemap ``(6, N, N, 3)``: logarithm of W/m²/sr times the exposure."""
DARK = -14.0
"""Logarithm of what a lamp that is out sends: too little to be seen, and yet above 0."""
DIMMEST = -6.0
"""Logarithm of the least that a lobe begins with: what is darker has no gradient to speak of."""
FIRST_SHARPNESS = 0.3
"""Sharpness of lobes that begin: nearly the same all round."""
LAMPS = (POSITIONS, AXES, SHARPNESS, AMPLITUDES)


def lamps_from(values: Mapping[str, torch.Tensor]) -> Lamps:
    """Return the lamps of parameters by name, as bright as in exposed pictures; differentiable."""
    return Lamps(values[POSITIONS], values[AXES], values[SHARPNESS].exp(), values[AMPLITUDES].exp())


def sky_from(values: Mapping[str, torch.Tensor]) -> torch.Tensor:
    """Return the surroundings, exposed, shape ``(6, N, N, 3)``; differentiable."""
    return values[SKY].exp()


def first_lights(first: FirstLights, settings: GsidSettings) -> dict[str, torch.Tensor]:
    """Parameters before the first step; lamps that are missing are out.

    Args:
        first: At most ``settings.lamps`` of them.
        settings: Numbers of lamps, lobes and texels.
    """
    missing, lobes = settings.lamps - len(first.positions), settings.lobes
    places = torch.cat([first.positions, first.middle.expand(missing, 3)])
    sent = torch.zeros(settings.lamps, lobes, 3)
    shapes = first.intensities.shape[1]
    sent[: len(first.positions), :shapes] = first.intensities
    sharpness = torch.tensor([max(s, FIRST_SHARPNESS) for s in SHAPES[:lobes]])
    sharpness = torch.cat([sharpness, sharpness[-1:].expand(lobes - len(sharpness))]).log()
    axes = torch.nn.functional.normalize(first.middle - places + 1e-3, dim=-1)
    faces = first.sky.log()[:, None, None]
    return {
        POSITIONS: places.clone(),
        AXES: axes[:, None].repeat(1, lobes, 1),
        SHARPNESS: (sharpness + _spread(lobes)).expand(settings.lamps, lobes).clone(),
        AMPLITUDES: (sent + 1e-12).log().clamp(min=DIMMEST),
        SKY: faces.expand(6, settings.sky_size, settings.sky_size, 3).clone(),
    }


def _spread(lobes: int) -> torch.Tensor:
    """Lobes that begin alike would stay alike."""
    return torch.linspace(0, 0.1 * (lobes - 1), lobes)

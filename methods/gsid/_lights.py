# SPDX-License-Identifier: Apache-2.0
"""The lights as parameters: lamps of spherical Gaussians, and a cubemap."""

from collections.abc import Mapping

import torch

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
FIRST_SHARPNESS = 0.3
"""Of lobes that begin: nearly the same all round."""
LAMPS = (POSITIONS, AXES, SHARPNESS, AMPLITUDES)


def lamps_from(values: Mapping[str, torch.Tensor]) -> Lamps:
    """The lamps of parameters by name, as bright as in exposed pictures; differentiable."""
    return Lamps(values[POSITIONS], values[AXES], values[SHARPNESS].exp(), values[AMPLITUDES].exp())


def sky_from(values: Mapping[str, torch.Tensor]) -> torch.Tensor:
    """The surroundings, exposed, shape ``(6, N, N, 3)``; differentiable."""
    return values[SKY].exp()


def first_lights(
    positions: torch.Tensor,
    intensities: torch.Tensor,
    sky: torch.Tensor,
    middle: torch.Tensor,
    settings: GsidSettings,
) -> dict[str, torch.Tensor]:
    """Parameters of lamps that shine nearly alike all round; those that are missing are out.

    Args:
        positions: Shape ``(k, 3)``, metres, k at most ``settings.lamps``.
        intensities: Shape ``(k, 3)``, exposed.
        sky: Shape ``(6, 3)``: radiance of the faces of the cubemap, exposed.
        middle: Shape ``(3,)``, metres: lobes look there.
        settings: Numbers of lamps, lobes and texels.
    """
    missing, lobes = settings.lamps - len(positions), settings.lobes
    places = torch.cat([positions, middle.expand(missing, 3)])
    sent = torch.cat([intensities.clamp(min=0), torch.zeros(missing, 3)])
    axes = torch.nn.functional.normalize(middle - places + 1e-3, dim=-1)
    levels = (sent / lobes + 1e-12).log().clamp(min=DARK)
    faces = sky.clamp(min=1e-4).log()[:, None, None].expand(6, settings.sky_size, settings.sky_size, 3)
    return {
        POSITIONS: places.clone(),
        AXES: axes[:, None].repeat(1, lobes, 1),
        SHARPNESS: torch.full((settings.lamps, lobes), FIRST_SHARPNESS).log() + _spread(lobes),
        AMPLITUDES: levels[:, None].repeat(1, lobes, 1),
        SKY: faces.clone(),
    }


def _spread(lobes: int) -> torch.Tensor:
    """Lobes that begin alike would stay alike."""
    return torch.linspace(0, 0.5 * (lobes - 1), lobes)

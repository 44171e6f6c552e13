# SPDX-License-Identifier: Apache-2.0
"""Where lamps begin: of many places the few whose light, with its shadows, explains the photographs.

Pictures are linear in light. On pixels whose place, normal and material are about known, what a lamp of
strength 1 at each of many places would give is found with rays, and non-negative least squares tells how
strong each has to be: nearly all come out dark (inferred; the paper says nothing of where lamps begin).
"""

from dataclasses import dataclass

import numpy as np
import torch
from scipy.optimize import nnls

from graycard.methods.gsid._model import SOFTEN
from graycard.methods.gsid._settings import GsidSettings
from graycard.methods.gsid._visibility import lamp_visibility
from graycard.methods.shading import (
    Lamps,
    Material,
    arriving,
    lit_by_lamps,
    lit_by_surroundings,
    surroundings_of,
)
from graycard.methods.splat import Surfels

SAMPLES = 2000
"""Pixels that are explained."""
GRID = 9
"""Places along the longest side of the box in which lamps are looked for."""
INFLATED = 1.4
"""Sides of that box, over those of the box around surfaces and cameras."""
COVERED = 0.5
"""Share of a pixel that surfels must cover."""
_AT_ONCE = 64
"""Places whose light is found at once."""
_SEEN = 0.05
"""Share of the samples that a place must see."""


@dataclass(frozen=True, eq=False)
class Samples:
    """P pixels out of all training views."""

    points: torch.Tensor
    """Shape ``(P, 3)``, world, metres."""
    normal: torch.Tensor
    eye: torch.Tensor
    material: Material
    open: torch.Tensor
    """Shape ``(P,)``: share of the sky's light that arrives."""
    shown: torch.Tensor
    """Shape ``(P, 3)``: what the photographs show, linear, exposed."""
    eyes: torch.Tensor
    """Shape ``(V, 3)``: the cameras' places, metres."""


@dataclass(frozen=True, eq=False)
class FirstLights:
    """Lamps that shine alike all round, and a sky of six colours, exposed."""

    positions: torch.Tensor
    intensities: torch.Tensor
    """Shapes ``(k, 3)``."""
    sky: torch.Tensor
    """Shape ``(6, 3)``."""


def find_lights(samples: Samples, surfels: Surfels, settings: GsidSettings, extent: float) -> FirstLights:
    """The lights that explain the samples best, at most ``settings.lamps`` lamps.

    Args:
        samples: Pixels.
        surfels: In the way of light.
        settings: Of the fit.
        extent: Of the scene, metres.
    """
    sky = _sky_columns(samples)
    if settings.lamps == 0:
        _, of_sky = _explained(torch.zeros(len(sky), 0, 3), sky, samples.shown)
        return FirstLights(torch.zeros(0, 3), torch.zeros(0, 3), of_sky)
    places, spacing = _grid(samples)
    columns, seen = _lamp_columns(places, samples, surfels, settings, extent)
    places, columns = places[seen > _SEEN], columns[:, seen > _SEEN]
    levels, _ = _explained(
        columns.mean(dim=-1, keepdim=True),
        sky.mean(dim=-1, keepdim=True),
        samples.shown.mean(dim=-1, keepdim=True),
    )
    merged = _merged(places, levels[:, 0] * columns.mean(dim=(0, 2)), 1.6 * spacing, settings.lamps)
    columns, _ = _lamp_columns(merged, samples, surfels, settings, extent)
    intensities, of_sky = _explained(columns, sky, samples.shown)
    return FirstLights(merged, intensities, of_sky)


def _grid(samples: Samples) -> tuple[torch.Tensor, float]:
    """Places in a box around what is seen and the cameras, shape ``(C, 3)``, and how far apart, metres."""
    inside = torch.cat([samples.points, samples.eyes])
    low, high = inside.quantile(0.005, dim=0), inside.quantile(0.995, dim=0)
    low, high = torch.minimum(low, samples.eyes.amin(dim=0)), torch.maximum(high, samples.eyes.amax(dim=0))
    middle, half = (low + high) / 2, (high - low) / 2 * INFLATED
    spacing = float(2 * half.max() / (GRID - 1))
    counts = (2 * half / spacing).floor().long() + 1
    axes = [
        m + (torch.arange(int(n)) - (int(n) - 1) / 2) * spacing for m, n in zip(middle, counts, strict=True)
    ]
    return torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=-1).reshape(-1, 3), spacing


def _lamp_columns(
    places: torch.Tensor, samples: Samples, surfels: Surfels, settings: GsidSettings, extent: float
) -> tuple[torch.Tensor, torch.Tensor]:
    """What a lamp of 1 W/sr at each place gives, ``(P, C, 3)``, and the share of the samples that it sees."""
    parts, seen = [], []
    for some in places.split(_AT_ONCE):
        reached = torch.ones(len(samples.points), len(some))
        if settings.visibility != "none":
            reached = lamp_visibility(surfels, samples.points, some, extent)
        lamps = Lamps(
            some, torch.ones(len(some), 1, 3), torch.zeros(len(some), 1), torch.ones(len(some), 1, 3)
        )
        arrival = arriving(lamps, samples.points, SOFTEN * extent)
        arrival = arrival._replace(facing=arrival.facing * reached[..., None])
        parts.append(lit_by_lamps(samples.material, samples.normal, samples.eye, arrival).whole)
        seen.append(reached.mean(dim=0))
    return torch.cat(parts, dim=1), torch.cat(seen)


def _sky_columns(samples: Samples) -> torch.Tensor:
    """What each face of the cubemap gives with a radiance of 1, shape ``(P, 6, 3)``."""
    columns = []
    for face in range(6):
        sky = torch.zeros(6, 1, 1, 3)
        sky[face] = 1
        lit = lit_by_surroundings(samples.material, samples.normal, samples.eye, surroundings_of(sky))
        columns.append(lit.whole * samples.open[:, None])
    return torch.stack(columns, dim=1)


def _explained(
    lamps: torch.Tensor, sky: torch.Tensor, shown: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """Strengths of lamps ``(C, channels)`` and of the faces ``(6, channels)``: non-negative least squares.

    Errors count in shares of a pixel's brightness, as far as that is above a tenth of the mean.
    """
    weights = 1 / (shown.mean(dim=-1) + 0.1 * shown.mean())
    found = []
    for channel in range(shown.shape[-1]):
        columns = torch.cat([lamps[..., channel], sky[..., channel]], dim=1) * weights[:, None]
        target = shown[:, channel] * weights
        found.append(nnls(columns.double().numpy(), target.double().numpy())[0])
    strengths = torch.from_numpy(np.stack(found, axis=-1)).float()
    return strengths[: lamps.shape[1]], strengths[lamps.shape[1] :]


def _merged(places: torch.Tensor, given: torch.Tensor, reach: float, most: int) -> torch.Tensor:
    """Middles of groups of places, brightest first, shape ``(k, 3)``.

    Args:
        places: Shape ``(C, 3)``.
        given: Shape ``(C,)``: mean brightness that each gives.
        reach: Metres: how far places of one group are from its brightest.
        most: Groups.
    """
    found: list[tuple[float, torch.Tensor]] = []
    left = given.clone()
    while bool((left > 0).any()):
        near = ((places - places[left.argmax()]).norm(dim=-1) <= reach) & (left > 0)
        found.append(
            (float(left[near].sum()), (left[near, None] * places[near]).sum(dim=0) / left[near].sum())
        )
        left[near] = 0
    found.sort(key=lambda group: -group[0])
    return torch.stack([place for _, place in found[:most]]) if found else torch.zeros(0, 3)


def enough_cover(alpha: torch.Tensor) -> torch.Tensor:
    """Pixels that surfels cover well enough to be explained, bool, of the same shape."""
    return alpha > COVERED

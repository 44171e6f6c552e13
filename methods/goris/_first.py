# SPDX-License-Identifier: Apache-2.0
"""How much glossy surfaces reflect before the first step with light: what photographs allow (inferred).

A point of a glossy surface is seen in several views. What it scatters is the same in all of them, what it
reflects is F (L + V E): radiance L and transmittance V of the mirrored ray are traced, and with F0 given F is
known, so that the surroundings E are a linear least squares fit, of the differences between views. Both terms
look alike to a fit that steps downhill: begun with F0 of 0.5 on wood, or 0.1 on steel, it stays near to that.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import torch
from scipy.optimize import nnls

from graycard.methods.goris._model import (
    REGION,
    Mirrored,
    drawn_buffers,
    mirrored_colours,
)
from graycard.methods.goris._settings import GorisSettings
from graycard.methods.goris._shots import Shot
from graycard.methods.removal import points_in_picture
from graycard.methods.shading import look_up, texel_directions
from graycard.methods.splat import CENTRES
from graycard.methods.surfels import decode

CANDIDATES = (0.04, 0.07, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
"""Of F0, the same for all glossy surfaces and channels; glass, wood and stone have 0.04 and
more, most metals 0.5 to 0.9."""
SLACK = 1.04
"""Of the metals, or of the others, the geometric mean is taken of those whose error is no more than so many
times their least: between them photographs do not decide."""
LEAST_METAL, METAL_SLACK, METAL_SHARE = 0.4, 1.07, 0.85
"""Metals reflect so much or more on average, little else reflects a third of it, and a weak mirror of bright
surroundings explains a metal's photographs nearly as well. It is a metal if the best fit of a metal's F0
leaves no more than so many times the least error, which is mostly of what was traced, and takes off at least
this share of what the best takes off the squares, for noise draws errors level and not these."""
LEAST_EXPLAINED = 0.05
"""Of the squares of all differences between views: with less there is noise and little else."""
LEAST_MET = 0.02
"""Share of the clear sightings whose mirrored ray meets a surfel: with less, surroundings take up any F0."""
_MET = 0.5
_CLEAR = 0.05
"""F0 is told by clear sightings, whose mirrored ray surfels stop or let pass but for so much: where edges are
mirrored, what was traced is most often wrong. The surroundings are of all, as some parts of them are seen in
half-open rays alone."""
_SIZE = 6
"""Texels along the side of a face of the surroundings that are fitted."""
_DOUBT = 1e-3
"""Of the mean square of reflections: how much surroundings that are not the mean of photographs cost."""
_NEAR = 0.02
"""A point whose depth differs from what a view sees there by no more than this share is what it sees."""


@dataclass(frozen=True, eq=False)
class Sightings:
    """Glossy surfels in photographs: M times that one was seen."""

    surfel: np.ndarray
    """Shape ``(M,)``: which one."""
    colour: np.ndarray
    """Shape ``(M, 3)``: of the photograph, linear, exposed."""
    radiance: np.ndarray
    """Shape ``(M, 3)``: along the mirrored ray, of surfels, as much as they cover."""
    passed: np.ndarray
    """Shape ``(M,)``: what passes them."""
    direction: np.ndarray
    """Shape ``(M, 3)``: of the mirrored ray, world, unit."""
    grazing: np.ndarray
    """Shape ``(M,)``: (1 - cosine)^5, see :func:`graycard.methods.goris._model.fresnel`."""

    def take(self, which: np.ndarray) -> "Sightings":
        """Some of them, by a mask of shape ``(M,)``."""
        return Sightings(*(getattr(self, part.name)[which] for part in fields(self)))


@dataclass(frozen=True, eq=False)
class FirstLight:
    """Before the first step with light."""

    f0: float
    """Of all glossy surfels."""
    surroundings: torch.Tensor
    """Cubemap ``(6, N, N, 3)``, exposed radiance, above 0."""
    surfels: torch.Tensor
    """Numbers of the surfels that were seen, shape ``(S,)``."""
    diffuse: torch.Tensor
    """What each of them scatters, shape ``(S, 3)``, linear, exposed, 0 or more."""


def first_light(
    values: Mapping[str, torch.Tensor], shots: Sequence[Shot], settings: GorisSettings, extent: float
) -> FirstLight | None:
    """What photographs allow; None where glossy surfels are seen again too seldom to tell the surroundings,
    next to nothing is mirrored but these, which take up any F0, or views differ by noise alone.

    Args:
        values: Parameters by name, regions as priors have them.
        shots: The training views.
        settings: Of the method.
        extent: Of the scene, metres.
    """
    found = sightings(values, shots, settings, extent)
    f0 = found_f0(found)
    if f0 is None:
        return None
    basis = _basis(found)
    _, sky = _fitted(found, basis, f0)
    light = found.radiance + found.passed[:, None] * (basis @ sky)
    left = found.colour - _fresnel(f0, found)[:, None] * light
    seen, surfel, count = np.unique(found.surfel, return_inverse=True, return_counts=True)
    diffuse = np.stack([np.bincount(surfel, c) for c in left.T], axis=1)
    cubemap = _float(sky.reshape(6, _SIZE, _SIZE, 3))
    toward = _float(texel_directions(settings.sky_size))
    least = 0.05 * float(found.colour.mean())
    return FirstLight(
        f0,
        look_up(cubemap, toward).clamp(min=least),
        torch.from_numpy(seen),
        _float(diffuse / count[:, None]).clamp(min=0),
    )


def found_f0(found: Sightings) -> float | None:
    """The F0 of glossy surfels; None where sightings do not tell, see :func:`first_light`."""
    clear = found.take(np.abs(found.passed - 0.5) >= 0.5 - _CLEAR)
    _, number, count = np.unique(clear.surfel, return_inverse=True, return_counts=True)
    clear = clear.take(count[number] > 1)
    surfels, texels = int((count > 1).sum()), 6 * _SIZE**2
    if len(clear.surfel) - surfels < texels or (clear.passed < _MET).mean() < LEAST_MET:
        return None
    basis = _basis(clear)
    matte = _error(_between_views(clear.colour, clear.surfel))
    return likeliest([_fitted(clear, basis, f0)[0] for f0 in CANDIDATES], matte)


def likeliest(errors: Sequence[float], matte: float) -> float | None:
    """The F0 that photographs speak for most, the mean of those between which they do not decide.

    Args:
        errors: Root mean squares that each of the :data:`CANDIDATES` leaves, above 0.
        matte: The same if nothing is reflected: all differences between views.

    Returns:
        None if no candidate explains any differences to speak of.
    """
    squares, candidates = np.square(errors), np.asarray(CANDIDATES)
    metal = candidates >= LEAST_METAL
    explained, by_metal = (matte**2 - least for least in (squares.min(), squares[metal].min()))
    if explained < LEAST_EXPLAINED * matte**2:
        return None
    nearly_as_good = squares[metal].min() <= METAL_SLACK**2 * squares.min()
    of_its_kind = metal if nearly_as_good and by_metal >= METAL_SHARE * explained else ~metal
    best = of_its_kind & (squares <= SLACK**2 * squares[of_its_kind].min())
    return float(np.exp(np.log(candidates[best]).mean()))


def _basis(found: Sightings) -> np.ndarray:
    """What each texel of the surroundings counts in each direction, ``(M, T)``."""
    texels = torch.eye(6 * _SIZE**2).reshape(6, _SIZE, _SIZE, -1)
    return look_up(texels, _float(found.direction)).numpy()


def _fitted(found: Sightings, basis: np.ndarray, f0: float) -> tuple[float, np.ndarray]:
    """The error that is left, of :func:`_error`, and surroundings ``(T, 3)``, none below 0."""
    strength = _fresnel(f0, found)
    seen_through = _between_views((strength * found.passed)[:, None] * basis, found.surfel)
    left = _between_views(found.colour - strength[:, None] * found.radiance, found.surfel)
    doubt = _DOUBT * len(found.surfel) * f0**2
    normal = seen_through.T @ seen_through + (doubt + 1e-9) * np.eye(basis.shape[1])
    root = np.linalg.cholesky(normal).T
    wanted = seen_through.T @ left + doubt * found.colour.mean(axis=0)
    sky = np.stack([nnls(root, np.linalg.solve(root.T, w))[0] for w in wanted.T], axis=1)
    return _error(left - seen_through @ sky), sky


def _error(left: np.ndarray) -> float:
    """Root mean square of values ``(M, 3)``."""
    return float(np.sqrt((left**2).mean()))


def _fresnel(f0: float, found: Sightings) -> np.ndarray:
    return f0 + (1 - f0) * found.grazing


def _between_views(values: np.ndarray, surfel: np.ndarray) -> np.ndarray:
    """Values ``(M, C)`` less their mean over the sightings of each surfel."""
    count = np.bincount(surfel).clip(min=1)
    means = np.stack([np.bincount(surfel, column) for column in values.T], axis=1) / count[:, None]
    return values - means[surfel]


@torch.no_grad()
def sightings(
    values: Mapping[str, torch.Tensor], shots: Sequence[Shot], settings: GorisSettings, extent: float
) -> Sightings:
    """Where photographs show the centres of glossy surfels, unless something is in front of them."""
    (glossy,) = (values[REGION][:, 0] < 0).nonzero(as_tuple=True)
    parts = []
    for shot in shots:
        view = shot.photograph
        buffers = drawn_buffers(values, view.camera, view.sky, settings)
        masked = replace(buffers, glossy=shot.glossy * (1 - shot.target))
        mirrored = mirrored_colours(values, masked, settings, extent)
        depth = np.where(buffers.drawn.alpha > 0.5, buffers.drawn.depth, np.inf)
        which, rows = _seen_at(values[CENTRES][glossy].numpy(), shot, depth)
        place = np.full(depth.size, -1)
        place[mirrored.rows.numpy()] = np.arange(len(mirrored.rows))
        kept = place[rows] >= 0
        normal, linear = buffers.normal.reshape(-1, 3), decode(view.encoded).reshape(-1, 3)
        rays, rows = torch.from_numpy(place[rows[kept]]), torch.from_numpy(rows[kept])
        parts.append(_sighted(glossy.numpy()[which[kept]], linear[rows], normal[rows], _at(mirrored, rays)))
    return Sightings(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def _at(mirrored: Mirrored, rays: torch.Tensor) -> Mirrored:
    parts = (mirrored.rows, mirrored.directions, mirrored.radiance, mirrored.passed, mirrored.depth)
    return Mirrored(*(part[rays] for part in parts))


def _sighted(
    surfel: np.ndarray, colour: torch.Tensor, normal: torch.Tensor, mirrored: Mirrored
) -> tuple[np.ndarray, ...]:
    cosine = (normal * mirrored.directions).sum(dim=-1).clamp(0, 1)
    parts = (colour, mirrored.radiance, mirrored.passed[:, 0], mirrored.directions, (1 - cosine) ** 5)
    return surfel, *(part.double().numpy() for part in parts)


def _seen_at(places: np.ndarray, shot: Shot, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the places that a view sees, and the numbers of their pixels, row by row."""
    camera = shot.photograph.camera
    numbers, rows, columns, z = points_in_picture(camera, places)
    seen = np.abs(z / depth[rows, columns] - 1) <= _NEAR
    return numbers[seen], (rows * camera.width + columns)[seen]


def _float(values: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(np.asarray(values, np.float32))

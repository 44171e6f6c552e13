# SPDX-License-Identifier: Apache-2.0
"""Initial F0, diffuse radiance and environment map of glossy surfaces, from the photographs (inferred).

A point of a glossy surface is seen in several views. Its diffuse radiance is the same in all of them, its
specular radiance is F (L + V E): radiance L and transmittance V of the reflected ray are traced, and with F0
given F is known, so that the environment E is a linear least squares fit to the differences between views.
Metals scatter nothing: of them reflections explain not only the differences, but all that is seen.
Gradient descent hardly tells the terms apart: begun with F0 of 0.5 on wood, or 0.1 on steel, it stays there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import torch
from scipy.ndimage import maximum_filter
from scipy.optimize import nnls

from graycard.methods._tensors import float_tensor
from graycard.methods.goris._model import (
    REGION,
    Reflection,
    drawn_buffers,
    reflected_radiance,
)
from graycard.methods.goris._settings import GorisSettings
from graycard.methods.goris._training_views import TrainingView
from graycard.methods.removal import NEAR, points_in_picture
from graycard.methods.shading import look_up, texel_directions
from graycard.methods.splat import CENTRES
from graycard.methods.surfels import srgb_decode_tensor

CANDIDATES = (0.04, 0.07, 0.1, 0.15, 0.2, 0.3)
"""F0 that are tried of what is no metal; glass, wood and stone have 0.04 and a little more."""
SLACK = 1.04
"""Photographs do not decide between candidates whose residual is no more than this many times the least."""
METAL = 0.6
"""F0 of a metal as long as it is not known: most have 0.5 to 0.95."""
MOST_SCATTERED = 1.16
"""A metal scatters no light. Surfaces are one if what reflections alone do not explain is no more than this
many times what they do not explain of the differences between views: 1.06 on two metal tuning tables, 1.28 to
1.42 on wood, on marble and on a dome."""
LEAST_EXPLAINED = 0.05
"""Least share of the variance between views that reflections have to explain: else it is mostly noise."""
LEAST_MET = 0.02
"""Least share of the clear sightings whose reflected ray meets a surfel: an environment fits any F0."""
LEAST_HITS = 50
"""Least number of clear sightings whose reflected ray meets a surfel, for F0 to be read off them."""
_MET = 0.5
_CLEAR = 0.05
"""F0 is estimated from clear sightings, whose reflected ray has a transmittance within this of 0 or 1: traced
radiance is least reliable at edges. The environment is fitted to all, as parts of it are seen by half-open
rays alone."""
_AROUND = 3
"""Side in pixels of the box in which all reflected rays have to meet surfels for F0 of a metal to be told."""
_AWAY = 3.0
"""Times the offset of reflected rays that they have to go for F0 of a metal to be told."""
_SIZE = 6
"""Texels along the side of a face of the environment map that is fitted first, by least squares."""
_DOUBT = 1e-3
"""Weight of the ridge towards the mean of the photographs, relative to the mean square of reflections."""
_FINER, _ROUNDS = 16, 3
"""Texels along the side of a face of the environment map that is corrected then, and how often. With more it
learns by heart: by 32 or 64 texels or 10 rounds, held-out views of all five tuning tables are told worse."""
_DARK = 1e-3
_LEAST_METAL, _MOST_METAL = 0.3, 0.98


@dataclass(frozen=True, eq=False)
class Observations:
    """Observations of glossy surfels in photographs, M in all."""

    surfel: np.ndarray
    """Shape ``(M,)``: which surfel."""
    colour: np.ndarray
    """Shape ``(M, 3)``: of the photograph, linear, exposed."""
    radiance: np.ndarray
    """Shape ``(M, 3)``: traced along the reflected ray, premultiplied by coverage."""
    passed: np.ndarray
    """Shape ``(M,)``: transmittance of that ray."""
    direction: np.ndarray
    """Shape ``(M, 3)``: of the reflected ray, world, unit."""
    grazing: np.ndarray
    """Shape ``(M,)``: (1 - cosine)^5, see :func:`graycard.methods.goris._model.fresnel`."""

    def take(self, which: np.ndarray) -> "Observations":
        """Return some of them, by a mask of shape ``(M,)``."""
        return Observations(*(getattr(self, part.name)[which] for part in fields(self)))


@dataclass(frozen=True, eq=False)
class Reflectance:
    """Material of the glossy surfaces."""

    f0: np.ndarray
    """Shape ``(3,)``; alike in all channels of what is no metal."""
    metal: bool
    """True if they scatter no light."""


@dataclass(frozen=True, eq=False)
class InitialLight:
    """Initial values of light transport."""

    reflectance: Reflectance
    """``f0`` of all glossy surfels."""
    surroundings: torch.Tensor
    """Cubemap ``(6, N, N, 3)``, exposed radiance, above 0."""
    surfels: torch.Tensor
    """Numbers of the surfels that were seen, shape ``(S,)``."""
    diffuse: torch.Tensor
    """Diffuse radiance of each of them, shape ``(S, 3)``, linear, exposed, 0 or more; 0 of a metal."""


def initial_light(
    values: Mapping[str, torch.Tensor], shots: Sequence[TrainingView], settings: GorisSettings, extent: float
) -> InitialLight | None:
    """Estimate initial values from the photographs.

    Args:
        values: Parameters by name, regions as told by priors.
        shots: The training views.
        settings: Of the method.
        extent: Of the scene, metres.

    Returns:
        None if too few views see glossy surfaces to determine the environment, if surfaces reflect next to
        nothing else, which would fit any F0, or if views differ by noise alone.
    """
    found = observations(values, shots, settings, extent)
    told = found_reflectance(found)
    if told is None:
        return None
    if told.metal:
        told = replace(told, f0=metal_f0(mirrored_pixels(values, shots, settings, extent), told.f0))
    return _light_of(found, told, settings.sky_size)


def found_reflectance(found: Observations) -> Reflectance | None:
    """Return the material of glossy surfels; None where sightings do not determine it.

    See :func:`initial_light`.
    """
    clear = found.take(np.abs(found.passed - 0.5) >= 0.5 - _CLEAR)
    _, number, count = np.unique(clear.surfel, return_inverse=True, return_counts=True)
    clear = clear.take(count[number] > 1)
    surfels, texels = int((count > 1).sum()), 6 * _SIZE**2
    freedom = len(clear.surfel) - surfels
    if freedom < texels or (clear.passed < _MET).mean() < LEAST_MET:
        return None
    basis = _basis(clear)
    errors = [_fitted(clear, basis, f0)[0] for f0 in CANDIDATES]
    if min(errors) ** 2 > (1 - LEAST_EXPLAINED) * _error(_between_views(clear.colour, clear.surfel)) ** 2:
        return None
    least = _fitted(clear, basis, METAL)[0] * np.sqrt(len(clear.surfel) / freedom)
    if _fitted(clear, basis, METAL, scatters=False)[0] <= MOST_SCATTERED * least:
        return Reflectance(metal_f0(clear, np.full(3, METAL)), metal=True)
    return Reflectance(np.full(3, _likeliest(errors, _dielectric_f0(clear))), metal=False)


def metal_f0(clear: Observations, otherwise: np.ndarray) -> np.ndarray:
    """F0 of each channel, shape ``(3,)``: what is seen over what was traced, where nothing is scattered.

    A median, as traced surfels are not all where they should be.

    Args:
        clear: Sightings.
        otherwise: Shape ``(3,)``: what it is taken to be where too few rays meet surfels.
    """
    light, seen, _ = _mirrored(clear)
    if len(light) < LEAST_HITS:
        return otherwise
    return np.median(seen / np.maximum(light, _DARK), axis=0).clip(_LEAST_METAL, _MOST_METAL)


def _dielectric_f0(clear: Observations) -> float:
    """F0 by how what is seen of a point follows, from view to view, what was traced; at least the least."""
    light, seen, surfel = _mirrored(clear)
    if len(light) < LEAST_HITS:
        return CANDIDATES[0]
    x, y = (_between_views(part, surfel) for part in (light, seen))
    return float(np.clip((x * y).sum() / max((x * x).sum(), 1e-12), CANDIDATES[0], CANDIDATES[-1]))


def _mirrored(clear: Observations) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return, where reflected rays meet surfels, the factor of F0 and the radiance that it explains.

    Returns:
        Two of shape ``(K, 3)``, and the surfel of each.
    """
    met = clear.take(clear.passed < _CLEAR)
    grazing = met.grazing[:, None]
    return (1 - grazing) * met.radiance, met.colour - grazing * met.radiance, met.surfel


def _likeliest(errors: Sequence[float], f0: float) -> float:
    """Return the candidate that is nearest to an F0, of those between which residuals do not decide."""
    squares, candidates = np.square(errors), np.asarray(CANDIDATES)
    may = candidates[squares <= SLACK**2 * squares.min()]
    return float(may[np.abs(np.log(may / f0)).argmin()])


def _light_of(found: Observations, told: Reflectance, sky_size: int) -> InitialLight:
    """Return the environment and the diffuse radiance that fit best to what surfaces are."""
    mean = float(told.f0.mean())
    _, coarse = _fitted(found, _basis(found), mean, scatters=not told.metal)
    coarse = float_tensor((coarse * mean / told.f0).reshape(6, _SIZE, _SIZE, 3))
    seen, surfel = np.unique(found.surfel, return_inverse=True)
    sky, diffuse = _corrected(found, torch.from_numpy(surfel), told, coarse)
    sky = look_up(sky, float_tensor(texel_directions(sky_size)))
    return InitialLight(told, sky, torch.from_numpy(seen), diffuse)


def _corrected(
    found: Observations, surfel: torch.Tensor, told: Reflectance, coarse: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """Correct an environment by what photographs show beside it, texel by texel, and the diffuse radiance.

    Each round adds to a texel the mean of what is missing in the sightings of it, all at once (SIRT: Gilbert
    1972), after the diffuse radiance was taken as the mean of what is left. A texel that none sees stays.

    Args:
        found: Sightings, M of S surfels.
        surfel: Shape ``(M,)``: which of the S.
        told: What surfaces are.
        coarse: The environment to begin with, a cubemap.

    Returns:
        The environment, above 0, and the diffuse radiance, shape ``(S, 3)``.
    """
    colour, radiance, passed = (float_tensor(part) for part in (found.colour, found.radiance, found.passed))
    strength = float_tensor(told.f0 + (1 - told.f0) * found.grazing[:, None])
    toward, through = float_tensor(found.direction), strength * passed[:, None]
    least = 0.05 * float(colour.mean())
    sky = look_up(coarse, float_tensor(texel_directions(_FINER))).clamp(min=least)
    count = torch.bincount(surfel)[:, None]
    diffuse = torch.zeros(len(count), 3)
    weight = _spread(through**2, toward) + (through**2).mean(dim=0)
    for _ in range(_ROUNDS):
        left = colour - strength * radiance - through * look_up(sky, toward)
        if not told.metal:
            diffuse = (torch.zeros_like(diffuse).index_add(0, surfel, left) / count).clamp(min=0)
        missing = _spread(through * (left - diffuse[surfel]), toward)
        sky = (sky + missing / weight).clamp(min=least)
    return sky, diffuse


@torch.enable_grad()
def _spread(values: torch.Tensor, toward: torch.Tensor) -> torch.Tensor:
    """Values ``(M, 3)`` of directions, added to the texels seen there: the transpose of a look-up."""
    sky = torch.zeros(6, _FINER, _FINER, 3, requires_grad=True)
    return torch.autograd.grad((look_up(sky, toward) * values).sum(), sky)[0]


def _basis(found: Observations) -> np.ndarray:
    """Weight of each texel of the environment map in each direction, ``(M, T)``."""
    texels = torch.eye(6 * _SIZE**2).reshape(6, _SIZE, _SIZE, -1)
    return look_up(texels, float_tensor(found.direction)).numpy()


def _fitted(
    found: Observations, basis: np.ndarray, f0: float, *, scatters: bool = True
) -> tuple[float, np.ndarray]:
    """Return the residual, see :func:`_error`, and the non-negative environment ``(T, 3)``.

    Args:
        found: Sightings, M.
        basis: Shape ``(M, T)``.
        f0: Of all channels.
        scatters: Whether each surfel also has a radiance that is the same in all views.
    """
    strength = _fresnel(f0, found)
    seen_through, left = (
        (strength * found.passed)[:, None] * basis,
        found.colour - strength[:, None] * found.radiance,
    )
    if scatters:
        seen_through, left = (_between_views(part, found.surfel) for part in (seen_through, left))
    doubt = _DOUBT * len(found.surfel) * f0**2
    normal = seen_through.T @ seen_through + (doubt + 1e-9) * np.eye(basis.shape[1])
    root = np.linalg.cholesky(normal).T
    wanted = seen_through.T @ left + doubt * found.colour.mean(axis=0)
    sky = np.stack([nnls(root, np.linalg.solve(root.T, w))[0] for w in wanted.T], axis=1)
    return _error(left - seen_through @ sky), sky


def _error(left: np.ndarray) -> float:
    """Root mean square of values ``(M, 3)``."""
    return float(np.sqrt((left**2).mean()))


def _fresnel(f0: float, found: Observations) -> np.ndarray:
    return f0 + (1 - f0) * found.grazing


def _between_views(values: np.ndarray, surfel: np.ndarray) -> np.ndarray:
    """Values ``(M, C)`` less their mean over the sightings of each surfel."""
    _, surfel = np.unique(surfel, return_inverse=True)
    count = np.bincount(surfel)
    means = np.stack([np.bincount(surfel, column) for column in values.T], axis=1) / count[:, None]
    return values - means[surfel]


@torch.no_grad()
def observations(
    values: Mapping[str, torch.Tensor], shots: Sequence[TrainingView], settings: GorisSettings, extent: float
) -> Observations:
    """Observations of the centres of glossy surfels in photographs, where they are not occluded."""
    (glossy,) = (values[REGION][:, 0] < 0).nonzero(as_tuple=True)
    parts = []
    for shot in shots:
        view = shot.photograph
        buffers = drawn_buffers(values, view.camera, view.sky, settings)
        masked = replace(buffers, glossy=shot.glossy)
        reflection = reflected_radiance(values, masked, settings, extent)
        depth = np.where(buffers.drawn.alpha > 0.5, buffers.drawn.depth, np.inf)
        which, rows = _seen_at(values[CENTRES][glossy].numpy(), shot, depth)
        place = np.full(depth.size, -1)
        place[reflection.rows.numpy()] = np.arange(len(reflection.rows))
        kept = place[rows] >= 0
        normal, linear = buffers.normal.reshape(-1, 3), srgb_decode_tensor(view.encoded).reshape(-1, 3)
        rays, rows = torch.from_numpy(place[rows[kept]]), torch.from_numpy(rows[kept])
        parts.append(_sighted(glossy.numpy()[which[kept]], linear[rows], normal[rows], _at(reflection, rays)))
    return Observations(*(np.concatenate(part) for part in zip(*parts, strict=True)))


@torch.no_grad()
def mirrored_pixels(
    values: Mapping[str, torch.Tensor], shots: Sequence[TrainingView], settings: GorisSettings, extent: float
) -> Observations:
    """Observations of all pixels whose reflected ray meets surfels, as do those of the pixels around it.

    There are none at edges of what is mirrored, where a ray that meets a surfel stands for light that does
    not, nor where something stands on the surface: surfels there have the surface's own colours.

    Returns:
        Each as one of its own surfel.
    """
    parts = []
    for shot in shots:
        view = shot.photograph
        buffers = replace(drawn_buffers(values, view.camera, view.sky, settings), glossy=shot.glossy)
        reflection = reflected_radiance(values, buffers, settings, extent)
        passed = np.ones(buffers.roughness.shape, np.float32)
        passed.flat[reflection.rows.numpy()] = reflection.passed[:, 0]
        inside = maximum_filter(passed, size=_AROUND).flat[reflection.rows.numpy()] < _CLEAR
        far = reflection.depth[:, 0].numpy() > _AWAY * settings.near * extent
        rays = torch.from_numpy((inside & far).nonzero()[0])
        rows = reflection.rows[rays]
        normal, linear = buffers.normal.reshape(-1, 3), srgb_decode_tensor(view.encoded).reshape(-1, 3)
        parts.append(_sighted(rows.numpy(), linear[rows], normal[rows], _at(reflection, rays)))
    found = Observations(*(np.concatenate(part) for part in zip(*parts, strict=True)))
    return replace(found, surfel=np.arange(len(found.surfel)))


def _at(reflection: Reflection, rays: torch.Tensor) -> Reflection:
    parts = (reflection.rows, reflection.directions, reflection.radiance, reflection.passed, reflection.depth)
    return Reflection(*(part[rays] for part in parts))


def _sighted(
    surfel: np.ndarray, colour: torch.Tensor, normal: torch.Tensor, reflection: Reflection
) -> tuple[np.ndarray, ...]:
    cosine = (normal * reflection.directions).sum(dim=-1).clamp(0, 1)
    parts = (colour, reflection.radiance, reflection.passed[:, 0], reflection.directions, (1 - cosine) ** 5)
    return surfel, *(part.double().numpy() for part in parts)


def _seen_at(places: np.ndarray, shot: TrainingView, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the places that a view sees, and the numbers of their pixels, row by row."""
    camera = shot.photograph.camera
    numbers, rows, columns, z = points_in_picture(camera, places)
    seen = np.abs(z / depth[rows, columns] - 1) <= NEAR
    return numbers[seen], (rows * camera.width + columns)[seen]

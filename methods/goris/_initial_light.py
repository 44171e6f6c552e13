# SPDX-License-Identifier: Apache-2.0
"""Initial F0, diffuse radiance and environment map of glossy surfaces, from the photographs (inferred).

A point of a glossy surface is seen in several views. Its diffuse radiance is the same in all of them, its
specular radiance is F (L + V E): radiance L and transmittance V of the reflected ray are traced, and with F0
given F is known, so that the environment E is a linear least squares fit to the differences between views.
Gradient descent hardly tells the terms apart: begun with F0 of 0.5 on wood, or 0.1 on steel, it stays there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import torch
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

CANDIDATES = (0.04, 0.07, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
"""F0 that are tried, the same for all glossy surfaces and channels; glass, wood and stone have 0.04 and more,
most metals 0.5 to 0.9."""
SLACK = 1.04
"""Of the metals, or of the others, the geometric mean is taken of all candidates whose residual is no more
than this many times the least of its kind: photographs do not decide between them."""
LEAST_METAL = 0.4
"""Metals have F0 of 0.4 and more, little else has a third of it. A weak mirror of bright surroundings
explains a metal's photographs nearly as well: residuals do not tell which it is, a fit of either does."""
LEAST_EXPLAINED = 0.05
"""Least share of the variance between views that a kind has to explain: with less it is mostly noise."""
LEAST_MET = 0.02
"""Least share of the clear sightings whose reflected ray meets a surfel: an environment fits any F0."""
_MET = 0.5
_CLEAR = 0.05
"""F0 is estimated from clear sightings, whose reflected ray has a transmittance within this of 0 or 1: traced
radiance is least reliable at edges. The environment is fitted to all, as parts of it are seen by half-open
rays alone."""
_SIZE = 6
"""Texels along the side of a face of the environment map that is fitted."""
_DOUBT = 1e-3
"""Weight of the ridge towards the mean of the photographs, relative to the mean square of reflections."""


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
        """Some of them, by a mask of shape ``(M,)``."""
        return Observations(*(getattr(self, part.name)[which] for part in fields(self)))


@dataclass(frozen=True, eq=False)
class InitialLight:
    """Initial values of light transport."""

    f0: float
    """Of all glossy surfels."""
    surroundings: torch.Tensor
    """Cubemap ``(6, N, N, 3)``, exposed radiance, above 0."""
    surfels: torch.Tensor
    """Numbers of the surfels that were seen, shape ``(S,)``."""
    diffuse: torch.Tensor
    """Diffuse radiance of each of them, shape ``(S, 3)``, linear, exposed, 0 or more."""


def initial_lights(
    values: Mapping[str, torch.Tensor], shots: Sequence[TrainingView], settings: GorisSettings, extent: float
) -> list[InitialLight]:
    """Estimate initial values from the photographs, once as of a metal and once as of what is none.

    Args:
        values: Parameters by name, regions as told by priors.
        shots: The training views.
        settings: Of the method.
        extent: Of the scene, metres.

    Returns:
        Two at most. The list is empty if too few views see glossy surfaces to determine the environment, if
        surfaces reflect next to nothing else, which would fit any F0, or if views differ by noise alone.
    """
    found = observations(values, shots, settings, extent)
    return [_light_of(found, f0, settings.sky_size) for f0 in found_f0s(found)]


def _light_of(found: Observations, f0: float, sky_size: int) -> InitialLight:
    """The environment and the diffuse radiance that fit best to an F0."""
    basis = _basis(found)
    _, sky = _fitted(found, basis, f0)
    light = found.radiance + found.passed[:, None] * (basis @ sky)
    left = found.colour - _fresnel(f0, found)[:, None] * light
    seen, surfel, count = np.unique(found.surfel, return_inverse=True, return_counts=True)
    diffuse = np.stack([np.bincount(surfel, c) for c in left.T], axis=1)
    cubemap = float_tensor(sky.reshape(6, _SIZE, _SIZE, 3))
    toward = float_tensor(texel_directions(sky_size))
    least = 0.05 * float(found.colour.mean())
    return InitialLight(
        f0,
        look_up(cubemap, toward).clamp(min=least),
        torch.from_numpy(seen),
        float_tensor(diffuse / count[:, None]).clamp(min=0),
    )


def found_f0s(found: Observations) -> list[float]:
    """F0 of glossy surfels by kind; empty where sightings do not determine it, see :func:`initial_lights`."""
    clear = found.take(np.abs(found.passed - 0.5) >= 0.5 - _CLEAR)
    _, number, count = np.unique(clear.surfel, return_inverse=True, return_counts=True)
    clear = clear.take(count[number] > 1)
    surfels, texels = int((count > 1).sum()), 6 * _SIZE**2
    if len(clear.surfel) - surfels < texels or (clear.passed < _MET).mean() < LEAST_MET:
        return []
    basis = _basis(clear)
    matte = _error(_between_views(clear.colour, clear.surfel))
    return likeliest([_fitted(clear, basis, f0)[0] for f0 in CANDIDATES], matte)


def likeliest(errors: Sequence[float], matte: float) -> list[float]:
    """The F0 of each kind that fits the photographs best: of what is no metal, then of metals.

    Each is the geometric mean of those between which photographs do not decide.

    Args:
        errors: Residual of each of the :data:`CANDIDATES`, root mean square, above 0.
        matte: The same if nothing is reflected: of all differences between views.

    Returns:
        Those that explain :data:`LEAST_EXPLAINED` of the variance.
    """
    squares, candidates = np.square(errors), np.asarray(CANDIDATES)
    metal, told = candidates >= LEAST_METAL, []
    for kind in (~metal, metal):
        least = squares[kind].min()
        if least <= (1 - LEAST_EXPLAINED) * matte**2:
            best = kind & (squares <= SLACK**2 * least)
            told.append(float(np.exp(np.log(candidates[best]).mean())))
    return told


def _basis(found: Observations) -> np.ndarray:
    """Weight of each texel of the environment map in each direction, ``(M, T)``."""
    texels = torch.eye(6 * _SIZE**2).reshape(6, _SIZE, _SIZE, -1)
    return look_up(texels, float_tensor(found.direction)).numpy()


def _fitted(found: Observations, basis: np.ndarray, f0: float) -> tuple[float, np.ndarray]:
    """The residual, see :func:`_error`, and the non-negative environment ``(T, 3)``."""
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


def _fresnel(f0: float, found: Observations) -> np.ndarray:
    return f0 + (1 - f0) * found.grazing


def _between_views(values: np.ndarray, surfel: np.ndarray) -> np.ndarray:
    """Values ``(M, C)`` less their mean over the sightings of each surfel."""
    count = np.bincount(surfel).clip(min=1)
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

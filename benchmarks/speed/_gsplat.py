# SPDX-License-Identifier: Apache-2.0
"""gsplat's PyTorch implementation of 2D Gaussian Splatting as a peer, on the CPU.

As it comes it needs CUDA twice: its lists of surfels and pixels are made by a kernel, and nerfacc, with which
it sums along rays, runs on a GPU only. Both are replaced here by the same arithmetic, so that its times are
flattering: the lists are given. It takes gsplat from the extra ``cuda``; nerfacc is not needed.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import torch

from graycard import Camera
from graycard.methods.splat import Surfels

ALPHA_MIN, ALPHA_MAX, TRANSMITTANCE_MIN = 1 / 255, 0.999, 1e-4
"""Limits of gsplat, not ours: an alpha is cut at 0.999, and the surfel that would reach 1e-4 is left out."""
LOW_PASS_REACH = 3
"""Pixels: beyond, the low-pass of an opaque surfel is below ALPHA_MIN."""
CANDIDATES = 1 << 20
"""Pairs that are looked at together: what bounds the memory of making lists."""


@dataclass(frozen=True)
class Projected:
    """Outputs of gsplat's ``_fully_fused_projection_2dgs`` for one camera: shapes begin ``(1, N, ...)``."""

    radii: torch.Tensor
    means2d: torch.Tensor
    depths: torch.Tensor
    ray_transforms: torch.Tensor
    normals: torch.Tensor
    """In the frame of the camera, facing it."""


@dataclass(frozen=True)
class Pairs:
    """Pairs of surfel and pixel: pixel after pixel, nearest centre first, int64."""

    surfels: torch.Tensor
    pixels: torch.Tensor
    """Row-major."""


def project(surfels: Surfels, camera: Camera) -> Projected:
    """Return the projection of gsplat, differentiable, in the dtype of the surfels."""
    from gsplat.cuda._torch_impl_2dgs import _fully_fused_projection_2dgs

    thick = torch.nn.functional.pad(surfels.scales, (0, 1), value=1.0)  # the third scales the normals
    view, K = (surfels.centres.new_tensor(value)[None] for value in (camera.world_to_camera, camera.K))
    size = (camera.width, camera.height)
    return Projected(
        *_fully_fused_projection_2dgs(surfels.centres, surfels.rotations, thick, view, K, *size)  # pyright: ignore[reportCallIssue]  # its annotation is one short
    )


def accumulate(
    projected: Projected,
    pairs: Pairs,
    opacities: torch.Tensor,
    features: torch.Tensor,
    camera: Camera,
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return the ``accumulate_2dgs`` of gsplat: features ``(H, W, C)``, alpha ``(H, W)``, normals ``(H, W,
    3)``.

    Args:
        projected: From :func:`project`.
        pairs: From :func:`pairs_of`.
        opacities: shape ``(N,)``.
        features: shape ``(N, C)``.
        camera: The pinhole camera.
    """
    from gsplat.cuda._torch_impl_2dgs import accumulate_2dgs

    with nerfacc_on_cpu():
        image, alpha, normals = accumulate_2dgs(
            projected.means2d,
            projected.ray_transforms,
            opacities[None],
            features[None],
            projected.normals,
            pairs.surfels,
            pairs.pixels,
            torch.zeros_like(pairs.pixels),
            camera.width,
            camera.height,
        )
    return image[0], alpha[0, :, :, 0], normals[0]


@contextmanager
def nerfacc_on_cpu() -> Iterator[None]:
    """While this context lasts, gsplat finds nerfacc's two functions in plain PyTorch."""
    stand_in = SimpleNamespace(
        render_weight_from_alpha=_render_weight_from_alpha, accumulate_along_rays=_accumulate_along_rays
    )
    with patch.dict(sys.modules, {"nerfacc": stand_in}):
        yield


def _render_weight_from_alpha(
    alphas: torch.Tensor, *, ray_indices: torch.Tensor, n_rays: int
) -> tuple[torch.Tensor, torch.Tensor]:
    """Weights and transmittances of samples, those of a ray together: sums of logarithms in float64."""
    counts = torch.bincount(ray_indices, minlength=n_rays)
    fall = torch.log1p(-alphas.double())
    before = torch.nn.functional.pad(fall.cumsum(dim=0), (1, 0))
    transmittance = torch.exp(before[:-1] - before[counts.cumsum(dim=0) - counts][ray_indices])
    transmittance = transmittance.to(alphas.dtype)
    return alphas * transmittance, transmittance


def _accumulate_along_rays(
    weights: torch.Tensor, values: torch.Tensor | None, *, ray_indices: torch.Tensor, n_rays: int
) -> torch.Tensor:
    summands = weights[:, None] if values is None else weights[:, None] * values
    return summands.new_zeros(n_rays, summands.shape[1]).index_add(0, ray_indices, summands)


@torch.no_grad()
def pairs_of(projected: Projected, opacities: torch.Tensor, camera: Camera) -> Pairs:
    """Return the lists that gsplat's CUDA kernel would make, within its boxes of 3.33 standard deviations.

    Args:
        projected: From :func:`project`.
        opacities: shape ``(N,)``.
        camera: The pinhole camera.
    """
    found = [_contributing(*chunk, projected, opacities, camera) for chunk in _candidates(projected, camera)]
    if not found:
        return Pairs(*torch.zeros(2, 0, dtype=torch.int64))
    surfels, pixels, alpha = (np.concatenate(column) for column in zip(*found, strict=True))
    order = np.lexsort((projected.depths[0].numpy()[surfels], pixels))
    surfels, pixels, alpha = surfels[order], pixels[order], alpha[order]
    drawn = _transmittance_after(alpha, pixels) > TRANSMITTANCE_MIN
    return Pairs(torch.from_numpy(surfels[drawn]), torch.from_numpy(pixels[drawn]))


def _candidates(projected: Projected, camera: Camera) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Surfels and pixels of whole boxes, some boxes at a time."""
    radii, means = projected.radii[0].numpy(), projected.means2d[0].double().numpy()
    seen = np.flatnonzero((radii > 0).all(axis=1))
    reach = np.maximum(radii[seen], LOW_PASS_REACH)
    size = np.array([camera.width, camera.height])
    first = np.clip(np.floor(means[seen] - reach), 0, size).astype(np.int64)
    past = np.clip(np.ceil(means[seen] + reach), 0, size).astype(np.int64)
    widths, heights = (past - first).T
    areas = widths * heights
    splits = np.flatnonzero(np.diff(np.cumsum(areas) // CANDIDATES)) + 1
    for rows in np.split(np.arange(len(seen)), splits):
        which = np.repeat(rows, areas[rows])
        inside = np.arange(len(which)) - np.repeat(np.cumsum(areas[rows]) - areas[rows], areas[rows])
        x, y = first[which, 0] + inside % widths[which], first[which, 1] + inside // widths[which]
        yield seen[which], y * camera.width + x


def _contributing(
    surfels: np.ndarray, pixels: np.ndarray, projected: Projected, opacities: torch.Tensor, camera: Camera
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Those of the candidates whose alpha is large enough, and that alpha."""
    M = projected.ray_transforms[0].double().numpy()[surfels]
    x, y = pixels % camera.width + 0.5, pixels // camera.width + 0.5
    planes = (x[:, None] * M[:, 2] - M[:, 0], y[:, None] * M[:, 2] - M[:, 1])
    u, v, w = np.cross(*planes).T
    dx, dy = np.stack([x, y]) - projected.means2d[0].double().numpy()[surfels].T
    met = w != 0
    disc = np.where(met, (u**2 + v**2) / np.where(met, w, 1.0) ** 2, np.inf)
    exponent = 0.5 * np.minimum(disc, 2 * (dx**2 + dy**2))
    alpha = np.minimum(opacities.double().numpy()[surfels] * np.exp(-exponent), ALPHA_MAX)
    enough = (alpha >= ALPHA_MIN) & met
    return surfels[enough], pixels[enough], alpha[enough]


def _transmittance_after(alpha: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Weights of each sample, those of a pixel together and in their order."""
    fall = np.concatenate([[0.0], np.cumsum(np.log1p(-alpha))])
    first = np.searchsorted(pixels, pixels)
    return np.exp(fall[1:] - fall[first])

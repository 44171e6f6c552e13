# SPDX-License-Identifier: Apache-2.0
"""Surfels that cover a known surface."""

import numpy as np
import torch

from graycard.methods._tensors import contiguous_float_tensor
from graycard.methods.splat._spread import spacing, spread_evenly
from graycard.methods.splat._surfels import Surfels
from graycard.methods.splat.fit._initialise import rotations_to

CANDIDATES = 6
"""Points that are looked at for each one chosen."""
COVER = 1.0
"""Standard deviation of a disc in spacings: from any view less than 1 % of what is behind shines through."""


def surfels_from_mesh(
    vertices: np.ndarray,
    faces: np.ndarray,
    features: np.ndarray,
    count: int,
    seed: int,
    opacity: float = 0.99,
) -> Surfels:
    """Cover a triangle mesh with discs, tangent to its faces and evenly spread by area.

    Args:
        vertices: shape ``(V, 3)``, world, metres.
        faces: shape ``(F, 3)``, integer: indices of vertices, counter-clockwise from outside.
        features: shape ``(V, C)``, interpolated over faces.
        count: how many discs.
        seed: equal seeds give equal surfels.
        opacity: alpha at each centre, in [0, 1].

    Returns:
        ``count`` surfels in float32.

    Raises:
        ValueError: Shapes do not fit, an index is of no vertex, or the mesh has no area.
    """
    _check_mesh(vertices, faces, features)
    points, normals, values = _sample(vertices, faces, features, CANDIDATES * count, seed)
    return surfels_on_surface(points, normals, values, count, seed, opacity=opacity)


def surfels_on_surface(
    points: np.ndarray,
    normals: np.ndarray,
    features: np.ndarray,
    count: int,
    seed: int,
    *,
    opacity: float = 0.99,
    sizes: np.ndarray | None = None,
) -> Surfels:
    """Cover a surface, of which many oriented points are known, with discs as large as their spacing.

    Points whose normals differ count as further apart, so that both sides of a sheet are covered.

    Args:
        points: shape ``(M, 3)``, world, metres; at most ``count`` are used, spread evenly.
        normals: shape ``(M, 3)``, world, unit length.
        features: shape ``(M, C)``.
        count: how many discs, 2 or more.
        seed: equal seeds give equal surfels.
        opacity: alpha at each centre, in [0, 1].
        sizes: shape ``(M,)``, positive, in any unit: how large discs may be in proportion, such as the
            distance from which a point is seen; equal for all by default.

    Returns:
        ``min(count, M)`` surfels in float32.

    Raises:
        ValueError: Shapes do not fit, or there are fewer than two points.
    """
    if min(count, len(points)) < 2 or points.shape != normals.shape or len(features) != len(points):
        raise ValueError(
            f"expected 2 or more points, as many normals and features, and a count of 2 or more, got "
            f"{points.shape}, {normals.shape}, {features.shape} and {count}"
        )
    coarse = _coarse_spacing(points, count, seed)
    relative = 1.0 if sizes is None else (sizes / np.median(sizes))[:, None]
    apart = np.concatenate([points, coarse * relative * normals], axis=1)
    chosen = spread_evenly(apart, count, seed, sizes)
    scale = COVER * np.maximum(spacing(apart[chosen]), 1e-6)
    return Surfels(
        contiguous_float_tensor(points[chosen]),
        contiguous_float_tensor(rotations_to(normals[chosen])),
        contiguous_float_tensor(np.stack([scale, scale], axis=1)),
        torch.full((len(chosen),), opacity),
        contiguous_float_tensor(features[chosen]),
    )


def _coarse_spacing(points: np.ndarray, count: int, seed: int) -> float:
    """Typical distance of ``count`` points out of all, metres: whatever their sides."""
    some = np.random.default_rng(seed).permutation(len(points))[:count]
    return float(np.median(spacing(points[some])))


def _check_mesh(vertices: np.ndarray, faces: np.ndarray, features: np.ndarray) -> None:
    shapes = vertices.shape, faces.shape, features.shape
    fit = vertices.shape[1:] == (3,) and faces.shape[1:] == (3,) and len(features) == len(vertices)
    if not fit or features.ndim != 2:
        raise ValueError(f"expected vertices (V, 3), faces (F, 3) and features (V, C), got {shapes}")
    if len(faces) == 0 or faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError(
            f"expected faces of vertices 0 to {len(vertices) - 1}, got {len(faces)} faces of others"
        )
    if not np.isfinite(vertices).all():
        raise ValueError("expected finite vertices, got NaN or infinity")


def _sample(
    vertices: np.ndarray, faces: np.ndarray, features: np.ndarray, count: int, seed: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, normals and features: one point in each of ``count`` strata of equal area."""
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    across = np.cross(b - a, c - a)
    doubled = np.linalg.norm(across, axis=1)
    if not doubled.sum() > 0:
        raise ValueError("expected a mesh with an area, got faces without")
    random = np.random.default_rng(seed)
    heights = (np.arange(count) + random.random(count)) / count * doubled.sum()
    face = np.minimum(np.searchsorted(np.cumsum(doubled), heights, side="right"), len(faces) - 1)
    first, second = np.sqrt(random.random(count)), random.random(count)
    weights = np.stack([1 - first, first * (1 - second), first * second], axis=1)  # uniform on a triangle
    corners = weights[:, :, None]
    points = (vertices[faces[face]] * corners).sum(axis=1)
    return points, across[face] / doubled[face, None], (features[faces[face]] * corners).sum(axis=1)

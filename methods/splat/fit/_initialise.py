# SPDX-License-Identifier: Apache-2.0
"""First surfels, before anything is fitted."""

import numpy as np
import torch

from graycard.methods._tensors import contiguous_float_tensor
from graycard.methods.splat._spread import spacing
from graycard.methods.splat._surfels import Surfels


def surfels_from_points(
    points: np.ndarray,
    normals: np.ndarray,
    features: np.ndarray,
    opacity: float = 0.1,
    smallest_scale: float = 1e-4,
) -> Surfels:
    """Return a round disc on each point, as wide as its nearest neighbours are far.

    Args:
        points: shape ``(N, 3)``, world, metres, N >= 2.
        normals: shape ``(N, 3)``, world, not zero; need not be unit length.
        features: shape ``(N, C)``.
        opacity: alpha at each centre, in [0, 1].
        smallest_scale: metres; points that coincide still get a disc.

    Returns:
        Surfels in float32. The scale is the root mean squared distance to the three nearest
        neighbours (Kerbl et al. 2023, section 5.2, as their code has it), or to all if there are fewer.

    Raises:
        ValueError: There are fewer than two points, or shapes or values do not fit.
    """
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2 or points.shape != normals.shape:
        raise ValueError(
            f"expected points and normals of shape (N, 3), N >= 2, got {points.shape} and {normals.shape}"
        )
    if not np.isfinite(points).all():
        raise ValueError("expected finite points, got NaN or infinity")
    scale = np.maximum(spacing(points), smallest_scale)
    return Surfels(
        centres=contiguous_float_tensor(points),
        rotations=contiguous_float_tensor(rotations_to(normals)),
        scales=contiguous_float_tensor(np.stack([scale, scale], axis=1)),
        opacities=torch.full((len(points),), opacity),
        features=contiguous_float_tensor(features),
    )


def rotations_to(normals: np.ndarray) -> np.ndarray:
    """Return the shortest rotation that takes the z axis to each normal, as ``(w, x, y, z)``.

    The half-way quaternion ``(1 + z.n, z x n)``, scaled to unit length; straight down, where it
    vanishes, is half a turn about x.

    Args:
        normals: shape ``(N, 3)``, not zero.

    Raises:
        ValueError: A normal is zero or not finite.
    """
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    if not (np.isfinite(lengths).all() and (lengths > 0).all()):
        raise ValueError("expected finite normals of positive length")
    x, y, z = (np.asarray(normals, dtype=np.float64) / lengths).T
    halfway = np.stack([1 + z, -y, x, np.zeros_like(z)], axis=1)
    halfway[z < -1 + 1e-12] = (0, 1, 0, 0)
    return halfway / np.linalg.norm(halfway, axis=1, keepdims=True)

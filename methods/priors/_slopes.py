# SPDX-License-Identifier: Apache-2.0
"""Normals of the surface that a depth draws, for priors that know depth only."""

import numpy as np
import torch
from scipy.ndimage import distance_transform_edt

from graycard import Camera
from graycard.methods.priors._draws import blurred
from graycard.methods.splat import depth_to_normals

WINDOW = 0.02
"""Standard deviation of the blur of inverse depth, a share of the width: slopes need a wider look."""


def normals_of(depth: np.ndarray, camera: Camera) -> np.ndarray:
    """Return the normals of a depth whose inverse is smoothed, for that is linear on the image of a plane.

    Args:
        depth: shape ``(H, W)``, z-depth, metres; +inf where there is nothing.
        camera: Of the view.

    Returns:
        Shape ``(H, W, 3)``, world, unit length; zero where there is nothing.
    """
    seen = np.isfinite(depth)
    inverse = np.where(seen, 1 / np.where(seen, depth, 1.0), 0.0)
    smooth = blurred(inverse, WINDOW, seen)
    return slopes_of(np.where(seen, 1 / np.where(seen, smooth, 1.0), np.inf), camera)


def slopes_of(depth: np.ndarray, camera: Camera) -> np.ndarray:
    """Return the normals of a depth as it is: central differences of the points behind the pixels.

    They face the camera. Where a neighbour is missing, at the border too, the nearest normal counts.

    Args:
        depth: shape ``(H, W)``, z-depth, metres, float64; +inf where there is nothing.
        camera: Of the view.

    Returns:
        Shape ``(H, W, 3)``, world, unit length; zero where there is nothing.
    """
    seen = np.isfinite(depth)
    normals = depth_to_normals(torch.from_numpy(depth), camera).numpy()
    known = np.abs(normals).sum(axis=-1) > 0
    if not known.any():
        toward = -camera.rays()
        return np.where(seen[..., None], toward, 0.0)
    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    assert isinstance(nearest, np.ndarray)
    return np.where(seen[..., None], normals[tuple(nearest)], 0.0)

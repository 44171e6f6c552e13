# SPDX-License-Identifier: Apache-2.0
"""Surfels all over the photographs: where stereo finds depth, and on flat triangles in between.

A few dozen sparse points leave most of a small picture without a surfel that a gradient could reach.
"""

import numpy as np
import torch
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.ndimage import median_filter
from scipy.spatial import QhullError

from graycard import Camera, Capture, Points
from graycard.methods.splat import Surfels, depth_to_normals, rotations_to, spacing
from graycard.methods.surfels._colour import encode
from graycard.methods.surfels._sweep import SweptView, sweep_depths

MANY = 4
"""Discs of each view, below which the sparse points alone are better."""
MARGIN = 1.6
"""How far the depths that are looked at go beyond those of the points of a view, as a factor."""
SMOOTH = 5
"""Pixels on each side of the windows whose median depth is taken."""


def surfels_between(capture: Capture, points: Points, count: int, opacity: float) -> Surfels | None:
    """Discs on a grid of each training view's pixels, at the depth that stereo finds.

    Args:
        capture: Photographs and cameras; the features are their encoded colours.
        points: Sparse points, world: between which depths surfaces are sought.
        count: About how many discs in all.
        opacity: alpha at each centre.

    Returns:
        The surfels; None if there would be next to none.
    """
    numbers = [n for n, view in enumerate(capture.views) if view.split == "train"]
    cameras = [capture.views[n].camera for n in numbers]
    known = [_observations(points, n, camera) for n, camera in zip(numbers, cameras, strict=True)]
    each = count // len(numbers)
    if each < MANY or not all(len(depths) for _, depths in known):
        return None
    shown = [
        encode(torch.from_numpy(capture.photograph(v) * np.float32(capture.exposure))) for v in capture.train
    ]
    views = [
        SweptView(camera, image.mean(dim=-1), z.min() / MARGIN, z.max() * MARGIN)
        for camera, image, (_, z) in zip(cameras, shown, known, strict=True)
    ]
    parts = [
        _grid(view.camera, _dense(depth, *found), image, each, opacity)
        for view, depth, found, image in zip(views, sweep_depths(views), known, shown, strict=True)
    ]
    names = ("centres", "rotations", "scales", "opacities", "features")
    return Surfels(*(torch.cat([getattr(part, name) for part in parts]) for name in names))


def _dense(depth: np.ndarray, pixels: np.ndarray, depths: np.ndarray) -> np.ndarray:
    """Depth everywhere, from where it is known (not NaN) and from some points besides."""
    row, column = np.nonzero(np.isfinite(depth))
    places = np.concatenate([pixels, np.stack([column, row], axis=1) + 0.5])
    filled = filled_depth(places, np.concatenate([depths, depth[row, column]]), depth.shape)
    return median_filter(filled, SMOOTH, mode="nearest")


def filled_depth(pixels: np.ndarray, depths: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """z-depth of each pixel from that of some, shape ``(H, W)``, metres.

    Within the triangles of these (Delaunay) the inverse of depth is linear, as it is on the image of a
    plane; outside it is that of the nearest.

    Args:
        pixels: shape ``(M, 2)``, image coordinates, M >= 1.
        depths: shape ``(M,)``, metres, positive.
        size: Height and width.
    """
    x, y = np.meshgrid(np.arange(size[1]) + 0.5, np.arange(size[0]) + 0.5)
    inverse = NearestNDInterpolator(pixels, 1 / depths)(x, y)
    try:
        flat = LinearNDInterpolator(pixels, 1 / depths)(x, y)
    except (QhullError, ValueError):  # too few points, or all on one line
        flat = np.full(x.shape, np.nan)
    return 1 / np.where(np.isfinite(flat), flat, inverse)


def _observations(points: Points, number: int, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Pixels and depths of the points that a view saw; without tracks, of those that project into it."""
    if len(points.point):
        seen = points.view == number
        pixels = points.pixel[seen]
        _, depths = camera.project(points.positions[points.point[seen]])
    else:
        pixels, depths = camera.project(points.positions)
    inside = ((pixels > 0) & (pixels < [camera.width, camera.height])).all(axis=1) & (depths > 0)
    return pixels[inside], depths[inside]


def _grid(camera: Camera, depth: np.ndarray, shown: torch.Tensor, count: int, opacity: float) -> Surfels:
    """Discs at the middles of square blocks of pixels, as wide as they are apart, along the surface."""
    block = max(1, round(np.sqrt(depth.size / max(count, 1))))
    rows, columns = (slice(block // 2, size, block) for size in depth.shape)
    rays = camera.rays()[rows, columns].reshape(-1, 3)
    chosen = depth[rows, columns].reshape(-1)
    positions = camera.position + rays * (chosen / (rays @ camera.forward))[:, None]
    normals = depth_to_normals(torch.from_numpy(depth), camera).numpy()[rows, columns].reshape(-1, 3)
    normals = np.where(np.abs(normals).sum(axis=1, keepdims=True) > 0, normals, -rays)
    scales = np.repeat(spacing(positions)[:, None], 2, axis=1) / 2
    values = positions, rotations_to(normals), scales
    geometry = (torch.from_numpy(np.ascontiguousarray(value, dtype=np.float32)) for value in values)
    features = shown[rows, columns].reshape(-1, 3)
    return Surfels(*geometry, torch.full((len(features),), opacity), features)

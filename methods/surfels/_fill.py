# SPDX-License-Identifier: Apache-2.0
"""Surfels all over the photographs: where stereo finds depth, and on flat triangles in between.

A few dozen sparse points leave most of a small picture without a surfel that a gradient could reach.
"""

import numpy as np
import torch
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.ndimage import median_filter, uniform_filter
from scipy.spatial import QhullError

from graycard import Camera, Capture, Points
from graycard.methods.splat import Surfels, depth_to_normals, rotations_to
from graycard.methods.surfels._colour import encode
from graycard.methods.surfels._sweep import SweptDepth, SweptView, sweep_depths

MANY = 4
"""Discs of each view, below which the sparse points alone are better."""
MARGIN = 1.6
"""How far the depths that are looked at go beyond those of the points of a view, as a factor."""
SMOOTH = 5
"""Pixels on each side of the windows whose median depth is taken."""
FLAT = 9
"""Pixels on each side of the windows whose mean inverse depth gives normals."""


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
        SweptView(camera, image.mean(dim=-1), float(z.min() / MARGIN), float(z.max() * MARGIN))
        for camera, image, (_, z) in zip(cameras, shown, known, strict=True)
    ]
    parts = [
        _grid(view.camera, swept, image, each, opacity)
        for view, swept, image in zip(views, sweep_depths(views), shown, strict=True)
        if swept.sure.any()
    ]
    if not parts:
        return None
    names = ("centres", "rotations", "scales", "opacities", "features")
    return Surfels(*(torch.cat([getattr(part, name) for part in parts]) for name in names))


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


def _grid(camera: Camera, swept: SweptDepth, shown: torch.Tensor, count: int, opacity: float) -> Surfels:
    """Discs at the middles of square blocks of pixels, half as wide as the blocks."""
    block = max(1, round(np.sqrt(swept.depth.size / count)))
    row, column = (
        a.ravel() for a in np.mgrid[block // 2 : camera.height : block, block // 2 : camera.width : block]
    )
    dense = _dense(swept)
    rays = camera.rays()[row, column]
    positions = camera.position + rays * (dense[row, column] / (rays @ camera.forward))[:, None]
    flat = 1 / uniform_filter(1 / dense, FLAT, mode="nearest")  # slopes need a wider look than depths
    normals = depth_to_normals(torch.from_numpy(flat), camera).numpy()[row, column]
    normals = np.where(np.abs(normals).sum(axis=1, keepdims=True) > 0, normals, -rays)
    scales = 0.5 * block * dense[row, column] / camera.K[0, 0]
    values = positions, rotations_to(normals), np.stack([scales, scales], axis=1)
    geometry = (torch.from_numpy(np.ascontiguousarray(value, dtype=np.float32)) for value in values)
    return Surfels(*geometry, torch.full((len(row),), opacity), shown[row, column])


def _dense(swept: SweptDepth) -> np.ndarray:
    """Depth without what stands out from its surroundings.

    Where stereo is not sure the farther counts of what it says and what lies between the sure places: a
    surfel that is too far hides nothing in other views, one that is too near hides what is right.
    """
    row, column = np.nonzero(swept.sure)
    places = np.stack([column, row], axis=1) + 0.5
    between = filled_depth(places, swept.depth[row, column], swept.depth.shape)
    depth = np.where(swept.sure, swept.depth, np.maximum(swept.depth, between))
    return median_filter(depth, SMOOTH, mode="nearest")

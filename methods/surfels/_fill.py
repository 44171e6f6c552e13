# SPDX-License-Identifier: Apache-2.0
"""Surfels all over the photographs: where stereo finds depth, and on flat triangles in between.

A few dozen sparse points leave most of a small picture without a surfel that a gradient could reach.
"""

from collections.abc import Sequence

import numpy as np
import torch
from scipy.ndimage import binary_erosion, median_filter, uniform_filter

from graycard import Camera, Capture, MethodError, Points, View
from graycard.io import Room
from graycard.methods.splat import Surfels, depth_to_normals, rotations_to
from graycard.methods.surfels._colour import srgb_encode_tensor
from graycard.methods.surfels._ncc import SweptView
from graycard.methods.surfels._planes import with_planes
from graycard.methods.surfels._sweep import SweptDepth, sweep_depths
from graycard.methods.surfels._transfer import count_hidden
from graycard.methods.surfels._triangles import filled_depth

MANY = 4
"""Discs of each view, below which the sparse points alone are better."""
MARGIN = 1.6
"""Margin: how far the depths that are looked at go beyond those of points, as a factor: the nearest of the
view, and the farthest of all views, for few points lie on what is far."""
FAR = 0.95
"""Quantile of all known depths that counts as far."""
SMOOTH = 5
"""Pixels on each side of the windows whose median depth is taken."""
FLAT = 9
"""Pixels on each side of the windows whose mean inverse depth gives normals."""


def surfels_between(
    capture: Capture,
    points: Points,
    count: int,
    opacity: float,
    seed: int,
    *,
    known: Sequence[np.ndarray] | None = None,
    swept: Sequence[SweptDepth] | None = None,
) -> Surfels | None:
    """Discs on a grid of each training view's pixels, at the depth that stereo finds.

    Args:
        capture: Photographs and cameras; the features are their encoded colours.
        points: Sparse points, world: between which depths surfaces are sought.
        count: About how many discs in all.
        opacity: alpha at each centre.
        seed: Of the search for planes.
        known: z-depth of each training view, shape ``(H, W)``, metres, NaN where stereo is to find it; None:
            everywhere.
        swept: Results of :func:`stereo_depths`, where they are there; None: it is asked.

    Returns:
        The surfels; None if there would be next to none.
    """
    each = count // len(capture.train)
    swept = stereo_depths(capture, points, seed) if swept is None and each >= MANY else swept
    if each < MANY or swept is None:
        return None
    depths = dense_depths([view.camera for view in capture.train], swept)
    parts = []
    told = [None] * len(depths) if known is None else known
    for view, depth, own in zip(capture.train, depths, told, strict=True):
        both = depth if own is None else np.where(np.isfinite(own), own, depth)
        parts.append(_grid(view.camera, both, _shown(capture, view), each, opacity))
    names = ("centres", "rotations", "scales", "opacities", "features")
    return Surfels(*(torch.cat([getattr(part, name) for part in parts]) for name in names))


def stereo_depths(capture: Capture, points: Points, seed: int) -> list[SweptDepth] | None:
    """Depth of each training view by stereo and planes; None if a view sees none of the sparse points.

    Args:
        capture: Photographs and cameras.
        points: Sparse points, world: between which depths surfaces are sought.
        seed: Of the search for planes.
    """
    numbers = [n for n, view in enumerate(capture.views) if view.split == "train"]
    cameras = [capture.views[n].camera for n in numbers]
    seen = [observations(points, n, camera) for n, camera in zip(numbers, cameras, strict=True)]
    if not all(len(depths) for _, depths in seen):
        return None
    far = MARGIN * max(float(z.max()) for _, z in seen)
    room = Room()
    views = [
        SweptView(view.camera, room.keep(_shown(capture, view).mean(dim=-1)), float(z.min() / MARGIN), far)
        for view, (_, z) in zip(capture.train, seen, strict=True)
    ]
    return with_planes(views, sweep_depths(views), seed)


def _shown(capture: Capture, view: View) -> torch.Tensor:
    """Return a training photograph, exposed and encoded, shape ``(H, W, 3)``."""
    return srgb_encode_tensor(torch.from_numpy(capture.photograph(view) * np.float32(capture.exposure)))


def observations(points: Points, number: int, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Pixels and depths of the points that a view saw; without tracks, of those that project into it."""
    if len(points.point):
        seen = points.view == number
        pixels = points.pixel[seen]
        _, depths = camera.project(points.positions[points.point[seen]])
    else:
        pixels, depths = camera.project(points.positions)
    inside = ((pixels > 0) & (pixels < [camera.width, camera.height])).all(axis=1) & (depths > 0)
    return pixels[inside], depths[inside]


def dense_depths(cameras: Sequence[Camera], swept: Sequence[SweptDepth]) -> list[np.ndarray]:
    """z-depth of every pixel of each view, shape ``(H, W)``, metres.

    Where stereo is not sure the farther counts of what it says and what lies between the sure places; and
    what would stand in front of what another view is sure of is far away. For a surfel that is too far
    hides nothing in other views, one that is too near hides what is right.

    Raises:
        MethodError: Stereo is sure of nothing.
    """
    room = Room()
    if not any(one.sure.any() for one in swept):
        raise MethodError(
            "expected photographs that show the same surfaces, got none on which two agree. Set fill to 0 to "
            "begin with the sparse points alone"
        )
    all_sure = Room().joined(one.depth[one.sure] for one in swept)
    far = float(np.quantile(all_sure, FAR, overwrite_input=True))
    del all_sure
    dense = []
    for camera, one in zip(cameras, swept, strict=True):
        depth = np.where(one.sure, one.depth, _guess(one))
        hides = np.zeros((1, *depth.shape), np.int32)
        for other, its in zip(cameras, swept, strict=True):
            if other is not camera:
                count_hidden(camera, depth[None], other, its.depth, its.sure, hides)
        wrong = ~one.sure & ((hides[0] > 0) | ~np.isfinite(depth))
        dense.append(room.keep(median_filter(np.where(wrong, far, depth), SMOOTH, mode="nearest")))
    return dense


def _guess(swept: SweptDepth) -> np.ndarray:
    """Depth where stereo is not sure; NaN where it says nothing. Where it is sure, anything.

    Triangles are drawn between the rims of what is sure: one that has a pixel with eight sure neighbours for
    a corner reaches no farther than these, and no such pixel is the nearest to one that is not sure.
    """
    rim = swept.sure & np.logical_not(binary_erosion(swept.sure, np.ones((3, 3)), border_value=1))
    row, column = np.nonzero(rim)
    if len(row) == 0:
        return swept.depth
    places = np.stack([column, row], axis=1) + 0.5
    return np.maximum(swept.depth, filled_depth(places, swept.depth[row, column], swept.depth.shape))


def _grid(camera: Camera, depth: np.ndarray, shown: torch.Tensor, count: int, opacity: float) -> Surfels:
    """Discs at the middles of square blocks of pixels, half as wide as the blocks."""
    block = max(1, round(np.sqrt(depth.size / count)))
    at = np.mgrid[block // 2 : camera.height : block, block // 2 : camera.width : block]
    row, column = (places.ravel() for places in at)
    rays, z = camera.rays()[row, column], depth[row, column]
    positions = camera.position + rays * (z / (rays @ camera.forward))[:, None]
    flat = 1 / uniform_filter(1 / depth, FLAT, mode="nearest")  # slopes need a wider look than depths
    normals = depth_to_normals(torch.from_numpy(flat), camera).numpy()[row, column]
    normals = np.where(np.abs(normals).sum(axis=1, keepdims=True) > 0, normals, -rays)
    scales = 0.5 * block * z / camera.K[0, 0]
    centres, turns, sizes = (
        torch.from_numpy(np.ascontiguousarray(value, dtype=np.float32))
        for value in (positions, rotations_to(normals), np.stack([scales, scales], axis=1))
    )
    return Surfels(centres, turns, sizes, torch.full((len(row),), opacity), shown[row, column])

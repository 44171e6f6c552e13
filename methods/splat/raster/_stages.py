# SPDX-License-Identifier: Apache-2.0
"""The stages of the engine: the differentiable rasteriser strings them together, benchmarks time them.

``project`` surfels, ``list_tiles``, ``draw``; then ``draw_backward`` and ``project_backward``.
"""

from typing import Any, cast

import numpy as np

from graycard import MethodError
from graycard.methods.splat.raster._backward import backward
from graycard.methods.splat.raster._blocks import GROUP, LANES
from graycard.methods.splat.raster._coefficients import COLUMNS
from graycard.methods.splat.raster._forward import forward
from graycard.methods.splat.raster._idle import borrowed, forget
from graycard.methods.splat.raster._project_backward import unproject
from graycard.methods.splat.raster._project_forward import project as project_kernel
from graycard.methods.splat.raster._stage_arrays import (
    Channels,
    Drawn,
    Found,
    Gradients,
    Lists,
    Pairs,
    Prepared,
    Projected,
    Scene,
    Slots,
    Upstream,
    UpstreamShape,
    empty_shape,
    vectors,
)
from graycard.methods.splat.raster._tiles import tile_lists, tiles_touched
from graycard.resources import free_memory

NARROW = 3
"""Channels that share a slot with the geometry."""
UNCHECKED = 2**26
"""Bytes below which nobody asks whether there is as much memory."""


def padded_channels(channels: int) -> int:
    """Return the number of channels that is drawn for so many: kernels are compiled for few numbers.

    One to three cost the same, so do four to eight; more are drawn in groups of ``GROUP``.
    """
    if channels <= GROUP // 2:
        return NARROW if channels <= NARROW else GROUP // 2
    return -(-channels // GROUP) * GROUP


def project(scene: Scene) -> Projected:
    """Prepare surfels for the pixels.

    Raises:
        MethodError: There is not enough memory.
    """
    count = len(scene.centres)
    per_surfel = 4 * COLUMNS + 16 + 8 + 12 + 8 + 16
    check_memory(per_surfel * count, f"{count} surfels")
    result = Projected(
        vectors(count, COLUMNS),
        np.empty((count, 4), np.int32),
        np.empty(count),
        np.empty((count, 3), np.float32),
    )
    cast(Any, project_kernel)(
        scene.discs, scene.view, result.rows, result.bounds, result.depths, result.normals
    )
    return result


def list_tiles(scene: Scene, projected: Projected) -> Lists:
    """Sort surfels by depth and hand them to the tiles.

    Raises:
        MethodError: There is not enough memory for the lists, the images and the way back.
    """
    slots = tiles_touched(projected.bounds)
    pairs, channels = int(slots[-1]), scene.features.shape[1]
    stride = _stride(scene)
    images = scene.camera.width * scene.camera.height * 4 * (channels + 1 + (11 if scene.shaped else 0))
    needed = pairs * (4 + 2 + 4 * LANES + 4 * stride) + images
    check_memory(
        needed, f"{pairs} pairs of surfels and tiles of {scene.camera.width} x {scene.camera.height} pixels"
    )
    return Lists(
        tile_lists(projected.bounds, projected.depths, scene.camera.width, scene.camera.height), slots
    )


def check_memory(needed: int, of_what: str) -> None:
    """Refuse what would not fit.

    Raises:
        MethodError: Less memory is available.
    """
    if needed < UNCHECKED:
        return
    available = free_memory()
    if needed > available:
        forget()
        available = free_memory()
    if needed > available:
        raise MethodError(
            f"expected {needed / 2**30:.1f} GiB of memory to draw {of_what}, got {available / 2**30:.1f} GiB "
            "that are available: draw fewer or smaller surfels, or a smaller image"
        )


def draw(scene: Scene, projected: Projected, lists: Lists, solid: tuple[int, ...] | None = None) -> Drawn:
    """Draw the image of discs, or of ellipsoids where ``solid`` is ``SOLID``."""
    size, tiles = scene.size, lists.tiles.start.size - 1
    result = Drawn(
        np.empty((*size, scene.features.shape[1]), np.float32),
        np.empty(size, np.float32),
        np.empty(lists.tiles.surfels.size, np.uint16),
        np.empty(tiles, np.int32),
        np.empty(tiles, np.int32),
        empty_shape(size, tiles) if scene.shaped else None,
    )
    normals = projected.normals.reshape(-1) if scene.shaped else None
    prepared, canvas = _prepared(scene, projected), result.canvas
    cast(Any, forward)(prepared, lists.tiles, *scene.templates, normals, canvas, result.shape, solid)
    return result


def draw_backward(
    scene: Scene,
    projected: Projected,
    lists: Lists,
    drawn: Drawn,
    to_image: np.ndarray,
    to_transmittance: np.ndarray,
    to_shape: tuple[np.ndarray, ...] | None,
) -> Slots:
    """Gradients of the pairs of surfels and tiles, from those of the image.

    Args:
        scene: What was drawn.
        projected: as ``project`` gave it.
        lists: as ``list_tiles`` gave it.
        drawn: as ``draw`` gave it.
        to_image: float32, of ``drawn.image``.
        to_transmittance: float32, of ``drawn.transmittance``.
        to_shape: float32, of normal, depth, distortion and median depth if they were drawn.
    """
    pairs, stride = lists.tiles.surfels.size, _stride(scene)
    result = Slots(borrowed(pairs, LANES), borrowed(pairs, stride) if stride else None, stride)
    shape = None
    if drawn.shape is not None and to_shape is not None:
        kept = (drawn.shape.normal, drawn.shape.moments, drawn.shape.ranks)
        shape = UpstreamShape(projected.normals.reshape(-1), *kept, *to_shape)
    cast(Any, backward)(
        _prepared(scene, projected),
        Pairs(*lists.tiles, lists.slots, result.geometry.reshape(-1)),
        *scene.templates,
        drawn.canvas,
        Upstream(to_image, to_transmittance),
        shape,
        None if result.channels is None else Channels(result.channels.reshape(-1), stride),
    )
    return result


def project_backward(scene: Scene, projected: Projected, lists: Lists, slots: Slots) -> Gradients:
    """Gradients of the surfels from those of the pairs."""
    result = Gradients(
        np.empty_like(scene.centres),
        np.empty_like(scene.rotations),
        np.empty_like(scene.scales),
        np.empty_like(scene.opacities),
        np.empty_like(scene.features),
        np.empty_like(scene.offsets),
    )
    found = Found(projected.rows, lists.slots, slots.geometry.reshape(-1))
    cast(Any, unproject)(
        scene.discs,
        scene.view,
        found,
        _flat(slots.channels),
        slots.stride,
        scene.shaped,
        result,
    )
    return result


def _flat(values: np.ndarray | None) -> np.ndarray | None:
    return None if values is None else values.reshape(-1)


def _prepared(scene: Scene, projected: Projected) -> Prepared:
    rows, features = projected.rows.reshape(-1), scene.features
    return Prepared(rows, projected.bounds, features.reshape(-1), features.shape[1])


def _stride(scene: Scene) -> int:
    """Floats of a pair's channels and normals if they have slots of their own, else 0."""
    channels = scene.features.shape[1] + (3 if scene.shaped else 0)
    return -(-channels // LANES) * LANES if channels > NARROW or scene.shaped else 0

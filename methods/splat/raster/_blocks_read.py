# SPDX-License-Identifier: Apache-2.0
"""From the gradients of images to the blocks of a tile, and what they make of each whole pixel."""

import numpy as np
from numba import types
from numba.extending import overload

from graycard.methods._numba import njit
from graycard.methods.splat.raster._blocks import (
    BLOCKS,
    GROUP,
    LANES,
    MOMENTS,
    NORMAL,
    ONE,
    PIXELS,
    pixel_of,
)
from graycard.methods.splat.raster._blocks_write import KAPPA, as_image, is_whole, spread_of
from graycard.methods.splat.simd import _many as many
from graycard.methods.splat.simd import _pixels as pixels
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd._parts import INLINED, UNWRAPPED

PLANES = 10
"""Three of the normal, five of ``CENTRED``, and:"""
TO_MEDIAN, RANK = 8, 9
"""The gradient of the median depth, and the median's place in the list."""
TO_DEPTH, TO_DISTORTION = 3, 4
"""Planes where these gradients wait until they are ``CENTRED``."""


def flat(image: np.ndarray | None) -> np.ndarray | None:
    """Return an image as a line, if there is one; for kernels, where the type decides."""
    return None if image is None else image.reshape(-1)


@overload(flat)
def _flat(image):  # no type hints: Numba compares signatures, hints included
    if isinstance(image, types.NoneType):
        return lambda image: None
    return lambda image: image.reshape(-1)


@njit(**INLINED)
def read_lanes(tile_x, tile_y, image, to_image, channel, count, gradients, stride, first, suffix):
    """Bring so many channels of an image's gradient to ``stride`` vectors a block, zero beyond the image.

    With the image, what they make of each pixel is added to ``suffix``.
    """
    height, width = to_image.shape[:2]
    for block in range(BLOCKS):
        for lane in range(LANES):
            row, column = pixel_of(block, lane)
            row, column = tile_y + row, tile_x + column
            for c in range(count):
                gradient = 0.0
                if row < height and column < width:
                    gradient = np.float64(to_image[row, column, channel + c])
                    if image is not None:
                        suffix[block * LANES + lane] += gradient * image[row, column, channel + c]
                gradients[(block * stride + first + c) * LANES + lane] = gradient


@njit(**INLINED)
def read_image(tile_x, tile_y, image, to_image, template, gradients, stride, first, suffix):
    """Return the same as ``read_lanes``, for all channels, as many as the template is long."""
    width, channels = to_image.shape[1], len(template)
    if not is_whole(tile_x, tile_y, to_image):
        read_lanes(tile_x, tile_y, image, to_image, 0, channels, gradients, stride, first, suffix)
        return
    asked, shown = to_image.reshape(-1), flat(image)
    for block in range(BLOCKS):
        row, column = pixel_of(block, 0)
        at = ((tile_y + row) * width + tile_x + column) * channels
        pulls = pixels.load_pixels(asked, at, width * channels, template)
        many.store_many(gradients, (block * stride + first) * LANES, pulls)
        if image is not None:
            drawn = pixels.load_pixels(shown, at, width * channels, template)
            total = many.add_pairs(simd.load(suffix, block * LANES), drawn, pulls)
            simd.store(suffix, block * LANES, total)


@njit(**UNWRAPPED)
def read_plane(tile_x, tile_y, plane, to_plane, gradients, stride, first, suffix):
    """Return the same as ``read_lanes``, for images without channels."""
    image = None if plane is None else as_image(plane)
    read_image(tile_x, tile_y, image, as_image(to_plane), ONE, gradients, stride, first, suffix)


@njit(**INLINED)
def widen(gradients, stride, first, count, wide, row, channel):
    """Write so many vectors of each block pixel by pixel, ``row`` floats apart."""
    for block in range(BLOCKS):
        for lane in range(LANES):
            for c in range(count):
                value = gradients[(block * stride + first + c) * LANES + lane]
                wide[(block * LANES + lane) * row + channel + c] = value


@njit(**UNWRAPPED)
def read_sixteen(tile_x, tile_y, channel, image, to_image, gradients, wide, stride, suffix):
    """Return the same as ``read_lanes``, for sixteen channels; and pixel by pixel into ``wide``,
    ``stride`` floats apart.
    """
    width, channels = image.shape[1:]
    if not is_whole(tile_x, tile_y, image):
        read_lanes(tile_x, tile_y, image, to_image, channel, GROUP, gradients, channels, channel, suffix)
        widen(gradients, channels, channel, GROUP, wide, stride, channel)
        return
    drawn, asked = image.reshape(-1), to_image.reshape(-1)
    for block in range(BLOCKS):
        row, column = pixel_of(block, 0)
        at = ((tile_y + row) * width + tile_x + column) * channels + channel
        values = pixels.load_square(asked, at, channels, width * channels)
        pixels.store_square(wide, block * LANES * stride + channel, stride, 4 * stride, values)
        pulls = pixels.transpose(values)
        many.store_many(gradients, (block * channels + channel) * LANES, pulls)
        sums = pixels.transpose(pixels.load_square(drawn, at, channels, width * channels))
        total = many.add_pairs(simd.load(suffix, block * LANES), sums, pulls)
        simd.store(suffix, block * LANES, total)


@njit(**UNWRAPPED)
def read_tile(tile, template, sixteen, canvas, upstream, room, apart):
    """Read gradients of channels and transmittance; ``suffix`` becomes what they make of each pixel."""
    x, y, gradients, suffix = tile.x, tile.y, room.gradients, room.suffix
    image, to_image, channels = canvas.image, upstream.image, canvas.image.shape[2]
    suffix[:] = 0
    read_plane(x, y, canvas.transmittance, upstream.transmittance, room.spare, 1, 0, suffix)
    if sixteen is not None:
        for channel in range(0, channels, GROUP):
            read_sixteen(x, y, channel, image, to_image, gradients, apart.wide, apart.stride, suffix)
    if template is not None:
        read_image(x, y, image, to_image, template, gradients, channels, 0, suffix)


@njit(**INLINED)
def pull_moments(number, planes, moments, ranks, suffix):
    """Make ``CENTRED`` of the gradients of depth and distortion, which lie in its first planes.

    With W the sum of weights and v the variance of 1/z, a weight at z moves the depth by (z - mean z) / W
    and the distortion, which is W^2 v, by W (v + (1/z - mean)^2). About the means, for without them a pixel
    with one surfel far away would get the difference of large numbers where zero is due. What they make of a
    whole pixel is nothing for depth, a ratio, and twice itself for distortion, a product.
    """
    zero, kappa = simd.broadcast(0.0), simd.broadcast(KAPPA**2)
    for block in range(BLOCKS):
        at, kept = block * PLANES * LANES, number * PIXELS + block * LANES
        total, first, inverse, square = many.load_many(moments, 4 * kept, MOMENTS)
        rank, spread = simd.load(ranks, kept), spread_of(total, inverse, square)
        to_depth = simd.load(planes, at + TO_DEPTH * LANES)
        to_spread = kappa * simd.load(planes, at + TO_DISTORTION * LANES)
        to_spread = simd.where_less(zero, spread, to_spread, zero)
        over = simd.where_at_least(rank, zero, simd.broadcast(1.0) / total, zero)
        pulls = (to_spread * spread * over, to_depth * over, to_spread * total, first * over, inverse * over)
        many.store_many(planes, at + TO_DEPTH * LANES, pulls)
        simd.store(planes, at + RANK * LANES, rank)
        whole = simd.fma(to_spread + to_spread, spread, simd.load(suffix, block * LANES))
        simd.store(suffix, block * LANES, whole)


@njit(**UNWRAPPED)
def read_shape(tile, number, shape, channels, sixteen, planes, suffix, apart):
    """Read gradients of normals, depth, distortion and median depth as those of the sums behind them."""
    x, y = tile.x, tile.y
    read_image(x, y, shape.normal, shape.to_normal, NORMAL, planes, PLANES, 0, suffix)
    read_plane(x, y, None, shape.to_depth, planes, PLANES, TO_DEPTH, suffix)
    read_plane(x, y, None, shape.to_distortion, planes, PLANES, TO_DISTORTION, suffix)
    read_plane(x, y, None, shape.to_median, planes, PLANES, TO_MEDIAN, suffix)
    pull_moments(number, planes, shape.moments, shape.ranks, suffix)
    if sixteen is not None:
        widen(planes, PLANES, 0, 3, apart.wide, apart.stride, channels)

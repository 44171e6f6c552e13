# SPDX-License-Identifier: Apache-2.0
"""From the sums of a tile's blocks to the pixels of images."""

from graycard.methods._numba import njit
from graycard.methods.splat._maps import NDC_FAR, NDC_NEAR
from graycard.methods.splat.raster._blocks import (
    BLOCKS,
    GROUP,
    LANES,
    MOMENTS,
    NORMAL,
    ONE,
    PIXELS,
    SHAPE_SUMS,
    SIXTEEN,
    pixel_of,
)
from graycard.methods.splat.raster._tiles import TILE
from graycard.methods.splat.simd import _many as many
from graycard.methods.splat.simd import _pixels as pixels
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd._parts import INLINED, UNWRAPPED

KAPPA = NDC_FAR * NDC_NEAR / (NDC_FAR - NDC_NEAR)
"""Metres: depth in normalised device coordinates is a constant minus ``KAPPA / z``."""
DEPTH, DISTORTION = 3, 4
"""Places of the maps among the sums of a block, from where they are copied."""


@njit(**INLINED)
def is_whole(tile_x, tile_y, image):
    """Return whether a tile lies within an image."""
    return tile_y + TILE <= image.shape[0] and tile_x + TILE <= image.shape[1]


@njit(**INLINED)
def as_image(plane):
    """Return the same values as an image of one channel."""
    return plane.reshape(plane.shape[0], plane.shape[1], 1)


@njit(**INLINED)
def write_lanes(tile_x, tile_y, sums, stride, first, channel, count, image):
    """Copy so many of the ``stride`` vectors of each block to channels of the pixels that the image has."""
    height, width = image.shape[:2]
    rows, columns = min(height - tile_y, TILE), min(width - tile_x, TILE)
    for block in range(BLOCKS):
        for lane in range(LANES):
            row, column = pixel_of(block, lane)
            if row < rows and column < columns:
                place = (block * stride + first) * LANES + lane
                for c in range(count):
                    image[tile_y + row, tile_x + column, channel + c] = sums[place + c * LANES]


@njit(**INLINED)
def write_image(tile_x, tile_y, sums, stride, first, template, image):
    """Copy vectors of each block to all channels of an image, as many as the template is long."""
    width, channels = image.shape[1], len(template)
    if not is_whole(tile_x, tile_y, image):
        write_lanes(tile_x, tile_y, sums, stride, first, 0, channels, image)
        return
    flat = image.reshape(-1)
    for block in range(BLOCKS):
        row, column = pixel_of(block, 0)
        at = ((tile_y + row) * width + tile_x + column) * channels
        vectors = many.load_many(sums, (block * stride + first) * LANES, template)
        pixels.store_pixels(flat, at, width * channels, vectors)


@njit(**UNWRAPPED)
def write_plane(tile_x, tile_y, sums, stride, first, plane):
    """Copy one vector of each block to an image without channels."""
    write_image(tile_x, tile_y, sums, stride, first, ONE, as_image(plane))


@njit(**UNWRAPPED)
def write_sixteen(tile_x, tile_y, sums, channel, image):
    """Copy sixteen vectors of each block to channels of the pixels."""
    width, channels = image.shape[1:]
    if not is_whole(tile_x, tile_y, image):
        write_lanes(tile_x, tile_y, sums, channels, channel, channel, GROUP, image)
        return
    flat = image.reshape(-1)
    for block in range(BLOCKS):
        vectors = many.load_many(sums, (block * channels + channel) * LANES, SIXTEEN)
        row, column = pixel_of(block, 0)
        at = ((tile_y + row) * width + tile_x + column) * channels + channel
        pixels.store_square(flat, at, channels, width * channels, pixels.transpose(vectors))


@njit(**UNWRAPPED)
def write_tile(tile, room, template, sixteen, canvas):
    """Copy channels and transmittance from blocks to the pixels of the images."""
    image, channels = canvas.image, canvas.image.shape[2]
    if sixteen is not None:
        for channel in range(0, channels, GROUP):
            write_sixteen(tile.x, tile.y, room.sums, channel, image)
    if template is not None:
        write_image(tile.x, tile.y, room.sums, channels, 0, template, image)
    write_plane(tile.x, tile.y, room.through, 1, 0, canvas.transmittance)


@njit(**UNWRAPPED)
def clear_medians(medians):
    """No depth, and no rank."""
    for block in range(BLOCKS):
        simd.store(medians, block * 2 * LANES, simd.broadcast(0.0))
        simd.store(medians, (block * 2 + 1) * LANES, simd.broadcast(-1.0))


@njit(**INLINED)
def spread_of(total, inverse, square):
    """``total * square - inverse^2``, zero where it comes out below.

    The products all but cancel where depths are close: what the rounding of one takes away is given back
    (Kahan), on processors that fuse.
    """
    product = inverse * inverse
    lost = simd.fnma(inverse, inverse, product)
    return simd.maximum(simd.fma(total, square, lost - product), simd.broadcast(0.0))


@njit(**INLINED)
def keep_moments(number, sums, medians, moments, ranks):
    """Keep what the way back needs, and put depth and distortion in the place of the first two moments."""
    zero, kappa = simd.broadcast(0.0), simd.broadcast(KAPPA**2)
    for block in range(BLOCKS):
        at, kept = (block * SHAPE_SUMS + DEPTH) * LANES, number * PIXELS + block * LANES
        vectors = many.load_many(sums, at, MOMENTS)
        many.store_many(moments, 4 * kept, vectors)
        simd.store(ranks, kept, simd.load(medians, (block * 2 + 1) * LANES))
        total, first, inverse, square = vectors
        simd.store(sums, at, simd.where_less(zero, total, first / total, zero))
        simd.store(sums, at + LANES, kappa * spread_of(total, inverse, square))


@njit(**UNWRAPPED)
def write_shape(tile, number, sums, medians, shape):
    """Copy normals, and make depth and distortion of the moments."""
    x, y = tile.x, tile.y
    keep_moments(number, sums, medians, shape.moments, shape.ranks)
    write_image(x, y, sums, SHAPE_SUMS, 0, NORMAL, shape.normal)
    write_plane(x, y, sums, SHAPE_SUMS, DEPTH, shape.depth)
    write_plane(x, y, sums, SHAPE_SUMS, DISTORTION, shape.distortion)
    write_plane(x, y, medians, 2, 0, shape.median_depth)

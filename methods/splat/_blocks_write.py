# SPDX-License-Identifier: Apache-2.0
"""From the sums of a tile's blocks to the pixels of images."""

import numpy as np
from numba import njit

from graycard.methods.splat import _simd as simd
from graycard.methods.splat import _simd_many as many
from graycard.methods.splat._blocks import BLOCK, BLOCKS, GROUP, LANES, SHAPE_SUMS, SIXTEEN, pixel_of
from graycard.methods.splat._maps import NDC_FAR, NDC_NEAR
from graycard.methods.splat._tiles import TILE

KAPPA = NDC_FAR * NDC_NEAR / (NDC_FAR - NDC_NEAR)
"""Metres: depth in normalised device coordinates is a constant minus ``KAPPA / z``."""


@njit(forceinline=True)
def write_lanes(tile_x, tile_y, sums, channel, count, image):
    """Copy so many vectors of each block to the channels of the pixels."""
    height, width, channels = image.shape
    rows, columns = min(height - tile_y, TILE), min(width - tile_x, TILE)
    for block in range(BLOCKS):
        for lane in range(LANES):
            row, column = pixel_of(block, lane)
            if row < rows and column < columns:
                place = (block * channels + channel) * LANES + lane
                for c in range(count):
                    image[tile_y + row, tile_x + column, channel + c] = sums[place + c * LANES]


@njit(cache=True)
def write_sixteen(tile_x, tile_y, sums, channel, image):
    """As ``write_lanes``, for sixteen channels; faster where the tile lies within the image."""
    height, width, channels = image.shape
    if tile_y + TILE > height or tile_x + TILE > width:
        write_lanes(tile_x, tile_y, sums, channel, GROUP, image)
        return
    flat = image.reshape(-1)
    for block in range(BLOCKS):
        vectors = many.load_many(sums, (block * channels + channel) * LANES, SIXTEEN)
        row, column = pixel_of(block, 0)
        at = ((tile_y + row) * width + tile_x + column) * channels + channel
        many.store_square(flat, at, channels, width * channels, many.transpose(vectors))


@njit(cache=True)
def write_tile(tile_x, tile_y, sums, channels, template, sixteen, through, image, transmittance):
    """Copy channels and transmittance from blocks to the pixels of the images."""
    channel = 0
    if sixteen is not None:
        while channel + GROUP <= channels:
            write_sixteen(tile_x, tile_y, sums, channel, image)
            channel += GROUP
    if template is not None:
        write_lanes(tile_x, tile_y, sums, channel, len(template), image)
    for block in range(BLOCKS):
        for lane in range(LANES):
            row, column = pixel_of(block, lane)
            if tile_y + row < image.shape[0] and tile_x + column < image.shape[1]:
                transmittance[tile_y + row, tile_x + column] = through[block * LANES + lane]


@njit(cache=True)
def clear_medians(medians):
    """No depth, and no rank."""
    for block in range(BLOCKS):
        simd.store(medians, block * 2 * LANES, simd.broadcast(0.0))
        simd.store(medians, (block * 2 + 1) * LANES, simd.broadcast(-1.0))


@njit(cache=True)
def write_shape(tile_x, tile_y, sums, medians, shape):
    """Copy normals, and make depth and distortion of the moments.

    Distortion is a difference of sums that all but cancel where depths are close: it may come out below
    zero by rounding.
    """
    normal, depth, distortion, median, moments, ranks = shape
    height, width = depth.shape
    for block in range(BLOCKS):
        for lane in range(LANES):
            row, column = pixel_of(block, lane)
            row, column = tile_y + row, tile_x + column
            if row < height and column < width:
                at = block * SHAPE_SUMS * LANES + lane
                for c in range(3):
                    normal[row, column, c] = sums[at + c * LANES]
                for c in range(4):
                    moments[row, column, c] = sums[at + (3 + c) * LANES]
                total, first, inverse, square = moments[row, column]
                depth[row, column] = first / total if total > 0 else 0.0
                spread = np.float64(total) * np.float64(square) - np.float64(inverse) * np.float64(inverse)
                distortion[row, column] = max(KAPPA**2 * spread, 0.0)
                median[row, column] = medians[block * 2 * LANES + lane]
                ranks[row, column] = int(medians[(block * 2 + 1) * LANES + lane])

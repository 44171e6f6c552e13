# SPDX-License-Identifier: Apache-2.0
"""From the gradients of images to the blocks of a tile, and what they make of each whole pixel."""

import numpy as np
from numba import njit

from graycard.methods.splat import _simd as simd
from graycard.methods.splat import _simd_many as many
from graycard.methods.splat._blocks import BLOCKS, GROUP, LANES, pixel_of
from graycard.methods.splat._blocks_write import KAPPA
from graycard.methods.splat._tiles import TILE

PLANES = 10
"""Three of the normal, five of depth and distortion, and:"""
TO_MEDIAN, RANK = 8, 9
"""The gradient of the median depth, and the median's place in the list."""


@njit(forceinline=True)
def read_lanes(tile_x, tile_y, channel, count, image, to_image, gradients, wide, stride, suffix):
    """Bring so many channels of the image's gradient into blocks; add what they make of each pixel."""
    height, width, channels = image.shape
    for block in range(BLOCKS):
        for lane in range(LANES):
            row, column = pixel_of(block, lane)
            row, column = tile_y + row, tile_x + column
            total, pixel = 0.0, block * LANES + lane
            for c in range(channel, channel + count):
                gradient = 0.0
                if row < height and column < width:
                    gradient = np.float64(to_image[row, column, c])
                    total += gradient * image[row, column, c]
                gradients[(block * channels + c) * LANES + lane] = gradient
                if wide is not None:
                    wide[pixel * stride + c] = gradient
            suffix[pixel] += total


@njit(cache=True)
def read_sixteen(tile_x, tile_y, channel, image, to_image, gradients, wide, stride, suffix):
    """As ``read_lanes``, for sixteen channels; faster where the tile lies within the image."""
    height, width, channels = image.shape
    if tile_y + TILE > height or tile_x + TILE > width:
        read_lanes(tile_x, tile_y, channel, GROUP, image, to_image, gradients, wide, stride, suffix)
        return
    drawn, asked = image.reshape(-1), to_image.reshape(-1)
    for block in range(BLOCKS):
        row, column = pixel_of(block, 0)
        at = ((tile_y + row) * width + tile_x + column) * channels + channel
        pixels = many.load_square(asked, at, channels, width * channels)
        many.store_square(wide, block * LANES * stride + channel, stride, 4 * stride, pixels)
        pulls = many.transpose(pixels)
        many.store_many(gradients, (block * channels + channel) * LANES, pulls)
        sums = many.transpose(many.load_square(drawn, at, channels, width * channels))
        total = many.add_pairs(simd.load(suffix, block * LANES), sums, pulls)
        simd.store(suffix, block * LANES, total)


@njit(cache=True)
def read_tile(
    tile_x, tile_y, template, sixteen, image, transmittance, to_image, to_transmittance,
    gradients, wide, stride, suffix,
):  # fmt: skip
    """Gradients of channels and of transmittance; ``suffix`` begins as what they make of each pixel."""
    height, width, channels = image.shape
    for block in range(BLOCKS):
        for lane in range(LANES):
            row, column = pixel_of(block, lane)
            row, column, pixel = tile_y + row, tile_x + column, block * LANES + lane
            inside = row < height and column < width
            suffix[pixel] = transmittance[row, column] * to_transmittance[row, column] if inside else 0.0
    channel = 0
    if sixteen is not None:
        while channel + GROUP <= channels:
            read_sixteen(tile_x, tile_y, channel, image, to_image, gradients, wide, stride, suffix)
            channel += GROUP
    if template is not None:
        count = len(template)
        read_lanes(tile_x, tile_y, channel, count, image, to_image, gradients, wide, stride, suffix)


@njit(cache=True)
def read_shape(tile_x, tile_y, shape, channels, planes, wide, stride, suffix):
    """Gradients of normals, depth, distortion and median depth as what they make of one weight.

    With W the sum of weights and v the variance of 1/z, a weight at z moves the depth by (z - mean z) / W
    and the distortion, which is W^2 v, by W (v + (1/z - mean)^2). About the means, for without them a pixel
    with one surfel far away would get the difference of large numbers where zero is due.
    """
    normal, moments, ranks, to_normal, to_depth, to_distortion, to_median = shape
    height, width = ranks.shape
    planes[:] = 0
    for block in range(BLOCKS):
        for lane in range(LANES):
            row, column = pixel_of(block, lane)
            row, column, pixel = tile_y + row, tile_x + column, block * LANES + lane
            at = block * PLANES * LANES + lane
            planes[at + RANK * LANES] = -1
            for c in range(channels, stride):
                wide[pixel * stride + c] = 0
            if row >= height or column >= width or ranks[row, column] < 0:
                continue
            total, first, inverse, square = moments[row, column]
            spread = np.float64(total) * np.float64(square) - np.float64(inverse) * np.float64(inverse)
            asked = KAPPA**2 * to_distortion[row, column] if spread > 0 else 0.0
            asked_depth = np.float64(to_depth[row, column]) / total
            mean, mean_over = np.float64(first) / total, np.float64(inverse) / total
            pulls = (asked * spread / total, asked_depth, asked * total, mean, mean_over)
            whole = 2 * asked * spread
            for c in range(3):
                gradient = to_normal[row, column, c]
                planes[at + c * LANES] = wide[pixel * stride + channels + c] = gradient
                whole += gradient * normal[row, column, c]
            for c in range(5):
                planes[at + (3 + c) * LANES] = pulls[c]
            planes[at + TO_MEDIAN * LANES] = to_median[row, column]
            planes[at + RANK * LANES] = ranks[row, column]
            suffix[pixel] += whole

# SPDX-License-Identifier: Apache-2.0
"""Work: counts of surfel and pixel pairs, whoever does it and however.

Counted in float64 from the formulas, apart from the engine, whose own lists hold pairs that turn out to be
too faint.
"""

from math import exp, inf, log

import numpy as np
from numba import njit, prange

from graycard import Camera
from graycard.methods.splat import Surfels
from graycard.methods.splat.stages import ALPHA_MAX, ALPHA_MIN, NEAR, TRANSMITTANCE_MIN

TILE = 16
LOW_PASS_REACH = 4.0
"""Pixels beyond which the low-pass around a box's centre is fainter than ``ALPHA_MIN``, and some reserve."""


def count_pairs(surfels: Surfels, camera: Camera) -> int:
    """Pairs of pixel and surfel with an alpha of at least ``ALPHA_MIN`` before the pixel is opaque.

    Args:
        surfels: that lie wholly before the camera, on the CPU.
        camera: The pinhole camera, without skew.

    Raises:
        ValueError: A surfel may reach behind the camera: its picture has no bounds.
    """
    centres, matrices, boxes = _projected(surfels, camera)
    opacities = surfels.opacities.double().numpy()
    bounds = _bounds(centres, surfels, boxes, camera)
    order = np.argsort(centres[:, 2], kind="stable")
    columns, rows = -(-camera.width // TILE), -(-camera.height // TILE)
    counts = np.zeros(columns * rows, np.int64)
    _count(order, bounds, matrices, boxes, opacities, (camera.width, camera.height), counts)
    return int(counts.sum())


def _projected(surfels: Surfels, camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres in the camera's frame, M = K [s_u t_u, s_v t_v, mu], and the centres of the boxes, pixels."""
    pose = camera.world_to_camera
    centres = surfels.centres.double().numpy() @ pose[:3, :3].T + pose[:3, 3]
    w, x, y, z = (surfels.rotations.double() / surfels.rotations.double().norm(dim=1, keepdim=True)).numpy().T
    first = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1)
    second = np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], axis=1)
    scales = surfels.scales.double().numpy()
    axes = [axis @ pose[:3, :3].T * scales[:, k : k + 1] for k, axis in enumerate((first, second))]
    M = np.einsum("ij,njk->nik", camera.K, np.stack([*axes, centres], axis=2))
    signs = np.array([1, 1, -1])
    boxes = (M[:, :2] * M[:, 2:] * signs).sum(axis=2) / (M[:, 2:] ** 2 * signs).sum(axis=2)
    return centres, np.ascontiguousarray(M), boxes


def _bounds(centres: np.ndarray, surfels: Surfels, boxes: np.ndarray, camera: Camera) -> np.ndarray:
    """Pixels from and past, in x and y, that the sphere around a disc may touch; shape ``(N, 4)``."""
    reach = np.sqrt(2 * np.log(np.maximum(surfels.opacities.double().numpy() / ALPHA_MIN, 1)))
    radius = reach * surfels.scales.double().numpy().max(axis=1)
    if (centres[:, 2] - radius <= NEAR).any():
        row = int(np.argmin(centres[:, 2] - radius))
        raise ValueError(f"expected surfels before the camera, got one {centres[row, 2]:.3g} m before it")
    sides = []
    for axis, size in ((0, camera.width), (1, camera.height)):
        distance = np.hypot(centres[:, axis], centres[:, 2])
        middle, half = np.arctan2(centres[:, axis], centres[:, 2]), np.arcsin(radius / distance)
        ends = [camera.K[axis, axis] * np.tan(middle + s * half) + camera.K[axis, 2] for s in (-1, 1)]
        low = np.minimum(ends[0], boxes[:, axis] - LOW_PASS_REACH)
        high = np.maximum(ends[1], boxes[:, axis] + LOW_PASS_REACH)
        sides += [np.clip(np.floor(low), 0, size), np.clip(np.ceil(high), 0, size)]
    return np.stack(sides, axis=1).astype(np.int64)


@njit(cache=True)
def _exponent(M, box, x, y):
    """Exponent of the larger Gaussian of a surfel at a pixel, positive; infinite where there is none."""
    h = x * M[2] - M[0]
    k = y * M[2] - M[1]
    below = h[0] * k[1] - h[1] * k[0]
    low_pass = (x - box[0]) ** 2 + (y - box[1]) ** 2
    if below == 0:
        return low_pass
    u, v = (h[1] * k[2] - h[2] * k[1]) / below, (h[2] * k[0] - h[0] * k[2]) / below
    depth = M[2, 0] * u + M[2, 1] * v + M[2, 2]
    disc = 0.5 * (u * u + v * v) if depth >= NEAR else inf
    return min(disc, low_pass)


@njit(parallel=True, cache=True)
def _count(order, bounds, matrices, boxes, opacities, size, counts):  # noqa: PLR0917  # a kernel of Numba
    """Pairs of each tile; surfels in the order that is given."""
    width, height = size
    columns = (width + TILE - 1) // TILE
    for tile in prange(counts.size):
        left, top = tile % columns * TILE, tile // columns * TILE
        right, bottom = min(left + TILE, width), min(top + TILE, height)
        transmittance = np.ones((TILE, TILE))
        for surfel in order:
            x_from, x_past = max(bounds[surfel, 0], left), min(bounds[surfel, 1], right)
            y_from, y_past = max(bounds[surfel, 2], top), min(bounds[surfel, 3], bottom)
            if x_from >= x_past or y_from >= y_past or opacities[surfel] < ALPHA_MIN:
                continue
            faintest = log(opacities[surfel] / ALPHA_MIN)
            for row in range(y_from, y_past):
                for column in range(x_from, x_past):
                    before = transmittance[row - top, column - left]
                    exponent = _exponent(matrices[surfel], boxes[surfel], column + 0.5, row + 0.5)
                    if exponent <= faintest and before > TRANSMITTANCE_MIN:
                        alpha = min(opacities[surfel] * exp(-exponent), ALPHA_MAX)
                        transmittance[row - top, column - left] = before * (1 - alpha)
                        counts[tile] += 1

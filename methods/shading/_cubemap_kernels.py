# SPDX-License-Identifier: Apache-2.0
"""Kernels: what is seen of cubemaps in directions, one row a direction; sums are in one order, on one thread.

Cubemaps of one sky, one after the other in ``texels`` and each with a border of one texel a face in
``bordered``; a direction has a level, between two of which it is linear. Gradients are written by hand and
tested against finite differences.
"""

import numpy as np

from graycard.methods._numba import njit


@njit(cache=True, error_model="numpy")
def _place(directions, row, axes, size):
    """Return where a direction meets its face: the face, its axis, two coordinates in [-1, 1], the texel
    to the upper left in a face with a border, and how far it is across and down from there.
    """
    axis = 0
    for other in range(1, 3):
        if abs(directions[row, other]) > abs(directions[row, axis]):
            axis = other
    along = directions[row, axis]
    face = 2 * axis + (1 if along < 0 else 0)
    u = v = along * 0
    for k in range(3):
        u += directions[row, k] * axes[0, face, k]
        v += directions[row, k] * axes[1, face, k]
    u, v = u / abs(along), v / abs(along)
    half = directions.dtype.type(0.5)
    x, y = (u + 1) * (size * half) + half, (v + 1) * (size * half) + half
    left, top = min(max(int(np.floor(x)), 0), size), min(max(int(np.floor(y)), 0), size)
    corner = (face * (size + 2) + top) * (size + 2) + left
    return face, axis, u, v, corner, x - left, y - top


@njit(cache=True)
def _levels(levels, row, count):
    """Return the lower of the two cubemaps between which a level is, and how far it is towards the other."""
    level = min(max(levels[row], levels.dtype.type(0)), levels.dtype.type(count - 1))
    lower = max(min(int(level), count - 1), 0)  # no level is none of a number
    return lower, level - lower


@njit(cache=True, error_model="numpy")
def seen(texels, bordered, sizes, directions, levels, axes, found):
    """Look cubemaps up.

    Args:
        texels: ``(T, C)``: of all cubemaps.
        bordered: ``(B,)``, integers: rows of ``texels``, by their place in faces with a border.
        sizes: ``(L,)``, integers: texels along the side of a face of each cubemap.
        directions: ``(R, 3)``, of any length above 0.
        levels: ``(R,)``: numbers of cubemaps; beyond the ends those at the ends.
        axes: ``(2, 6, 3)``: to the right and down on each face.
        found: ``(R, C)``, to be written.
    """
    begins = _begins(sizes)
    for row in range(len(directions)):
        lower, toward = _levels(levels, row, len(sizes))
        found[row] = 0 * directions[row].sum()  # NaN where a direction is none
        for other in range(2 if toward > 0 else 1):
            number, share = lower + other, toward if other else 1 - toward
            size = sizes[number]
            _, _, _, _, corner, across, below = _place(directions, row, axes, size)
            corner += begins[number]
            for i in range(2):
                for j in range(2):
                    texel = bordered[corner + i * (size + 2) + j]
                    weight = share * (below if i else 1 - below) * (across if j else 1 - across)
                    for c in range(texels.shape[1]):
                        found[row, c] += weight * texels[texel, c]


@njit(cache=True, error_model="numpy")
def seen_backward(
    texels, bordered, sizes, directions, levels, axes, to_found, to_texels, to_directions, to_levels
):
    """Write the gradients of :func:`seen`.

    A level that is that of a cubemap, or beyond the ends, has a gradient of 0.

    Args:
        texels: as above.
        bordered: as above.
        sizes: as above.
        directions: as above.
        levels: as above.
        axes: as above.
        to_found: ``(R, C)``.
        to_texels: ``(T, C)``, zero, to be added to.
        to_directions: ``(R, 3)``, to be written.
        to_levels: ``(R,)``, to be written.
    """
    begins = _begins(sizes)
    for row in range(len(directions)):
        lower, toward = _levels(levels, row, len(sizes))
        longest = max(abs(directions[row, 0]), abs(directions[row, 1]), abs(directions[row, 2]))
        known = 0 < longest < np.inf and not np.isnan(directions[row].sum() + toward)
        to_directions[row] = 0 if known else np.nan
        to_levels[row] = 0 if known else np.nan
        if not known:
            continue
        for other in range(2 if toward > 0 else 1):
            number, share = lower + other, toward if other else 1 - toward
            size = sizes[number]
            face, axis, u, v, corner, across, below = _place(directions, row, axes, size)
            corner += begins[number]
            whole = to_x = to_y = share * 0
            for i in range(2):
                for j in range(2):
                    texel = bordered[corner + i * (size + 2) + j]
                    in_row, in_column = below if i else 1 - below, across if j else 1 - across
                    weight, asked = share * in_row * in_column, share * 0
                    for c in range(texels.shape[1]):
                        to_texels[texel, c] += weight * to_found[row, c]
                        asked += texels[texel, c] * to_found[row, c]
                    whole += in_row * in_column * asked
                    to_x += in_row * (asked if j else -asked)
                    to_y += in_column * (asked if i else -asked)
            if toward > 0:
                to_levels[row] += whole if other else -whole
            along = directions[row, axis]
            scale = share * (size * directions.dtype.type(0.5)) / abs(along)
            for k in range(3):
                to_directions[row, k] += scale * (to_x * axes[0, face, k] + to_y * axes[1, face, k])
            to_directions[row, axis] -= scale * (to_x * u + to_y * v) * (1 if along > 0 else -1)


@njit(cache=True)
def _begins(sizes):
    """Offsets where the bordered faces of each cubemap begin."""
    begins = np.zeros(len(sizes), np.int64)
    for number in range(1, len(sizes)):
        begins[number] = begins[number - 1] + 6 * (sizes[number - 1] + 2) ** 2
    return begins

# SPDX-License-Identifier: Apache-2.0
"""Filters of images that are a product of a vertical and a horizontal one."""

import numpy as np

_BLOCK = 32
"""Pixels that one matrix product filters."""


def separable(image: np.ndarray, down: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Return the correlation with the filter ``down[i] * across[j]``, shape ``(H, W)``, float64.

    Beyond the image lies its last pixel, again and again.

    Args:
        image: shape ``(H, W)``, any unit.
        down: Weights along a column, an odd number of them.
        across: Weights along a row, an odd number of them.

    Raises:
        ValueError: A filter has no middle.

    Examples:
        >>> import numpy as np
        >>> separable(np.eye(3), np.ones(1), np.array([0, 0, 1])).tolist()
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]
    """
    return along_columns(along_rows(image, across), down)


def along_columns(image: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the correlation of each column with weights; arguments as of :func:`separable`.

    By products with a banded matrix, block by block: though most of its elements are 0, BLAS is three times
    as fast as a loop over the weights.
    """
    windows = _windows(image, len(weights), 0).swapaxes(1, 2)
    return np.matmul(_banded(weights), windows).reshape(-1, image.shape[1])[: image.shape[0]]


def along_rows(image: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the correlation of each row with weights; as :func:`along_columns`."""
    windows = _windows(image, len(weights), 1).swapaxes(0, 1)
    blocks = np.matmul(windows, _banded(weights).T)
    return blocks.swapaxes(0, 1).reshape(image.shape[0], -1)[:, : image.shape[1]]


def _windows(image: np.ndarray, length: int, axis: int) -> np.ndarray:
    """Return the pixels that each block along an axis sees, in a last axis of its own."""
    if length % 2 == 0:
        raise ValueError(f"expected an odd number of weights, got {length}")
    wide = np.take(image, _seen(image.shape[axis], length // 2), axis).astype(np.float64, copy=False)
    windows = np.lib.stride_tricks.sliding_window_view(wide, _BLOCK + length - 1, axis)
    return windows[::_BLOCK] if axis == 0 else windows[:, ::_BLOCK]


def _seen(size: int, reach: int) -> np.ndarray:
    """Return indices of the pixels that whole blocks see."""
    places = np.arange(-reach, size + -size % _BLOCK + reach)
    return np.clip(places, 0, size - 1)


def _banded(weights: np.ndarray) -> np.ndarray:
    """Matrix from what a block sees to the filtered block, shape ``(_BLOCK, _BLOCK + len(weights) - 1)``."""
    band = np.zeros((_BLOCK, _BLOCK + len(weights) - 1))
    rows = np.arange(_BLOCK)[:, None]
    band[rows, rows + np.arange(len(weights))] = weights
    return band

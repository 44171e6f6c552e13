# SPDX-License-Identifier: Apache-2.0
"""Masks of judged pixels; what lies outside is left out, never multiplied by zero."""

from collections.abc import Set

import numpy as np


def judged_mask(object_id: np.ndarray, left_out: Set[int] = frozenset()) -> np.ndarray:
    """Mark where an object is seen that is not left out, shape ``(H, W)``, bool.

    Args:
        object_id: shape ``(H, W)``, integer, from the truth; 0 is where nothing is seen.
        left_out: Ids that are not judged (for base colour: the surfaces of lights).

    Examples:
        >>> import numpy as np
        >>> judged_mask(np.array([[0, 1, 2]]), {2}).tolist()
        [[False, True, False]]
    """
    return (object_id > 0) & ~np.isin(object_id, sorted(left_out))


def judged_pixels(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels of two images inside a mask, each of shape ``(N, ...)``, float64.

    Raises:
        ValueError: The shapes differ, or the mask is empty.
    """
    check_images(predicted, true, mask)
    inside = np.flatnonzero(mask)  # several times as fast as a boolean index
    return _chosen(predicted, inside), _chosen(true, inside)


def _chosen(image: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    return np.take(image.reshape(-1, *image.shape[2:]), pixels, axis=0).astype(np.float64, copy=False)


def with_true_background(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the prediction inside the mask and the truth outside, shape ``(H, W, C)``, float64.

    Metrics that look at neighbourhoods (FLIP, SSIM) would otherwise see pixels that are not judged.

    Raises:
        ValueError: The shapes differ, or the mask is empty.
    """
    check_images(predicted, true, mask)
    return np.where(mask[..., None], predicted, true).astype(np.float64)


def box_around(mask: np.ndarray, margin: int) -> tuple[slice, slice]:
    """Rows and columns of the least box that holds the mask and a margin of pixels, cut off at the image.

    What a filter says inside the mask is the same in the box, if the margin is not less than its reach.

    Examples:
        >>> import numpy as np
        >>> box_around(np.eye(9)[::-1] * np.arange(9) > 7, 2)
        (slice(0, 3, None), slice(6, 11, None))
    """
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    return _widened(rows, margin), _widened(columns, margin)


def _widened(seen: np.ndarray, margin: int) -> slice:
    return slice(max(int(seen[0]) - margin, 0), int(seen[-1]) + 1 + margin)


def check_images(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> None:
    """Raise ValueError unless the images have one shape that fits a mask with pixels in it."""
    if predicted.shape != true.shape or mask.shape != true.shape[:2] or mask.dtype != np.bool_:
        raise ValueError(
            "expected two images of one shape and a boolean mask of their height and width, got "
            f"{predicted.shape}, {true.shape} and {mask.dtype} {mask.shape}"
        )
    if not mask.any():
        raise ValueError("expected a mask with pixels in it, got an empty one")

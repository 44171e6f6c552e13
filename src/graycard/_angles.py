# SPDX-License-Identifier: Apache-2.0
"""Angles between directions."""

import numpy as np


def angles(predicted: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Angle between two fields of directions, shape ``(...)``, degrees, float64.

    ``atan2(|p x t|, p . t)``: exact at 0° and 180°, where the arc cosine loses half its digits, and
    the same whatever the lengths. A vector of length zero points nowhere; it is counted as 90°, the
    mean angle of a random direction, where the formula alone would call it perfect.

    Args:
        predicted: shape ``(..., 3)``, of any length.
        true: Same shape, of any length.

    Raises:
        ValueError: The shapes differ or are no vectors.

    Examples:
        >>> import numpy as np
        >>> angles(np.array([[0, 0, 2.0], [0, 1, 0], [0, 0, 0]]), np.array([[0, 0, 1.0]] * 3)).tolist()
        [0.0, 90.0, 90.0]
    """
    p, t = np.asarray(predicted, np.float64), np.asarray(true, np.float64)
    if p.shape != t.shape or p.shape[-1] != 3:
        raise ValueError(f"expected two fields of vectors (..., 3) of one shape, got {p.shape} and {t.shape}")
    nowhere = (p == 0).all(axis=-1) | (t == 0).all(axis=-1)
    # A power of two rounds nothing, and keeps the squares of tiny and huge vectors representable.
    p = np.ldexp(p, -np.frexp(np.abs(p).max(axis=-1, keepdims=True))[1])
    turned = np.degrees(np.arctan2(np.linalg.norm(np.cross(p, t), axis=-1), (p * t).sum(axis=-1)))
    return np.where(nowhere, 90.0, turned)

# SPDX-License-Identifier: Apache-2.0
"""CIEDE2000: how different two colours look."""

import numpy as np

REC709_TO_XYZ = np.array(
    [
        [0.4123907993, 0.3575843394, 0.1804807884],
        [0.2126390059, 0.7151686788, 0.0721923154],
        [0.0193308187, 0.1191947798, 0.9505321522],
    ]
)
"""From linear Rec.709 to CIE XYZ (ITU-R BT.709-6 primaries, white D65 at x = 0.3127, y = 0.3290)."""
_KNEE = (6 / 29) ** 3


def lab(linear: np.ndarray) -> np.ndarray:
    """CIE 1976 L*a*b* of linear Rec.709 colours, shape ``(..., 3)``, float64.

    The white of L*a*b* is that of the colours, (1, 1, 1), so that every gray has a* = b* = 0.
    Formula: CIE 15:2018, equations 8.1 to 8.5. A reflectance needs no clipping: above 1 it is brighter
    than white, below 0 it lies on the straight part of the curve.

    Examples:
        >>> import numpy as np
        >>> [round(x, 6) + 0.0 for x in lab(np.full(3, 0.18)).tolist()]
        [49.496108, 0.0, 0.0]
    """
    planes = np.ascontiguousarray(np.moveaxis(np.asarray(linear, np.float64), -1, 0))
    to_xyz = REC709_TO_XYZ / REC709_TO_XYZ.sum(axis=1, keepdims=True)
    return np.stack(lab_planes(np.tensordot(to_xyz, planes, 1)), axis=-1)


def lab_planes(xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """L*, a* and b*, each of shape ``(...)``, of CIE XYZ over white, shape ``(3, ...)``; see :func:`lab`."""
    straight = xyz * (29 / 6) ** 2 / 3 + 4 / 29
    x, y, z = np.where(xyz > _KNEE, np.cbrt(xyz), straight)
    return 116 * y - 16, 500 * (x - y), 200 * (y - z)


def ciede2000(predicted: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Colour difference ΔE₀₀ of linear Rec.709 colours, shape ``(...)``, float64.

    Formula: Sharma, Wu and Dalal 2005, k_L = k_C = k_H = 1, by scikit-image. About 1 is just seen side
    by side.

    Args:
        predicted: shape ``(..., 3)``, linear; 1 is white.
        true: shape ``(..., 3)``, linear.

    Returns:
        [0, ∞); 0 for equal colours.
    """
    from skimage.color import deltaE_ciede2000

    return np.asarray(deltaE_ciede2000(lab(predicted), lab(true)))

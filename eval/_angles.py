# SPDX-License-Identifier: Apache-2.0
"""Angles between predicted and true normals."""

import numpy as np

from graycard import angles


def mean_angle(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> float:
    """Mean of :func:`graycard.angles` over the mask, degrees; images of shape ``(H, W, 3)``."""
    return float(angles(predicted[mask], true[mask]).mean())


def median_angle(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> float:
    """Median of :func:`graycard.angles` over the mask, degrees; images of shape ``(H, W, 3)``."""
    return float(np.median(angles(predicted[mask], true[mask])))

# SPDX-License-Identifier: Apache-2.0
"""FLIP: the error that an observer sees when two images alternate at 67 pixels per degree."""

import numpy as np

from graycard.eval._mask import box_around, with_true_background

REACH = 10
"""Radius in pixels of FLIP's widest filter at 67 pixels per degree."""


def flip_map(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """FLIP error per pixel, shape ``(H, W)``, [0, 1].

    Andersson et al. 2020 (LDR), by the authors' own library. Outside the mask both images show the
    truth: FLIP's filters reach about ten pixels far, and what is not judged must not leak in.

    Args:
        predicted: shape ``(H, W, 3)``, display values (sRGB-encoded) in [0, 1].
        true: shape ``(H, W, 3)``, display values in [0, 1].
        mask: shape ``(H, W)``, bool.

    Raises:
        ValueError: The shapes differ, the mask is empty, or a value is outside [0, 1].
    """
    from flip_evaluator import evaluate

    shown = with_true_background(predicted, true, mask)
    if min(shown.min(), true.min()) < 0 or max(shown.max(), true.max()) > 1:
        raise ValueError(f"expected display values in [0, 1], got [{shown.min()}, {shown.max()}]")
    # Beyond the filters' reach of the mask both images are equal and the error is 0.
    box = box_around(mask, 2 * REACH)
    error, _, _ = evaluate(
        np.ascontiguousarray(true[box], np.float32),
        np.ascontiguousarray(shown[box], np.float32),
        "LDR",
        inputsRGB=True,
        applyMagma=False,
        computeMeanError=False,
    )
    found = np.zeros(mask.shape)
    found[box] = np.asarray(error)[..., 0]
    return found


def flip(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> float:
    """Mean of :func:`flip_map` over the mask, [0, 1]; 0 for equal images.

    Raises:
        ValueError: As :func:`flip_map`.
    """
    return float(flip_map(predicted, true, mask)[mask].mean())

# SPDX-License-Identifier: Apache-2.0
"""FLIP: the error that an observer sees when two images alternate at 67 pixels per degree.

Andersson et al. 2020, "FLIP: A Difference Evaluator for Alternating Images" (LDR), in float64: three times as
fast as the authors' own library, with which it agrees to the rounding of that library's float32.
"""

import math
from functools import cache

import numpy as np

from graycard import srgb_decode
from graycard.eval.measures._colour_difference import lab_planes
from graycard.eval.measures._filters import along_columns, along_rows, separable
from graycard.eval.scoring._mask import box_around, with_true_background
from graycard.io import blocks

PIXELS_PER_DEGREE = 3840 * math.radians(1)
"""Resolution of a screen of 3840 pixels and 0.7 m width, seen from 0.7 m."""
REACH = 10
"""Radius in pixels of FLIP's widest filter at that density."""

_XYZ = np.array(
    [
        [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
        [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
        [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
    ]
)
"""From linear Rec.709 to CIE XYZ as the authors have it: another digit of white is worth 3e-5 of FLIP."""
_XYZ_OVER_WHITE = _XYZ / _XYZ.sum(axis=1, keepdims=True)
_OPPONENT = np.array([[0, 1, 0], [1, -1, 0], [0, 1, -1]]) @ _XYZ_OVER_WHITE
"""From linear Rec.709 to luminance Y, red-green X - Y and blue-yellow Y - Z: YCxCz without its scales, which
filters that are linear and keep constants do not see."""
_SENSITIVITY = (((1, 0.0047),), ((1, 0.0053),), ((34.1, 0.04), (13.5, 0.025)))
"""Contrast sensitivity of each opponent channel: a and b of Gaussians a √(π/b) exp(-π² r² / b), r in degrees
(table 1 of the paper). In two dimensions, too, the factor is √(π/b) and not π/b."""
_FEATURE_WIDTH = 0.082
"""Width of the lines that an observer detects, degrees."""
_COLOUR_EXPONENT, _FEATURE_EXPONENT = 0.7, 0.5
_KNEE_AT, _KNEE = 0.4, 0.95
"""Share of the greatest colour difference that is mapped to an error of 0.95: what is greater saturates."""


def flip_map(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """FLIP error per pixel, shape ``(H, W)``, [0, 1].

    Outside the mask both images show the truth: FLIP's filters reach about ten pixels far, and what is not
    judged must not leak in.

    Args:
        predicted: shape ``(H, W, 3)``, display values (sRGB-encoded) in [0, 1].
        true: shape ``(H, W, 3)``, display values in [0, 1].
        mask: shape ``(H, W)``, bool.

    Raises:
        ValueError: The shapes differ, the mask is empty, or a value is outside [0, 1].
    """
    shown = with_true_background(predicted, true, mask)
    if min(shown.min(), true.min()) < 0 or max(shown.max(), true.max()) > 1:
        raise ValueError(f"expected display values in [0, 1], got [{shown.min()}, {shown.max()}]")
    # Beyond the filters' reach of the mask both images are equal and the error is 0.
    box = box_around(mask, 2 * REACH)
    found = np.zeros(mask.shape)
    found[box] = _difference(_opponent_planes(shown[box]), _opponent_planes(true[box]))
    return found


def flip(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> float:
    """Mean of :func:`flip_map` over the mask, [0, 1]; 0 for equal images.

    Raises:
        ValueError: As :func:`flip_map`.
    """
    return float(flip_map(predicted, true, mask)[mask].mean())


def _opponent_planes(display: np.ndarray) -> np.ndarray:
    """Opponent channels of display values ``(H, W, 3)``, shape ``(3, H, W)``."""
    planes = np.ascontiguousarray(np.moveaxis(display, -1, 0), np.float64)
    return np.tensordot(_OPPONENT, srgb_decode(planes), 1)


def _difference(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """FLIP of two images in opponent channels ``(3, H, W)``, shape ``(H, W)``: equation 8 of the paper."""
    seen = [_resolved(image).reshape(3, -1) for image in (one, other)]
    colour = np.empty(one[0].size)
    for block in blocks(colour.size):
        colour[block] = _redistributed(_hyab(*(_perceived(image[:, block]) for image in seen)))
    colour = colour.reshape(one[0].shape)
    (edge, point), (other_edge, other_point) = _features(one[0]), _features(other[0])
    feature = np.maximum(np.abs(edge - other_edge), np.abs(point - other_point)) / math.sqrt(2)
    return colour ** (1 - feature**_FEATURE_EXPONENT)


def _resolved(opponent: np.ndarray) -> np.ndarray:
    """Return the image as far as the eye resolves it, shape ``(3, H, W)``."""
    return np.array([_without_details(c, s) for c, s in zip(opponent, _SENSITIVITY, strict=True)])


def _perceived(resolved: np.ndarray) -> np.ndarray:
    """Hunt-adjusted L*a*b* of what a display can show of opponent channels ``(3, N)``, shape ``(3, N)``."""
    return _hunt_lab(np.clip(np.tensordot(np.linalg.inv(_OPPONENT), resolved, 1), 0, 1))


def _without_details(channel: np.ndarray, gaussians: tuple[tuple[float, float], ...]) -> np.ndarray:
    """Return a channel without the details to which the eye is blind."""
    square_degrees = (np.arange(-REACH, REACH + 1) / PIXELS_PER_DEGREE) ** 2
    found, total = np.zeros(channel.shape), 0.0
    for a, b in gaussians:
        weights, factor = np.exp(-(math.pi**2) * square_degrees / b), a * math.sqrt(math.pi / b)
        found += factor * separable(channel, weights, weights)
        total += factor * weights.sum() ** 2
    return found / total


def _hunt_lab(linear: np.ndarray) -> np.ndarray:
    """L*a*b* of linear Rec.709 planes ``(3, ...)``; colours seem less colourful when they are dark (Hunt)."""
    lightness, a, b = lab_planes(np.tensordot(_XYZ_OVER_WHITE, linear, 1))
    return np.array([lightness, 0.01 * lightness * a, 0.01 * lightness * b])


def _hyab(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """HyAB distance of colours ``(3, ...)`` (Abasi et al. 2020), compressed for large differences."""
    lightness, a, b = one - other
    return (np.abs(lightness) + np.sqrt(a**2 + b**2)) ** _COLOUR_EXPONENT


def _redistributed(distance: np.ndarray) -> np.ndarray:
    """Colour error in [0, 1] of a compressed distance: most of the range for what is common in renderings."""
    greatest = _greatest_distance()
    knee = _KNEE_AT * greatest
    above = _KNEE + (1 - _KNEE) * (distance - knee) / (greatest - knee)
    return np.where(distance < knee, _KNEE / knee * distance, above)


@cache
def _greatest_distance() -> float:
    """Return the greatest compressed distance of two display colours: that of green and blue."""
    green, blue = np.eye(3)[1:]
    return float(_hyab(_hunt_lab(green), _hunt_lab(blue)))


def _features(luminance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Strengths of edges and of points and lines in luminance ``(H, W)``, each of the same shape."""
    deviation = _FEATURE_WIDTH / 2 * PIXELS_PER_DEGREE
    x = np.arange(-math.ceil(3 * deviation), math.ceil(3 * deviation) + 1)
    smooth = np.exp(-(x**2) / (2 * deviation**2))
    blurred = along_rows(luminance, smooth / smooth.sum()), along_columns(luminance, smooth / smooth.sum())
    edge, point = (_balanced(w * smooth) for w in (-x, (x / deviation) ** 2 - 1))
    return _strength(blurred, edge), _strength(blurred, point)


def _strength(blurred: tuple[np.ndarray, np.ndarray], weights: np.ndarray) -> np.ndarray:
    """Length of the answers down and across, each of the image that was blurred in the other direction."""
    return np.sqrt(along_columns(blurred[0], weights) ** 2 + along_rows(blurred[1], weights) ** 2)


def _balanced(weights: np.ndarray) -> np.ndarray:
    """Return the weights with a sum of 1 of what is above 0, and of -1 of what is below."""
    above, below = np.maximum(weights, 0), np.minimum(weights, 0)
    return above / above.sum() - below / below.sum()

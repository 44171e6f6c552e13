# SPDX-License-Identifier: Apache-2.0
"""Errors in units of the truth's own noise."""

from dataclasses import dataclass

import numpy as np

from graycard.eval.kinds._metric import Metric
from graycard.eval.kinds._records import error
from graycard.eval.kinds._references import Reference
from graycard.eval.kinds._views import ViewRule
from graycard.eval.scoring._ceiling import OF_HALVES
from graycard.eval.scoring._findings import Measurement
from graycard.eval.scoring._readings import TrueView

WINDOW = 5
"""Side in pixels of the neighbourhood over which variances are averaged."""


@dataclass(frozen=True, slots=True)
class Noisy:
    """Truth with its noise, at the pixels where there is any."""

    values: np.ndarray
    """Shape ``(N, 3)``."""
    deviation: np.ndarray
    """Standard deviation of their mean, shape ``(N, 3)``, positive."""
    judged: np.ndarray
    """Judged pixels, shape ``(H, W)``, bool."""
    half_difference: np.ndarray | None
    """(half_a - half_b) / 2, shape ``(N, 3)``: as far off as the truth itself; None without halves."""


def local_variance(variance: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the mean of the variance over each pixel's neighbours inside a mask.

    A variance from four images has three degrees of freedom: the mean square of errors divided by such ones
    is three times what it should be. A mean over 25 pixels has 75.

    Args:
        variance: shape ``(H, W, 3)``, any unit squared.
        mask: shape ``(H, W)``, bool: only neighbours inside count.

    Returns:
        Shape ``(H, W, 3)``, float64; 0 outside the mask.
    """
    from scipy.ndimage import uniform_filter

    inside = mask[..., None].astype(np.float64)
    sums, count = (
        uniform_filter(image, WINDOW, mode="constant", axes=(0, 1)) for image in (variance * inside, inside)
    )
    return np.where(mask[..., None], np.maximum(sums, 0) / np.maximum(count, 1 / WINDOW**2), 0)


def _prepare(layer: str, true: TrueView) -> Noisy | None:
    mask = true.mask(layer)
    variance = local_variance(true.take(f"{layer}.var"), mask)
    judged = mask & (variance > 0).all(axis=-1)
    if not judged.any():
        return None
    halves = [true.take(f"{layer}.{h}") for h in ("half_a", "half_b") if f"{layer}.{h}" in true.layers]
    difference = (halves[0].astype(np.float64) - halves[1])[judged] / 2 if len(halves) == 2 else None
    values = true.take(layer).astype(np.float64)[judged]
    return Noisy(values, np.sqrt(variance[judged]), judged, difference)


def _compute(predicted: np.ndarray, noisy: Noisy) -> Measurement:
    return Measurement(_rms((predicted[noisy.judged] - noisy.values) / noisy.deviation))


def _noise(noisy: Noisy) -> float | None:
    return 1.0 if noisy.half_difference is None else _rms(noisy.half_difference / noisy.deviation)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


_REFERENCES = (
    Reference("local variance", "sums over each window, pixel by pixel", 1e-9),
    Reference("error over noise", "the closed form of an offset of k standard deviations", 1e-9, "σ"),
)


def _metric(group: str, title: str, layer: str) -> Metric[ViewRule]:
    return Metric(
        record=error(
            group,
            "noise_rms",
            f"{title}, error over noise",
            f"mean over views of the root mean square of (p - t) / σ of {layer}, linear, over the mask; σ² "
            "the mean variance of the truth in 5x5 pixels. 1: as close as the truth knows itself; its "
            "ceiling is the same of (half_a - half_b) / 2",
            unit="σ",
            tolerance=0.5,
        ),
        rule=ViewRule(
            (layer, f"{layer}.var"),
            lambda true, exposure: _prepare(layer, true),
            _compute,
            noise=_noise,
        ),
        layers=(layer,),
        ceiling=OF_HALVES,
        references=_REFERENCES,
    )


METRICS: tuple[Metric[ViewRule], ...] = (
    _metric("novel_view", "Novel view", "radiance"),
    _metric("counterfactual", "Removal", "counterfactual.radiance"),
)

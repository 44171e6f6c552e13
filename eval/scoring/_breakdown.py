# SPDX-License-Identifier: Apache-2.0
"""The same number by neighbouring rules: other pixels, other colour space, other pooling, without noise."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import Any

import numpy as np

from graycard.eval.measures._pixelwise import Bracketed, Errors, Pixelwise
from graycard.eval.measures._psnr import psnr
from graycard.eval.metrics._image_metric import ImageMetric, Space
from graycard.eval.scoring._ceiling import mean_variance


@dataclass(frozen=True, slots=True)
class Comparison:
    """One layer of one view, ready to be judged."""

    predicted: np.ndarray
    """shape ``(H, W, 3)`` or ``(H, W)``, linear, float64, with the gauge applied."""
    true: np.ndarray
    """Same shape, linear, float64."""
    mask: np.ndarray
    """shape ``(H, W)``, bool."""
    exposure: float
    variance: np.ndarray | None = None
    """shape ``(H, W, 3)``: of the truth, in its unit squared; None where the truth is exact, or no part."""
    pure: np.ndarray | None = None
    """shape ``(H, W)``, bool: pixels of one surface and colour; None where the truth does not say."""
    kept: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False)
    """What several metrics ask for: encoded images and errors of pixels."""

    def shown(self, space: Space) -> tuple[np.ndarray, np.ndarray]:
        """Prediction and truth in a space of comparison."""
        if space not in self.kept:
            self.kept[space] = space(self.predicted, self.exposure), space(self.true, self.exposure)
        return self.kept[space]

    def errors(self, of: Errors, space: Space) -> np.ndarray:
        """The errors of the judged pixels, shape ``(N,)``."""
        if (of, space) not in self.kept:
            self.kept[of, space] = of(*self.shown(space), self.mask)
        return self.kept[of, space]

    def noise(self, space: Space) -> float | None:
        """Mean variance of the judged pixels in a space of comparison; None where it is not known."""
        if self.variance is None:
            return None
        key = "noise", space
        if key not in self.kept:
            true, variance = (values[self.mask] for values in (self.true, self.variance))
            self.kept[key] = mean_variance(true, variance, lambda x: space(x, self.exposure))
        return self.kept[key]


def measure(metric: ImageMetric, seen: Comparison) -> tuple[float, dict[str, float]]:
    """The value of one view, and the same by neighbouring rules; all before ``finish``.

    Raises:
        DatasetError: The images are too small for the metric.
    """
    value_of = metric.measure
    if not isinstance(value_of, Pixelwise):
        return value_of(*seen.shown(metric.space), seen.mask), {}
    spaces = value_of.spaces if isinstance(value_of, Bracketed) else (metric.space,)
    errors = reduce(np.maximum, (seen.errors(value_of.errors, space) for space in spaces))
    parts = {name: float(value_of.statistic(errors[of])) for name, of in _regions(seen).items() if of.any()}
    if metric.beside:
        name, space = metric.beside
        parts[name] = float(value_of.statistic(seen.errors(value_of.errors, space)))
    value = float(value_of.statistic(errors))
    if metric.noisy and seen.variance is not None and seen.variance.any():
        parts["debiased"] = value - (seen.noise(metric.space) or 0.0)
    return value, parts


def breakdown(
    metric: ImageMetric, values: Sequence[float], parts: Sequence[Mapping[str, float]]
) -> dict[str, float]:
    """The breakdown of a score from what :func:`measure` found in its views.

    A view without a part, as one whose every pixel is interior has no boundary, does not enter that part;
    the noise must be known of every view.

    Args:
        metric: What was measured.
        values: By view, before ``finish``.
        parts: By view, before ``finish``.
    """
    names = dict.fromkeys(name for view in parts for name in view)
    if not all("debiased" in view for view in parts):
        names.pop("debiased", None)
    means = {name: _mean([view[name] for view in parts if name in view]) for name in names}
    pooled = {name: metric.finish(max(mean, 0.0)) for name, mean in means.items()}
    if metric.finish is psnr:
        pooled["mean_of_views"] = _mean([psnr(value) for value in values])
    return pooled


def _regions(seen: Comparison) -> dict[str, np.ndarray]:
    """Which of the judged pixels belong to a region, each of shape ``(N,)``, bool."""
    if seen.pure is None:
        return {}
    inside = seen.pure[seen.mask]
    return {"interior": inside, "boundary": ~inside}


def _mean(values: Sequence[float]) -> float:
    return math.fsum(values) / len(values)

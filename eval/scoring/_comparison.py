# SPDX-License-Identifier: Apache-2.0
"""One layer of one view, predicted and true, with what several metrics compute from it."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from graycard.eval.measures._pixelwise import Errors
from graycard.eval.measures._spaces import Space
from graycard.eval.scoring._ceiling import mean_variance

REGIONS = "interior", "boundary"
"""Pixels of one surface and colour, and the others."""
NEIGHBOURS = (*REGIONS, "srgb", "linear", "mean_of_views", "debiased", "signed")
"""Names of neighbouring rules that mean the same in the breakdown of every metric."""


@dataclass(frozen=True, slots=True)
class LayerComparison:
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
    true_shown: dict[Space, np.ndarray] = field(default_factory=dict, repr=False, compare=False)
    """The truth in spaces of comparison; comparisons of one layer under several gauges share it."""
    kept: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False)
    """Encoded images and errors of pixels that were computed before."""

    def shown(self, space: Space) -> tuple[np.ndarray, np.ndarray]:
        """Return prediction and truth in a space of comparison."""
        if space not in self.kept:
            if space not in self.true_shown:
                self.true_shown[space] = space(self.true, self.exposure)
            self.kept[space] = space(self.predicted, self.exposure), self.true_shown[space]
        return self.kept[space]

    def errors(self, of: Errors, space: Space) -> np.ndarray:
        """Return the errors of the judged pixels, shape ``(N,)``."""
        if (of, space) not in self.kept:
            self.kept[of, space] = of(*self.shown(space), self.mask)
        return self.kept[of, space]

    def noise(self, space: Space) -> float | None:
        """Return the mean variance of the judged pixels in a space; None where it is not known."""
        if self.variance is None:
            return None
        key = "noise", space
        if key not in self.kept:
            true, variance = (values[self.mask] for values in (self.true, self.variance))
            self.kept[key] = mean_variance(true, variance, lambda x: space(x, self.exposure))
        return self.kept[key]

    def regions(self) -> dict[str, np.ndarray]:
        """Return which judged pixels belong to each region, ``(N,)``, bool; empty without pure pixels."""
        if self.pure is None:
            return {}
        if REGIONS not in self.kept:
            inside = self.pure[self.mask]
            self.kept[REGIONS] = dict(zip(REGIONS, (inside, ~inside), strict=True))
        return self.kept[REGIONS]

# SPDX-License-Identifier: Apache-2.0
"""What is left of a removed object, apart for where it stood, its shadow, its mirror image and the rest."""

import math
from dataclasses import dataclass

import numpy as np

from graycard.eval.measures._psnr import psnr
from graycard.eval.metrics._image_metric import display, exposed
from graycard.eval.metrics._view_metrics import Answer, ViewMetric
from graycard.eval.scoring._ceiling import mean_variance
from graycard.eval.scoring._readings import TrueView
from graycard.records import MetricRecord

LAYER = "counterfactual.radiance"
EFFECTS = ("footprint", "shadow", "mirror")
"""Regions by what the target does there; shadow and mirror image may overlap."""
WHERE = {
    "footprint": "where the object is seen",
    "shadow": "where the object takes direct light away",
    "mirror": "where the object is seen by reflection",
    "rest": "outside of footprint, shadow and mirror image",
}
BESIDE = (
    "A picture of one colour, as bright as what is around, holds next to nothing of the object either: read "
    "it beside counterfactual.psnr and counterfactual.psnr.rest"
)
"""What a reader of any share that is left has to know."""


@dataclass(frozen=True, slots=True)
class Removed:
    """What is asked of a removal in one region of one view, at the pixels of the region."""

    without: np.ndarray
    """True radiance without the object, shape ``(N, 3)``."""
    with_object: np.ndarray
    """True radiance with it."""
    region: np.ndarray
    """Which pixels they are, shape ``(H, W)``, bool."""
    exposure: float
    variance: np.ndarray | None
    """Of ``without``; None where it is not known."""


def residual_energy(
    predicted: np.ndarray, without: np.ndarray, with_object: np.ndarray, region: np.ndarray
) -> float:
    """How much of an object's effect is still in a picture: <p - c, o - c> / ‖o - c‖² over a region.

    The coefficient of the least squares fit of p - c by o - c. What the picture lacks in other ways, and is
    not alike the effect, does not enter.

    Args:
        predicted: p, the picture from which the object was removed, shape ``(..., 3)``.
        without: c, the true picture without the object, shape ``(..., 3)``, same unit.
        with_object: o, the true picture with it, shape ``(..., 3)``, same unit.
        region: shape ``(...)``, bool.

    Returns:
        0: the effect is gone; 1: it is still there; below 0: more was taken away than the object did.

    Raises:
        ValueError: The object changes nothing in the region.

    Example:
        >>> import numpy as np
        >>> dark, lit = np.full((2, 2, 3), 0.2), np.full((2, 2, 3), 0.6)
        >>> round(residual_energy(dark + 0.1, dark, lit, np.ones((2, 2), bool)), 3)
        0.25
    """
    effect = np.asarray(with_object, np.float64)[region] - without[region]
    left = np.asarray(predicted, np.float64)[region] - without[region]
    energy = float((effect**2).sum())
    if energy == 0:
        raise ValueError("expected a region in which the object changes something, got no change")
    return float((left * effect).sum()) / energy


def region_of(true: TrueView, name: str) -> np.ndarray:
    seen = true.mask(LAYER)
    if name != "rest":
        return seen & (true.take(f"effect.{name}") > 0.5)
    return seen & ~np.any([true.take(f"effect.{effect}") > 0.5 for effect in EFFECTS], axis=0)


def _asked(true: TrueView, exposure: float, name: str) -> Removed | None:
    region = region_of(true, name)
    if not region.any():
        return None
    variance = true.take(f"{LAYER}.var")[region] if f"{LAYER}.var" in true.layers else None
    without, with_object = (true.take(layer)[region].astype(np.float64) for layer in (LAYER, "radiance"))
    return Removed(without, with_object, region, exposure, variance)


def _asked_for_residual(true: TrueView, exposure: float, name: str) -> Removed | None:
    asked = _asked(true, exposure, name)
    if asked is None:
        return None
    o, c = exposed(asked.with_object, exposure), exposed(asked.without, exposure)
    return asked if (o != c).any() else None


def _square_error(predicted: np.ndarray, asked: Removed) -> Answer:
    p, t = (display(pixels, asked.exposure) for pixels in (predicted[asked.region], asked.without))
    return Answer(float(np.mean((p - t) ** 2)))


def _noise(asked: Removed) -> float | None:
    if asked.variance is None:
        return None
    return mean_variance(asked.without, asked.variance, lambda values: display(values, asked.exposure))


def _residual(predicted: np.ndarray, asked: Removed) -> Answer:
    seen = predicted[asked.region], asked.without, asked.with_object
    p, c, o = (exposed(pixels, asked.exposure) for pixels in seen)
    evidence = np.array([((p - c) * (o - c)).sum(), ((o - c) ** 2).sum()])
    return _left(evidence)._replace(evidence=evidence)


def _left(evidence: np.ndarray) -> Answer:
    """Of one view, or of all together: views in which the effect is faint say as little as they know."""
    left, energy = evidence.reshape(-1, 2).sum(axis=0).tolist()
    return Answer(abs(left / energy), {"signed": left / energy})


def _psnr_metric(region: str) -> ViewMetric:
    record = MetricRecord(
        f"counterfactual.psnr.{region}", f"Removal PSNR, {region}", "counterfactual", "dB", True, math.inf,
        "10·log10(1 / mean over views of MSE) of radiance without the target object as displayed, "
        f"srgb(L·exposure), {WHERE[region]}",
        headline=False, tolerance=0.5,
    )  # fmt: skip
    needs = LAYER, "effect.footprint", "effect.shadow", "effect.mirror"
    return ViewMetric(
        record,
        LAYER,
        needs,
        lambda true, exposure: _asked(true, exposure, region),
        _square_error,
        finish=psnr,
        ceiling=_noise,
    )


def _residual_metric(region: str) -> ViewMetric:
    record = MetricRecord(
        f"counterfactual.residual.{region}", f"Object left over, {region}", "counterfactual", "1", False, 0.0,
        "|Σ <p - c, o - c> / Σ ‖o - c‖²|, sums over views (prediction p, truth without object c, with it o; "
        f"linear, L·exposure clipped to [0, 1]) {WHERE[region]}: 0 gone, 1 still there. {BESIDE}",
        headline=False, tolerance=0.02,
    )  # fmt: skip
    needs = LAYER, f"effect.{region}"
    return ViewMetric(
        record,
        LAYER,
        needs,
        lambda true, exposure: _asked_for_residual(true, exposure, region),
        _residual,
        pool=_left,
    )


REMOVAL_METRICS: tuple[ViewMetric, ...] = (
    *(_psnr_metric(region) for region in (*EFFECTS, "rest")),
    *(_residual_metric(region) for region in EFFECTS),
)

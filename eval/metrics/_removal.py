# SPDX-License-Identifier: Apache-2.0
"""Residue of a removed object, apart for where it stood, its shadow, its mirror image and the rest."""

from dataclasses import dataclass

import numpy as np

from graycard.eval.kinds._metric import Metric
from graycard.eval.kinds._records import decibels, error
from graycard.eval.kinds._references import PSNR, RESIDUAL
from graycard.eval.kinds._views import ViewRule
from graycard.eval.measures._psnr import psnr
from graycard.eval.measures._spaces import display, exposed
from graycard.eval.scoring._ceiling import AS_DISPLAYED, PROJECTED, mean_variance
from graycard.eval.scoring._findings import Measurement
from graycard.eval.scoring._readings import TrueView

LAYER = "counterfactual.radiance"
EFFECTS = ("footprint", "shadow", "mirror")
"""Regions by what the target does there; shadow and mirror image may overlap."""
WHERE = {
    "footprint": "where the object is seen",
    "shadow": "where the object takes direct light away",
    "mirror": "where the object is seen by reflection",
    "rest": "outside of footprint, shadow and mirror image",
}
CAUTION = (
    "A picture of one colour, as bright as what is around, holds next to nothing of the object either: read "
    "it beside counterfactual.psnr and counterfactual.psnr.rest"
)
"""Warning to the reader of any share that is left."""
NOTE = f"counterfactual.residual.*: 0 the object is gone, 1 all of it is still there. {CAUTION}"
"""The same for a reader who sees only numbers, whose unit alone does not say what 1 is."""


@dataclass(frozen=True, slots=True)
class Removed:
    """The truth with and without the object in one region of one view, at the pixels of the region."""

    without: np.ndarray
    """True radiance without the object, shape ``(N, 3)``."""
    with_object: np.ndarray
    """True radiance with it."""
    region: np.ndarray
    """Judged pixels, shape ``(H, W)``, bool."""
    exposure: float
    variance: np.ndarray | None
    """Variance of ``without``; None where it is not known."""


def residual_energy(
    predicted: np.ndarray, without: np.ndarray, with_object: np.ndarray, region: np.ndarray
) -> float:
    """Return the share of an object's effect that is still in a picture: <p - c, o - c> / ‖o - c‖².

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

    Examples:
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
    """Return the judged pixels of a region of :data:`WHERE`, shape ``(H, W)``, bool."""
    seen = true.mask(LAYER)
    if name != "rest":
        return seen & (true.take(f"effect.{name}") > 0.5)
    return seen & ~np.any([true.take(f"effect.{effect}") > 0.5 for effect in EFFECTS], axis=0)


def _prepare(true: TrueView, exposure: float, name: str) -> Removed | None:
    region = region_of(true, name)
    if not region.any():
        return None
    variance = true.take(f"{LAYER}.var")[region] if f"{LAYER}.var" in true.layers else None
    without, with_object = (true.take(layer)[region].astype(np.float64) for layer in (LAYER, "radiance"))
    return Removed(without, with_object, region, exposure, variance)


def _prepare_residual(true: TrueView, exposure: float, name: str) -> Removed | None:
    removed = _prepare(true, exposure, name)
    if removed is None:
        return None
    o, c = exposed(removed.with_object, exposure), exposed(removed.without, exposure)
    return removed if (o != c).any() else None


def _square_error(predicted: np.ndarray, removed: Removed) -> Measurement:
    p, t = (display(pixels, removed.exposure) for pixels in (predicted[removed.region], removed.without))
    return Measurement(float(np.mean((p - t) ** 2)))


def _noise(removed: Removed) -> float | None:
    if removed.variance is None:
        return None
    return mean_variance(removed.without, removed.variance, lambda values: display(values, removed.exposure))


def _residual(predicted: np.ndarray, removed: Removed) -> Measurement:
    seen = predicted[removed.region], removed.without, removed.with_object
    p, c, o = (exposed(pixels, removed.exposure) for pixels in seen)
    evidence = np.array([((p - c) * (o - c)).sum(), ((o - c) ** 2).sum()])
    return _pool(evidence)._replace(evidence=evidence)


def _pool(evidence: np.ndarray) -> Measurement:
    """Return the share of one view, or of all together: a view with a faint effect has little weight."""
    left, energy = evidence.reshape(-1, 2).sum(axis=0).tolist()
    return Measurement(abs(left / energy), {"signed": left / energy})


def _psnr_metric(region: str) -> Metric[ViewRule]:
    return Metric(
        record=decibels(
            "counterfactual",
            f"psnr.{region}",
            f"Removal PSNR, {region}",
            "10·log10(1 / mean over views of MSE) of radiance without the target object as displayed, "
            f"srgb(L·exposure), {WHERE[region]}",
            tolerance=0.5,
        ),
        rule=ViewRule(
            (LAYER, *(f"effect.{effect}" for effect in EFFECTS)),
            lambda true, exposure: _prepare(true, exposure, region),
            _square_error,
            finish=psnr,
            noise=_noise,
        ),
        layers=(LAYER,),
        ceiling=AS_DISPLAYED,
        references=(PSNR,),
    )


def _residual_metric(region: str) -> Metric[ViewRule]:
    return Metric(
        record=error(
            "counterfactual",
            f"residual.{region}",
            f"Object left over, {region}",
            "|Σ <p - c, o - c> / Σ ‖o - c‖²|, sums over views (prediction p, truth without object c, with it "
            f"o; linear, L·exposure clipped to [0, 1]) {WHERE[region]}: 0 gone, 1 still there. {CAUTION}",
            tolerance=0.02,
        ),
        rule=ViewRule(
            (LAYER, f"effect.{region}"),
            lambda true, exposure: _prepare_residual(true, exposure, region),
            _residual,
            pool=_pool,
        ),
        layers=(LAYER,),
        ceiling=PROJECTED,
        references=(RESIDUAL,),
        breakdown=("signed",),
        note=NOTE,
    )


METRICS: tuple[Metric[ViewRule], ...] = (
    *(_psnr_metric(region) for region in (*EFFECTS, "rest")),
    *(_residual_metric(region) for region in EFFECTS),
)

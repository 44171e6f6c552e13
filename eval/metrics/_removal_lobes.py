# SPDX-License-Identifier: Apache-2.0
"""Residue of a removed object's mirror image apart from its shadow, and the other way round.

On a polished table both lie on the same pixels, and a method that takes one of them away leaves a share of
the whole that says little of either. The truth knows by which lobe each change of the light comes.
"""

from dataclasses import dataclass

import numpy as np

from graycard.eval.kinds._metric import Metric
from graycard.eval.kinds._records import error
from graycard.eval.kinds._references import RESIDUAL
from graycard.eval.kinds._views import ViewRule
from graycard.eval.measures._spaces import exposed
from graycard.eval.metrics._removal import CAUTION, LAYER, NOTE, WHERE, region_of
from graycard.eval.scoring._ceiling import PROJECTED
from graycard.eval.scoring._findings import Measurement
from graycard.eval.scoring._readings import TrueView

LEAST_APART = 0.2
"""Sine of the angle between two effects on a region up to which what is left is not told apart."""
_SPECULAR = "specular", "counterfactual.specular"
"""Layers of the specular light with the target and without it."""
_LOBES = {"mirror": "specular", "shadow": "diffuse"}
"""Lobe of the effect that gives a region its name."""


@dataclass(frozen=True, slots=True)
class LobeEffects:
    """An object's effects in one region of one view, at those of its pixels that are not overexposed."""

    without: np.ndarray
    """True radiance without the object, shape ``(N, 3)``, exposed."""
    effect: np.ndarray
    """Effect of the object on the light of the lobe, same shape, exposed."""
    other: np.ndarray
    """Effect on all other light."""
    region: np.ndarray
    """Judged pixels, shape ``(H, W)``, bool."""
    exposure: float


def effect_sums(left: np.ndarray, effect: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the sums that :func:`residual_share` needs; those of several views add up.

    Args:
        left: A prediction less the true picture without the object, any shape.
        effect: What the object changes by one way of light, same shape, same unit.
        other: What it changes by another way, likewise.

    Returns:
        Shape ``(5,)``: products of effect and effect, effect and other, other and other, left and effect,
        left and other.
    """
    pairs = (effect, effect), (effect, other), (other, other), (left, effect), (left, other)
    return np.array([float((np.asarray(a, np.float64) * b).sum()) for a, b in pairs])


def are_apart(sums: np.ndarray) -> bool:
    """Tell whether an effect is there, and unlike the other so that the two can be told apart.

    Of views of which each has it, all together have it too (Cauchy and Schwarz).

    Args:
        sums: Of :func:`effect_sums`, shape ``(5,)``.
    """
    energy, alike, of_other = sums[:3].tolist()
    return energy > 0 and energy * of_other - alike**2 >= LEAST_APART**2 * energy * of_other


def residual_share(sums: np.ndarray) -> float:
    """Return the share of one effect of an object that is still in a picture, where another overlaps it.

    The coefficient of the effect in the least squares fit of what is left by both effects together: the
    projection on that part of it which is not alike the other (Frisch and Waugh 1933).

    Args:
        sums: Of :func:`effect_sums`, shape ``(5,)``; of effects that :func:`are_apart`.

    Examples:
        >>> import numpy as np
        >>> shadow, mirrored = np.array([-0.2, -0.2, 0.0]), np.array([0.0, 0.1, 0.1])
        >>> round(residual_share(effect_sums(shadow + 0.25 * mirrored, mirrored, shadow)), 3)
        0.25
    """
    energy, alike, of_other, along, along_other = sums.tolist()
    slope = alike / of_other if of_other else 0.0
    return (along - slope * along_other) / (energy - slope * alike)


def _prepare(true: TrueView, exposure: float, name: str) -> LobeEffects | None:
    layers = (true.take(layer).astype(np.float64) for layer in ("radiance", LAYER, *_SPECULAR))
    with_object, without, present, emptied = (layer * exposure for layer in layers)
    region = region_of(true, name) & (np.maximum(with_object, without).max(axis=-1) <= 1)
    present, emptied, without = present[region], emptied[region], np.maximum(without, 0)
    specular = present - emptied
    diffuse = (with_object - without)[region] - specular
    effects = (specular, diffuse) if _LOBES[name] == "specular" else (diffuse, specular)
    if not are_apart(effect_sums(specular, *effects)):
        return None
    return LobeEffects(without[region], *effects, region, exposure)


def _compute(predicted: np.ndarray, effects: LobeEffects) -> Measurement:
    left = exposed(predicted[effects.region], effects.exposure) - effects.without
    sums = effect_sums(left, effects.effect, effects.other)
    return _pool(sums)._replace(evidence=sums)


def _pool(evidence: np.ndarray) -> Measurement:
    """Return the share of one view, or of all together."""
    share = residual_share(evidence.reshape(-1, 5).sum(axis=0))
    return Measurement(abs(share), {"signed": share})


def _metric(region: str) -> Metric[ViewRule]:
    lobe = _LOBES[region]
    return Metric(
        record=error(
            "counterfactual",
            f"residual.{region}.{lobe}",
            f"Object left over, {region}, {lobe} light",
            "|a| in the least squares fit p - c = a·d + b·e over all views (prediction p, truth without "
            f"object c, d what the object changes in {lobe} light, e in all other; linear, L·exposure, "
            f"pixels where no truth is overexposed) {WHERE[region]}: 0 gone, 1 still there, whatever is left "
            f"of the other; views where d and e are alike (sine of the angle up to {LEAST_APART:g}) are not "
            f"asked. {CAUTION}",
            tolerance=0.02,
        ),
        rule=ViewRule(
            (LAYER, f"effect.{region}", *_SPECULAR),
            lambda true, exposure: _prepare(true, exposure, region),
            _compute,
            pool=_pool,
        ),
        layers=(LAYER,),
        ceiling=PROJECTED,
        references=(RESIDUAL,),
        breakdown=("signed",),
        note=NOTE,
    )


METRICS: tuple[Metric[ViewRule], ...] = tuple(_metric(region) for region in _LOBES)

# SPDX-License-Identifier: Apache-2.0
"""What is left of a removed object's mirror image apart from its shadow, and the other way round.

On a polished table both lie on the same pixels, and a method that takes one of them away leaves a share of
the whole that says little of either. The truth knows by which lobe each change of the light comes.
"""

from dataclasses import dataclass

import numpy as np

from graycard.eval.metrics._image_metric import exposed
from graycard.eval.metrics._removal import BESIDE, LAYER, WHERE, region_of
from graycard.eval.metrics._view_metrics import Answer, ViewMetric
from graycard.eval.scoring._readings import TrueView
from graycard.records import MetricRecord

LEAST_APART = 0.2
"""Sine of the angle between two effects on a region up to which what is left is not told apart."""
_SPECULAR = "specular", "counterfactual.specular"
"""Layers of the specular light with the target and without it."""
_LOBES = {"mirror": "specular", "shadow": "diffuse"}
"""Which lobe the effect that gives a region its name is in."""


@dataclass(frozen=True, slots=True)
class LobeAsked:
    """What is asked in one region of one view, at those of its pixels that are not overexposed."""

    without: np.ndarray
    """True radiance without the object, shape ``(N, 3)``, exposed."""
    effect: np.ndarray
    """What the object changes in the light of the lobe, same shape, exposed."""
    other: np.ndarray
    """What it changes in all other light."""
    region: np.ndarray
    """Which pixels they are, shape ``(H, W)``, bool."""
    exposure: float


def effect_sums(left: np.ndarray, effect: np.ndarray, other: np.ndarray) -> np.ndarray:
    """What :func:`residual_share` needs of a view; sums of several views are those of all together.

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
    """Whether an effect is there, and not so much alike the other that nobody can tell them apart.

    Of views of which each has it, all together have it too (Cauchy and Schwarz).

    Args:
        sums: Of :func:`effect_sums`, shape ``(5,)``.
    """
    energy, alike, of_other = sums[:3].tolist()
    return energy > 0 and energy * of_other - alike**2 >= LEAST_APART**2 * energy * of_other


def residual_share(sums: np.ndarray) -> float:
    """How much of one effect of an object is still in a picture, where another one overlaps it.

    The coefficient of the effect in the least squares fit of what is left by both effects together: the
    projection on that part of it which is not alike the other (Frisch and Waugh 1933).

    Args:
        sums: Of :func:`effect_sums`, shape ``(5,)``; of effects that :func:`are_apart`.

    Example:
        >>> import numpy as np
        >>> shadow, mirrored = np.array([-0.2, -0.2, 0.0]), np.array([0.0, 0.1, 0.1])
        >>> round(residual_share(effect_sums(shadow + 0.25 * mirrored, mirrored, shadow)), 3)
        0.25
    """
    energy, alike, of_other, along, along_other = sums.tolist()
    slope = alike / of_other if of_other else 0.0
    return (along - slope * along_other) / (energy - slope * alike)


def _asked(true: TrueView, exposure: float, name: str) -> LobeAsked | None:
    layers = (true.take(layer).astype(np.float64) for layer in ("radiance", LAYER, *_SPECULAR))
    with_object, without, present, emptied = (layer * exposure for layer in layers)
    region = region_of(true, name) & (np.maximum(with_object, without).max(axis=-1) <= 1)
    present, emptied, without = present[region], emptied[region], np.maximum(without, 0)
    specular = present - emptied
    diffuse = (with_object - without)[region] - specular
    effects = (specular, diffuse) if _LOBES[name] == "specular" else (diffuse, specular)
    if not are_apart(effect_sums(specular, *effects)):
        return None
    return LobeAsked(without[region], *effects, region, exposure)


def _answer(predicted: np.ndarray, asked: LobeAsked) -> Answer:
    left = exposed(predicted[asked.region], asked.exposure) - asked.without
    sums = effect_sums(left, asked.effect, asked.other)
    return _share(sums)._replace(evidence=sums)


def _share(evidence: np.ndarray) -> Answer:
    """Of one view, or of all together."""
    share = residual_share(evidence.reshape(-1, 5).sum(axis=0))
    return Answer(abs(share), {"signed": share})


def _metric(region: str) -> ViewMetric:
    lobe = _LOBES[region]
    record = MetricRecord(
        f"counterfactual.residual.{region}.{lobe}",
        f"Object left over, {region}, {lobe} light",
        "counterfactual", "1", False, 0.0,
        "|a| in the least squares fit p - c = a·d + b·e over all views (prediction p, truth without object "
        f"c, d what the object changes in {lobe} light, e in all other; linear, L·exposure, pixels "
        f"where no truth is overexposed) {WHERE[region]}: 0 gone, 1 still there, whatever is left of the "
        f"other; views where d and e are alike (sine of the angle up to {LEAST_APART:g}) are not asked. "
        f"{BESIDE}",
        headline=False, tolerance=0.02,
    )  # fmt: skip
    needs = LAYER, f"effect.{region}", *_SPECULAR
    return ViewMetric(
        record, LAYER, needs, lambda true, exposure: _asked(true, exposure, region), _answer, pool=_share
    )


REMOVAL_LOBE_METRICS: tuple[ViewMetric, ...] = tuple(_metric(region) for region in _LOBES)

# SPDX-License-Identifier: Apache-2.0
"""Light that is baked into albedo: the slope of the log albedo error over the log of the true light.

A prediction that is the true albedo times (shading)^k has the slope k: 0 where nothing leaks, 1 where all
of the light does. Slopes are medians over pairs of pixels (Theil 1950, Sen 1968), not Huber's: they need no
scale of the errors, which is 0 for a perfect prediction, and no starting point; and three in ten pixels that
are wrong at will (other surfaces at an outline) do not move them far. All pairs would be too many, so each
pixel has one partner (Theil's incomplete method), by a rule without chance. Partners are of one object and
almost one albedo: a prediction without any light in it, as a constant, errs by the difference of two albedos,
and which of them lies in the brighter place is the scene's own matter.

Shading is diffuse light. Where specular light is more than a third of it, a photograph in the place of albedo
is wrong by what is mirrored, whose course along the shading is again the scene's own matter: such pixels tell
nothing about shading and are left out; highlights have a slope of their own, over the gloss.

Partners are of one view, and the median is over the pairs of all views together. A mean of medians would give
a view with fifty pairs, or with hardly any change of light, the weight of one with thousands.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from graycard.eval.kinds._metric import Metric
from graycard.eval.kinds._records import CHANNEL, error
from graycard.eval.kinds._references import Reference
from graycard.eval.kinds._views import ViewRule
from graycard.eval.scoring._ceiling import CERTAIN_SHADING
from graycard.eval.scoring._findings import Measurement
from graycard.eval.scoring._readings import TrueView

FLOOR = 1e-3
"""Reflectance below which an albedo counts as black: a logarithm would make a great error of it."""
LEAST_STEP = 0.1
"""Difference of the logarithms in a pair that can tell: 10 % of light."""
MOST_GLOSS = 1 / 3
"""Specular over diffuse light above which shading is not judged (of 1 + that, the geometric mean)."""
SAME_ALBEDO = 0.05
"""Width of the classes of the log of albedo in which a pixel looks for its partner."""
LEAST_PAIRS = 50
"""With fewer, a view says nothing."""
LEAST_REACH, SHARE_OF_SIDE = 4, 28
"""Pixels between the partners across an edge of light, and which part of the picture's smaller side, if that
is more: beyond the filter of the photograph and a small penumbra."""
_SIGMAS = 4
"""Standard deviations above 0 at which a shading is certain."""
_LEAST_LIGHT = 0.01
"""Share of display white below which diffuse light is too dark to tell a highlight by."""

_NO_LIGHT = 1e-12
"""W/m²/sr, so that nothing is divided by 0."""

LAYER = "base_color"


@dataclass(frozen=True, slots=True)
class Pairs:
    """Pairs of pixels that the light tells apart."""

    albedo: np.ndarray
    """The true one, shape ``(H·W, 3)``."""
    low: np.ndarray
    """Indices of the darker pixels, shape ``(N,)``."""
    high: np.ndarray
    """Indices of their brighter partners, shape ``(N,)``."""
    light: np.ndarray
    """Logs of the light, shape ``(H·W,)``."""


def median_slope(errors: np.ndarray, light: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
    """Return the median over pairs of (error_high - error_low) / (light_high - light_low).

    Args:
        errors: Log albedo errors, shape ``(N,)``.
        light: Logs of the true light, shape ``(N,)``.
        low: Index of one pixel of each pair.
        high: Index of the other, with other light.

    Examples:
        >>> import numpy as np
        >>> light = np.linspace(-2, 0, 101)
        >>> round(median_slope(0.3 * light, light, *partners(light)), 6)
        0.3
    """
    return float(np.median(slopes(errors, light, low, high)))


def slopes(errors: np.ndarray, light: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return (error_high - error_low) / (light_high - light_low), ``(N,)``; see :func:`median_slope`."""
    return (errors[high] - errors[low]) / (light[high] - light[low])


def partners(light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pair each pixel of the darker half with that half of all pixels further on, by rank of the light.

    Args:
        light: Logs of the light, shape ``(N,)``.

    Returns:
        Indices of the darker and of the brighter ones, each ``(N // 2,)``.
    """
    order, half = np.argsort(light, kind="stable"), len(light) // 2
    return order[:half], order[half : 2 * half]


def log_errors(predicted: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Mean over channels of log(predicted / true), each at least 0.001; shapes ``(N, 3)`` to ``(N,)``."""
    return np.log(np.maximum(predicted, FLOOR) / np.maximum(true, FLOOR)).mean(axis=-1)


def _over_the_mask(true: TrueView, exposure: float) -> Pairs | None:
    light, certain = true.once(_log_shading)
    inside = np.flatnonzero(_scatters(true).ravel() & certain & true.once(_dull))
    if not len(inside):
        return None
    ids, albedo = (values.ravel()[inside] for values in (true.take("object_id"), true.once(_log_albedo)))
    shades = np.floor(albedo / SAME_ALBEDO).astype(np.int64)
    classes = ids.astype(np.int64) * (np.ptp(shades) + 1) + shades - shades.min()
    order = np.argsort(classes, kind="stable")
    alike = np.split(inside[order], np.flatnonzero(np.diff(classes[order])) + 1)
    low, high = np.concatenate([[same[side] for side in partners(light[same])] for same in alike], axis=1)
    return _pairs(true, light, low, high)


def _across_shadow_edges(true: TrueView, exposure: float) -> Pairs | None:
    light, certain = true.once(_log_shading)
    edges = [_neighbours(visibility) for visibility in _visibilities(true)]
    wanted = [np.any(along, axis=0) for along in zip(*edges, strict=True)]
    return _local_pairs(true, light, certain & true.once(_dull), wanted)


def _neighbours(visibility: np.ndarray) -> list[np.ndarray]:
    """Mark where one partner sees nearly all of a light and the other nearly nothing, along each axis."""
    sides = [_sides(visibility, axis) for axis in (0, 1)]
    return [(np.maximum(a, b) > 0.75) & (np.minimum(a, b) < 0.25) for a, b in sides]


def _local_pairs(
    true: TrueView, light: np.ndarray, usable: np.ndarray, wanted: list[np.ndarray]
) -> Pairs | None:
    """Pairs of one object, a few pixels apart in a column or a row, where they are wanted."""
    ids = true.take("object_id")
    usable = usable.reshape(ids.shape) & _scatters(true)
    number, found = np.arange(ids.size).reshape(ids.shape), []
    for axis, chosen in enumerate(wanted):
        alike = np.equal(*_sides(ids, axis)) & np.logical_and(*_sides(usable, axis))
        found.append([side[chosen & alike] for side in _sides(number, axis)])
    one, other = np.concatenate(found, axis=1)
    darker = light[one] < light[other]
    return _pairs(true, light, np.where(darker, one, other), np.where(darker, other, one))


def _sides(image: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Pixels, and those that lie a few further along an axis."""
    along, reach = np.moveaxis(image, axis, 0), max(LEAST_REACH, min(image.shape[:2]) // SHARE_OF_SIDE)
    return along[:-reach], along[reach:]


def _scatters(true: TrueView) -> np.ndarray:
    """Mark where base colour is judged and is no metal's, which shading does not light, ``(H, W)``, bool."""
    mask = true.mask(LAYER)
    return mask & (true.take("metallic") < 0.5) if "metallic" in true.layers else mask


def _visibilities(true: TrueView) -> list[np.ndarray]:
    return [true.take(name) for name in true.layers if name.startswith("visibility.")]


def _at_highlights(true: TrueView, exposure: float) -> Pairs | None:
    diffuse, _ = true.once(_lobes)
    seen = np.all(diffuse * exposure > _LEAST_LIGHT, axis=-1)
    gloss = true.once(_log_gloss)
    shading, certain = true.once(_log_shading)
    alike = shading.reshape(gloss.shape), true.once(_log_albedo)
    wanted = []
    for axis in (0, 1):
        step, *others = (np.abs(np.subtract(*_sides(image, axis))) for image in (gloss, *alike))
        wanted.append(np.all([other < step / 4 for other in others], axis=0))
    return _local_pairs(true, gloss.ravel(), seen.ravel() & certain, wanted)


def _lobes(true: TrueView) -> tuple[np.ndarray, np.ndarray]:
    """Diffuse and specular light of all sources, each ``(H, W, 3)``, W/m²/sr."""
    names = [name.split(".") for name in true.layers]
    parts = [name for name in names if len(name) == 3 and name[0] in ("direct", "indirect")]
    diffuse, specular = (
        np.sum([true.take(".".join(name)) for name in parts if name[1] == lobe], axis=0)
        for lobe in ("diffuse", "specular")
    )
    return diffuse, specular


def _dull(true: TrueView) -> np.ndarray:
    """Mark where diffuse light far outweighs the specular, ``(H·W,)``, bool; anywhere without true lobes."""
    if not any(name.startswith("direct.specular.") for name in true.layers):
        return np.ones(true.take("object_id").size, bool)
    return true.once(_log_gloss).ravel() <= math.log1p(MOST_GLOSS)


def _log_gloss(true: TrueView) -> np.ndarray:
    """Mean over channels of log((diffuse + specular) / diffuse), ``(H, W)``: what baking it in would add."""
    diffuse, specular = true.once(_lobes)
    return np.log1p(np.maximum(specular, 0) / np.maximum(diffuse, _NO_LIGHT)).mean(axis=-1)


def _log_shading(true: TrueView) -> tuple[np.ndarray, np.ndarray]:
    """Mean over channels of the log of the shading, ``(H·W,)``, and where the noise leaves it certain."""
    shading = true.take("shading").astype(np.float64).reshape(-1, 3)
    variance = true.take("shading.var").reshape(-1, 3) if "shading.var" in true.layers else 0 * shading
    certain = np.all((shading > 0) & (shading >= _SIGMAS * np.sqrt(variance)), axis=-1, keepdims=True)
    return np.log(np.where(certain, shading, 1)).mean(axis=-1), certain[:, 0]


def _log_albedo(true: TrueView) -> np.ndarray:
    """Mean over channels of the log of base colour, ``(H, W)``."""
    return np.log(np.maximum(true.take(LAYER), FLOOR)).mean(axis=-1)


def _pairs(true: TrueView, light: np.ndarray, low: np.ndarray, high: np.ndarray) -> Pairs | None:
    tells = light[high] - light[low] > LEAST_STEP
    if tells.sum() < LEAST_PAIRS:
        return None
    return Pairs(true.take(LAYER).reshape(-1, 3), low[tells], high[tells], light)


def _compute(predicted: np.ndarray, pairs: Pairs) -> Measurement:
    errors = log_errors(predicted.reshape(-1, 3), pairs.albedo)
    return _pool(slopes(errors, pairs.light, pairs.low, pairs.high))


def _pool(found: np.ndarray) -> Measurement:
    """Return the slope of the pairs of a view, or of all views together."""
    slope = float(np.median(found))
    return Measurement(abs(slope), {"signed": slope}, found)


_THEIL_SEN = Reference("leakage slope", "scipy.stats.theilslopes over every pair", 1e-9)


def _metric(
    name: str, title: str, needs: tuple[str, ...], prepare: Callable[..., Pairs | None], where: str
) -> Metric[ViewRule]:
    return Metric(
        record=error(
            "albedo",
            name,
            title,
            "|median over the pairs of pixels of all views of Δ log(s_c·base_color / truth) / Δ log(light)|, "
            f"not metal, logs averaged over channels, Δ log(light) > 0.1; {where}: 0 no leak, 1 all baked in",
            tolerance=0.02,
            ignores=CHANNEL,
        ),
        rule=ViewRule((LAYER, *needs), prepare, _compute, pool=_pool),
        layers=(LAYER,),
        gauge="channel",
        refuses=("sign",),
        ceiling=CERTAIN_SHADING,
        references=(_THEIL_SEN,),
        breakdown=("signed",),
    )


_DULL = "with specular light of at most a third of the diffuse"
METRICS: tuple[Metric[ViewRule], ...] = (
    _metric(
        "leakage",
        "Light in albedo",
        ("shading",),
        _over_the_mask,
        f"light is the shading; pixels of one object and albedo (5 %) {_DULL}, half of their ranks apart",
    ),
    _metric(
        "leakage.shadow",
        "Shadows in albedo",
        ("shading", "visibility."),
        _across_shadow_edges,
        f"light is the shading; pixels of one object {_DULL}, a 28th of the side apart, one in a light, "
        "one not",
    ),
    _metric(
        "leakage.highlight",
        "Highlights in albedo",
        ("shading", "direct.diffuse.", "direct.specular."),
        _at_highlights,
        "light is (diffuse + specular) / diffuse; pixels of one object, a 28th of the side apart, in almost "
        "the same shading and true base_color",
    ),
)

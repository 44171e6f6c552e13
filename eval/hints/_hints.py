# SPDX-License-Identifier: Apache-2.0
"""Conventions that predictions mistake again and again, recognised by undoing each mistake.

Each hint is the test of one mistake. If the inverse of the mistake brings the prediction far closer to the
truth, in nearly all test views, a warning beside the score says so. No score is changed by it, and what fits
badly before and after, as an honest method does, draws none. Test views alone are looked at, as only they
are scored: a mistake that only the training views have shows in the gauge that is fitted on them.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from graycard import Camera, PredictionError, Predictions, Truth, angles, srgb_decode, srgb_encode
from graycard.eval.hints._lights import light_hints
from graycard.eval.hints._pictures import Looks, look, picture_hints
from graycard.eval.scoring._findings import SceneFacts
from graycard.eval.scoring._readings import PredictedView, TrueView
from graycard.records import Score

_RATIO = 0.4
"""The error after the inverse must be below this share of the error before."""
_AGREE = 0.8
"""Share of the views in which the inverse must bring the prediction closer."""
_PIXELS = 20_000
"""Judged pixels of a view that are looked at, about."""

SCORES = {
    "radiance": "novel_view.psnr",
    "base_color": "albedo.psnr.channel",
    "normal": "normal.mean_angle",
    "depth": "depth.abs_rel",
    "roughness": "roughness.mae",
    "counterfactual.radiance": "counterfactual.psnr",
}
"""The score beside which a hint about a layer stands."""


@dataclass(frozen=True, slots=True)
class Sight:
    """Camera and exposure, which a mistake may depend on, at the pixels that are looked at."""

    exposure: float
    camera_to_world: np.ndarray
    """Shape ``(3, 3)``: camera axes to the world's."""
    cosine: np.ndarray
    """Of the angle between the ray and the optical axis, shape ``(N, 1)``."""


Values = np.ndarray
"""Shape ``(N, C)``: a layer at the pixels that are looked at."""


@dataclass(frozen=True, slots=True)
class Suspicion:
    """One mistake that can be undone."""

    layer: str
    undo: Callable[[Values, Sight], Values]
    error: Callable[[Values, Values, Sight], float]
    limit: float
    """The error that must be undercut after the inverse."""
    says: str


def shape_error(predicted: Values, true: Values, sight: Sight) -> float:
    """Root of the relative square error after the best factor for each channel: no gain matters."""
    square = np.maximum((predicted**2).sum(axis=0), 1e-12)
    scaled = predicted * (predicted * true).sum(axis=0) / square
    return relative_error(scaled, true, sight)


def relative_error(predicted: Values, true: Values, sight: Sight) -> float:
    """Root of the square error over that of a black prediction."""
    return float(np.sqrt(((predicted - true) ** 2).sum() / max((true**2).sum(), 1e-12)))


def display_error(predicted: Values, true: Values, sight: Sight) -> float:
    """Root mean square error as displayed."""
    p, t = (srgb_encode(values * sight.exposure) for values in (predicted, true))
    return float(np.sqrt(np.mean((p - t) ** 2)))


def angle_error(predicted: Values, true: Values, sight: Sight) -> float:
    """Mean angle, degrees."""
    return float(angles(predicted, true).mean())


def median_ratio_error(predicted: Values, true: Values, sight: Sight) -> float:
    """Median of |p - t| / t: a few holes do not matter."""
    return float(np.median(np.abs(predicted - true) / true))


def absolute_error(predicted: Values, true: Values, sight: Sight) -> float:
    """Mean of |p - t|."""
    return float(np.abs(predicted - true).mean())


def _flip(*signs: float) -> Callable[[Values, Sight], Values]:
    return lambda p, sight: p * np.array(signs)


def _times(factor: float) -> Callable[[Values, Sight], Values]:
    return lambda p, sight: p * factor


def _group(
    layer: str,
    error: Callable[[Values, Values, Sight], float],
    limit: float,
    undone: Mapping[str, Callable[[Values, Sight], Values]],
) -> list[Suspicion]:
    return [Suspicion(layer, undo, error, limit, f"{layer} {says}") for says, undo in undone.items()]


SUSPICIONS: tuple[Suspicion, ...] = (
    *_group("base_color", shape_error, 0.3, {
        "looks sRGB-encoded: write linear values": lambda p, sight: srgb_decode(p),
        "looks like B, G, R: write R, G, B": lambda p, sight: p[:, ::-1],
    }),
    *_group("base_color", relative_error, 0.15, {
        "looks divided by π: write the reflectance itself": _times(np.pi),
        "looks multiplied by π: write the reflectance itself": _times(1 / np.pi),
        "looks like 0 to 255: write 0 to 1": _times(1 / 255),
    }),
    *_group("radiance", display_error, 0.1, {
        "looks as displayed (sRGB, exposed): write linear W/m²/sr":
            lambda p, sight: srgb_decode(p) / sight.exposure,
        "looks sRGB-encoded: write linear values": lambda p, sight: srgb_decode(p),
        "looks multiplied by the exposure: write W/m²/sr": lambda p, sight: p / sight.exposure,
        "looks divided by π: write radiance": _times(np.pi),
        "looks multiplied by π: write radiance": _times(1 / np.pi),
        "looks like B, G, R: write R, G, B": lambda p, sight: p[:, ::-1],
    }),
    *_group("normal", angle_error, 20.0, {
        "looks mirrored in x: try (-x, y, z)": _flip(-1, 1, 1),
        "looks mirrored in y: try (x, -y, z)": _flip(1, -1, 1),
        "looks mirrored in z: try (x, y, -z)": _flip(1, 1, -1),
        "looks turned inward: try -n": _flip(-1, -1, -1),
        "looks like y up: try (x, -z, y)": lambda p, sight: p[:, [0, 2, 1]] * (1, -1, 1),
        "looks like camera axes (x right, y down): rotate to the world": lambda p, sight: p
        @ sight.camera_to_world.T,
        "looks like camera axes (x right, y up): rotate to the world": lambda p, sight: (p * (1, -1, -1))
        @ sight.camera_to_world.T,
        "looks encoded as (n + 1) / 2: write n": lambda p, sight: 2 * p - 1,
    }),
    *_group("depth", median_ratio_error, 0.1, {
        "looks like distance along the ray: write z": lambda p, sight: p * sight.cosine,
        "looks like 1 / z: write z": lambda p, sight: 1 / np.maximum(p, 1e-9),
        "looks like millimetres: write metres": _times(1e-3),
        "looks like centimetres: write metres": _times(1e-2),
        "looks like kilometres: write metres": _times(1e3),
    }),
    *_group("roughness", absolute_error, 0.1, {
        "looks like alpha: write its square root": lambda p, sight: np.sqrt(np.maximum(p, 0)),
        "looks squared twice over: write the square root of alpha": lambda p, sight: p**2,
        "looks like glossiness: write 1 - p": lambda p, sight: 1 - p,
    }),
)  # fmt: skip


@dataclass(slots=True)
class Hints:
    """Errors before and after each inverse, gathered while the test views pass by."""

    errors: dict[Suspicion, list[tuple[float, float]]] = field(default_factory=dict)
    looks: list[Looks] = field(default_factory=list)

    def observe(self, predicted: PredictedView, true: TrueView, scene: SceneFacts) -> None:
        """Try every inverse on a view; what is not fit to be scored is passed over."""
        self.looks += [look(predicted, true, scene.exposure)]
        for layer in dict.fromkeys(s.layer for s in SUSPICIONS):
            seen = _values(layer, predicted, true, scene.exposure)
            if seen is not None:
                self._try(layer, *seen)

    def _try(self, layer: str, predicted: Values, true: Values, sight: Sight) -> None:
        before: dict[object, float] = {}
        for suspicion in (s for s in SUSPICIONS if s.layer == layer):
            error = suspicion.error
            if error not in before:
                before[error] = error(predicted, true, sight)
            after = error(suspicion.undo(predicted, sight), true, sight)
            self.errors.setdefault(suspicion, []).append((before[error], after))

    def found(self, predictions: Predictions, truth: Truth) -> dict[str, tuple[str, ...]]:
        """Return hints by the id of the score that they belong to."""
        hints = [(SCORES[layer], says) for layer, says in _convincing(self.errors)]
        hints += [(SCORES[layer], says) for layer, says in picture_hints(self.looks)]
        hints += light_hints(predictions, truth)
        return {score: tuple(s for id_, s in hints if id_ == score) for score in dict(hints)}


def with_hints(scores: Iterable[Score], found: Mapping[str, tuple[str, ...]]) -> tuple[Score, ...]:
    """Return the scores with the hints among their warnings."""
    return tuple(replace(s, warnings=s.warnings + found.get(s.metric, ())) for s in scores)


def _values(
    layer: str, predicted: PredictedView, true: TrueView, exposure: float
) -> tuple[Values, Values, Sight] | None:
    if layer not in predicted.layers or layer not in true.layers:
        return None
    mask = true.mask(layer)
    try:
        values = predicted.take(layer, mask)
    except PredictionError:
        return None
    if layer == "depth":
        mask = mask & np.isfinite(values)
    chosen = np.flatnonzero(mask)[:: max(1, int(mask.sum()) // _PIXELS)]
    if not len(chosen):
        return None
    camera = true.view.camera
    p, t = (v.reshape(mask.size, -1)[chosen].astype(np.float64) for v in (values, true.take(layer)))
    return p, t, Sight(exposure, camera.camera_to_world[:3, :3], _cosines(camera, chosen))


def _cosines(camera: Camera, pixels: np.ndarray) -> np.ndarray:
    """Cosines of the angles between rays and the optical axis, shape ``(N, 1)``, of pixels row by row."""
    rows, columns = np.divmod(pixels, camera.width)
    centres = np.stack([columns + 0.5, rows + 0.5, np.ones(len(pixels))], axis=-1)
    return 1 / np.linalg.norm(centres @ np.linalg.inv(camera.K).T, axis=-1, keepdims=True)


def _convincing(errors: Mapping[Suspicion, list[tuple[float, float]]]) -> list[tuple[str, str]]:
    """For each layer the mistake whose inverse comes closest, if that is clear."""
    best: dict[str, tuple[float, str]] = {}
    for suspicion, found in errors.items():
        before, after = np.array(found).T
        share = float(after.mean() / before.mean()) if before.mean() > 0 else 1.0
        clear = share < _RATIO and after.mean() < suspicion.limit and np.mean(after < before) >= _AGREE
        if clear and share < best.get(suspicion.layer, (1.0, ""))[0]:
            numbers = f"(error {before.mean():.2g} before, {after.mean():.2g} after)"
            best[suspicion.layer] = share, f"{suspicion.says} {numbers}"
    return [(layer, says) for layer, (_, says) in best.items()]

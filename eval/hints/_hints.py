# SPDX-License-Identifier: Apache-2.0
"""Conventions that predictions mistake again and again, recognised by undoing each mistake.

Each hint is the test of one mistake. If the inverse of the mistake brings the prediction far closer to the
truth, in nearly all test views, a warning beside the score says so. No score is changed by it, and what fits
badly before and after, as an honest method does, draws none. Test views alone are looked at, as only they
are scored: a mistake that only the training views have shows in the gauge that is fitted on them.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from graycard import Camera, PredictionError, Predictions, Truth
from graycard.eval.hints._lights import light_hints
from graycard.eval.hints._pictures import Looks, look, picture_hints
from graycard.eval.hints._scales import Scale, scale_hints, scale_of
from graycard.eval.hints._suspicions import SUSPICIONS, Sight, Suspicion, Values
from graycard.eval.scoring._findings import SceneFacts
from graycard.eval.scoring._readings import PredictedView, TrueView
from graycard.records import Score

_RATIO = 0.4
"""The error after the inverse must be below this share of the error before."""
_AGREE = 0.8
"""Share of the views in which the inverse must bring the prediction closer."""
_SHORT, _LONG = 0.5, 1.75
"""Median lengths of normals between which noise may have moved them."""
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
class Hint:
    """One mistake that a layer looks like."""

    layer: str
    says: str
    declare: str = ""
    """Word for `graycard adopt` to declare of the layer instead; empty where nothing would help."""


@dataclass(slots=True)
class Hints:
    """Errors before and after each inverse, gathered while the test views pass by."""

    errors: dict[Suspicion, list[tuple[float, float]]] = field(default_factory=dict)
    looks: list[Looks] = field(default_factory=list)
    scales: list[Scale] = field(default_factory=list)
    lengths: list[float] = field(default_factory=list)
    """Median length of the normals of each view."""

    def observe(self, predicted: PredictedView, true: TrueView, scene: SceneFacts) -> None:
        """Try every inverse on a view; what is not fit to be scored is passed over."""
        self.looks += [look(predicted, true, scene.exposure)]
        for layer in dict.fromkeys(s.layer for s in SUSPICIONS):
            seen = _values(layer, predicted, true, scene.exposure)
            if seen is not None:
                self._try(layer, *seen)

    def _try(self, layer: str, predicted: Values, true: Values, sight: Sight) -> None:
        if layer == "depth":
            self.scales.append(scale_of(predicted, true))
        if layer == "normal":
            self.lengths.append(float(np.median(np.linalg.norm(predicted, axis=-1))))
        before: dict[object, float] = {}
        for suspicion in (s for s in SUSPICIONS if s.layer == layer):
            error = suspicion.error
            if error not in before:
                before[error] = error(predicted, true, sight)
            after = error(suspicion.undo(predicted, sight), true, sight)
            self.errors.setdefault(suspicion, []).append((before[error], after))

    def found(self, predictions: Predictions, truth: Truth) -> dict[str, tuple[str, ...]]:
        """Return hints by the id of the score that they belong to."""
        hints = [(SCORES[hint.layer], hint.says) for hint in self.of_layers()]
        hints += light_hints(predictions, truth)
        return {score: tuple(s for id_, s in hints if id_ == score) for score in dict(hints)}

    def of_layers(self) -> list[Hint]:
        """Return hints about layers: of single pixels, of whole pictures, and of one factor on all depths."""
        found = _convincing(self.errors)
        if not any(hint.layer == "depth" for hint in found):
            found += [Hint("depth", says, declare) for says, declare in scale_hints(self.scales)]
        if not any(hint.layer == "normal" for hint in found):
            found += _length_hints(self.lengths)
        return found + [Hint(layer, says, declare) for layer, says, declare in picture_hints(self.looks)]


def _length_hints(lengths: list[float]) -> list[Hint]:
    """Return a hint if normals have no unit length, which a wrong code or factor leaves behind."""
    middle = float(np.median(lengths)) if lengths else 1.0
    if _SHORT < middle < _LONG:
        return []
    longer = "longer" if middle > 1 else "shorter"
    says = f"normal is not of unit length: half of the normals are {longer} than {middle:.3g}"
    return [Hint("normal", says, "coded where values are (n + 1) / 2, and no codes or times=")]


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


def _convincing(errors: Mapping[Suspicion, list[tuple[float, float]]]) -> list[Hint]:
    """For each layer the mistake whose inverse comes closest, if that is clear."""
    best: dict[str, tuple[float, Hint]] = {}
    for suspicion, found in errors.items():
        before, after = np.array(found).T
        share = float(after.mean() / before.mean()) if before.mean() > 0 else 1.0
        clear = share < _RATIO and after.mean() < suspicion.limit and np.mean(after < before) >= _AGREE
        if clear and share < best.get(suspicion.layer, (1.0, None))[0]:
            numbers = f"(error {before.mean():.2g} before, {after.mean():.2g} after)"
            hint = Hint(suspicion.layer, f"{suspicion.says} {numbers}", suspicion.declare)
            best[suspicion.layer] = share, hint
    return [hint for _, hint in best.values()]

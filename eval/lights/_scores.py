# SPDX-License-Identifier: Apache-2.0
"""Scores of the predicted lights of a scene that have a place."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from graycard import Camera, EnvironmentLight, Light, LocalLight, PredictionError, Predictions, Truth
from graycard.eval.lights._errors import LightMatch, intensity_error, match_lights
from graycard.eval.lights._metrics import LIGHT_METRICS, MISSED
from graycard.eval.lights._shapes import axis_of, chromaticity_error, direction_error, extent_error, radius_of
from graycard.eval.protocols import PROTOCOL
from graycard.eval.scoring._gauge import Factors
from graycard.records import MetricRecord, Score, Status

INDEX = "lights.json"


@dataclass(frozen=True, slots=True)
class Case:
    """The lights of a scene, predicted and true, matched."""

    predicted: Sequence[LocalLight]
    true: Sequence[LocalLight]
    cameras: Sequence[Camera]
    diameter: float
    gauge: Factors | str
    """What light gains where albedo loses, or why that is not known."""
    match: LightMatch

    @property
    def pairs(self) -> list[tuple[LocalLight, LocalLight]]:
        """Predicted and true."""
        return [(self.predicted[i], self.true[j]) for i, j in self.match.pairs]


Error = Callable[[LocalLight, LocalLight, Case], float]
"""Of a predicted light against its true partner."""


@dataclass(frozen=True, slots=True)
class Rule:
    """How one number is made from matched lights."""

    judges: Callable[[LocalLight], bool]
    """Which true lights."""
    error: Error | None = None
    """Averaged over those lights; None for what looks at all lights together."""
    price: float = 0.0
    """What a true light without a partner counts, and the most that one with a partner does."""
    together: Callable[[Case], float] | None = None
    empty: bool = False
    """Whether it says something of a scene without such lights."""


def _any(light: LocalLight) -> bool:
    return True


def _position(case: Case) -> float:
    near = [min(distance / case.diameter, 1.0) for distance in case.match.distances]
    unmatched = case.match.missing + case.match.extra
    return 100 * (sum(near) + unmatched) / (len(near) + unmatched)


def _gauged_intensity(predicted: LocalLight, true: LocalLight, case: Case) -> float:
    if isinstance(case.gauge, str):
        raise PredictionError(case.gauge)
    return intensity_error(predicted, true, case.gauge)


def _rule(price: float, error: Error, judges: Callable[[LocalLight], bool] = _any) -> Rule:
    return Rule(judges, error, price)


_RULES: dict[str, Rule] = {
    "light.position": Rule(_any, together=_position),
    "light.intensity": _rule(MISSED["light.intensity"], lambda p, t, case: intensity_error(p, t)),
    "light.intensity.channel": _rule(MISSED["light.intensity.channel"], _gauged_intensity),
    "light.chromaticity": _rule(
        MISSED["light.chromaticity"],
        lambda p, t, case: chromaticity_error(p, t),
        lambda light: bool(light.axial_intensity.any()),
    ),
    "light.direction": _rule(
        MISSED["light.direction"],
        lambda p, t, case: direction_error(p, t, case.cameras),
        lambda light: bool(axis_of(light).any()),
    ),
    "light.extent": _rule(
        MISSED["light.extent"],
        lambda p, t, case: extent_error(p, t),
        lambda light: radius_of(light) > 0,
    ),
    "light.missing": Rule(_any, together=lambda case: float(case.match.missing), empty=True),
    "light.extra": Rule(_any, together=lambda case: float(case.match.extra), empty=True),
}


def score_lights(
    predictions: Predictions, truth: Truth, gauge: Factors | str = (1.0, 1.0, 1.0)
) -> list[Score]:
    """All light scores, in the order of the table.

    A scene without local lights has only counts, one without axes no directions, and so on. A true light
    without a partner counts as :data:`graycard.eval.lights._metrics.MISSED` says, in every score.

    Args:
        predictions: What is scored.
        truth: What it is scored by.
        gauge: Factors (R, G, B) on predicted light, or why they are not known.

    Raises:
        DatasetError: The true lights are missing or broken.
    """
    true = local(truth.lights())
    records = [r for r in LIGHT_METRICS if _RULES[r.id].empty or any(map(_RULES[r.id].judges, true))]
    try:
        lights = predicted_lights(predictions)
    except PredictionError as cause:
        return [light_score(r, _judged(r, true), "failed", reason=str(cause)) for r in records]
    if lights is None:
        reason = f"there is no {INDEX}"
        return [light_score(r, _judged(r, true), "not provided", reason=reason) for r in records]
    cameras = [v.camera for v in truth.views if v.split == "test"]
    predicted = local(lights)
    match = match_lights(predicted, true, cameras)
    case = Case(predicted, true, cameras, truth.diameter, gauge, match)
    return [_judge(r, _RULES[r.id], case) for r in records]


def true_names(predictions: Predictions, truth: Truth) -> dict[str, str] | None:
    """Names of true lights by those of the predicted ones that stand for them.

    Local lights by least sum of distances, environments in their order. None where no lights are predicted,
    or none that can be read: then names stand as they are.

    Raises:
        DatasetError: The true lights are missing or broken.
    """
    try:
        lights = predicted_lights(predictions)
    except PredictionError:
        return None
    if not lights:
        return None
    true = truth.lights()
    p, t = local(lights), local(true)
    cameras = [v.camera for v in truth.views if v.split == "test"]
    names = {p[i].name: t[j].name for i, j in match_lights(p, t, cameras).pairs}
    return names | {a.name: b.name for a, b in zip(distant(lights), distant(true), strict=False)}


def predicted_lights(predictions: Predictions) -> tuple[Light, ...] | None:
    """The predicted lights; None where there are none.

    Raises:
        PredictionError: They are broken, or have a place or an intensity that is not finite.
    """
    lights = predictions.lights()
    for light in local(lights or ()):
        _check(light)
    return lights


def local(lights: Iterable[Light]) -> list[LocalLight]:
    """The lights that have a place."""
    return [light for light in lights if not isinstance(light, EnvironmentLight)]


def distant(lights: Iterable[Light]) -> list[EnvironmentLight]:
    """The lights that have none."""
    return [light for light in lights if isinstance(light, EnvironmentLight)]


def _check(light: LocalLight) -> None:
    for name, values in (("position", light.position), ("intensity", light.axial_intensity)):
        if not np.isfinite(values).all():
            raise PredictionError(
                f"expected light {light.name!r} with a finite {name}, got {np.asarray(values).tolist()}. "
                f"Mend {INDEX}"
            )


def _judged(record: MetricRecord, true: Iterable[LocalLight]) -> int:
    """How many of the true lights a metric asks for."""
    return sum(map(_RULES[record.id].judges, true))


def _judge(record: MetricRecord, rule: Rule, case: Case) -> Score:
    judged = _judged(record, case.true)
    pairs = [(p, t) for p, t in case.pairs if rule.judges(t)]
    alone = judged - len(pairs)
    try:
        value = _value(rule, pairs, alone, case)
    except PredictionError as cause:
        return light_score(record, judged, "failed", reason=str(cause))
    unmatched = ()
    if rule.error and alone:
        unmatched = (f"{alone} of {judged} lights have no partner; each counts {rule.price:g} {record.unit}",)
    score = light_score(record, judged, "scored", value=value, scored=len(pairs), warnings=unmatched)
    gauged = rule.error is _gauged_intensity and not isinstance(case.gauge, str)
    return replace(score, gauge=case.gauge) if gauged else score


def _value(rule: Rule, pairs: Sequence[tuple[LocalLight, LocalLight]], alone: int, case: Case) -> float:
    if rule.error:
        errors = [min(rule.error(p, t, case), rule.price) for p, t in pairs]
        return float(np.mean([*errors, *[rule.price] * alone]))
    assert rule.together is not None
    return rule.together(case)


def light_score(
    record: MetricRecord,
    expected: int,
    status: Status,
    *,
    value: float | None = None,
    scored: int = 0,
    reason: str = "",
    warnings: tuple[str, ...] = (),
) -> Score:
    """A score that is not made of views: ``expected`` and ``scored`` count lights."""
    return Score(
        record.id,
        PROTOCOL,
        status,
        value,
        record.unit,
        record.higher_is_better,
        record.optimum,
        expected=expected,
        scored=scored,
        reason=reason,
        warnings=warnings,
    )

# SPDX-License-Identifier: Apache-2.0
"""Every metric and protocol ignores the gauge groups that it declares, and no other."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import Phase, find, given, settings
from hypothesis import strategies as st

import graycard.eval as ge
from graycard import Camera, Light, PredictionError, SphereLight, SpotLight, View, look_at
from graycard.eval.kinds._changed import ChangedMetric, ChangedPicture, ChangedRule, judge_picture
from graycard.eval.kinds._images import ImageMetric, ImageRule, judge
from graycard.eval.kinds._lights import LightRule, score_lights
from graycard.eval.kinds._metric import Metric
from graycard.eval.kinds._sets import SetMetric, SetRule, SetScorer
from graycard.eval.kinds._views import ViewRule, judge_view
from graycard.eval.lights._spheres import render_spheres
from graycard.eval.metrics._environment import EnvironmentRule
from graycard.eval.metrics._light_off import LightsOffRule, LightsOffScorer
from graycard.eval.metrics._removal import EFFECTS
from graycard.eval.metrics._training_view import TrainingRule, TrainingScorer
from graycard.eval.protocols import PUBLISHED, JudgedView, JudgedViews, LpipsProtocol, PublishedProtocol
from graycard.eval.scoring._findings import SceneFacts
from graycard.eval.scoring._readings import PredictedView, TrueView
from graycard.eval.scoring._training import REFLECTANCES, Fit, Training, fit_gauges
from graycard.layers import LOBES, PARTS
from graycard.networks import has_lpips
from graycard.records import Invariance

RNG = np.random.default_rng(77)
SHAPE = 32, 34, 3
CAMERA = Camera.from_fov(34, 32, 50, look_at(np.array([0.0, -3, 1]), np.zeros(3)))
VIEW = View("test_000", "test", CAMERA)
COLOR = RNG.uniform(0.1, 0.5, SHAPE)
TRUE = {
    "radiance": RNG.uniform(0.05, 0.7, SHAPE),
    "counterfactual.radiance": RNG.uniform(0.05, 0.7, SHAPE),
    "base_color": COLOR,
    "diffuse_reflectance": COLOR * 0.8,
    "albedo": COLOR * 0.9,
    "normal": RNG.normal(size=SHAPE) / 2,
    "object_id": np.ones(SHAPE[:2], np.uint32),
    "depth": RNG.uniform(1, 2, SHAPE[:2]),
    "f0": RNG.uniform(0.2, 0.8, SHAPE),
    "roughness": RNG.uniform(0.2, 0.8, SHAPE[:2]),
    "glossy": RNG.integers(0, 2, SHAPE[:2]).astype(float),
    "metallic": RNG.uniform(0.2, 0.8, SHAPE[:2]),
    "shading": RNG.uniform(0.2, 2, SHAPE),
    "irradiance.lamp": RNG.uniform(0.5, 6, SHAPE),
    "radiance.lamp": RNG.uniform(0.05, 0.7, SHAPE),
    **{part: RNG.uniform(0.05, 0.7, SHAPE) for part in (*LOBES, *PARTS)},
}
PREDICTED = {k: v * RNG.uniform(0.7, 1.2, v.shape) for k, v in TRUE.items() if k != "object_id"}
RECEIVED = ("shading", "irradiance.lamp")
"""Light loses what albedo gains, so that the photographs stay as they are."""
LIT = np.repeat(RNG.integers(0, 2, (SHAPE[0], SHAPE[1] // 2)), 2, axis=1).astype(float)
MIRRORED = ("specular", "counterfactual.specular")
BESIDE = {
    "radiance.var": np.full(SHAPE, 1e-4),
    "counterfactual.radiance.var": np.full(SHAPE, 1e-4),
    "base_color": np.full(SHAPE, 0.3),
    "shading": np.where(LIT[..., None] > 0, 1.0, 0.3) * np.ones(SHAPE),
    "visibility.lamp": LIT,
    "direct.diffuse.lamp": RNG.uniform(0.2, 0.3, SHAPE),
    "direct.specular.lamp": RNG.uniform(0, 0.13, SHAPE),
    **{name: np.random.default_rng(5).uniform(0, 0.1, (2, *SHAPE))[k] for k, name in enumerate(MIRRORED)},
    **{f"effect.{name}": RNG.integers(0, 2, SHAPE[:2]).astype(float) for name in EFFECTS},
}
"""Layers that metrics with rules of their own ask the truth for."""
LIGHTS = tuple(
    SpotLight(f"s{i}", (float(i), 0.2 * i, 1.0), (0.1 * i, 0.2, -1), (3.0, 2.0, 1.0 + i), 20, 30)
    for i in range(3)
)
SPHERE = SphereLight("s3", (5.0, 0.0, 1.0), 0.2, (3.0, 2.0, 4.0))
SKY = RNG.uniform(0.1, 2, (8, 16, 3))

GAIN = st.floats(0.3, 5)
CHANGES: dict[Invariance, st.SearchStrategy[np.ndarray]] = {
    "global gain": GAIN.map(lambda g: np.full(3, g)),
    "channel gain": st.tuples(GAIN, GAIN, GAIN).map(np.array),
    "sign": st.just(np.full(3, -1.0)),
}
"""Each element of a group as factors for the three channels."""
ONCE = settings(max_examples=8, database=None, deadline=None, phases=(Phase.generate,))
"""One example that differs is a proof; it need not be made small."""
CASES: tuple[Invariance, ...] = get_args(Invariance)


def acted_on(name: str, values: np.ndarray, factors: np.ndarray) -> np.ndarray:
    """Return a layer under an element of a group; a layer of one channel takes the first factor."""
    scale = factors if values.ndim == 3 else factors[0]
    return values / scale if name in RECEIVED else values * scale


def gauges_of(layers: dict[str, np.ndarray]) -> Training:
    mask = np.ones(SHAPE[:2], bool)
    fits = {name: Fit((ge.moments(layers[name], TRUE[name], mask),)) for name in REFLECTANCES}
    return Training(frozenset(layers), (), fits)


def image_score(metric: ImageMetric, factors: np.ndarray) -> float | None:
    """The value of one view whose prediction, also in training, is multiplied; None where it failed."""
    layers = multiplied(factors)
    true = TrueView(VIEW, TRUE, frozenset(), frozenset({1}))
    each = replace(metric, layers=tuple(layer.replace("<light>", "lamp") for layer in metric.layers))
    return judge(each, PredictedView(VIEW, layers), true, scene_of(layers), {}).value


def multiplied(factors: np.ndarray) -> dict[str, np.ndarray]:
    return {name: acted_on(name, values, factors) for name, values in PREDICTED.items()}


def scene_of(layers: dict[str, np.ndarray]) -> SceneFacts:
    training = gauges_of(layers)
    return SceneFacts(1.2, training, fit_gauges(training))


def view_score(metric: Metric[ViewRule], factors: np.ndarray) -> float | None:
    """The value of one view by a rule of its own, as ``image_score``."""
    layers = multiplied(factors)
    true = TrueView(VIEW, TRUE | BESIDE, frozenset())
    finding = judge_view(metric, PredictedView(VIEW, layers), true, scene_of(layers))
    assert finding is not None, "the view has something to judge"
    return finding.value


def changed_score(metric: ChangedMetric, factors: np.ndarray) -> float | None:
    """The value of one picture of a changed scene, whose albedo is multiplied as well."""
    layers = multiplied(factors)
    mask, changed = np.ones(SHAPE[:2], bool), {"radiance": layers["counterfactual.radiance"]}
    truth = {"radiance": TRUE["counterfactual.radiance"]}
    picture = ChangedPicture("e", metric.rule.kind, VIEW, truth, lambda: changed, mask)
    return judge_picture([metric], picture, scene_of(layers))[metric.id].value


def set_score(metric: SetMetric, factors: np.ndarray) -> float | None:
    """The value of three views, each turned another way."""
    layers = multiplied(factors)
    scorer = SetScorer([metric], scene_of(layers))
    for turn in range(3):
        view = replace(VIEW, name=f"test_{turn:03d}")
        predicted, true = (
            {name: np.roll(values, 9 * turn, axis=1) for name, values in each.items()}
            for each in (layers, TRUE)
        )
        scorer.observe(PredictedView(view, predicted), TrueView(view, true, frozenset()), scorer.scene)
    (score,) = scorer.scores()
    return score.value


def off_score(metric: Metric[LightsOffRule], factors: np.ndarray) -> float | None:
    """The value of one view with the lamp switched off."""
    layers = multiplied(factors)
    lamp = {"radiance.lamp": TRUE["radiance"] * TRUE["radiance.lamp"]}
    share = {"radiance.lamp": layers["radiance"] * PREDICTED["radiance.lamp"] / 1.2}
    scorer = LightsOffScorer([metric], ["lamp"])
    true, predicted = TrueView(VIEW, TRUE | lamp, frozenset()), PredictedView(VIEW, layers | share)
    scorer.observe(predicted, true, scene_of(layers))
    (score,) = scorer.scores()
    return score.value


def training_score(metric: Metric[TrainingRule], factors: np.ndarray) -> float | None:
    """The value of one training view."""
    p, t = (np.clip(layers["radiance"], 0, 1) for layers in (multiplied(factors), TRUE))
    training = Training(frozenset({"radiance"}), (), {}, {"train_000": float(np.mean((p - t) ** 2))})
    (score,) = TrainingScorer([metric], training).scores()
    return score.value


@dataclass(frozen=True)
class Stub:
    """Answers that light scores ask predictions and truth for."""

    found: tuple[Light, ...]
    views: tuple[View, ...] = (VIEW,)
    diameter: float = 5.0

    def lights(self) -> tuple[Light, ...]:
        return self.found


def light_score(metric: Metric[LightRule], factors: np.ndarray) -> float | None:
    """The value for lights whose intensity is multiplied, and albedo divided, by what the group says."""
    colors = [np.array(light.intensity) * (1.1, 1.0, 0.9) * factors for light in LIGHTS]
    shifted = [
        replace(light, position=(light.position[0], 0.1, 1.2), direction=(0, 0, -1), intensity=tuple(color))
        for light, color in zip(LIGHTS, np.array(colors).tolist(), strict=True)
    ]
    radiance = tuple((np.array(SPHERE.radiance) * (1.1, 1.0, 0.9) * factors).tolist())
    found = (*shifted, replace(SPHERE, radiance=radiance, radius=0.3))
    gauge = fit_gauges(gauges_of({name: PREDICTED[name] / factors for name in REFLECTANCES}))["light"]
    (score,) = score_lights([metric], Stub(found), Stub((*LIGHTS, SPHERE)), gauge)  # pyright: ignore[reportArgumentType]
    return score.value


def environment_score(metric: Metric[EnvironmentRule], factors: np.ndarray) -> float | None:
    blurred = np.roll(SKY, 1, axis=1) * (1.1, 1.0, 0.8)
    try:
        return metric.rule.compare(render_spheres(blurred * factors), render_spheres(SKY)).value
    except PredictionError:
        return None


SCORES: dict[type, Callable[..., float | None]] = {
    ImageRule: image_score,
    ViewRule: view_score,
    SetRule: set_score,
    LightsOffRule: off_score,
    ChangedRule: changed_score,
    TrainingRule: training_score,
    LightRule: light_score,
    EnvironmentRule: environment_score,
}
"""Judges of a made-up prediction, by the kind of metric."""


SCORABLE = [p for p in PUBLISHED if not isinstance(p, LpipsProtocol) or has_lpips(p.net)]
"""Protocols whose weights, if they need some, are there."""


def protocol_score(protocol: PublishedProtocol, factors: np.ndarray) -> float | None:
    mask = np.ones(SHAPE[:2], bool)
    layer = "radiance" if protocol.subject == "relit" else protocol.subject
    view = JudgedView("v", acted_on(layer, PREDICTED[layer], factors), TRUE[layer], mask)
    try:
        return protocol.score(JudgedViews((view,), view)).value
    except PredictionError:
        return None


def prove(
    score: Callable[[np.ndarray], float | None],
    ignored: tuple[Invariance, ...],
    group: Invariance,
    *,
    refused: bool = False,
) -> None:
    """Hold a declaration against what a score does under a group.

    A score that failed neither ignores a group nor sees it: that is a third case, to be named as such.
    """
    before = score(np.ones(3))
    assert before is not None

    def change(factors: np.ndarray) -> float | None:
        """By how much the value changes; None where there is none."""
        value = score(factors)
        return None if value is None else abs(value - before)

    if group not in ignored and not refused:
        find(CHANGES[group], lambda factors: (change(factors) or 0.0) > 1e-3, settings=ONCE)
        return

    @ONCE
    @given(CHANGES[group])
    def holds(factors: np.ndarray) -> None:
        found = change(factors)
        assert (found is None) is refused
        assert found is None or found < 1e-5  # FLIP is rounded next to black

    holds()


@pytest.mark.usefixtures("random_lpips")
@pytest.mark.parametrize("group", CASES)
@pytest.mark.parametrize("metric", ge.registry(), ids=lambda m: m.id)
def test_a_metric_ignores_and_refuses_what_it_declares_and_nothing_else(
    metric: Metric[Any], group: Invariance
) -> None:
    score, refused = SCORES[type(metric.rule)], group in metric.refuses
    prove(lambda factors: score(metric, factors), metric.record.ignores, group, refused=refused)


@pytest.mark.parametrize("group", CASES)
@pytest.mark.parametrize("protocol", SCORABLE, ids=lambda p: p.name)
def test_a_protocol_ignores_what_it_declares_and_nothing_else(
    protocol: PublishedProtocol, group: Invariance
) -> None:
    refused = group in protocol.refuses
    prove(lambda factors: protocol_score(protocol, factors), protocol.ignores, group, refused=refused)


def test_whoever_ignores_a_gain_for_each_channel_ignores_one_for_all() -> None:
    declared = [m.ignores for m in ge.all_metrics()] + [p.ignores for p in PUBLISHED]
    assert all("global gain" in groups for groups in declared if "channel gain" in groups)
    assert {len(groups) for groups in declared} == {0, 1, 2, 3}


def test_a_declaration_that_is_wrong_is_found() -> None:
    raw = ge.find_metric("albedo.psnr.raw")
    with pytest.raises(AssertionError):
        prove(lambda factors: image_score(raw, factors), ("global gain",), "global gain")
    with pytest.raises(AssertionError):
        prove(lambda factors: image_score(raw, factors), (), "sign", refused=True)
    channel = ge.find_metric("albedo.psnr.channel")
    with pytest.raises(Exception, match="NoSuchExample|could not be satisfied|No examples"):
        prove(lambda factors: image_score(channel, factors), (), "global gain")


def test_a_score_that_failed_proves_nothing() -> None:
    def fails(factors: np.ndarray) -> float | None:
        return 1.0 if (factors == 1).all() else None

    with pytest.raises(Exception, match="NoSuchExample|could not be satisfied|No examples"):
        prove(fails, (), "sign")
    with pytest.raises(AssertionError):
        prove(fails, ("sign",), "sign")
    prove(fails, (), "sign", refused=True)

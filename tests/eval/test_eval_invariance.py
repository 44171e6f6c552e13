# SPDX-License-Identifier: Apache-2.0
"""Every metric and protocol ignores the gauge groups that it declares, and no other."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
import pytest
from hypothesis import Phase, find, given, settings
from hypothesis import strategies as st

import graycard as gc
import graycard.eval as ge
from graycard.eval._images import Scene, fit_gauges, judge
from graycard.eval._light_scores import score_lights
from graycard.eval._metrics import IMAGE_METRICS, LIGHT_METRICS, ImageMetric
from graycard.eval._readings import PredictedView, TrueView
from graycard.eval._relighting import (
    COMPOSITION_METRICS,
    RELIGHTING_METRICS,
    ChangedMetric,
    Picture,
    judge_picture,
)
from graycard.eval._table import VIEW_METRICS
from graycard.eval._training import Training
from graycard.eval._view_metrics import ViewMetric, judge_view
from graycard.eval.protocols import PUBLISHED, AlbedoProtocol, AlbedoView, AlbedoViews

RNG = np.random.default_rng(77)
SHAPE = 24, 26, 3
CAMERA = gc.Camera.from_fov(26, 24, 50, gc.look_at(np.array([0.0, -3, 1]), np.zeros(3)))
VIEW = gc.View("test_000", "test", CAMERA)
COLOR = RNG.uniform(0.1, 0.5, SHAPE)
TRUE = {
    "radiance": RNG.uniform(0.05, 0.7, SHAPE),
    "counterfactual.radiance": RNG.uniform(0.05, 0.7, SHAPE),
    "base_color": COLOR,
    "normal": RNG.normal(size=SHAPE) / 2,
    "object_id": np.ones(SHAPE[:2], np.uint32),
}
PREDICTED = {k: v * RNG.uniform(0.7, 1.2, SHAPE) for k, v in TRUE.items() if k != "object_id"}
BESIDE = {
    "radiance.var": np.full(SHAPE, 1e-4),
    "counterfactual.radiance.var": np.full(SHAPE, 1e-4),
    "shading": RNG.uniform(0.1, 1, SHAPE),
    "visibility.lamp": np.repeat(RNG.integers(0, 2, (24, 13)), 2, axis=1).astype(float),
    "direct.diffuse.lamp": RNG.uniform(0.2, 0.3, SHAPE),
    "direct.specular.lamp": RNG.uniform(0, 0.2, SHAPE),
} | {
    f"effect.{name}": RNG.integers(0, 2, SHAPE[:2]).astype(float)
    for name in ("footprint", "shadow", "mirror")
}
"""What metrics with rules of their own ask the truth for."""
LIGHTS = tuple(gc.PointLight(f"l{i}", (float(i), 0.2 * i, 1.0), (3.0, 2.0, 1.0 + i)) for i in range(3))

GAIN = st.floats(0.3, 5)
CHANGES: dict[gc.Invariance, st.SearchStrategy[np.ndarray]] = {
    "global gain": GAIN.map(lambda g: np.full(3, g)),
    "channel gain": st.tuples(GAIN, GAIN, GAIN).map(np.array),
    "sign": st.just(np.full(3, -1.0)),
}
"""Each element of a group as factors for the three channels."""
ONCE = settings(max_examples=8, database=None, deadline=None, phases=(Phase.generate,))
"""One example that differs is a proof; it need not be made small."""
CASES: tuple[gc.Invariance, ...] = get_args(gc.Invariance)


def image_score(metric: ImageMetric, factors: np.ndarray) -> float | None:
    """The value of one view whose prediction, also in training, is multiplied; None where it failed."""
    layers = {name: values * factors for name, values in PREDICTED.items()}
    true = TrueView(VIEW, TRUE, frozenset())
    return judge(metric, PredictedView(VIEW, layers), true, scene_of(layers, true), {}).value


def scene_of(layers: dict[str, np.ndarray], true: TrueView) -> Scene:
    sums = ge.moments(layers["base_color"], TRUE["base_color"], true.mask("base_color"))
    training = Training(frozenset(layers), (), (sums,), ())
    return Scene(1.2, training, fit_gauges(training))


def view_score(metric: ViewMetric, factors: np.ndarray) -> float | None:
    """The value of one view by a rule of its own, as ``image_score``."""
    layers = {name: values * factors for name, values in PREDICTED.items()}
    true = TrueView(VIEW, TRUE | BESIDE, frozenset())
    finding = judge_view(metric, PredictedView(VIEW, layers), true, scene_of(layers, true))
    assert finding is not None, "the view has something to judge"
    return finding.value


def changed_score(record: gc.MetricRecord, factors: np.ndarray) -> float | None:
    """The value of one picture under changed lights, whose albedo is multiplied as well."""
    layers = {name: values * factors for name, values in PREDICTED.items()}
    true = TrueView(VIEW, TRUE, frozenset())
    kind = record.id.split(".")[-1] if record.id.count(".") == 2 else None
    mask, relit = true.mask("radiance"), {"radiance": layers["counterfactual.radiance"]}
    truth = {"radiance": TRUE["counterfactual.radiance"]}
    picture = Picture("e", kind, VIEW, truth, lambda: relit, mask)  # pyright: ignore[reportArgumentType]
    table = (*RELIGHTING_METRICS, *COMPOSITION_METRICS)
    return judge_picture(table, picture, scene_of(layers, true))[record.id].value


@dataclass(frozen=True)
class Stub:
    """What light scores ask of predictions and truth."""

    found: tuple[gc.Light, ...]
    views: tuple[gc.View, ...] = (VIEW,)
    diameter: float = 5.0

    def lights(self) -> tuple[gc.Light, ...]:
        return self.found


def light_score(record: gc.MetricRecord, factors: np.ndarray) -> float | None:
    shifted = [replace(light, position=(light.position[0], 0.1, 1.2)) for light in LIGHTS]
    colors = [np.array(light.intensity) * (1.1, 1.0, 0.9) * factors for light in LIGHTS]
    scaled = [replace(a, intensity=tuple(b.tolist())) for a, b in zip(shifted, colors, strict=True)]
    scores = score_lights(Stub(tuple(scaled)), Stub(LIGHTS))  # pyright: ignore[reportArgumentType]
    (score,) = (s for s in scores if s.metric == record.id)
    return score.value


def protocol_score(protocol: AlbedoProtocol, factors: np.ndarray) -> float | None:
    mask = np.ones(SHAPE[:2], bool)
    view = AlbedoView("v", PREDICTED["base_color"] * factors, TRUE["base_color"], mask)
    try:
        return protocol.score(AlbedoViews((view,), view)).value
    except gc.PredictionError:
        return None


def prove(
    score: Callable[[np.ndarray], float | None], ignored: tuple[gc.Invariance, ...], group: gc.Invariance
) -> None:
    """Hold a declaration against what a score does under a group."""
    before = score(np.ones(3))
    assert before is not None

    def differs(factors: np.ndarray, least: float) -> bool:
        value = score(factors)
        return value is None or abs(value - before) > least

    if group not in ignored:
        find(CHANGES[group], lambda factors: differs(factors, 1e-3), settings=ONCE)
        return

    @ONCE
    @given(CHANGES[group])
    def holds(factors: np.ndarray) -> None:
        assert not differs(factors, 1e-5)  # FLIP computes in float32

    holds()


@pytest.mark.parametrize("group", CASES)
@pytest.mark.parametrize("metric", IMAGE_METRICS, ids=lambda m: m.record.id)
def test_an_image_metric_ignores_what_it_declares_and_nothing_else(
    metric: ImageMetric, group: gc.Invariance
) -> None:
    prove(lambda factors: image_score(metric, factors), metric.record.ignores, group)


@pytest.mark.parametrize("group", CASES)
@pytest.mark.parametrize("metric", VIEW_METRICS, ids=lambda m: m.record.id)
def test_a_view_metric_ignores_what_it_declares_and_nothing_else(
    metric: ViewMetric, group: gc.Invariance
) -> None:
    prove(lambda factors: view_score(metric, factors), metric.record.ignores, group)


@pytest.mark.parametrize("group", CASES)
@pytest.mark.parametrize("metric", [*RELIGHTING_METRICS, *COMPOSITION_METRICS], ids=lambda m: m.record.id)
def test_a_changed_picture_is_judged_in_the_gauge_of_the_albedo(
    metric: ChangedMetric, group: gc.Invariance
) -> None:
    prove(lambda factors: changed_score(metric.record, factors), metric.record.ignores, group)


@pytest.mark.parametrize("group", CASES)
@pytest.mark.parametrize("record", LIGHT_METRICS, ids=lambda r: r.id)
def test_a_light_metric_ignores_what_it_declares_and_nothing_else(
    record: gc.MetricRecord, group: gc.Invariance
) -> None:
    prove(lambda factors: light_score(record, factors), record.ignores, group)


@pytest.mark.parametrize("group", CASES)
@pytest.mark.parametrize("protocol", PUBLISHED, ids=lambda p: p.name)
def test_a_protocol_ignores_what_it_declares_and_nothing_else(
    protocol: AlbedoProtocol, group: gc.Invariance
) -> None:
    prove(lambda factors: protocol_score(protocol, factors), protocol.ignores, group)


def test_whoever_ignores_a_gain_for_each_channel_ignores_one_for_all() -> None:
    declared = [m.ignores for m in ge.metrics()] + [p.ignores for p in PUBLISHED]
    assert all("global gain" in groups for groups in declared if "channel gain" in groups)
    assert {len(groups) for groups in declared} == {0, 1, 2, 3}


def test_a_declaration_that_is_wrong_is_found() -> None:
    raw = next(m for m in IMAGE_METRICS if m.record.id == "albedo.psnr.raw")
    with pytest.raises(AssertionError):
        prove(lambda factors: image_score(raw, factors), ("global gain",), "global gain")
    channel = next(m for m in IMAGE_METRICS if m.record.id == "albedo.psnr.channel")
    with pytest.raises(Exception, match="NoSuchExample|could not be satisfied|No examples"):
        prove(lambda factors: image_score(channel, factors), (), "global gain")

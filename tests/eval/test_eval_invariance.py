# SPDX-License-Identifier: Apache-2.0
"""Every metric and protocol ignores the gauge groups that it declares, and no other."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
import pytest
from hypothesis import Phase, find, given, settings
from hypothesis import strategies as st

import graycard.eval as ge
from graycard import Camera, Light, PredictionError, SphereLight, SpotLight, View, look_at
from graycard.eval.lights._environment import compare_spheres
from graycard.eval.lights._metrics import ENVIRONMENT_METRICS, LIGHT_METRICS
from graycard.eval.lights._scores import score_lights
from graycard.eval.lights._spheres import render_spheres
from graycard.eval.metrics._albedo import IMAGE_METRICS
from graycard.eval.metrics._image_metric import ImageMetric
from graycard.eval.metrics._relighting import (
    COMPOSITION_METRICS,
    RELIGHTING_METRICS,
    ChangedMetric,
    Picture,
    judge_picture,
)
from graycard.eval.metrics._removal import EFFECTS
from graycard.eval.metrics._table import VIEW_METRICS
from graycard.eval.metrics._view_metrics import ViewMetric, judge_view
from graycard.eval.protocols import PUBLISHED, AlbedoProtocol, AlbedoView, AlbedoViews
from graycard.eval.scoring._assembly import Scene
from graycard.eval.scoring._images import judge
from graycard.eval.scoring._readings import PredictedView, TrueView
from graycard.eval.scoring._training import REFLECTANCES, Fit, Training, fit_gauges
from graycard.layers import LOBES, PARTS
from graycard.records import Invariance, MetricRecord

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
"""What metrics with rules of their own ask the truth for."""
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


REFUSED = frozenset({
    "albedo.psnr.scalar", "albedo.psnr.channel", "albedo.ssim", "albedo.flip", "albedo.ciede2000",
    "albedo.chart",
    "diffuse_reflectance.psnr.scalar", "diffuse_reflectance.psnr.channel",
    "hemispherical_albedo.psnr.scalar", "hemispherical_albedo.psnr.channel",
    "albedo.leakage", "albedo.leakage.shadow", "albedo.leakage.highlight", "shading.psnr", "irradiance.psnr",
    *(m.record.id for m in RELIGHTING_METRICS),
    "light.intensity", "light.intensity.channel", "light.chromaticity", "environment.psnr",
    "global-lsq", "channel-lsq", "nerfactor", "orb-albedo", "nvdiffrec", "owl",
})  # fmt: skip
"""Scores that fail for what is below zero: no positive gauge fits it, and no lamp takes light away."""


def refuses(name: str, group: Invariance) -> bool:
    return group == "sign" and name in REFUSED


def acted_on(name: str, values: np.ndarray, factors: np.ndarray) -> np.ndarray:
    """What an element of a group makes of a layer; a layer of one channel takes the first factor."""
    scale = factors if values.ndim == 3 else factors[0]
    return values / scale if name in RECEIVED else values * scale


def gauges_of(layers: dict[str, np.ndarray]) -> Training:
    mask = np.ones(SHAPE[:2], bool)
    fits = {name: Fit((ge.moments(layers[name], TRUE[name], mask),)) for name in REFLECTANCES}
    return Training(frozenset(layers), (), fits)


def image_score(metric: ImageMetric, factors: np.ndarray) -> float | None:
    """The value of one view whose prediction, also in training, is multiplied; None where it failed."""
    layers = {name: acted_on(name, values, factors) for name, values in PREDICTED.items()}
    true = TrueView(VIEW, TRUE, frozenset(), frozenset({1}))
    each = replace(metric, layer=metric.layer.replace("<light>", "lamp"))
    return judge(each, PredictedView(VIEW, layers), true, scene_of(layers), {}).value


def scene_of(layers: dict[str, np.ndarray]) -> Scene:
    training = gauges_of(layers)
    return Scene(1.2, training, fit_gauges(training))


def view_score(metric: ViewMetric, factors: np.ndarray) -> float | None:
    """The value of one view by a rule of its own, as ``image_score``."""
    layers = {name: acted_on(name, values, factors) for name, values in PREDICTED.items()}
    true = TrueView(VIEW, TRUE | BESIDE, frozenset())
    finding = judge_view(metric, PredictedView(VIEW, layers), true, scene_of(layers))
    assert finding is not None, "the view has something to judge"
    return finding.value


def changed_score(record: MetricRecord, factors: np.ndarray) -> float | None:
    """The value of one picture under changed lights, whose albedo is multiplied as well."""
    layers = {name: acted_on(name, values, factors) for name, values in PREDICTED.items()}
    true = TrueView(VIEW, TRUE, frozenset())
    kind = record.id.split(".")[-1] if record.id.count(".") == 2 else None
    mask, relit = true.mask("radiance"), {"radiance": layers["counterfactual.radiance"]}
    truth = {"radiance": TRUE["counterfactual.radiance"]}
    gauged = record.id.startswith("relighting.")
    picture = Picture("e", kind, VIEW, truth, lambda: relit, mask, gauged=gauged)  # pyright: ignore[reportArgumentType]
    table = (*RELIGHTING_METRICS, *COMPOSITION_METRICS)
    return judge_picture(table, picture, scene_of(layers))[record.id].value


@dataclass(frozen=True)
class Stub:
    """What light scores ask of predictions and truth."""

    found: tuple[Light, ...]
    views: tuple[View, ...] = (VIEW,)
    diameter: float = 5.0

    def lights(self) -> tuple[Light, ...]:
        return self.found


def light_score(record: MetricRecord, factors: np.ndarray) -> float | None:
    """The value for lights whose intensity is multiplied, and albedo divided, by what the group says."""
    colors = [np.array(light.intensity) * (1.1, 1.0, 0.9) * factors for light in LIGHTS]
    shifted = [
        replace(light, position=(light.position[0], 0.1, 1.2), direction=(0, 0, -1), intensity=tuple(color))
        for light, color in zip(LIGHTS, np.array(colors).tolist(), strict=True)
    ]
    radiance = tuple((np.array(SPHERE.radiance) * (1.1, 1.0, 0.9) * factors).tolist())
    found = (*shifted, replace(SPHERE, radiance=radiance, radius=0.3))
    gauge = fit_gauges(gauges_of({name: PREDICTED[name] / factors for name in REFLECTANCES}))["light"]
    scores = score_lights(Stub(found), Stub((*LIGHTS, SPHERE)), gauge)  # pyright: ignore[reportArgumentType]
    (score,) = (s for s in scores if s.metric == record.id)
    return score.value


def environment_score(factors: np.ndarray) -> float | None:
    blurred = np.roll(SKY, 1, axis=1) * (1.1, 1.0, 0.8)
    try:
        return compare_spheres(render_spheres(blurred * factors), render_spheres(SKY)).value
    except PredictionError:
        return None


def protocol_score(protocol: AlbedoProtocol, factors: np.ndarray) -> float | None:
    mask = np.ones(SHAPE[:2], bool)
    view = AlbedoView("v", PREDICTED["base_color"] * factors, TRUE["base_color"], mask)
    try:
        return protocol.score(AlbedoViews((view,), view)).value
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
@pytest.mark.parametrize("metric", IMAGE_METRICS, ids=lambda m: m.record.id)
def test_an_image_metric_ignores_what_it_declares_and_nothing_else(
    metric: ImageMetric, group: Invariance
) -> None:
    refused = refuses(metric.record.id, group)
    prove(lambda factors: image_score(metric, factors), metric.record.ignores, group, refused=refused)


@pytest.mark.parametrize("group", CASES)
@pytest.mark.parametrize("metric", VIEW_METRICS, ids=lambda m: m.record.id)
def test_a_view_metric_ignores_what_it_declares_and_nothing_else(
    metric: ViewMetric, group: Invariance
) -> None:
    refused = refuses(metric.record.id, group)
    prove(lambda factors: view_score(metric, factors), metric.record.ignores, group, refused=refused)


@pytest.mark.parametrize("group", CASES)
@pytest.mark.parametrize("metric", [*RELIGHTING_METRICS, *COMPOSITION_METRICS], ids=lambda m: m.record.id)
def test_a_changed_picture_is_judged_in_the_gauge_of_the_albedo(
    metric: ChangedMetric, group: Invariance
) -> None:
    refused = refuses(metric.record.id, group)
    prove(
        lambda factors: changed_score(metric.record, factors), metric.record.ignores, group, refused=refused
    )


@pytest.mark.parametrize("group", CASES)
@pytest.mark.parametrize("record", LIGHT_METRICS, ids=lambda r: r.id)
def test_a_light_metric_ignores_what_it_declares_and_nothing_else(
    record: MetricRecord, group: Invariance
) -> None:
    refused = refuses(record.id, group)
    prove(lambda factors: light_score(record, factors), record.ignores, group, refused=refused)


@pytest.mark.parametrize("group", CASES)
@pytest.mark.parametrize("record", ENVIRONMENT_METRICS, ids=lambda r: r.id)
def test_an_environment_metric_ignores_what_it_declares_and_nothing_else(
    record: MetricRecord, group: Invariance
) -> None:
    prove(environment_score, record.ignores, group, refused=refuses(record.id, group))


@pytest.mark.parametrize("group", CASES)
@pytest.mark.parametrize("protocol", PUBLISHED, ids=lambda p: p.name)
def test_a_protocol_ignores_what_it_declares_and_nothing_else(
    protocol: AlbedoProtocol, group: Invariance
) -> None:
    refused = refuses(protocol.name, group)
    prove(lambda factors: protocol_score(protocol, factors), protocol.ignores, group, refused=refused)


def test_whoever_ignores_a_gain_for_each_channel_ignores_one_for_all() -> None:
    declared = [m.ignores for m in ge.all_metrics()] + [p.ignores for p in PUBLISHED]
    assert all("global gain" in groups for groups in declared if "channel gain" in groups)
    assert {len(groups) for groups in declared} == {0, 1, 2, 3}


def test_a_declaration_that_is_wrong_is_found() -> None:
    raw = next(m for m in IMAGE_METRICS if m.record.id == "albedo.psnr.raw")
    with pytest.raises(AssertionError):
        prove(lambda factors: image_score(raw, factors), ("global gain",), "global gain")
    with pytest.raises(AssertionError):
        prove(lambda factors: image_score(raw, factors), (), "sign", refused=True)
    channel = next(m for m in IMAGE_METRICS if m.record.id == "albedo.psnr.channel")
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

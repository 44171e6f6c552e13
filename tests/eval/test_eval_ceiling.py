# SPDX-License-Identifier: Apache-2.0
"""What the truth's noise allows: what a noise-free prediction scores, and who is accused of being better."""

import math
from collections.abc import Callable
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import pytest

import graycard as gc
import graycard.eval as ge
from changed_scene import enrich
from graycard.eval._ceiling import CEILINGS, MARGINS, ceiling_warnings, is_suspicious, pooled_ceiling
from graycard.eval._readings import TrueView
from graycard.eval._second_truth import second_truth, without_noise

Layers = dict[str, np.ndarray]
Predict = Callable[..., Path]
VIEW = gc.View("v", "test", gc.Camera.from_fov(80, 60, 50, gc.look_at(np.array([0.0, -3, 1]), np.zeros(3))))
RNG = np.random.default_rng(11)


def rule_of(metric: str) -> ge.CeilingRule:
    (rule,) = [r for r in CEILINGS if any(fnmatch(metric, pattern) for pattern in r.metrics)]
    return rule


def noisy_view(sigma: float) -> tuple[TrueView, np.ndarray]:
    """A gray ramp with noise, and the ramp."""
    clean = np.linspace(0.2, 0.8, 80)[None, :, None] * np.ones((60, 80, 3))
    a, b = (clean + RNG.normal(0, sigma * math.sqrt(2), clean.shape) for _ in range(2))
    layers = {"radiance": (a + b) / 2, "radiance.var": np.full_like(clean, sigma**2)}
    layers |= {"radiance.half_a": a, "radiance.half_b": b}
    return TrueView(VIEW, layers, frozenset()), clean


def with_halves(scene: Path, sigma: float) -> Path:
    """Two halves whose mean is the radiance that the scene has."""
    truth = gc.open_truth(scene / "truth")
    for view in truth.views:
        layers = truth.layers(view)
        off = RNG.normal(0, sigma, layers["radiance"].shape).astype(np.float32)
        halves = {"radiance.half_a": layers["radiance"] + off, "radiance.half_b": layers["radiance"] - off}
        gc.write_layers(scene / "truth" / "views" / f"{view.name}.exr", layers | halves)
    gc.seal(scene / "truth", gc.manifest_of(truth))
    return scene


@pytest.mark.parametrize("metric", ge.metrics(), ids=lambda m: m.id)
def test_every_metric_has_one_rule(metric: gc.MetricRecord) -> None:
    assert not rule_of(metric.id).known or metric.unit in MARGINS


def test_scores_have_the_ceilings_that_the_rules_say(
    make_scene: Callable[..., Path], predict: Predict
) -> None:
    scene = enrich(make_scene(track="tabletop"))
    truth = gc.open_truth(scene / "truth", check=False)
    folder = predict(scene, lambda view, layers: truth.layers(view))
    scores = ge.score_predictions(folder, scene).scores
    assert {s.metric: s.noise_ceiling is not None for s in scores if s.status == "scored"} == {
        s.metric: rule_of(s.metric).known and s.metric != "shading.psnr"
        for s in scores
        if s.status == "scored"
    }, "the shading of this scene is exact"


@pytest.mark.parametrize("sigma", [0.01, 0.05])
def test_a_noise_free_prediction_scores_the_ceiling(
    make_scene: Callable[..., Path], predict: Predict, sigma: float
) -> None:
    scene = with_halves(make_scene(sigma=sigma, scene="noisy-0000"), sigma)
    exact = gc.open_truth(make_scene(sigma=0.0, scene="clean-0000") / "truth")

    def noise_free(view: gc.View, layers: Layers) -> Layers:
        return layers | {"radiance": exact.layers(exact.view(view.name))["radiance"]}

    sheet, copied = (ge.score_predictions(predict(scene, *change), scene) for change in ([noise_free], []))
    score, copy = sheet.score("novel_view.ssim"), copied.score("novel_view.ssim")
    assert score.value == pytest.approx(score.noise_ceiling, abs=0.02)
    assert not score.warnings
    assert bool(copy.warnings) == (abs(score.optimum - (copy.noise_ceiling or 0)) >= MARGINS["1"])


def test_who_holds_the_noise_is_named(make_scene: Callable[..., Path], predict: Predict) -> None:
    """The truth as a prediction, with its changed pictures: its errors are less than the noise."""
    scene = enrich(make_scene(track="tabletop"))
    truth = gc.open_truth(scene / "truth", check=False)
    folder = predict(scene, lambda view, layers: truth.layers(view))
    for view in (v for v in truth.views if v.split == "test"):
        for edit in truth.edits:
            relit = truth.relit(edit.name, view)["radiance"]
            gc.write_layers(folder / edit.view_file(view.name), {"radiance": relit})
        composed = truth.composed(view)["radiance"]
        gc.write_layers(folder / gc.composed_file(view.name), {"radiance": composed})
    gc.finish_predictions(folder, gc.Predictions("truth", truth.track, truth.scene), truth.lights())
    sheet = ge.score_predictions(folder, scene)
    known = [s for s in sheet.scores if s.unit in ("dB", "σ") and s.metric != "shading.psnr"]
    assert {s.metric for s in known if rule_of(s.metric).known} == {
        s.metric for s in known if any("holds the noise of the truth itself" in w for w in s.warnings)
    }
    (said,) = sheet.score("novel_view.noise_rms").warnings
    assert said.startswith("0.000 σ is ")
    assert "chance makes up for less than 0.1 σ" in said


@pytest.mark.parametrize(
    ("value", "ceiling", "unit", "up", "warned"),
    [
        (41.0, 40.0, "dB", True, True),
        (40.9, 40.0, "dB", True, False),
        (math.inf, 40.0, "dB", True, True),
        (0.89, 1.0, "σ", False, True),
        (0.95, 1.0, "σ", False, False),
        (3.0, 1.0, "σ", False, False),
        (0.05, 0.07, "1", False, True),
        (0.96, 0.93, "1", True, True),
        (0.935, 0.93, "1", True, False),
        (math.nan, 40.0, "dB", True, False),
        (None, 40.0, "dB", True, False),
        (41.0, None, "dB", True, False),
        (90.0, 1.0, "°", True, False),
    ],
)
def test_the_margin_is_that_of_the_unit(
    value: float | None, ceiling: float | None, unit: str, up: bool, warned: bool
) -> None:
    assert bool(ceiling_warnings(value, ceiling, unit, up)) == warned


def test_a_warning_says_how_far_and_which_way() -> None:
    assert ceiling_warnings(0.05, 0.07, "1", False) == (
        "0.050 is 0.020 below the 0.070 that the noise of the truth allows, and chance makes up for less "
        "than 0.01: the prediction holds the noise of the truth itself",
    )
    assert "41.0 dB is 1.0 dB above the 40.0 dB" in ceiling_warnings(41.0, 40.0, "dB", True)[0]
    assert not is_suspicious(math.inf, "%")


def test_a_pooled_ceiling_is_that_of_the_mean_of_all_views() -> None:
    assert pooled_ceiling([0.01, 0.03], ge.psnr) == pytest.approx(ge.psnr(0.02))
    assert pooled_ceiling([0.01, None], ge.psnr) is None
    assert pooled_ceiling([0.0, 0.0], ge.psnr) is None
    assert pooled_ceiling([], ge.psnr) is None


def test_a_second_truth_has_the_noise_of_the_first() -> None:
    true, clean = noisy_view(0.05)
    found = second_truth(true, "radiance")
    assert found is not None
    quiet, again = found
    assert np.std(again - quiet) == pytest.approx(0.05, rel=0.05)
    assert np.std(quiet - clean) < 0.025, "most of the noise is gone"
    correlation = np.corrcoef((again - quiet).ravel(), (true.take("radiance") - clean).ravel())[0, 1]
    assert correlation == pytest.approx(0, abs=0.05)


def test_without_noise_there_is_no_second_truth() -> None:
    true, _ = noisy_view(0.0)
    assert second_truth(true, "radiance") is None
    assert second_truth(true, "base_color") is None


def test_texture_far_above_the_noise_is_kept() -> None:
    texture = RNG.uniform(0, 1, (40, 40, 3))
    kept = without_noise(texture, np.full_like(texture, 1e-8))
    assert np.abs(kept - texture).max() < 1e-5
    assert np.allclose(without_noise(texture, np.full_like(texture, 9.0)).std(), texture.std() / 5, rtol=0.2)

# SPDX-License-Identifier: Apache-2.0
"""Novel views in and out of the main light's shadow, and training views: known predictions."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from skimage.metrics import peak_signal_noise_ratio

import graycard.eval as ge
from graycard import Camera, Truth, View, open_truth, srgb_encode
from graycard.colour import srgb_slope
from graycard.dataset import manifest_of, write_index
from graycard.eval.metrics._shadow import METRICS, main_light
from graycard.eval.metrics._training_view import METRICS as TRAINING_METRICS
from graycard.eval.metrics._training_view import TrainingScorer
from graycard.eval.scoring._readings import TrueView
from graycard.eval.scoring._training import Training
from graycard.io import write_layers, write_manifest

Layers = dict[str, np.ndarray]
Predict = Callable[..., Path]
SIGMA = 1e-3


def lit_columns(shape: tuple[int, ...]) -> np.ndarray:
    """1 in the light, 0 in the shadow, and a column of half-shadow between, which belongs to neither."""
    column = np.arange(shape[1])
    return np.broadcast_to(np.select([column < 10, column == 10], [0.0, 0.5], 1.0), shape[:2])


def with_lights(layers: Layers, brighter: str) -> Layers:
    """The lamp is hidden on the left, a desk lamp on the right; one of them brings more."""
    visible = lit_columns(layers["object_id"].shape)
    bright, dim = (np.full(layers["radiance"].shape, level, np.float32) for level in (2.0, 1.0))
    found = dict(layers)
    for name, seen in (("lamp", visible), ("desk", 1 - visible)):
        found[f"visibility.{name}"] = seen.astype(np.float32)
        found[f"irradiance.{name}"] = bright if name == brighter else dim
    return found


@pytest.fixture(params=["lamp", "desk"])
def brighter(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def scene(make_scene: Callable[..., Path], brighter: str) -> Path:
    folder = make_scene(sigma=SIGMA)
    truth = open_truth(folder / "truth")
    manifest = manifest_of(truth)
    for view in truth.views:
        path = folder / "truth" / "views" / f"{view.name}.exr"
        write_layers(path, with_lights(truth.layers(view), brighter))
    write_index(folder / "truth", replace(truth, exposure=0.4))
    write_manifest(folder / "truth", manifest)
    return folder


def regions(truth: Truth, view: View, brighter: str) -> dict[str, np.ndarray]:
    layers = truth.layers(view)
    visible = lit_columns(layers["object_id"].shape)
    visible = visible if brighter == "lamp" else 1 - visible
    seen = layers["object_id"] > 0
    return {"shadow": seen & (visible < 0.25), "lit": seen & (visible > 0.75)}


@pytest.mark.parametrize(("where", "other"), [("shadow", "lit"), ("lit", "shadow")])
def test_each_side_is_judged_apart(
    scene: Path, predict: Predict, brighter: str, where: str, other: str
) -> None:
    truth = open_truth(scene / "truth", check=False)

    def change(view: View, layers: Layers) -> Layers:
        region = regions(truth, view, brighter)[where][..., None]
        return layers | {"radiance": (layers["radiance"] * np.where(region, 0.8, 1)).astype(np.float32)}

    sheet = ge.score_predictions(predict(scene, change), scene)
    errors = []
    for view in (v for v in truth.views if v.split == "test"):
        true, region = (
            truth.layers(view)["radiance"].astype(np.float64),
            regions(truth, view, brighter)[where],
        )
        shown = [srgb_encode(values[region] * truth.exposure) for values in (true, np.float32(0.8) * true)]
        errors.append(10 ** (-peak_signal_noise_ratio(*shown, data_range=1) / 10))
    assert sheet.score(f"novel_view.psnr.{where}").value == pytest.approx(
        -10 * math.log10(np.mean(errors)), abs=1e-4
    )
    assert sheet.score(f"novel_view.psnr.{other}").value == math.inf


def test_the_noise_of_each_side_is_its_ceiling(scene: Path, predict: Predict) -> None:
    rng = np.random.default_rng(5)

    def change(view: View, layers: Layers) -> Layers:
        noise = rng.normal(0, SIGMA, layers["radiance"].shape)
        return layers | {"radiance": (layers["radiance"] + noise).astype(np.float32)}

    sheet = ge.score_predictions(predict(scene, change), scene)
    for metric in ("novel_view.psnr.shadow", "novel_view.psnr.lit"):
        score = sheet.score(metric)
        assert score.value == pytest.approx(score.noise_ceiling, abs=1.0)


def test_without_a_picture_nothing_is_provided(scene: Path, predict: Predict) -> None:
    folder = predict(scene, lambda view, layers: {k: v for k, v in layers.items() if k != "radiance"})
    sheet = ge.score_predictions(folder, scene)
    for metric in ("novel_view.psnr.shadow", "novel_view.psnr.lit", "training_view.psnr"):
        assert (sheet.score(metric).status, sheet.score(metric).value) == ("not provided", None)


def test_a_scene_that_does_not_tell_what_is_hidden_is_not_judged(
    make_scene: Callable[..., Path], predict: Predict
) -> None:
    scene = make_scene(scene="tiny-0001")
    metrics = {score.metric for score in ge.score_predictions(predict(scene), scene).scores}
    assert not {"novel_view.psnr.shadow", "novel_view.psnr.lit"} & metrics


def darker(split: str) -> Callable[[View, Layers], Layers]:
    def change(view: View, layers: Layers) -> Layers:
        factor = 0.8 if view.split == split else 1.0
        return layers | {"radiance": (layers["radiance"] * factor).astype(np.float32)}

    return change


@pytest.mark.parametrize("brighter", ["lamp"])
def test_training_views_have_a_score_of_their_own(scene: Path, predict: Predict) -> None:
    truth = open_truth(scene / "truth", check=False)
    sheet = ge.score_predictions(predict(scene, darker("train")), scene)
    errors = []
    for view in (v for v in truth.views if v.split == "train"):
        layers = truth.layers(view)
        pictures = (layers["radiance"][layers["object_id"] > 0] * f for f in (1.0, np.float32(0.8)))
        shown = [srgb_encode(p.astype(np.float64) * truth.exposure) for p in pictures]
        errors.append(np.mean((shown[0] - shown[1]) ** 2))
    score = sheet.score("training_view.psnr")
    assert score.value == pytest.approx(-10 * math.log10(np.mean(errors)), abs=1e-4)
    assert (score.expected, score.scored, score.per_view, score.noise_ceiling) == (3, 3, {}, None)
    assert sheet.score("novel_view.psnr").value == math.inf
    other = ge.score_predictions(predict(scene, darker("test")), scene)
    assert other.score("training_view.psnr").value == math.inf


@pytest.mark.parametrize("brighter", ["lamp"])
def test_a_training_view_that_is_missing_has_failed(scene: Path, predict: Predict) -> None:
    def change(view: View, layers: Layers) -> Layers:
        return {k: v for k, v in layers.items() if k != "radiance" or view.name != "train_000"}

    score = ge.score_predictions(predict(scene, change), scene).score("training_view.psnr")
    assert (score.status, score.value, score.scored) == ("failed", None, 2)
    assert "train_000: expected radiance" in score.reason


def seen(layers: Layers) -> TrueView:
    """A view of 4 × 4 pixels that shows one surface, but for what ``layers`` says."""
    camera = Camera.from_fov(4, 4, 60, np.eye(4))
    base = {"object_id": np.ones((4, 4), np.uint32), "radiance": np.full((4, 4, 3), 0.5, np.float32)}
    return TrueView(View("test_000", "test", camera), base | layers, frozenset())


def light(name: str, visible: float, brings: float) -> Layers:
    return {
        f"visibility.{name}": np.full((4, 4), visible, np.float32),
        f"irradiance.{name}": np.full((4, 4, 3), brings, np.float32),
    }


def test_the_main_light_is_the_one_that_brings_most() -> None:
    both = light("a", 0.0, 1.0) | light("b", 1.0, 2.0)
    assert main_light(seen(both)) == "b"
    assert main_light(seen({name: both[name] for name in ("visibility.a", "irradiance.b")})) is None
    assert main_light(seen(both | {"object_id": np.zeros((4, 4), np.uint32)})) is None
    assert main_light(seen({})) is None


@pytest.mark.parametrize(
    ("visible", "asked"), [(0.0, [True, False]), (1.0, [False, True]), (0.5, [False, False])]
)
def test_a_view_without_shadow_or_light_asks_nothing(visible: float, asked: list[bool]) -> None:
    view = seen(light("a", visible, 1.0))
    assert [metric.rule.prepare(view, 1.0) is not None for metric in METRICS] == asked
    assert [metric.rule.prepare(seen({}), 1.0) for metric in METRICS] == [None, None]


def test_without_a_variance_there_is_no_ceiling() -> None:
    rule = METRICS[0].rule
    assert rule.noise(rule.prepare(seen(light("a", 0.0, 1.0)), 1.0)) is None
    known = light("a", 0.0, 1.0) | {"radiance.var": np.full((4, 4, 3), 1e-6, np.float32)}
    noise = rule.noise(rule.prepare(seen(known), 1.0))
    assert noise == pytest.approx(1e-6 * srgb_slope(np.asarray(0.5)) ** 2, rel=1e-3)


def test_training_views_that_see_nothing_have_no_score() -> None:
    assert TrainingScorer(TRAINING_METRICS, Training(frozenset(), (), {})).scores() == []

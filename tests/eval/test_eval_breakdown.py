# SPDX-License-Identifier: Apache-2.0
"""The same number by neighbouring rules: interior and boundary, the other space, the mean, without noise."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import graycard.eval as ge
from graycard import View, open_predictions, open_truth, srgb_encode
from graycard.colour import display_variance
from graycard.dataset import manifest_of
from graycard.eval.kinds._images import measure
from graycard.eval.scoring._comparison import LayerComparison
from graycard.io import write_layers, write_manifest

Predict = Callable[..., Path]
Layers = dict[str, np.ndarray]
PIXELS = ("novel_view.psnr", "novel_view.flip", "albedo.psnr.raw", "albedo.ciede2000", "normal.mean_angle")


def with_pure(scene: Path, pure: Callable[[np.ndarray], np.ndarray]) -> Path:
    """The scene with a ``pure`` layer made from the object ids."""
    truth = open_truth(scene / "truth")
    manifest = manifest_of(truth)
    for view in truth.views:
        layers = truth.layers(view)
        named = {"pure": pure(layers["object_id"]).astype(np.float32)}
        write_layers(scene / "truth" / "views" / f"{view.name}.exr", layers | named)
    write_manifest(scene / "truth", manifest)
    return scene


def left_half(ids: np.ndarray) -> np.ndarray:
    return np.arange(ids.shape[1])[None] < ids.shape[1] // 2 + 0 * ids


def shifted(view: View, layers: Layers) -> Layers:
    """Wrong on the right half alone."""
    right = ~left_half(layers["radiance"][..., 0])
    return {k: np.where(right.T, v.T * 0.8 + 0.05, v.T).T.astype(np.float32) for k, v in layers.items()}


def test_interior_and_boundary_are_what_the_truth_calls_pure(
    make_scene: Callable[..., Path], predict: Predict
) -> None:
    scene = with_pure(make_scene(), left_half)
    sheet = ge.score_predictions(predict(scene, shifted), scene, "graycard-1")
    for metric in ("novel_view.psnr", "albedo.psnr.raw", "normal.mean_angle"):
        score = sheet.score(metric)
        assert score.breakdown["interior"] == score.optimum, metric
    for metric in PIXELS:
        score = sheet.score(metric)
        assert score.value is not None
        gap = (score.breakdown["boundary"] - score.value) * (1 if score.higher_is_better else -1)
        assert gap < 0, f"{metric}: all that is wrong lies there"


def test_the_whole_is_the_mean_of_its_regions(make_scene: Callable[..., Path], predict: Predict) -> None:
    scene = with_pure(make_scene(test=1), left_half)
    truth = open_truth(scene / "truth")
    ids = truth.layers(truth.view("test_001"))["object_id"]
    share = (left_half(ids) & (ids > 0)).sum() / (ids > 0).sum()

    def halved(view: View, layers: Layers) -> Layers:
        return {k: (v * 0.8 + 0.05 * v**2).astype(np.float32) for k, v in layers.items()}

    for score in ge.score_predictions(predict(scene, halved), scene).scores:
        if "interior" in score.breakdown and score.unit == "dB":
            inside, outside, whole = (
                10 ** (-x / 10)
                for x in (score.breakdown["interior"], score.breakdown["boundary"], score.value or 0)
            )
            assert share * inside + (1 - share) * outside == pytest.approx(whole, rel=1e-9), score.metric


def test_a_region_that_no_view_has_is_left_out(make_scene: Callable[..., Path], predict: Predict) -> None:
    scene = with_pure(make_scene(), lambda ids: np.ones(ids.shape))
    score = ge.score_predictions(predict(scene, shifted), scene).score("albedo.psnr.raw")
    assert score.breakdown["interior"] == score.value
    assert "boundary" not in score.breakdown


def test_a_truth_that_names_no_pure_pixels_has_no_regions(
    tiny_scenes: dict[str, Path], predict: Predict
) -> None:
    sheet = ge.score_predictions(predict(tiny_scenes["dark"], shifted), tiny_scenes["dark"])
    assert set(sheet.score("albedo.psnr.raw").breakdown) == {"srgb", "mean_of_views"}
    assert set(sheet.score("novel_view.psnr").breakdown) == {"linear", "mean_of_views", "debiased"}
    for metric in ("novel_view.ssim", "albedo.lmse", "light.position", "normal.mean_angle", "albedo.flip"):
        assert sheet.score(metric).breakdown == {}, metric


def test_the_other_space_and_the_mean_of_views(tiny_scenes: dict[str, Path], predict: Predict) -> None:
    scene = tiny_scenes["dark"]
    folder = predict(scene, shifted)
    sheet, truth = ge.score_predictions(folder, scene), open_truth(scene / "truth")
    albedo, light = [], []
    for view in (v for v in truth.views if v.split == "test"):
        true, found = truth.layers(view), open_predictions(folder).layers(view.name)
        seen = true["object_id"] > 0
        p, t = (srgb_encode(x["base_color"][seen]) for x in (found, true))
        albedo.append(np.mean((p - t) ** 2))
        p, t = (np.clip(x["radiance"][seen].astype(float) * truth.exposure, 0, 1) for x in (found, true))
        light.append(np.mean((p - t) ** 2))
    raw, novel = sheet.score("albedo.psnr.raw"), sheet.score("novel_view.psnr")
    assert raw.breakdown["srgb"] == pytest.approx(-10 * math.log10(np.mean(albedo)), abs=1e-6)
    assert novel.breakdown["linear"] == pytest.approx(-10 * math.log10(np.mean(light)), abs=1e-6)
    for score in (raw, novel):
        assert score.breakdown["mean_of_views"] == pytest.approx(np.mean(list(score.per_view.values())))
        assert score.breakdown["mean_of_views"] >= (score.value or 0)


def test_debiased_is_the_score_against_a_truth_without_noise(
    make_scene: Callable[..., Path], predict: Predict
) -> None:
    """The error of a prediction is 30 dB, that of the truth 33 dB: what the latter costs comes back."""
    clean = make_scene(sigma=0.0, scene="clean-0000", train=3, test=3)
    exact = open_truth(clean / "truth")

    def off(view: View, layers: Layers) -> Layers:
        return layers | {"radiance": exact.layers(exact.view(view.name))["radiance"] * np.float32(1.12)}

    noisy = make_scene(sigma=5e-3, train=3, test=3)
    without = ge.score_predictions(predict(clean, off), clean).score("novel_view.psnr")
    found = ge.score_predictions(predict(noisy, off), noisy).score("novel_view.psnr")
    assert without.value is not None
    assert found.value is not None
    assert found.value < without.value - 1
    assert found.breakdown["debiased"] == pytest.approx(without.value, abs=0.25)
    assert "debiased" not in without.breakdown, "an exact truth has nothing to take off"


@pytest.mark.parametrize("sigma", [0.001, 0.005, 0.01, 0.02])
def test_a_noise_free_prediction_has_little_error_left(sigma: float) -> None:
    """Half of the pixels are dark, where the display clips half of the noise and a slope says too much."""
    rng = np.random.default_rng(3)
    exact = np.broadcast_to(np.linspace(0.002, 0.5, 400)[:, None, None] ** 2, (400, 100, 3))
    metric = ge.find_metric("novel_view.psnr")
    variance, mask = np.full(exact.shape, sigma**2), np.ones(exact.shape[:2], bool)
    true = exact + rng.normal(0, sigma, exact.shape)
    noise, parts = measure(metric, LayerComparison(exact, true, mask, 1.0, variance))
    assert -0.03 * noise < parts["debiased"] < 0.25 * noise, "what is left is on the safe side"
    if sigma >= 0.01:
        assert display_variance(true, variance, 1.0).mean() > 1.2 * noise


def test_less_error_than_noise_is_no_error(make_scene: Callable[..., Path], predict: Predict) -> None:
    scene = make_scene(sigma=1e-2)
    score = ge.score_predictions(predict(scene), scene).score("novel_view.psnr")
    assert score.breakdown["debiased"] == math.inf


def test_what_failed_has_no_breakdown(tiny_scenes: dict[str, Path], predict: Predict) -> None:
    scene = tiny_scenes["dark"]
    folder = predict(scene, lambda view, layers: None if view.name == "test_003" else layers)
    sheet = ge.score_predictions(folder, scene)
    assert sheet.score("albedo.psnr.raw").status == "failed"
    assert sheet.score("albedo.psnr.raw").breakdown == {}

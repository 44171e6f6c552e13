# SPDX-License-Identifier: Apache-2.0
"""Removal by region, light that leaks into albedo, and errors in units of the noise: known predictions."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import graycard.eval as ge
from changed_scene import SIGMA, enrich
from graycard import View, open_truth
from graycard.dataset import manifest_of
from graycard.eval.metrics._removal import EFFECTS
from graycard.io import write_layers, write_manifest
from graycard.records import ScoreSheet

Layers = dict[str, np.ndarray]
Change = Callable[[View, Layers], Layers]
Predict = Callable[..., Path]
PSNRS = tuple(f"counterfactual.psnr.{region}" for region in (*EFFECTS, "rest"))
RESIDUALS = tuple(f"counterfactual.residual.{region}" for region in EFFECTS)
LEAKS = ("albedo.leakage", "albedo.leakage.shadow", "albedo.leakage.highlight")


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory, write_tiny: Callable[..., Path]) -> Path:
    return enrich(write_tiny(tmp_path_factory.mktemp("removal"), track="tabletop"))


@pytest.fixture
def sheet_of(scene: Path, predict: Predict) -> Callable[[Change], ScoreSheet]:
    """``sheet_of(change)``, where ``change(view, layers)`` is given all true layers of a view."""
    truth = open_truth(scene / "truth", check=False)

    def make(change: Change) -> ScoreSheet:
        folder = predict(scene, lambda view, layers: layers | change(view, truth.layers(view)))
        return ge.score_predictions(folder, scene)

    return make


def value(sheet: ScoreSheet, metric: str) -> float:
    score = sheet.score(metric)
    assert score.status == "scored", score.reason
    assert score.value is not None
    return score.value


def kept(share: float, *regions: str) -> Change:
    """The object's effect stays by a share in some regions, and is gone elsewhere."""

    def change(view: View, layers: Layers) -> Layers:
        without, with_object = layers["counterfactual.radiance"], layers["radiance"]
        there = np.any([layers[f"effect.{region}"] > 0 for region in regions], axis=0)[..., None]
        return {"counterfactual.radiance": without + np.where(there, share, 0) * (with_object - without)}

    return change


def test_an_object_that_is_still_there_leaves_one(sheet_of: Callable[[Change], ScoreSheet]) -> None:
    sheet = sheet_of(lambda view, layers: {"counterfactual.radiance": layers["radiance"]})
    assert [value(sheet, metric) for metric in RESIDUALS] == pytest.approx([1, 1, 1])
    assert all(value(sheet, metric) < 40 for metric in PSNRS[:3])


@pytest.mark.parametrize("region", EFFECTS)
def test_each_region_is_judged_apart(sheet_of: Callable[[Change], ScoreSheet], region: str) -> None:
    sheet = sheet_of(kept(1.0, region))
    for other in EFFECTS:
        left = value(sheet, f"counterfactual.residual.{other}")
        assert left == pytest.approx(float(other == region), abs=1e-6)
        assert (value(sheet, f"counterfactual.psnr.{other}") < 40) == (other == region)
    assert value(sheet, "counterfactual.psnr.rest") == math.inf


def test_too_much_taken_away_is_no_better_than_too_little(
    sheet_of: Callable[[Change], ScoreSheet],
) -> None:
    score = sheet_of(kept(-0.25, "shadow")).score("counterfactual.residual.shadow")
    assert score.value == pytest.approx(0.25, abs=1e-6)
    assert score.breakdown["signed"] == pytest.approx(-0.25, abs=1e-6)


def test_an_error_elsewhere_is_no_residue(sheet_of: Callable[[Change], ScoreSheet]) -> None:
    def change(view: View, layers: Layers) -> Layers:
        touched = np.any([layers[f"effect.{region}"] > 0 for region in EFFECTS], axis=0)[..., None]
        return {"counterfactual.radiance": layers["counterfactual.radiance"] + np.where(touched, 0, 0.1)}

    sheet = sheet_of(change)
    assert [value(sheet, metric) for metric in RESIDUALS] == [0, 0, 0]
    assert value(sheet, "counterfactual.psnr.rest") < 30
    assert value(sheet, "counterfactual.psnr.shadow") == math.inf


def test_the_ceiling_of_a_region(scene: Path, sheet_of: Callable[[Change], ScoreSheet]) -> None:
    rng, truth = np.random.default_rng(3), open_truth(scene / "truth", check=False)
    held_out = [truth.layers(view) for view in truth.views if view.split == "test"]

    def change(view: View, layers: Layers) -> Layers:
        clean = layers["counterfactual.radiance"]
        return {"counterfactual.radiance": clean + rng.normal(0, SIGMA, clean.shape)}

    sheet = sheet_of(change)
    for region, metric in zip((*EFFECTS, "rest"), PSNRS, strict=True):
        score = sheet.score(metric)
        values = 3 * sum(int(np.sum((x["object_id"] > 0) & inside(x, region))) for x in held_out)
        chance = 10 / math.log(10) * math.sqrt(2 / values)
        assert value(sheet, metric) == pytest.approx(score.noise_ceiling, abs=4 * chance)


def inside(layers: Layers, region: str) -> np.ndarray:
    if region == "rest":
        return ~np.any([layers[f"effect.{effect}"] > 0 for effect in EFFECTS], axis=0)
    return layers[f"effect.{region}"] > 0


def test_a_removal_that_is_not_provided(scene: Path, predict: Predict) -> None:
    def without(view: View, layers: Layers) -> Layers:
        return {k: v for k, v in layers.items() if not k.startswith("counterfactual")}

    sheet = ge.score_predictions(predict(scene, without), scene)
    for metric in (*PSNRS, *RESIDUALS, "counterfactual.noise_rms"):
        assert sheet.score(metric).status == "not provided"
        assert sheet.score(metric).reason == "no view has counterfactual.radiance"


def test_a_faulty_view_fails(sheet_of: Callable[[Change], ScoreSheet]) -> None:
    def change(view: View, layers: Layers) -> Layers:
        bad = np.nan if view.name == "test_003" else 1
        return {"counterfactual.radiance": layers["counterfactual.radiance"] * bad}

    for metric in (*PSNRS, *RESIDUALS):
        score = sheet_of(change).score(metric)
        assert (score.status, score.value, score.scored, score.expected) == ("failed", None, 1, 2)
        assert "test_003: expected finite values" in score.reason


def test_a_residue_needs_an_effect() -> None:
    same = np.ones((2, 2, 3))
    with pytest.raises(ValueError, match="expected a region in which the object changes something"):
        ge.residual_energy(same, same, same, np.ones((2, 2), bool))


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0, -0.5])
def test_shading_to_a_power_leaks_by_that_power(
    sheet_of: Callable[[Change], ScoreSheet], share: float
) -> None:
    sheet = sheet_of(lambda view, layers: {"base_color": layers["base_color"] * layers["shading"] ** share})
    for metric in LEAKS[:2]:
        assert value(sheet, metric) == pytest.approx(abs(share), abs=1e-5)
        assert sheet.score(metric).breakdown["signed"] == pytest.approx(share, abs=1e-5)
    assert value(sheet, "albedo.leakage.highlight") == pytest.approx(0, abs=1e-5)


def test_a_constant_holds_no_light(sheet_of: Callable[[Change], ScoreSheet]) -> None:
    """Its error is the texture alone, which the light does not follow."""
    sheet = sheet_of(lambda view, layers: {"base_color": np.full_like(layers["base_color"], 0.18)})
    for metric in LEAKS[:2]:
        assert value(sheet, metric) < 0.1


@pytest.mark.parametrize("apart", ["albedo", "object"])
def test_what_lies_in_dark_places_is_no_leak(
    make_scene: Callable[..., Path], predict: Predict, apart: str
) -> None:
    """Two paints or objects, one mostly in the light: a prediction that is wrong for one holds no light."""
    scene = enrich(make_scene(track="multilight"))
    truth = open_truth(scene / "truth")
    for view in truth.views:
        layers = truth.layers(view)
        lit = layers["visibility.lamp"] > 0.5
        first = lit ^ (np.random.default_rng(4).random(lit.shape) < 0.25)
        albedo = np.where(first, 0.6, 0.1) if apart == "albedo" else np.full(lit.shape, 0.4)
        layers["base_color"] = np.repeat(albedo[..., None], 3, axis=-1).astype(np.float32)
        ids = np.where(first | (apart == "albedo"), 1, 2)
        layers["object_id"] = np.where(layers["object_id"] > 0, ids, 0).astype(np.uint32)
        write_layers(scene / "truth" / "views" / f"{view.name}.exr", layers)
    write_manifest(scene / "truth", manifest_of(truth))
    truth = open_truth(scene / "truth")

    def wrong(view: View, layers: Layers) -> Layers:
        second = truth.layers(view)["object_id"][..., None] == 2
        return layers | {"base_color": np.where(second, 0.5, 0.18) * np.ones(3, np.float32)}

    sheet = ge.score_predictions(predict(scene, wrong), scene)
    assert value(sheet, "albedo.leakage") == pytest.approx(0, abs=1e-6)


def test_highlights_leak_apart_from_shadows(sheet_of: Callable[[Change], ScoreSheet]) -> None:
    def change(view: View, layers: Layers) -> Layers:
        gloss = 1 + layers["direct.specular.lamp"] / np.maximum(layers["direct.diffuse.lamp"], 1e-9)
        return {"base_color": layers["base_color"] * gloss**0.6}

    sheet = sheet_of(change)
    assert value(sheet, "albedo.leakage.highlight") == pytest.approx(0.6, abs=1e-5)
    assert value(sheet, "albedo.leakage.shadow") == pytest.approx(0, abs=1e-5)


def test_a_fifth_of_wrong_pixels_moves_a_leak_little(sheet_of: Callable[[Change], ScoreSheet]) -> None:
    def change(view: View, layers: Layers) -> Layers:
        wrong = np.random.default_rng(1).random(layers["object_id"].shape)[..., None] < 0.2
        leaked = layers["base_color"] * layers["shading"] ** 0.5
        return {"base_color": np.where(wrong, 0.9, leaked)}

    sheet = sheet_of(change)
    for metric in LEAKS[:2]:
        assert value(sheet, metric) == pytest.approx(0.5, abs=0.02)


def test_metals_are_left_out_of_leaks(make_scene: Callable[..., Path], predict: Predict) -> None:
    scene = enrich(make_scene(track="multilight"))
    truth = open_truth(scene / "truth")
    for view in truth.views:
        layers = truth.layers(view)
        layers["metallic"] = (layers["object_id"] == 2).astype(np.float32)
        write_layers(scene / "truth" / "views" / f"{view.name}.exr", layers)
    write_manifest(scene / "truth", manifest_of(truth))

    def change(view: View, layers: Layers) -> Layers:
        true = truth.layers(view)
        ball = (true["object_id"] == 2)[..., None]
        return layers | {"base_color": np.where(ball, true["shading"], true["base_color"])}

    folder = predict(scene, change)
    truth = open_truth(scene / "truth", check=False)
    sheet = ge.score_predictions(folder, scene)
    assert value(sheet, "albedo.leakage") == value(sheet, "albedo.leakage.shadow") == 0


def test_shading_below_its_noise_tells_nothing(make_scene: Callable[..., Path], predict: Predict) -> None:
    scene = enrich(make_scene(track="multilight"))
    truth = open_truth(scene / "truth")
    for view in truth.views:
        layers = truth.layers(view)
        layers["shading.var"] = layers["shading"] ** 2
        write_layers(scene / "truth" / "views" / f"{view.name}.exr", layers)
    write_manifest(scene / "truth", manifest_of(truth))
    found = {s.metric for s in ge.score_predictions(predict(scene), scene).scores}
    assert not found & set(LEAKS)


@pytest.mark.parametrize("factor", [1.0, 3.0])
def test_noise_of_the_truths_size_is_one(sheet_of: Callable[[Change], ScoreSheet], factor: float) -> None:
    rng = np.random.default_rng(8)

    def change(view: View, layers: Layers) -> Layers:
        noise = rng.normal(0, factor * SIGMA, layers["radiance"].shape)
        return {name: layers[name] + noise for name in ("radiance", "counterfactual.radiance")}

    sheet = sheet_of(change)
    for metric in ("novel_view.noise_rms", "counterfactual.noise_rms"):
        assert value(sheet, metric) == pytest.approx(factor, rel=0.05)
        assert sheet.score(metric).noise_ceiling == pytest.approx(1, abs=0.05)


def test_without_halves_the_ceiling_is_one(tiny_scenes: dict[str, Path], predict: Predict) -> None:
    sheet = ge.score_predictions(predict(tiny_scenes["dark"]), tiny_scenes["dark"])
    assert sheet.score("novel_view.noise_rms").noise_ceiling == 1


def test_exact_truth_has_no_noise_to_measure_by(make_scene: Callable[..., Path], predict: Predict) -> None:
    scene = make_scene(sigma=0.0)
    found = {s.metric for s in ge.score_predictions(predict(scene), scene).scores}
    assert "novel_view.noise_rms" not in found


def test_a_mean_of_variances_cures_too_few_samples() -> None:
    """Four normal samples: errors over their own spread have no finite mean square, over neighbours' 1."""
    rng = np.random.default_rng(2)
    samples = rng.normal(0, 1, (4, 60, 60, 3))
    error, variance = samples.mean(axis=0), samples.var(axis=0, ddof=1) / 4
    pooled = ge.local_variance(variance, np.ones((60, 60), bool))
    assert np.mean(error**2 / pooled) == pytest.approx(75 / 73, abs=0.04)
    assert np.mean(error**2 / variance) > 2

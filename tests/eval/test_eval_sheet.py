# SPDX-License-Identifier: Apache-2.0
"""Whole score sheets: the truth against itself, and what each change of a prediction does."""

import math
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from skimage.metrics import mean_squared_error

import graycard.eval as ge
from graycard import (
    TRACKS,
    EnvironmentLight,
    Light,
    PointLight,
    SphereLight,
    View,
    open_truth,
    srgb_encode,
    world_position,
)
from graycard.dataset import manifest_of, write_index
from graycard.io import dumps, sha256, write_json, write_layers, write_manifest, write_rgb
from graycard.lights import write_lights
from graycard.records import ScoreSheet, read_score_sheet

Predict = Callable[..., Path]
Layers = dict[str, np.ndarray]
LAMP = PointLight("lamp", (0.3, -0.1, 0.0), (12.0, 10.0, 8.0), "camera")


def value(sheet: ScoreSheet, metric: str) -> float:
    score = sheet.score(metric)
    assert score.status == "scored", score.reason
    assert score.value is not None
    return score.value


def scaled(gains: tuple[float, ...], splits: tuple[str, ...] = ("train", "test")) -> Callable[..., Layers]:
    def change(view: View, layers: Layers) -> Layers:
        gain = np.array(gains) if view.split in splits else np.ones(3)
        return layers | {"base_color": layers["base_color"] * gain}

    return change


def roughened(view: View, layers: Layers) -> Layers:
    """Base colour with an error that no gauge mends."""
    noise = np.random.default_rng(len(view.name)).uniform(0.8, 1.2, layers["base_color"].shape)
    return layers | {"base_color": layers["base_color"] * noise}


@pytest.mark.parametrize("track", TRACKS)
def test_the_truth_reaches_the_optimum_of_every_metric(
    track: str, tiny_scenes: dict[str, Path], predict: Predict
) -> None:
    sheet = ge.score_predictions(predict(tiny_scenes[track]), tiny_scenes[track])
    for score in sheet.scores:
        assert score.status == "scored", score.reason
        assert score.value == score.optimum, score.metric
        assert score.expected == score.scored > 0
        assert score.protocol == ge.PROTOCOL == "graycard-1"
    assert (sheet.track, sheet.scene, sheet.method) == (track, "tiny-0000", "truth")


@pytest.mark.parametrize("track", TRACKS)
def test_scores_stand_in_the_order_of_the_table(
    track: str, tiny_scenes: dict[str, Path], predict: Predict
) -> None:
    sheet = ge.score_predictions(predict(tiny_scenes[track]), tiny_scenes[track])
    table = [m.id for m in ge.all_metrics()]
    found = [s.metric for s in sheet.scores]
    assert found == [name for name in table if name in found]
    assert ("counterfactual.psnr" in found) == (track == "tabletop")


def test_the_table_is_consistent() -> None:
    table = ge.all_metrics()
    assert len({m.id for m in table}) == len(table)
    headlines = {m.id: m.group for m in table if m.headline}
    assert len(set(headlines.values())) == len(headlines), "a group has one headline at most"
    assert headlines.keys() >= {
        "novel_view.psnr",
        "counterfactual.psnr",
        "albedo.psnr.channel",
        "relighting.psnr",
        "normal.mean_angle",
        "light.position",
    }
    assert all(m.id.startswith(f"{m.group}.") and m.formula and m.tolerance >= 0 for m in table)
    assert all(m.higher_is_better == (m.optimum > 0) for m in table)


def test_the_sheet_is_a_pure_function_and_survives_the_disk(
    tiny_scenes: dict[str, Path], predict: Predict, tmp_path: Path
) -> None:
    folder = predict(tiny_scenes["dark"], roughened)
    sheet = ge.score_predictions(folder, tiny_scenes["dark"])
    assert sheet == ge.score_predictions(folder, tiny_scenes["dark"])
    write_json(tmp_path / "scores.json", sheet)
    assert dumps(read_score_sheet(tmp_path / "scores.json")) == dumps(sheet)


def test_hashes_name_the_files_that_were_scored(tiny_scenes: dict[str, Path], predict: Predict) -> None:
    scene = tiny_scenes["dark"]
    first = ge.score_predictions(predict(scene), scene)
    assert first.truth_sha256 == sha256(scene / "truth" / "manifest.json")
    folder = predict(scene)
    assert ge.score_predictions(folder, scene).predictions_sha256 == first.predictions_sha256
    other = predict(scene, roughened)
    assert ge.score_predictions(other, scene).predictions_sha256 != first.predictions_sha256


def test_gains_move_raw_and_leave_the_channel_score(tiny_scenes: dict[str, Path], predict: Predict) -> None:
    scene, gains = tiny_scenes["dark"], np.array((1.7, 0.6, 1.1))

    def both(view: View, layers: Layers) -> Layers:
        return scaled(tuple(gains))(view, roughened(view, layers))

    plain, tinted = (ge.score_predictions(predict(scene, c), scene) for c in (roughened, both))
    for metric in ("albedo.psnr.channel", "albedo.ssim", "albedo.flip"):
        assert value(tinted, metric) == pytest.approx(value(plain, metric), abs=1e-5), metric
    assert abs(value(tinted, "albedo.psnr.raw") - value(plain, "albedo.psnr.raw")) > 3
    assert value(tinted, "albedo.psnr.scalar") < value(plain, "albedo.psnr.scalar") - 3
    fitted, before = tinted.score("albedo.psnr.channel").gauge, plain.score("albedo.psnr.channel").gauge
    assert fitted is not None
    assert before is not None
    assert np.array(fitted) * gains == pytest.approx(before, rel=1e-6)
    assert tinted.score("albedo.psnr.raw").gauge is None


def test_the_gauge_never_sees_a_test_view(tiny_scenes: dict[str, Path], predict: Predict) -> None:
    scene = tiny_scenes["dark"]
    sheet = ge.score_predictions(predict(scene, scaled((3, 3, 3), ("test",))), scene)
    assert sheet.score("albedo.psnr.channel").gauge == (1, 1, 1)
    assert value(sheet, "albedo.psnr.channel") == value(sheet, "albedo.psnr.raw") < 10
    train = ge.score_predictions(predict(scene, scaled((2, 4, 8), ("train",))), scene)
    assert train.score("albedo.ssim").gauge == (0.5, 0.25, 0.125)
    assert value(train, "albedo.psnr.raw") == math.inf
    assert value(train, "albedo.psnr.channel") < 20


def test_psnr_is_of_the_mean_error_and_not_the_mean_of_psnrs(
    tiny_scenes: dict[str, Path], predict: Predict
) -> None:
    scene = tiny_scenes["dark"]
    offsets = {"test_001": 0.001, "test_003": 0.1}

    def change(view: View, layers: Layers) -> Layers:
        return layers | {"base_color": layers["base_color"] + np.float32(offsets.get(view.name, 0))}

    score = ge.score_predictions(predict(scene, change), scene).score("albedo.psnr.raw")
    assert score.per_view == pytest.approx({"test_001": 60, "test_003": 20}, abs=1e-3)
    pooled = 10 * math.log10(1 / np.mean([1e-6, 1e-2]))
    assert score.value == pytest.approx(pooled, abs=1e-3)
    assert np.mean(list(score.per_view.values())) > pooled + 10


def test_radiance_is_compared_as_displayed(tiny_scenes: dict[str, Path], predict: Predict) -> None:
    scene = tiny_scenes["dark"]
    sheet = ge.score_predictions(
        predict(scene, lambda v, layers: layers | {"radiance": layers["radiance"] * 0.5}), scene
    )
    truth = open_truth(scene / "truth")
    errors = []
    for view in (v for v in truth.views if v.split == "test"):
        layers = truth.layers(view)
        shown = srgb_encode(layers["radiance"][layers["object_id"] > 0].astype(float) * truth.exposure)
        half = srgb_encode(layers["radiance"][layers["object_id"] > 0].astype(float) * truth.exposure / 2)
        errors.append(mean_squared_error(shown, half))
    assert value(sheet, "novel_view.psnr") == pytest.approx(-10 * math.log10(np.mean(errors)), abs=1e-6)
    assert value(sheet, "novel_view.flip") > 0.05
    assert value(sheet, "novel_view.ssim") < 0.999


def test_the_background_changes_nothing(tiny_scenes: dict[str, Path], predict: Predict) -> None:
    scene = tiny_scenes["tabletop"]
    truth = open_truth(scene / "truth")

    def wrong(view: View, layers: Layers) -> Layers:
        return {k: v * np.float32(0.9) + np.float32(0.01) for k, v in layers.items()}

    def wrong_outside(view: View, layers: Layers) -> Layers:
        seen = truth.layers(view)["object_id"].T > 0
        return {k: np.where(seen, v.T, 7).T.astype(np.float32) for k, v in wrong(view, layers).items()}

    first, second = (ge.score_predictions(predict(scene, c), scene) for c in (wrong, wrong_outside))
    assert [s.value for s in first.scores] == [s.value for s in second.scores]
    slack = ("light.", "normal.within", "depth.within")
    assert all(s.value != s.optimum for s in first.scores if not s.metric.startswith(slack))


def test_surfaces_of_lights_have_no_base_color_to_be_found(
    make_scene: Callable[..., Path], predict: Predict
) -> None:
    scene = make_scene()
    truth = open_truth(scene / "truth")
    manifest = manifest_of(truth)
    objects = tuple(replace(o, emits=o.id == 2) for o in truth.objects)
    write_index(scene / "truth", replace(truth, objects=objects))
    write_manifest(scene / "truth", manifest)

    def change(view: View, layers: Layers) -> Layers:
        ball = truth.layers(view)["object_id"].T == 2
        return {k: np.where(ball, 0.5, v.T).T for k, v in layers.items()}

    sheet = ge.score_predictions(predict(scene, change), scene)
    assert value(sheet, "albedo.psnr.raw") == value(sheet, "albedo.psnr.channel") == math.inf
    assert value(sheet, "novel_view.psnr") < 40
    assert value(sheet, "normal.mean_angle") > 1


def test_the_noise_ceiling_is_what_renoised_truth_scores(
    make_scene: Callable[..., Path], predict: Predict
) -> None:
    scene = make_scene(sigma=1e-3, test=3, train=3)
    clean = make_scene(sigma=0.0, test=3, train=3, scene="clean-0000")
    exact = open_truth(clean / "truth")

    def noise_free(view: View, layers: Layers) -> Layers:
        return layers | {"radiance": exact.layers(exact.view(view.name))["radiance"]}

    score = ge.score_predictions(predict(scene, noise_free), scene).score("novel_view.psnr")
    assert score.noise_ceiling is not None
    assert score.value == pytest.approx(score.noise_ceiling, abs=0.25)
    assert 20 < score.noise_ceiling < 60
    assert not score.warnings


def test_better_than_the_noise_allows_is_suspicious(tiny_scenes: dict[str, Path], predict: Predict) -> None:
    sheet = ge.score_predictions(predict(tiny_scenes["tabletop"]), tiny_scenes["tabletop"])
    for metric in ("novel_view.psnr", "counterfactual.psnr"):
        assert "above the" in sheet.score(metric).warnings[0]
        assert sheet.score(metric).noise_ceiling is not None
    assert sheet.score("albedo.psnr.raw").noise_ceiling is None


def test_an_exact_truth_has_no_ceiling(make_scene: Callable[..., Path], predict: Predict) -> None:
    scene = make_scene(sigma=0.0)
    score = ge.score_predictions(predict(scene), scene).score("novel_view.psnr")
    assert (score.noise_ceiling, score.warnings) == (None, ())


def test_flipped_normals(tiny_scenes: dict[str, Path], predict: Predict) -> None:
    scene = tiny_scenes["dark"]
    sheet = ge.score_predictions(
        predict(scene, lambda v, layers: layers | {"normal": -3 * layers["normal"]}), scene
    )
    assert value(sheet, "normal.mean_angle") == pytest.approx(180)
    assert value(sheet, "normal.median_angle") == pytest.approx(180)


def test_normals_of_length_zero_are_counted_and_told(tiny_scenes: dict[str, Path], predict: Predict) -> None:
    scene = tiny_scenes["dark"]
    sheet = ge.score_predictions(
        predict(scene, lambda v, layers: layers | {"normal": 0 * layers["normal"]}), scene
    )
    assert value(sheet, "normal.mean_angle") == 90
    assert "normals have length zero; each counts as 90°" in sheet.score("normal.mean_angle").warnings[0]


def test_importing_it_needs_no_renderer_and_no_torch() -> None:
    heavy = "{'mitsuba', 'torch', 'scipy', 'skimage', 'flip_evaluator'}"
    code = f"import graycard.eval, sys; print(sorted({heavy} & set(sys.modules)))"
    # Coverage of one subpackage imports numpy before the process starts, and it cannot be imported twice.
    plain = {name: value for name, value in os.environ.items() if not name.startswith("COV")}
    shown = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=plain
    )
    assert shown.stdout.strip() == "[]"


def test_lights_at_known_distances(make_scene: Callable[..., Path], predict: Predict) -> None:
    scene = make_scene()
    moved = replace(LAMP, position=(0.3, -0.1, 0.2), intensity=(24.0, 20.0, 16.0))
    sheet = ge.score_predictions(predict(scene, lights=(moved,)), scene)
    assert value(sheet, "light.position") == pytest.approx(100 * 0.2 / 4.0)
    assert value(sheet, "light.intensity") == pytest.approx(1)
    assert (value(sheet, "light.missing"), value(sheet, "light.extra")) == (0, 0)


def test_missing_extra_and_swapped_lights(make_scene: Callable[..., Path], predict: Predict) -> None:
    scene = make_scene(track="multilight")
    pair = (
        PointLight("a", (1.0, 0.0, 1.0), (5.0, 5.0, 5.0)),
        SphereLight("b", (-1.0, 0.5, 2.0), 0.1, (9.0, 9.0, 9.0)),
    )
    sky = EnvironmentLight("sky", "sky.exr")
    write_rgb(scene / "truth" / "sky.exr", np.ones((4, 8, 3)))
    write_lights(scene / "truth" / "lights.json", (*pair, sky))
    write_manifest(scene / "truth", manifest_of(open_truth(scene / "truth", check=False)))

    def scores(*lights: Light) -> list[float | None]:
        sheet = ge.score_predictions(predict(scene, lights=lights), scene)
        return [sheet.score(f"light.{name}").value for name in ("position", "intensity", "missing", "extra")]

    assert scores(*pair) == [0, 0, 0, 0], "an environment is not counted"
    assert scores(pair[1], sky, pair[0]) == [0, 0, 0, 0]
    assert scores(pair[0]) == [50, 5, 1, 0], "one of two found: the other is a scene away and 10 stops off"
    assert scores(*pair, LAMP) == [pytest.approx(100 / 3), 0, 0, 1]
    sheet = ge.score_predictions(predict(scene, lights=(pair[0],)), scene)
    position = sheet.score("light.position")
    assert (position.expected, position.scored) == (2, 1)
    assert sheet.score("light.intensity").warnings == ("1 of 2 lights have no partner; each counts 10 stops",)


def test_very_many_lights_do_not_pay(make_scene: Callable[..., Path], predict: Predict) -> None:
    """A grid that is dense enough to have a light next to any true one."""
    scene = make_scene()
    places = np.stack(np.meshgrid(*[np.linspace(-2, 2, 6)] * 3), -1).reshape(-1, 3).tolist()
    grid = tuple(PointLight(f"g{i}", (x, y, z), (1, 1, 1)) for i, (x, y, z) in enumerate(places))
    sheet = ge.score_predictions(predict(scene, lights=grid), scene)
    assert (sheet.score("light.position").value or 0) > 99


def test_a_scene_without_local_lights_has_counts_only(
    make_scene: Callable[..., Path], predict: Predict
) -> None:
    scene = make_scene()
    write_rgb(scene / "truth" / "sky.exr", np.ones((4, 8, 3)))
    write_lights(scene / "truth" / "lights.json", (EnvironmentLight("sky", "sky.exr"),))
    write_manifest(scene / "truth", manifest_of(open_truth(scene / "truth", check=False)))
    sheet = ge.score_predictions(predict(scene, lights=(LAMP,)), scene)
    found = {s.metric: s.value for s in sheet.scores if s.metric.startswith("light.")}
    assert found == {"light.missing": 0, "light.extra": 1}


def test_lights_are_placed_by_the_test_cameras(make_scene: Callable[..., Path], predict: Predict) -> None:
    scene = make_scene()
    fixed = replace(LAMP, position=(1.0, -2.0, 1.5), frame="world")
    sheet = ge.score_predictions(predict(scene, lights=(fixed,)), scene)
    cameras = [v.camera for v in open_truth(scene / "truth").views if v.split == "test"]
    away = [np.linalg.norm(world_position(LAMP, c) - fixed.position) for c in cameras]
    assert value(sheet, "light.position") == pytest.approx(100 * np.mean(away) / 4.0)


def test_a_ceiling_needs_the_noise_of_every_test_view(
    make_scene: Callable[..., Path], predict: Predict
) -> None:
    scene = make_scene()
    truth = open_truth(scene / "truth")
    layers = truth.layers(truth.view("test_003"))
    layers.pop("radiance.var")
    write_layers(scene / "truth" / "views" / "test_003.exr", layers)
    write_manifest(scene / "truth", manifest_of(truth))
    assert ge.score_predictions(predict(scene), scene).score("novel_view.psnr").noise_ceiling is None

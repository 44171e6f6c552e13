# SPDX-License-Identifier: Apache-2.0
"""Bad predictions: a failed score with its reason, never a skipped view, never a crash."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import graycard.eval as ge
from graycard import DatasetError, PointLight, PredictionError, View, open_predictions, open_truth
from graycard.dataset import manifest_of
from graycard.eval.kinds._images import ImageRule
from graycard.eval.kinds._lights import LightRule
from graycard.eval.kinds._metric import Metric
from graycard.eval.kinds._views import ViewRule
from graycard.io import write_bytes, write_layers, write_manifest, write_rgb
from graycard.lights import write_lights
from graycard.predictions import finish_predictions, write_view
from graycard.records import ScoreSheet

Predict = Callable[..., Path]
Layers = dict[str, np.ndarray]
HERE = frozenset({"radiance", "base_color", "normal", "depth"})
"""True layers of the scene; base colour is the only reflectance, so it gauges light, too."""
TRAINING = "training_view.psnr"


def judged(metric: Metric[Any]) -> bool:
    """True if the scene has an image metric, by its layers alone."""
    rule = metric.rule
    if not metric.available() or (isinstance(rule, ImageRule) and rule.chart):
        return False
    if isinstance(rule, ViewRule):
        return all(need.removesuffix(".var") in HERE for need in rule.needs)
    return isinstance(rule, ImageRule) and metric.layer in HERE


IMAGES = tuple(m.id for m in ge.registry() if judged(m))
ALBEDO = tuple(m.id for m in ge.registry() if judged(m) and m.layer == "base_color")
NORMAL = tuple(m.id for m in ge.registry() if judged(m) and m.layer == "normal")
LAMP = PointLight("lamp", (0, 0, 0), (1, 1, 1))
LIGHT_METRICS = tuple(m for m in ge.registry() if isinstance(m.rule, LightRule) and m.rule.judges(LAMP))
"""Those that a scene with a point light alone has."""
LIGHTS = tuple(m.id for m in LIGHT_METRICS)
PARTNERED = {m.id: m.rule.price for m in LIGHT_METRICS if m.rule.error}
"""Price of a missed light."""
GAUGED = tuple(m.id for m in ge.registry() if judged(m) and m.gauge)
GAUGED_TOO = (*GAUGED, *(m.id for m in LIGHT_METRICS if m.gauge))


@pytest.fixture
def scene(tiny_scenes: dict[str, Path]) -> Path:
    return tiny_scenes["dark"]


def statuses(sheet: ScoreSheet) -> dict[str, str]:
    return {s.metric: s.status for s in sheet.scores}


def expect(sheet: ScoreSheet, status: str, metrics: tuple[str, ...], *words: str) -> None:
    """Exactly these metrics have this status, with these words in the reason; all others are scored."""
    assert {m for m, s in statuses(sheet).items() if s == status} == set(metrics)
    assert {s for m, s in statuses(sheet).items() if m not in metrics} <= {"scored"}
    for metric in metrics:
        score = sheet.score(metric)
        assert score.value is None
        assert score.expected > 0
        for word in words:
            assert word in score.reason, score.reason


def edit(layer: str, change: Callable[[np.ndarray], np.ndarray | None], view: str) -> Callable[..., Layers]:
    """Change one layer of one view; None leaves it out."""

    def apply(seen: View, layers: Layers) -> Layers:
        if seen.name != view:
            return layers
        changed = change(layers[layer].copy())
        rest = {k: v for k, v in layers.items() if k != layer}
        return rest if changed is None else rest | {layer: changed}

    return apply


def spoil(value: float) -> Callable[[np.ndarray], np.ndarray]:
    def apply(values: np.ndarray) -> np.ndarray:
        values[14, 12, 1] = value  # where an object is seen
        return values

    return apply


@pytest.mark.parametrize(("value", "shown"), [(np.nan, "nan"), (np.inf, "inf")])
def test_values_that_are_not_finite(scene: Path, predict: Predict, value: float, shown: str) -> None:
    sheet = ge.score_predictions(predict(scene, edit("normal", spoil(value), "test_003")), scene)
    words = (
        f"test_003: expected finite values in normal, got {shown}",
        "first at (14, 12, 1)",
        "Write this view",
    )
    expect(sheet, "failed", NORMAL, *words)
    score = sheet.score("normal.mean_angle")
    assert (score.expected, score.scored, list(score.per_view)) == (2, 1, ["test_001"])


def test_a_wrong_size(scene: Path, predict: Predict) -> None:
    def smaller(view: View, layers: Layers) -> Layers:
        return {k: v[:-1] for k, v in layers.items()} if view.name == "test_001" else layers

    sheet = ge.score_predictions(predict(scene, smaller), scene)
    expect(sheet, "failed", IMAGES, "test_001: expected", "of shape (24, 28", ", got (23, 28")


def test_a_layer_that_one_test_view_lacks(scene: Path, predict: Predict) -> None:
    sheet = ge.score_predictions(predict(scene, edit("base_color", lambda v: None, "test_001")), scene)
    words = ("test_001: expected base_color in views/test_001.exr, got depth, normal, radiance", "every view")
    expect(sheet, "failed", ALBEDO, *words)


def test_a_layer_that_no_view_has_is_not_provided(scene: Path, predict: Predict) -> None:
    def without(view: View, layers: Layers) -> Layers:
        return {k: v for k, v in layers.items() if k != "base_color"}

    sheet = ge.score_predictions(predict(scene, without), scene)
    expect(sheet, "not provided", ALBEDO, "no view has base_color")
    assert sheet.score("albedo.psnr.raw").expected == 2


def test_a_layer_on_training_views_only_is_missing_and_not_absent(scene: Path, predict: Predict) -> None:
    def train_only(view: View, layers: Layers) -> Layers:
        return {k: v for k, v in layers.items() if k != "base_color" or view.split == "train"}

    sheet = ge.score_predictions(predict(scene, train_only), scene)
    expect(sheet, "failed", ALBEDO, "test_001: expected base_color", "(and 1 more)")


def test_a_view_without_a_file(scene: Path, predict: Predict) -> None:
    folder = predict(scene, lambda view, layers: None if view.name == "test_003" else layers)
    sheet = ge.score_predictions(folder, scene)
    expect(sheet, "failed", IMAGES, "test_003: expected", "in views/test_003.exr, got no file")


def test_a_view_that_was_lost_after_it_was_listed(scene: Path, predict: Predict) -> None:
    folder = predict(scene)
    (folder / "views" / "test_003.exr").unlink()
    sheet = ge.score_predictions(folder, scene)
    expect(sheet, "failed", IMAGES, "expected views/test_003.exr, which predictions.json lists, got none")


def test_lights_alone_are_scored_and_images_are_not_provided(scene: Path, predict: Predict) -> None:
    sheet = ge.score_predictions(predict(scene, lambda view, layers: None), scene)
    expect(sheet, "not provided", (*IMAGES, TRAINING), "no view has")


@pytest.mark.parametrize(
    ("name", "more"), [("test_001", ()), ("train_000", ("light.intensity.channel", TRAINING))]
)
def test_a_truncated_file_fails_all_images(
    scene: Path, predict: Predict, name: str, more: tuple[str, ...]
) -> None:
    folder = predict(scene)
    path = folder / "views" / f"{name}.exr"
    path.write_bytes(path.read_bytes()[:900])
    index = open_predictions(folder)
    finish_predictions(folder, index)
    sheet = ge.score_predictions(folder, scene)
    expect(
        sheet, "failed", IMAGES + more, f"{name}: expected a whole EXR file", "900 bytes", "Write it again"
    )


def test_a_file_that_changed_after_its_hash_was_taken(scene: Path, predict: Predict) -> None:
    folder = predict(scene)
    layers = open_predictions(folder).layers("test_001")
    write_view(folder, "test_001", layers | {"normal": -layers["normal"]})
    sheet = ge.score_predictions(folder, scene)
    expect(sheet, "failed", IMAGES, "test_001: expected", "it changed after predictions.json was written")


def test_a_wrong_channel_name(scene: Path, predict: Predict) -> None:
    folder = predict(scene)
    path = folder / "views" / "test_001.exr"
    path.unlink()
    write_rgb(path, np.zeros((24, 28, 3)))
    finish_predictions(folder, open_predictions(folder))
    sheet = ge.score_predictions(folder, scene)
    expect(sheet, "failed", IMAGES, "expected channels named <layer>.<suffix>", "got R, G, B", "Rename them")


def test_a_gauge_needs_base_color_on_the_training_views(scene: Path, predict: Predict) -> None:
    def test_only(view: View, layers: Layers) -> Layers:
        return {k: v for k, v in layers.items() if k != "base_color" or view.split == "test"}

    sheet = ge.score_predictions(predict(scene, test_only), scene)
    words = ("expected base_color on the training views, where the gauge is fitted, got 3", "train_000")
    expect(sheet, "failed", GAUGED, *words)
    assert sheet.score("albedo.psnr.raw").status == "scored"
    assert sheet.score("albedo.psnr.channel").gauge is None


def test_one_faulty_training_view_is_not_left_out_of_the_gauge(scene: Path, predict: Predict) -> None:
    sheet = ge.score_predictions(predict(scene, edit("base_color", spoil(np.nan), "train_002")), scene)
    expect(
        sheet,
        "failed",
        (*GAUGED, "light.intensity.channel"),
        "got 1 of them without: train_002: expected finite values",
    )


def test_a_black_prediction_has_no_gauge(scene: Path, predict: Predict) -> None:
    def black(view: View, layers: Layers) -> Layers:
        return layers | {"base_color": 0 * layers["base_color"]}

    sheet = ge.score_predictions(predict(scene, black), scene)
    expect(sheet, "failed", GAUGED_TOO, "black in channel R wherever an object is seen")
    assert sheet.score("albedo.psnr.raw").value is not None


def test_views_that_the_scene_does_not_have(scene: Path, predict: Predict) -> None:
    folder = predict(scene)
    write_view(folder, "bonus_000", {"radiance": np.zeros((24, 28, 3))})
    sheet = ge.score_predictions(folder, scene)
    assert set(statuses(sheet).values()) == {"scored"}
    for metric in (m for m in IMAGES if not m.endswith("noise_rms")):
        assert "does not have were left out: bonus_000" in sheet.score(metric).warnings[0]


def test_predictions_for_another_scene(tiny_scenes: dict[str, Path], predict: Predict) -> None:
    with pytest.raises(PredictionError, match="expected predictions for dark/tiny-0000, got some for tab"):
        ge.score_predictions(predict(tiny_scenes["tabletop"]), tiny_scenes["dark"])


def test_a_folder_without_predictions(scene: Path, tmp_path: Path) -> None:
    with pytest.raises(PredictionError, match=r"expected a predictions folder with predictions.json"):
        ge.score_predictions(tmp_path, scene)


def test_lights_that_are_not_provided(scene: Path, predict: Predict) -> None:
    sheet = ge.score_predictions(predict(scene, lights=None), scene)
    expect(sheet, "not provided", LIGHTS, "there is no lights.json")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[{", "expected JSON in"),
        ('{"lamp": 1}', "expected a JSON list of lights"),
        ('[{"type": "laser"}]', "expected a light type that exists, got 'laser'"),
        ('[{"type": "point", "name": "a", "position": [0, 0, 0]}]', "intensity"),
    ],
)
def test_lights_that_cannot_be_read(scene: Path, predict: Predict, text: str, words: str) -> None:
    folder = predict(scene, lights=None)
    write_bytes(folder / "lights.json", text.encode())
    expect(ge.score_predictions(folder, scene), "failed", LIGHTS, words)


@pytest.mark.parametrize("lost", [True, False])
def test_lights_that_changed_after_their_hash_was_taken(scene: Path, predict: Predict, lost: bool) -> None:
    folder = predict(scene)
    if lost:
        (folder / "lights.json").unlink()
    else:
        write_lights(folder / "lights.json", ())
    words = ("lights.json with SHA-256", "got none" if lost else "it changed after")
    expect(ge.score_predictions(folder, scene), "failed", LIGHTS, *words)


def test_a_light_nowhere(scene: Path, predict: Predict) -> None:
    light = PointLight("lost", (0.0, np.nan, 0.0), (1.0, 1.0, 1.0))
    sheet = ge.score_predictions(predict(scene, lights=(light,)), scene)
    expect(sheet, "failed", LIGHTS, "expected light 'lost' with a finite position, got [0.0, nan, 0.0]")


def test_a_light_that_is_off_fails_its_intensity_and_colour_only(scene: Path, predict: Predict) -> None:
    light = PointLight("off", (0.3, -0.1, 0.0), (0.0, 0.0, 0.0), "camera")
    sheet = ge.score_predictions(predict(scene, lights=(light,)), scene)
    expect(sheet, "failed", tuple(PARTNERED), "expected light 'off' with a")


def test_an_empty_list_of_lights_finds_none(scene: Path, predict: Predict) -> None:
    sheet = ge.score_predictions(predict(scene, lights=()), scene)
    assert {m: sheet.score(m).value for m in PARTNERED} == PARTNERED
    assert [sheet.score(m).value for m in LIGHTS if m not in PARTNERED] == [100, 1, 0]


def rewrite_truth(scene: Path, change: Callable[[View, Layers], Layers | None]) -> None:
    """Change the true layers and seal the folder again, as a broken generator would."""
    truth = open_truth(scene / "truth")
    for view in truth.views:
        if (changed := change(view, truth.layers(view))) is not None:
            write_layers(scene / "truth" / "views" / f"{view.name}.exr", changed)
    write_manifest(scene / "truth", manifest_of(truth))


def test_a_damaged_truth_is_never_scored_by(make_scene: Callable[..., Path], predict: Predict) -> None:
    scene = make_scene()
    folder = predict(scene)
    with open(scene / "truth" / "views" / "test_001.exr", "r+b") as file:
        file.seek(-3, 2)
        file.write(b"\x00")
    with pytest.raises(DatasetError, match="expected the files of .* to be as they were written"):
        ge.score_predictions(folder, scene)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda v, x: {k: a for k, a in x.items() if k != "normal"}, "expected normal in the truth of view"),
        (lambda v, x: x | {"base_color": x["base_color"] * np.nan}, "truth of view .*: expected finite"),
        (lambda v, x: x | {"normal": x["normal"] * 0}, "expected true normals of unit length in view"),
        (lambda v, x: x | {"object_id": x["object_id"] * 0}, "expected a test view that sees something"),
    ],
)
def test_a_truth_that_cannot_judge(
    make_scene: Callable[..., Path], predict: Predict, change: Callable[..., Layers], words: str
) -> None:
    scene = make_scene()
    folder = predict(scene)
    rewrite_truth(scene, change)
    with pytest.raises(DatasetError, match=words):
        ge.score_predictions(folder, scene)


def test_a_scene_without_test_views(make_scene: Callable[..., Path], predict: Predict) -> None:
    scene = make_scene(train=3, test=0)
    with pytest.raises(DatasetError, match="expected test and train views in .*truth.json, got 3 views"):
        ge.score_predictions(predict(scene), scene)


def test_training_views_that_see_nothing_fit_no_gauge(
    make_scene: Callable[..., Path], predict: Predict
) -> None:
    scene = make_scene()
    rewrite_truth(scene, lambda v, x: x | {"object_id": x["object_id"] * np.uint32(v.split == "test")})
    sheet = ge.score_predictions(predict(scene), scene)
    expect(sheet, "failed", GAUGED_TOO, "no training view sees an object")


def test_a_test_view_that_sees_nothing_is_not_expected(
    make_scene: Callable[..., Path], predict: Predict
) -> None:
    scene = make_scene()
    rewrite_truth(scene, lambda v, x: x | {"object_id": x["object_id"] * np.uint32(v.name != "test_001")})
    score = ge.score_predictions(predict(scene), scene).score("novel_view.psnr")
    assert (score.expected, score.scored, list(score.per_view)) == (1, 1, ["test_003"])


def test_an_object_too_small_for_the_window_of_ssim(
    make_scene: Callable[..., Path], predict: Predict
) -> None:
    scene = make_scene()
    corner = np.zeros((24, 28), np.uint32)
    corner[:8, :8] = 1
    rewrite_truth(scene, lambda v, x: x | {"object_id": corner, "normal": x["normal"] + 1})
    score = ge.score_predictions(predict(scene), scene).score("novel_view.ssim")
    assert score.value == pytest.approx(1)
    assert "test_001: no SSIM window fits into the mask" in score.warnings[0]

# SPDX-License-Identifier: Apache-2.0
"""Published protocols from predictions folders into score sheets, with their faults."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import graycard.eval as ge
from graycard import DatasetError, UnknownNameError, View, open_predictions, open_truth
from graycard.dataset import manifest_of
from graycard.eval.protocols import PUBLISHED, AlbedoView, AlbedoViews
from graycard.io import dumps, write_json, write_layers, write_manifest
from graycard.predictions import finish_predictions
from graycard.records import read_score_sheet

Predict = Callable[..., Path]
Layers = dict[str, np.ndarray]
NAMES = [p.id for p in PUBLISHED]


@pytest.fixture
def scene(tiny_scenes: dict[str, Path]) -> Path:
    return tiny_scenes["dark"]


def faded(view: View, layers: Layers) -> Layers:
    noise = np.random.default_rng(len(view.name)).uniform(0.6, 0.9, layers["base_color"].shape)
    return layers | {"base_color": (layers["base_color"] * noise).astype(np.float32)}


def without(layer: str, *views: str) -> Callable[[View, Layers], Layers]:
    def change(view: View, layers: Layers) -> Layers:
        return {k: v for k, v in layers.items() if k != layer or (views and view.name not in views)}

    return change


def test_all_protocols_stand_beside_the_sheet_and_survive_the_disk(
    scene: Path, predict: Predict, tmp_path: Path
) -> None:
    folder = predict(scene, faded)
    sheet = ge.score_predictions(folder, scene, "all")
    assert sheet.scores == ge.score_predictions(folder, scene).scores
    assert [s.protocol for s in sheet.protocols] == NAMES
    for score in sheet.protocols:
        assert (score.status, score.expected, score.scored) == ("scored", 2, 2)
        assert list(score.per_view) == ["test_001", "test_003"]
    write_json(tmp_path / "s.json", sheet)
    assert [s["protocol"] for s in json.loads((tmp_path / "s.json").read_text())["protocols"]] == NAMES
    assert dumps(read_score_sheet(tmp_path / "s.json")) == dumps(sheet)


def test_one_protocol_alone(scene: Path, predict: Predict) -> None:
    sheet = ge.score_predictions(predict(scene, faded), scene, "tensoir-three")
    (score,) = sheet.protocols
    assert sheet.scores == ()
    assert (score.metric, score.protocol, score.unit) == ("albedo.psnr", "tensoir-three-1", "dB")
    assert score.gauge is not None
    assert all(f > 1.1 for f in score.gauge)
    lmse = ge.score_predictions(predict(scene, faded), scene, "mit-lmse-1").protocols[0]
    assert (lmse.metric, lmse.unit, lmse.higher_is_better) == ("albedo.lmse", "1", False)
    assert ge.score_predictions(predict(scene), scene).protocols == ()


def test_the_views_are_those_of_the_folder(scene: Path, predict: Predict) -> None:
    folder = predict(scene, faded)
    truth, found = open_truth(scene / "truth"), open_predictions(folder)

    def view(name: str) -> AlbedoView:
        true = truth.layers(truth.view(name))
        return AlbedoView(name, found.layers(name)["base_color"], true["base_color"], true["object_id"] > 0)

    views = AlbedoViews((view("test_001"), view("test_003")), view("train_000"))
    sheet = ge.score_predictions(folder, scene, "all")
    assert [s.value for s in sheet.protocols] == [p.score(views).value for p in PUBLISHED]


def test_a_view_without_base_color_fails_them_all(scene: Path, predict: Predict) -> None:
    sheet = ge.score_predictions(predict(scene, without("base_color", "test_003")), scene, "all")
    for score in sheet.protocols:
        assert (score.status, score.value, score.expected, score.scored) == ("failed", None, 2, 0)
        assert "test_003: expected base_color in views/test_003.exr" in score.reason


def test_no_base_color_at_all_is_not_provided(scene: Path, predict: Predict) -> None:
    sheet = ge.score_predictions(predict(scene, without("base_color")), scene, "all")
    assert {(s.status, s.reason) for s in sheet.protocols} == {("not provided", "no view has base_color")}


def test_an_unreadable_file_may_have_held_it(scene: Path, predict: Predict) -> None:
    folder = predict(scene, without("base_color"))
    path = folder / "views" / "test_001.exr"
    path.write_bytes(path.read_bytes()[:700])
    finish_predictions(folder, open_predictions(folder))
    sheet = ge.score_predictions(folder, scene, "gs-ir")
    assert sheet.protocols[0].status == "failed"
    assert "expected a whole EXR file" in sheet.protocols[0].reason


def test_only_who_fits_on_a_training_view_needs_one(scene: Path, predict: Predict) -> None:
    sheet = ge.score_predictions(predict(scene, without("base_color", "train_000")), scene, "all")
    failed = [s for s in sheet.protocols if s.status == "failed"]
    assert [s.protocol for s in failed] == ["nerfactor-1"]
    assert "on the first training view" in failed[0].reason


def test_a_training_view_that_sees_nothing_is_passed_over(
    make_scene: Callable[..., Path], predict: Predict
) -> None:
    scene = make_scene()
    blind(scene, lambda view: view.name == "train_000")
    sheet = ge.score_predictions(predict(scene, without("base_color", "train_000")), scene, "nerfactor")
    assert sheet.protocols[0].status == "scored"
    blind(scene, lambda view: view.split == "train")
    sheet = ge.score_predictions(predict(scene), scene, "nerfactor")
    assert sheet.protocols[0].status == "failed"


def test_a_truth_without_objects_is_no_dataset(make_scene: Callable[..., Path], predict: Predict) -> None:
    scene = make_scene()
    blind(scene, lambda view: view.split == "test")
    with pytest.raises(DatasetError, match="expected a test view that sees an object, got none. Render"):
        ge.score_predictions(predict(scene), scene, "gs-ir")


def blind(scene: Path, which: Callable[[View], bool]) -> None:
    """Let views see nothing."""
    truth = open_truth(scene / "truth")
    manifest = manifest_of(truth)
    for view in filter(which, truth.views):
        layers = truth.layers(view)
        layers["object_id"] = np.zeros_like(layers["object_id"])
        write_layers(scene / "truth" / "views" / f"{view.name}.exr", layers)
    write_manifest(scene / "truth", manifest)


def test_a_protocol_that_nobody_knows(scene: Path) -> None:
    with pytest.raises(
        UnknownNameError, match=r"expected a protocol that exists, got 'gsir'.*did you mean 'gs-ir'"
    ):
        ge.score_predictions(Path("nowhere"), scene, "gsir")

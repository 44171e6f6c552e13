# SPDX-License-Identifier: Apache-2.0
"""Published protocols from predictions folders into score sheets, with their faults."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import graycard.eval as ge
from changed_scene import EDITS, enrich
from graycard import DatasetError, UnknownNameError, View, open_predictions, open_truth, srgb_encode
from graycard.dataset import manifest_of
from graycard.eval.protocols import ALBEDO, FORMER, PUBLISHED, JudgedView, JudgedViews, LpipsProtocol
from graycard.io import dumps, write_json, write_layers, write_manifest
from graycard.networks import has_lpips
from graycard.predictions import finish_predictions, write_relit
from graycard.records import read_score_sheet

Predict = Callable[..., Path]
Layers = dict[str, np.ndarray]
NAMES = [p.id for p in PUBLISHED]
OF_COLOUR = [p.id for p in PUBLISHED if p.subject == "base_color"]
OF_WEIGHTS = [p.id for p in PUBLISHED if isinstance(p, LpipsProtocol) and not has_lpips(p.net)]
"""Protocols that need weights which are not there."""


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
    there = [s for s in sheet.protocols if s.metric.split(".")[0] not in ("relighting", "roughness")]
    for score in (s for s in there if s.protocol not in OF_WEIGHTS):
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

    def view(name: str) -> JudgedView:
        true = truth.layers(truth.view(name))
        return JudgedView(name, found.layers(name)["base_color"], true["base_color"], true["object_id"] > 0)

    views = JudgedViews((view("test_001"), view("test_003")), view("train_000"))
    sheet = ge.score_predictions(folder, scene, "albedo")
    assert [s.value for s in sheet.protocols] == [p.score(views).value for p in ALBEDO]
    assert sheet.scores, "graycard's own stand beside them"


def test_a_view_without_base_color_fails_them_all(scene: Path, predict: Predict) -> None:
    sheet = ge.score_predictions(predict(scene, without("base_color", "test_003")), scene, "all")
    for score in (s for s in sheet.protocols if s.protocol in OF_COLOUR):
        assert (score.status, score.value, score.expected, score.scored) == ("failed", None, 2, 0)
        assert "test_003: expected base_color in views/test_003.exr" in score.reason


def test_no_base_color_at_all_is_not_provided(scene: Path, predict: Predict) -> None:
    sheet = ge.score_predictions(predict(scene, without("base_color")), scene, "all")
    found = {(s.status, s.reason) for s in sheet.protocols if s.protocol in OF_COLOUR}
    assert found == {("not provided", "no view has base_color")}


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
    assert [s.protocol for s in failed] == ["nerfactor-2"]
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


Relight = Callable[[str, View, np.ndarray], np.ndarray | None]


@pytest.fixture(scope="module")
def changed(tmp_path_factory: pytest.TempPathFactory, write_tiny: Callable[..., Path]) -> Path:
    return enrich(write_tiny(tmp_path_factory.mktemp("changed"), track="multilight"))


@pytest.fixture
def relit(changed: Path, predict: Predict) -> Callable[[Relight], Path]:
    """``relit(picture)`` writes predictions with the pictures of changed light that ``picture`` gives."""

    def make(picture: Relight) -> Path:
        truth, folder = open_truth(changed / "truth", check=False), predict(changed)
        for view in (v for v in truth.views if v.split == "test"):
            for edit in EDITS:
                made = picture(edit.name, view, truth.relit(edit.name, view)["radiance"])
                if made is not None:
                    write_relit(folder, edit.name, view.name, made)
        finish_predictions(folder, open_predictions(folder), truth.lights())
        return folder

    return make


def test_relit_pictures_are_judged_by_rules_for_relit_pictures(
    changed: Path, relit: Callable[[Relight], Path]
) -> None:
    pictures = [f"{edit.name}/{view}" for edit in EDITS for view in ("test_001", "test_003")]
    dimmed = ge.score_predictions(relit(lambda e, v, true: 0.5 * true), changed, "relighting").protocols
    exact = ge.score_predictions(relit(lambda e, v, true: true), changed, "relighting").protocols
    for half, whole in zip(dimmed, exact, strict=True):
        assert (half.status, half.expected, half.scored) == ("scored", 8, 8), half.reason
        assert list(half.per_view) == pictures
        assert half.value == pytest.approx(whole.value, abs=1e-6), "each takes a gain off"


def test_relit_pictures_that_are_not_there(changed: Path, relit: Callable[[Relight], Path]) -> None:
    nothing = ge.score_predictions(relit(lambda e, v, true: None), changed, "relighting").protocols
    assert {s.status for s in nothing} == {"not provided"}
    lost = ("moved-lamp", "test_003")
    folder = relit(lambda e, v, true: None if (e, v.name) == lost else true)
    for score in ge.score_predictions(folder, changed, "relighting").protocols:
        assert (score.status, score.value) == ("failed", None)
        assert "got none of moved-lamp/test_003. Write all of a kind" in score.reason
    folder = relit(lambda e, v, true: true[:-1] if e == "moved-lamp" else true)
    for score in ge.score_predictions(folder, changed, "relighting").protocols:
        assert "moved-lamp, test_001: expected radiance of shape" in score.reason


def test_a_scene_without_the_subject_is_not_provided(scene: Path, predict: Predict) -> None:
    found = ge.score_predictions(predict(scene), scene, "all").protocols
    missing = {s.protocol: s.reason for s in found if s.status == "not provided"}
    assert missing["owl-2"] == "the scene has no picture under other lights"
    assert missing["r3dg-roughness-1"] == "the scene has no roughness to judge"


def test_views_are_judged_at_the_exposure_of_the_scene(scene: Path, predict: Predict) -> None:
    (found,) = ge.score_predictions(predict(scene, half_as_bright), scene, "3dgs-psnr").protocols
    truth = open_truth(scene / "truth")
    each = []
    for view in (v for v in truth.views if v.split == "test"):
        true = truth.layers(view)["radiance"].astype(np.float64) * truth.exposure
        shown = [np.round(srgb_encode(x) * 255) / 255 for x in (true / 2, true)]
        each.append(-10 * np.log10(np.mean((shown[0] - shown[1]) ** 2)))
    assert found.value == pytest.approx(np.mean(each), abs=1e-3)


def half_as_bright(view: View, layers: Layers) -> Layers:
    return layers | {"radiance": layers["radiance"] / 2}


@pytest.mark.parametrize(
    "group", ["albedo", "appearance", "perceptual", "views", "relighting", "geometry", "materials"]
)
def test_a_group_holds_the_protocols_of_its_subject(group: str) -> None:
    found = ge.find_protocols(group)
    assert set(found) <= set(ge.all_protocols())
    assert (ge.find_protocols("graycard")[0] in found) is (group == "albedo")


@pytest.mark.parametrize("former", FORMER)
def test_a_former_version_no_longer_scores_and_says_why(former: str) -> None:
    name, _, version = former.rpartition("-")
    (now,) = ge.find_protocols(name)
    assert now.version > int(version)
    with pytest.raises(UnknownNameError, match=rf"got '{former}'.*{former} .*: score by a newer version"):
        ge.find_protocols(former)

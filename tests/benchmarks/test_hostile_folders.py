# SPDX-License-Identifier: Apache-2.0
"""Folders of strangers: nothing is written outside of the target, nothing is read outside of the folder."""

import json
import math
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from changed_scene import enrich
from graycard import DatasetError, GraycardError, open_capture, open_predictions, open_truth
from graycard.benchmarks import FitSpec, fit_scene
from graycard.dataset import manifest_of
from graycard.eval import score_predictions
from graycard.io import silent, write_manifest, write_rgb
from graycard.lights import EnvironmentLight
from graycard.methods import load_method
from graycard.predictions import write_composed, write_environment, write_relit, write_view

ESCAPES = (
    "../../../../outside/pwn", "/tmp/graycard-pwn", "..", "a/../../b", "a\\..\\b", "con", "x\x1b[2J", ".x",
)  # fmt: skip


@pytest.fixture
def scene(make_scene: Callable[..., Path], tmp_path: Path) -> Path:
    (tmp_path / "outside").mkdir()
    return enrich(make_scene(track="multilight"))


def edited(path: Path, change: Callable[[Any], object], part: Path) -> None:
    """Change JSON data of a part of a scene, and seal it again."""
    manifest = manifest_of(open_capture(part) if part.name == "capture" else open_truth(part))
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))
    write_manifest(part, manifest)


def written(root: Path) -> set[Path]:
    return {path for path in root.rglob("*") if path.is_file()}


def refused(scene: Path, out: Path, method: str = "gray") -> str:
    """Fit a method on a scene that is refused; returns the words, and proves that nothing was written."""
    before = written(out.parent)
    with pytest.raises(GraycardError) as caught:
        fit_scene(FitSpec(method, {}, 0, scene), out, silent)
    assert written(out.parent) == before
    return str(caught.value)


@pytest.mark.parametrize("name", ESCAPES)
@pytest.mark.parametrize("split", ["train", "test"])
def test_a_view_cannot_leave_the_predictions(scene: Path, tmp_path: Path, name: str, split: str):
    def rename(data: Any) -> None:
        next(view for view in data["views"] if view["split"] == split)["name"] = name

    edited(scene / "capture" / "capture.json", rename, scene / "capture")
    assert "expected a name" in refused(scene, tmp_path / "p")


@pytest.mark.parametrize("name", ESCAPES)
def test_an_edit_cannot_leave_the_predictions(scene: Path, tmp_path: Path, name: str):
    edited(scene / "truth" / "truth.json", lambda d: d["edits"][0].update(name=name), scene / "truth")
    assert "expected a name" in refused(scene, tmp_path / "p", "truth")


@pytest.mark.parametrize("field", ["track", "scene"])
def test_a_scene_cannot_be_named_like_a_path(scene: Path, tmp_path: Path, field: str):
    edited(scene / "capture" / "capture.json", lambda d: d.update({field: "../x"}), scene / "capture")
    assert "expected a name" in refused(scene, tmp_path / "p")


@pytest.mark.parametrize("image", [*ESCAPES, "../../../../outside/x.py", "views/../../lights.json"])
def test_the_image_of_a_light_is_copied_from_its_folder_alone(scene: Path, tmp_path: Path, image: str):
    (scene.parent / "outside").mkdir()
    (scene.parent / "outside" / "x.py").write_text("payload")
    lights = scene / "truth" / "relighting" / "environment-1" / "lights.json"
    edited(lights, lambda d: d[0].update(image=image), scene / "truth")
    assert "expected a path that stays in its folder" in refused(scene, tmp_path / "p", "truth")


def test_the_image_of_a_light_may_not_be_a_link_out_of_its_folder(scene: Path, tmp_path: Path):
    folder = scene / "truth" / "relighting" / "environment-1"
    write_rgb(tmp_path / "outside" / "sky.exr", np.ones((2, 4, 3), np.float32))
    manifest = manifest_of(open_truth(scene / "truth"))
    (folder / "environment.exr").unlink()
    (folder / "environment.exr").symlink_to(tmp_path / "outside" / "sky.exr")
    write_manifest(scene / "truth", manifest)
    assert "got a link to" in refused(scene, tmp_path / "p", "truth")


def test_views_that_differ_in_case_alone_are_refused(scene: Path, tmp_path: Path):
    def rename(data: Any) -> None:
        data["views"][1]["name"] = data["views"][0]["name"].upper()

    edited(scene / "capture" / "capture.json", rename, scene / "capture")
    assert "expected names of different files" in refused(scene, tmp_path / "p")


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
def test_lights_without_finite_numbers_are_refused(scene: Path, tmp_path: Path, value: float):
    fit_scene(FitSpec("truth", {}, 0, scene), tmp_path / "p", silent)
    edited(
        scene / "truth" / "lights.json",
        lambda d: d[0].update(position=[str(value), 0, 0]),
        scene / "truth",
    )
    with pytest.raises(GraycardError, match="expected finite numbers of light"):
        score_predictions(tmp_path / "p", scene)
    with pytest.raises(GraycardError, match="expected finite numbers of light"):
        open_truth(scene / "truth").lights()


@pytest.mark.parametrize("name", ESCAPES)
def test_writers_of_predictions_refuse_to_leave_the_folder(tmp_path: Path, name: str):
    folder, image = tmp_path / "p", np.ones((2, 4, 3), np.float32)
    folder.mkdir()
    attempts: list[Callable[[], object]] = [
        lambda: write_view(folder, name, {"radiance": image}),
        lambda: write_relit(folder, name, "test_000", image),
        lambda: write_relit(folder, "edit", name, image),
        lambda: write_composed(folder, name, image),
        lambda: write_environment(folder, EnvironmentLight(name, ""), image),
    ]
    for attempt in attempts:
        with pytest.raises(GraycardError, match="Rename it"):
            attempt()
    assert not written(tmp_path)


def test_predictions_may_not_link_to_the_truth(scene: Path, tmp_path: Path):
    fit_scene(FitSpec("gray", {}, 0, scene), tmp_path / "p", silent)
    views = tmp_path / "p" / "views"
    for path in views.iterdir():
        path.unlink()
    views.rmdir()
    views.symlink_to(scene / "truth" / "views")
    sheet = score_predictions(tmp_path / "p", scene)
    scored = [score for score in sheet.scores if score.status == "scored"]
    assert not scored
    assert any("got a link to" in score.reason for score in sheet.scores)


def test_views_of_predictions_may_not_be_links_to_the_truth(scene: Path, tmp_path: Path):
    fit_scene(FitSpec("gray", {}, 0, scene), tmp_path / "p", silent)
    index = tmp_path / "p" / "predictions.json"
    index.write_text(json.dumps({**json.loads(index.read_text()), "files": {}}))
    for path in (tmp_path / "p" / "views").iterdir():
        path.unlink()
        path.symlink_to(scene / "truth" / "views" / path.name)
    sheet = score_predictions(tmp_path / "p", scene)
    assert not [score for score in sheet.scores if score.status == "scored"]
    assert any("got a link to" in score.reason for score in sheet.scores)


STRANGE: dict[str, Callable[[Path], object]] = {
    "a device": lambda path: path.symlink_to("/dev/zero"),
    "a folder outside": lambda path: path.symlink_to("/usr"),
    "a folder above": lambda path: path.symlink_to(".."),
    "the folder itself": lambda path: path.symlink_to("."),
    "a circle": lambda path: path.symlink_to(path.name),
    "nothing": lambda path: path.symlink_to("nowhere"),
    "a pipe": os.mkfifo,
}


@pytest.mark.parametrize("what", STRANGE)
@pytest.mark.parametrize("name", ["photographs/more.exr", "more", ".hidden"])
@pytest.mark.parametrize("part", ["capture", "truth"])
def test_a_scene_holds_files_and_folders_alone(scene: Path, part: str, name: str, what: str):
    """Copies of a capture would follow links to anywhere, and read devices and pipes without end."""
    path = scene / part / name
    path.parent.mkdir(exist_ok=True)
    STRANGE[what](path)
    with pytest.raises(DatasetError, match=f"the first {name}: (a link|got a link|neither a file)"):
        (open_capture if part == "capture" else open_truth)(scene / part)


def test_a_link_to_a_file_of_the_same_scene_is_as_good_as_the_file(scene: Path):
    photographs = scene / "capture" / "photographs"
    manifest = manifest_of(open_capture(scene / "capture"))
    (photographs / "train_000.exr").rename(photographs / "same.exr")
    (photographs / "train_000.exr").symlink_to("same.exr")
    write_manifest(scene / "capture", manifest)
    capture = open_capture(scene / "capture")
    assert capture.photograph(capture.train[0]).shape == (24, 28, 3)


@pytest.mark.parametrize("name", ["predictions.json", "lights.json", "views", "relighting"])
def test_predictions_are_written_anew_whatever_lies_in_their_place(scene: Path, tmp_path: Path, name: str):
    """A folder in the place of a file, and a file or a link in that of a folder."""
    fit_scene(FitSpec("truth", {}, 0, scene), tmp_path / "p", silent)
    place = tmp_path / "p" / name
    if place.is_dir():
        shutil.rmtree(place)
        place.symlink_to(tmp_path / "outside")
    else:
        place.unlink()
        (place / "x").mkdir(parents=True)
    fit_scene(FitSpec("truth", {}, 0, scene), tmp_path / "p", silent)
    assert open_predictions(tmp_path / "p").is_whole()
    assert not written(tmp_path / "outside")


def test_the_index_of_predictions_names_files_of_the_folder(scene: Path, tmp_path: Path):
    fit_scene(FitSpec("gray", {}, 0, scene), tmp_path / "p", silent)
    index = tmp_path / "p" / "predictions.json"
    data = json.loads(index.read_text())
    data["files"]["../x"] = "0" * 64
    index.write_text(json.dumps(data))
    with pytest.raises(GraycardError, match=re.escape("got '../x'")):
        open_predictions(tmp_path / "p")


@pytest.mark.parametrize(
    "facts", [{}, {"reflectance": "light"}, {"reflectance": None}, {"reflectance": [1]}, [], "x", None]
)
def test_a_saved_decomposition_without_its_facts_is_damaged(scene: Path, tmp_path: Path, facts: Any):
    fit_scene(FitSpec("gray", {}, 0, scene), tmp_path / "p", silent, tmp_path / "saved")
    index = tmp_path / "saved" / "decomposition.json"
    data = json.loads(index.read_text())
    index.write_text(json.dumps({**data, "facts": facts}))
    with pytest.raises(GraycardError, match="expected a whole decomposition in"):
        load_method("gray").load(tmp_path / "saved")

# SPDX-License-Identifier: Apache-2.0
"""Checks that are made, those that are skipped and why, and words of the command line."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from fault_planting import edit_manifest, reseal
from graycard import DatasetError, EnvironmentLight
from graycard.cli import main
from graycard.io import read_json, read_layers, write_json, write_layers
from graycard.lights import read_lights, write_lights
from graycard.synth import RenderSettings, SceneSpec, render_scene, use_renderer
from graycard.synth.verify import Check, verify_dataset, worst
from graycard.synth.verify._check import At

Copied = Callable[[str], Path]
Capture = pytest.CaptureFixture[str]


def reasons(checks: tuple[Check, ...], name: str, status: str = "skipped") -> set[str]:
    return {check.reason for check in checks if check.name == name and check.status == status}


def test_a_damaged_scene_fails_and_the_others_go_on(copied: Copied):
    scene = copied("dark")
    damaged = Path(shutil.copytree(scene, scene.with_name("corridor-1001")))
    (damaged / "truth" / "lights.json").write_text("[]")
    half_written = Path(shutil.copytree(scene, scene.with_name("corridor-1002")))
    (half_written / "truth" / "manifest.json").unlink()
    verdict = verify_dataset(scene.parents[1], render=False)
    failed = {check.scene: check for check in verdict.checks if check.status == "failed"}
    assert verdict.scenes == 3
    assert set(failed) == {"dark/corridor-1001", "dark/corridor-1002"}
    assert {check.name for check in failed.values()} == {"files"}
    assert "lights.json: expected SHA-256" in failed["dark/corridor-1001"].reason
    assert "without one: its rendering was cut off" in failed["dark/corridor-1002"].reason
    assert reasons(verdict.checks, "rendered again") == {"only the files were asked for"}


def radiance_lost(scene: Path) -> None:
    path = scene / "truth" / "views" / "train_000.exr"
    write_layers(path, {n: v for n, v in read_layers(path).items() if n != "radiance"})


def all_training_radiance_lost(scene: Path) -> None:
    for path in (scene / "truth" / "views").glob("train_*.exr"):
        write_layers(path, {n: v for n, v in read_layers(path).items() if n != "radiance"})


def surroundings_missing(scene: Path) -> None:
    path = scene / "truth" / "lights.json"
    write_lights(path, (*read_lights(path), EnvironmentLight("sky", "nowhere.exr")))


def surroundings_of_an_edit_missing(scene: Path) -> None:
    path = scene / "truth" / "relighting" / "without-lamp" / "lights.json"
    write_lights(path, (EnvironmentLight("sky", "nowhere.exr"),))


def view_that_is_no_image(scene: Path) -> None:
    (scene / "truth" / "views" / "train_000.exr").write_text("no image")


def lights_lost(scene: Path) -> None:
    write_lights(scene / "truth" / "lights.json", ())


def view_more_in_one_index(scene: Path) -> None:
    more_views(scene, ("truth",))


def view_more_in_both(scene: Path) -> None:
    more_views(scene, ("truth", "capture"))
    views = scene / "truth" / "views"
    shutil.copy(views / "test_001.exr", views / "test_009.exr")
    for edit in (scene / "truth" / "relighting").iterdir():
        shutil.copy(edit / "views" / "test_001.exr", edit / "views" / "test_009.exr")


def more_views(scene: Path, parts: tuple[str, ...]) -> None:
    for part in parts:
        path = scene / part / f"{part}.json"
        data = read_json(path)
        data["views"].append(next(v for v in data["views"] if v["name"] == "test_001") | {"name": "test_009"})
        write_json(path, data)


def index_that_is_a_list(scene: Path) -> None:
    (scene / "truth" / "truth.json").write_text("[]")


def points_broken(scene: Path) -> None:
    (scene / "capture" / "points.ply").write_text("no points")


def relit_picture_of_another_size(scene: Path) -> None:
    for path in (scene / "truth" / "relighting").glob("*/views/*.exr"):
        write_layers(path, {name: values[:40] for name, values in read_layers(path).items()})


def light_of_another_name(scene: Path) -> None:
    path = scene / "truth" / "lights.json"
    write_lights(path, tuple(replace(x, name=x.name.replace("lamp", "L")) for x in read_lights(path)))
    for view in (scene / "truth" / "views").iterdir():
        renamed = {name.replace(".lamp", ".L"): values for name, values in read_layers(view).items()}
        write_layers(view, renamed)


ODD: dict[Callable[[Path], None], str] = {
    radiance_lost: "layers present",
    all_training_radiance_lost: "layers present",
    surroundings_missing: "files",
    surroundings_of_an_edit_missing: "files",
    view_that_is_no_image: "files",
    lights_lost: "lights of the spec",
    view_more_in_one_index: "files",
    view_more_in_both: "cameras of the spec",
    index_that_is_a_list: "files",
    points_broken: "files",
    relit_picture_of_another_size: "files",
    light_of_another_name: "lights of the spec",
}


@pytest.mark.parametrize("plant", ODD, ids=lambda plant: plant.__name__)
def test_an_odd_scene_fails_and_the_others_go_on(copied: Copied, plant: Callable[[Path], None]):
    whole = copied("dark")
    odd = Path(shutil.copytree(whole, whole.with_name("corridor-1001")))
    plant(odd)
    reseal(odd)
    verdict = verify_dataset(whole.parents[1], render=False)
    failed = [check for check in verdict.checks if check.status == "failed"]
    assert {check.scene for check in failed} == {"dark/corridor-1001"}
    assert ODD[plant] in {check.name for check in failed}
    assert "dark/corridor-1000" in {check.scene for check in verdict.checks if check.status == "passed"}


def test_a_scene_of_another_generator_is_not_rendered_again(copied: Copied):
    scene = copied("dark")
    edit_manifest(scene, lambda data: data["generator"].update(generator=1))
    verdict = verify_dataset(scene.parents[1])
    assert verdict.count("failed") == 0
    (reason,) = reasons(verdict.checks, "rendered again")
    assert reason.startswith("the scene is of generator 1, this graycard has generator")
    assert reasons(verdict.checks, "lights of the spec") == {reason}


def test_a_spec_that_is_not_known_here_is_not_rendered_again(copied: Copied):
    scene = copied("dark")
    edit_manifest(scene, lambda data: data["settings"]["knobs"].update(fog=1.0))
    verdict = verify_dataset(scene.parents[1])
    assert verdict.count("failed") == 0
    assert all("its spec cannot be built here" in r for r in reasons(verdict.checks, "rendered again"))


def test_a_scene_of_another_spec_is_not_laid_side_by_side(copied: Copied):
    scene = copied("dark")
    edit_manifest(scene, lambda data: data["settings"]["render"].update(train_views=5))
    verdict = verify_dataset(scene.parents[1])
    assert reasons(verdict.checks, "cameras of the spec", "failed")
    assert reasons(verdict.checks, "rendered again") == {
        "the files hold other views, sizes or lights than the spec"
    }


def test_an_imported_capture_is_skipped(copied: Copied):
    scene = copied("dark")
    shutil.rmtree(scene / "truth")
    path = scene / "capture" / "manifest.json"
    data = read_json(path)
    data["generator"] = {"name": "graycard.import"}
    write_json(path, data)
    verdict = verify_dataset(scene.parents[1])
    assert [check.status for check in verdict.checks] == ["skipped"]
    assert "has no truth" in verdict.checks[0].reason


def test_a_scene_of_the_slow_renderer_is_verified_too(tmp_path: Path, no_llvm: None):
    settings = RenderSettings(16, 16, train_views=2, test_views=1, samples=16)
    render_scene(SceneSpec("tabletop", "glossy-table", 1000), settings, tmp_path)
    verdict = verify_dataset(tmp_path, views=1)
    assert [c.reason for c in verdict.checks if c.status == "failed"] == []
    assert reasons(verdict.checks, "parts add up") == {"its light is not told apart"}
    assert {"radiance again: level", "object_id again"} <= {
        check.name for check in verdict.checks if check.status == "passed"
    }
    use_renderer()


def test_a_folder_without_scenes_is_an_error(tmp_path: Path):
    with pytest.raises(DatasetError, match="expected scenes DATASET/<track>/<scene>"):
        verify_dataset(tmp_path)
    with pytest.raises(ValueError, match="expected 1 or more views, got 0"):
        verify_dataset(tmp_path, views=0)


def test_what_is_not_a_number_fails():
    at = At("dark/a", "test_000")
    assert at.judge("x", float("nan"), 1, "m", "why").status == "failed"
    assert at.judge("x", 1.0, 1, "m", "why").status == "passed"
    failed = at.judge("x", 2.0, 1, "m", "looks like a mistake")
    assert failed.reason == "expected 1 m or less, got 2: looks like a mistake"
    assert failed.strain == 2


def test_the_worst_of_each_check_is_shown():
    a, b = At("s", "a"), At("s", "b")
    made = [a.judge("x", 0.2, 1, "m", ""), b.judge("x", 0.4, 1, "m", ""), a.skip("x", "why not")]
    zero = [a.judge("y", 1, 0, "", ""), b.judge("y", 0, 0, "", ""), b.fail("z", "no"), a.skip("w", "no")]
    assert [(c.name, c.view, c.status) for c in worst(made + zero)] == [
        ("x", "b", "passed"),
        ("y", "a", "failed"),
        ("z", "b", "failed"),
        ("w", "a", "skipped"),
    ]


def test_the_verb(copied: Copied, tmp_path: Path, capsys: Capture):
    scene = copied("tabletop")
    dataset, report = str(scene.parents[1]), tmp_path / "report.json"
    assert main(["verify", dataset, "--no-render", "--json", str(report)]) == 0
    out = capsys.readouterr().out
    assert "mask of the target" in out
    assert out.splitlines()[-1].startswith("verify: 1 scene, ")
    assert " 0 failed, " in out.splitlines()[-1]
    data = json.loads(report.read_text())["result"]
    assert data["false_alarm"] == 1e-4
    assert {check["status"] for check in data["checks"]} == {"passed", "skipped"}
    view = scene / "truth" / "views" / "train_000.exr"
    view.write_bytes(view.read_bytes()[:-1])
    assert main(["verify", dataset, "--no-render"]) == 1
    assert "failed: tabletop/" in capsys.readouterr().err
    assert main(["verify", dataset, "--views", "0"]) == 2
    assert "Mend --views" in capsys.readouterr().err
    assert main(["verify", str(tmp_path / "nowhere")]) == 2

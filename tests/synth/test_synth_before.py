# SPDX-License-Identifier: Apache-2.0
"""Scenes of other settings, specs and versions, and folders of something else."""

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from graycard import (
    DatasetError,
    open_truth,
)
from graycard.io import read_manifest
from graycard.synth import (
    GENERATOR_VERSION,
    CaptureSettings,
    RenderSettings,
    all_families,
    find_scene,
    render_scene,
    scene_name,
)
from graycard.synth.families._family import count
from graycard.synth.families._tables import GlossyTable
from graycard.synth.verify._subject import Rebuilt, rebuild
from tiny_tables import (
    TABLE,
    TINY,
    bits,
    in_the_making,
)


@pytest.mark.parametrize(
    ("settings", "difference"),
    [
        (RenderSettings(24, 16, 3, 1, 4, 3), r"render.width: expected 24, got 20"),
        (RenderSettings(20, 16, 3, 1, 64, 3), r"render.samples: expected 64, got 4"),
        (RenderSettings(20, 16, 4, 1, 4, 3), r"render.train_views: expected 4, got 3"),
    ],
)
def test_a_scene_of_other_settings_is_left_alone(
    table: Path, settings: RenderSettings, difference: str
) -> None:
    before = bits(table)
    with pytest.raises(DatasetError, match=f"{difference}.*Choose another output folder"):
        render_scene(TABLE, settings, table.parent.parent)
    assert bits(table) == before


@dataclass(frozen=True, slots=True)
class LaterTable(GlossyTable):
    """The family after it has gained a knob."""

    cartons: int = count(3, 0, 9)


@dataclass(frozen=True, slots=True)
class LaterSettings(RenderSettings):
    """Settings after they have gained one."""

    haze: float = 0.0


LATER = LaterSettings(20, 16, 3, 1, 4, 3)


@pytest.fixture
def later(monkeypatch: pytest.MonkeyPatch) -> None:
    """A version of graycard whose glossy tables have one more knob."""
    families = all_families() | {"glossy-table": LaterTable}
    monkeypatch.setattr("graycard.synth.families._catalogue._FAMILIES", tuple(families.values()))


@pytest.mark.usefixtures("later")
def test_a_scene_of_before_a_knob_and_a_setting_were_added_is_this_very_scene(table: Path) -> None:
    before = bits(table)
    assert scene_name(TABLE) == table.name
    assert find_scene(TABLE, LATER, table.parent.parent) == table
    assert render_scene(TABLE, LATER, table.parent.parent) == table
    assert bits(table) == before


@pytest.mark.usefixtures("later")
def test_a_scene_of_before_is_none_with_another_value_of_what_was_added(table: Path) -> None:
    with pytest.raises(DatasetError, match=r"render.haze: expected 0.5, got 0.0\).*Choose another output"):
        find_scene(TABLE, replace(LATER, haze=0.5), table.parent.parent)
    changed = replace(TABLE, knobs={"cartons": 5})
    shutil.move(table, table.with_name(scene_name(changed)))
    with pytest.raises(DatasetError, match=r"\(knobs.cartons: expected 5, got 3\)"):
        find_scene(changed, LATER, table.parent.parent)


def change_manifest(scene: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    path = scene / "truth" / "manifest.json"
    manifest = json.loads(path.read_text())
    change(manifest["settings"])
    path.write_text(json.dumps(manifest))


def test_what_a_manifest_of_before_does_not_name_had_its_default(table: Path) -> None:
    def forget(settings: dict[str, Any]) -> None:
        del settings["knobs"]["roughness"], settings["render"]["capture"]["bits"]

    change_manifest(table, forget)
    assert find_scene(TABLE, TINY, table.parent.parent) == table
    noisy = replace(TINY, capture=CaptureSettings(bits=8))
    with pytest.raises(DatasetError, match=r"\(render.capture.bits: expected 8, got 0\)"):
        find_scene(TABLE, noisy, table.parent.parent)


@pytest.mark.parametrize(
    ("part", "difference"), [("knobs", r"knobs.cartons: .*with 3"), ("render", r"render.cartons: .*with 3")]
)
def test_a_scene_with_a_knob_that_is_gone_is_refused(table: Path, part: str, difference: str) -> None:
    change_manifest(table, lambda settings: settings[part].update(cartons=3))
    with pytest.raises(DatasetError, match=rf"\({difference}\)\. Choose another output folder"):
        find_scene(TABLE, TINY, table.parent.parent)


def test_a_damaged_scene_of_before_is_mended_with_the_pictures_that_it_has(
    rendered: dict[str, Path], table: Path
) -> None:
    change_manifest(table, lambda settings: settings["knobs"].pop("roughness"))
    (table / "truth/views/test_002.exr").unlink()
    heard: list[str] = []
    render_scene(TABLE, TINY, table.parent.parent, lambda done, doing: heard.append(doing))
    assert sum("_00" in h for h in heard) == 1
    assert bits(table.parent) == bits(rendered["tabletop"].parent)


def test_a_scene_in_the_making_of_before_goes_on(rendered: dict[str, Path], table: Path) -> None:
    """Cut off before a knob was added, and taken up again after."""
    in_the_making(table, forgets="roughness")
    heard: list[str] = []
    render_scene(TABLE, TINY, table.parent.parent, lambda done, doing: heard.append(doing))
    assert sum("_00" in h for h in heard) == 1
    assert bits(table.parent) == bits(rendered["tabletop"].parent)


@pytest.mark.usefixtures("later")
def test_a_scene_of_before_is_verified_as_this_very_scene(table: Path) -> None:
    rebuilt = rebuild(read_manifest(table / "truth", "graycard-truth"))
    assert isinstance(rebuilt, Rebuilt)
    assert scene_name(rebuilt.spec) == table.name
    assert rebuilt.scene.views == open_truth(table / "truth").views


@pytest.mark.parametrize(
    ("part", "change", "difference"),
    [
        ("seeds", {"scene": 7}, "seed: expected 0, got 7"),
        ("generator", {"generator": 0}, f"generator: expected {GENERATOR_VERSION}, got 0"),
        ("settings", {"knobs": {"roughness": 0.5}}, "knobs.roughness: expected 0.2, got 0.5"),
    ],
)
def test_a_scene_of_another_spec_is_left_alone(
    table: Path, part: str, change: dict[str, Any], difference: str
) -> None:
    path = table / "truth" / "manifest.json"
    manifest = json.loads(path.read_text())
    manifest[part] |= change
    path.write_text(json.dumps(manifest))
    with pytest.raises(DatasetError, match=difference):
        render_scene(TABLE, TINY, table.parent.parent)


@pytest.mark.parametrize("part", ["capture", "truth"])
def test_a_newer_format_is_left_alone(table: Path, part: str) -> None:
    path = table / part / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"format_version": 99}))
    with pytest.raises(DatasetError, match="got version 99"):
        render_scene(TABLE, TINY, table.parent.parent)


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    thesis = tmp_path / "tabletop" / "glossy-table-0000" / "thesis.tex"
    thesis.parent.mkdir(parents=True)
    thesis.write_text("years of work")
    with pytest.raises(DatasetError, match=r"got thesis.tex in it. Choose another"):
        render_scene(TABLE, TINY, tmp_path)
    assert thesis.read_text() == "years of work"


def test_a_file_in_the_place_of_the_scene_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "tabletop" / "glossy-table-0000"
    path.parent.mkdir()
    path.write_text("x")
    with pytest.raises(DatasetError, match="Choose another"):
        render_scene(TABLE, TINY, tmp_path)

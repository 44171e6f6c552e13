# SPDX-License-Identifier: Apache-2.0
"""A scene whose pictures several processes render has the bits of one that one process renders."""

import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from graycard import DatasetError, OutputError
from graycard.io import read_layers, sha256, write_json
from graycard.synth import (
    RenderSettings,
    SceneSpec,
    begin_scene,
    find_scene,
    render_part,
    render_scene,
    scene_name,
)
from graycard.synth.dataset._render import clear_leftovers
from graycard.synth.dataset._renderings import Rendering, write_aside
from graycard.synth.dataset._store import Place, stamped
from without_llvm import hide_llvm

TINY = RenderSettings(20, 16, 3, 1, 4, 3)
TABLE = SceneSpec("tabletop", "glossy-table", 0)
PICTURES = 4 + 3
"""Views, and the held-out one under each change of the two lights: nothing is a sum in ``scalar_rgb``."""

pytestmark = pytest.mark.usefixtures("no_llvm")


def bits(folder: Path) -> dict[str, str]:
    """Return hashes of the files below a folder."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    return {str(p.relative_to(folder)): sha256(p) for p in files}


@pytest.fixture(scope="session")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The dataset of a scene that one process has rendered."""
    with pytest.MonkeyPatch.context() as patch:
        hide_llvm(patch)
        dataset = tmp_path_factory.mktemp("whole")
        render_scene(TABLE, TINY, dataset, threads=1)
        return dataset


def test_parts_give_the_same_bits_in_any_order(whole: Path, tmp_path: Path):
    numbers = begin_scene(TABLE, TINY, tmp_path)
    assert numbers == tuple(range(PICTURES))
    assert find_scene(TABLE, TINY, tmp_path) is None
    for part in (numbers[4:], numbers[:3]):
        render_part(TABLE, TINY, tmp_path, part)
    assert begin_scene(TABLE, TINY, tmp_path) == (3,)
    render_scene(TABLE, TINY, tmp_path)
    assert bits(tmp_path) == bits(whole)
    assert begin_scene(TABLE, TINY, tmp_path) == ()
    render_part(TABLE, TINY, tmp_path, numbers)
    assert bits(tmp_path) == bits(whole)


def test_a_part_is_rendered_again_by_nobody(tmp_path: Path):
    begin_scene(TABLE, TINY, tmp_path)
    render_part(TABLE, TINY, tmp_path, (1,))
    place = Place(tmp_path, "tabletop", scene_name(TABLE))
    (picture,) = place.partial.rglob("train_001.exr")
    before = picture.stat().st_mtime_ns
    render_part(TABLE, TINY, tmp_path, (1, 2))
    assert picture.stat().st_mtime_ns == before
    assert [path.name for path in (place.work / "truth").iterdir() if path.name.startswith("aside")] == []


def test_two_at_the_same_picture_leave_one(whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Two workers meet where one was thought lost. Pictures are copied: a process has one renderer alone."""
    from graycard.synth.layers import _views  # Mitsuba: not before its variant is chosen

    source = whole / "tabletop" / scene_name(TABLE) / "truth" / "views"
    names = ["train_000", "train_001", "test_002", "train_003"]
    monkeypatch.setattr(
        _views, "render_view", lambda scene, number, *_: read_layers(source / f"{names[number]}.exr")
    )
    begin_scene(TABLE, TINY, tmp_path)
    with ThreadPoolExecutor(2) as both:
        for done in [both.submit(render_part, TABLE, TINY, tmp_path, (0, 1, 2, 3)) for _ in range(2)]:
            done.result()
    monkeypatch.undo()
    hide_llvm(monkeypatch)
    render_scene(TABLE, TINY, tmp_path)
    assert bits(tmp_path) == bits(whole)


def test_what_a_killed_worker_left_goes(whole: Path, tmp_path: Path):
    begin_scene(TABLE, TINY, tmp_path)
    place = Place(tmp_path, "tabletop", scene_name(TABLE))
    aside = place.aside("killed") / "views"
    aside.mkdir(parents=True)
    (aside / ".train_000.exr.x7f3.partial").write_bytes(b"half an im")
    render_scene(TABLE, TINY, tmp_path)
    assert bits(tmp_path) == bits(whole)


def test_a_worker_that_comes_late_leaves_nothing_in_the_way(whole: Path, tmp_path: Path):
    """Its picture arrives after the scene was done: the next bench clears it away."""
    shutil.copytree(whole, tmp_path, dirs_exist_ok=True)
    place = Place(tmp_path, "tabletop", scene_name(TABLE))
    late = place.partial / "truth" / "views" / "train_000.exr"
    late.parent.mkdir(parents=True)
    shutil.copy(place.final / "truth" / "views" / "train_000.exr", late)
    assert begin_scene(TABLE, TINY, tmp_path) == ()
    clear_leftovers(tmp_path)
    assert bits(tmp_path) == bits(whole)


def test_a_part_of_a_scene_that_was_not_begun_is_refused(tmp_path: Path):
    with pytest.raises(DatasetError, match="a scene of this spec that was begun, got another"):
        render_part(TABLE, TINY, tmp_path, (0,))


def test_a_part_of_a_scene_of_other_settings_is_refused(tmp_path: Path):
    begin_scene(TABLE, TINY, tmp_path)
    with pytest.raises(DatasetError, match="a scene of this spec that was begun, got another"):
        render_part(TABLE, RenderSettings(20, 16, 3, 1, 36, 3), tmp_path, (0,))


def test_a_part_is_refused_where_its_renderer_is_not(tmp_path: Path):
    """Else its pictures would differ in noise from the others."""
    begin_scene(TABLE, TINY, tmp_path)
    place = Place(tmp_path, "tabletop", scene_name(TABLE))
    write_json(place.stamp, {**(stamped(place) or {}), "variant": "llvm_ad_rgb"})
    with pytest.raises(DatasetError, match="a machine that renders with 'llvm_ad_rgb'.*Install LLVM"):
        render_part(TABLE, TINY, tmp_path, (0,))


@pytest.mark.parametrize("wanted", [True, False])
def test_a_folder_that_is_gone_is_an_error_of_a_scene_that_is_wanted(wanted: bool, tmp_path: Path):
    (tmp_path / "file").write_text("no folder")
    picture = Rendering("a view", ("views/a.exr",), lambda: [{"depth": np.ones((2, 2), np.float32)}])
    told = picture, tmp_path / "truth", tmp_path / "file" / "aside", lambda: wanted
    if not wanted:
        write_aside(*told)
        return
    with pytest.raises(OutputError):
        write_aside(*told)


def test_a_picture_of_a_scene_that_was_begun_anew_is_dropped(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Another bench with other settings begins the scene while a worker is at a picture of the first."""
    from graycard.synth.layers import _views  # Mitsuba: not before its variant is chosen

    source = whole / "tabletop" / scene_name(TABLE) / "truth" / "views" / "train_000.exr"

    def render(*_: object) -> dict[str, np.ndarray]:
        begin_scene(TABLE, RenderSettings(20, 16, 3, 1, 36, 3), tmp_path)
        return read_layers(source)

    begin_scene(TABLE, TINY, tmp_path)
    monkeypatch.setattr(_views, "render_view", render)
    render_part(TABLE, TINY, tmp_path, (0,))
    place = Place(tmp_path, "tabletop", scene_name(TABLE))
    assert not [*place.work.rglob("*.exr")]

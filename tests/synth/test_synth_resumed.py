# SPDX-License-Identifier: Apache-2.0
"""Scene folders are whole or not there, whatever happens in between."""

import json
import os
import shutil
import signal
import subprocess
import threading
from pathlib import Path

import pytest

from graycard import (
    OutputError,
    capture_folders,
)
from graycard.io import writable_folder, write_json
from graycard.io._lock import file_lock
from graycard.synth import (
    SceneSpec,
    find_llvm,
    find_scene,
    render_scene,
    scene_name,
)
from graycard.synth.dataset._store import Place
from tiny_tables import (
    AMONG_RELIT,
    KEPT,
    TABLE,
    TABLE_RENDERINGS,
    TINY,
    RunPython,
    bits,
    in_the_making,
)


def test_a_second_call_finds_the_scene_and_imports_no_renderer(table: Path, in_process: RunPython) -> None:
    before = bits(table)
    stamps = {p: p.stat().st_mtime_ns for p in table.rglob("*")}
    done = in_process(table.parent.parent)
    assert done.stdout.split() == [str(table), "False", "False"]
    assert bits(table) == before
    assert {p: p.stat().st_mtime_ns for p in table.rglob("*")} == stamps


@pytest.mark.parametrize("threads", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_another_process_gives_the_same_bits(
    rendered: dict[str, Path], tmp_path: Path, threads: int, in_process: RunPython
) -> None:
    """One thread where the first had two is the harder case."""
    done = in_process(tmp_path, threads=threads)
    assert done.returncode == 0, done.stderr
    assert bits(tmp_path / "tabletop") == bits(rendered["tabletop"].parent)


@pytest.mark.slow
def test_llvm_gives_the_same_bits_with_one_and_two_threads(tmp_path: Path, in_process: RunPython) -> None:
    """Whole folders; ``test_synth_relighting.py`` has pictures alone."""
    if not find_llvm().usable:
        pytest.skip("no LLVM library here")
    spec = SceneSpec("multilight", "studio", 3)
    for threads in (1, 2):
        done = in_process(tmp_path / str(threads), spec, threads, hide=False)
        assert done.returncode == 0, done.stderr
    assert bits(tmp_path / "1") == bits(tmp_path / "2")


@pytest.mark.parametrize("kill_at", [AMONG_RELIT, *(pytest.param(at, marks=pytest.mark.slow) for at in KEPT)])
def test_a_killed_run_goes_on_and_ends_in_the_same_bits(
    rendered: dict[str, Path], tmp_path: Path, kill_at: str, no_llvm: str, in_process: RunPython
) -> None:
    killed = in_process(tmp_path, kill_at=kill_at)
    assert killed.returncode == -signal.SIGKILL
    assert capture_folders(tmp_path) == []
    assert find_scene(TABLE, TINY, tmp_path) is None
    truth = tmp_path / "tabletop" / ".glossy-table-0000.partial" / "truth" / "scene" / "truth"
    kept = {p: p.stat().st_mtime_ns for p in truth.rglob("views/*.exr")}
    assert len(kept) == (KEPT | {AMONG_RELIT: 5})[kill_at]
    heard: list[str] = []
    folder = render_scene(TABLE, TINY, tmp_path, lambda done, doing: heard.append(doing))
    assert len([h for h in heard if "_00" in h]) == TABLE_RENDERINGS - len(kept)
    assert bits(folder.parent) == bits(rendered["tabletop"].parent)


def test_a_broken_view_of_a_killed_run_is_made_anew(rendered: dict[str, Path], table: Path) -> None:
    place = in_the_making(table)
    views = place.partial / "truth" / "views"
    broken = views / "train_000.exr"
    broken.write_bytes(broken.read_bytes()[:500])
    (views / ".test_002.exr.x7f3.partial").write_bytes(b"half an im")
    heard: list[str] = []
    render_scene(TABLE, TINY, table.parent.parent, lambda done, doing: heard.append(doing))
    assert sum("_00" in h for h in heard) == 2
    assert bits(table.parent) == bits(rendered["tabletop"].parent)


def test_leftovers_of_another_spec_are_not_used(
    rendered: dict[str, Path], tmp_path: Path, no_llvm: str
) -> None:
    place = Place(tmp_path, "tabletop", scene_name(TABLE))
    views = place.partial / "truth" / "views"
    write_json(place.stamp, {"generator": 0, "variant": "scalar_rgb"})
    shutil.copy(rendered["dark"] / "truth" / "views" / "train_000.exr", writable_folder(views))
    folder = render_scene(TABLE, TINY, tmp_path)
    assert bits(folder.parent) == bits(rendered["tabletop"].parent)


DAMAGE = [
    "truth/views/test_002.exr",
    "truth/views/train_000.exr",
    "truth/relighting/without-lamp/views/test_002.exr",
    "truth/relighting/recoloured-lamp/environment.exr",
    "truth/relighting/recoloured-lamp/lights.json",
    "truth/lights.json",
    "truth/environment.exr",
    "truth/truth.json",
    "truth/manifest.json",
    "capture/capture.json",
    "capture/manifest.json",
    "capture/photographs/train_000.exr",
    "capture/masks/target/train_003.exr",
]


def in_ci(name: str, how: str) -> bool:
    """Tell if CI has time: all files but manifests are judged by their hash, whatever happened to them."""
    if name == "truth/manifest.json" and how == "cut":
        return False  # all is rendered anew, as without one
    return how == "changed" or name == DAMAGE[0] or name.endswith("manifest.json")


@pytest.mark.parametrize(
    ("name", "how"),
    [
        pytest.param(name, how, marks=() if in_ci(name, how) else pytest.mark.slow)
        for how in ("missing", "cut", "changed")
        for name in DAMAGE
    ],
)
def test_damage_is_mended_to_the_same_bits(
    rendered: dict[str, Path], table: Path, name: str, how: str
) -> None:
    path = table / name
    data = path.read_bytes()
    match how:
        case "missing":
            path.unlink()
        case "cut":
            path.write_bytes(data[: len(data) // 2])
        case "changed":
            # in a manifest, a digit of a hash: it stays JSON
            at = data.rindex(b'"') - 5 if path.name == "manifest.json" else len(data) // 2
            path.write_bytes(data[:at] + (b"0" if data[at : at + 1] != b"0" else b"1") + data[at + 1 :])
    assert find_scene(TABLE, TINY, table.parent.parent) is None
    heard: list[str] = []
    render_scene(TABLE, TINY, table.parent.parent, lambda done, doing: heard.append(doing))
    assert bits(table.parent) == bits(rendered["tabletop"].parent)
    made = sum("_00" in h for h in heard)
    if name == "truth/manifest.json":
        assert made == TABLE_RENDERINGS if how != "changed" else made <= 1
    else:
        assert made == int("/views/" in name)


def test_a_run_cut_off_between_seal_and_name_goes_on(
    rendered: dict[str, Path], tmp_path: Path, no_llvm: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(place: Place) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("graycard.synth.dataset._render.promote", interrupted)
        with pytest.raises(KeyboardInterrupt):
            render_scene(TABLE, TINY, tmp_path)
    assert capture_folders(tmp_path) == []
    folder = render_scene(TABLE, TINY, tmp_path)
    assert bits(folder.parent) == bits(rendered["tabletop"].parent)


@pytest.mark.parametrize(
    ("call", "complaint"),
    [("os.replace", "expected to rename .* to"), ("shutil.rmtree", "expected to remove")],
)
def test_a_disk_that_refuses_is_named(
    table: Path, monkeypatch: pytest.MonkeyPatch, call: str, complaint: str
) -> None:
    (table / "capture" / "capture.json").unlink()
    Place(table.parent.parent, "tabletop", table.name).work.mkdir()

    real = {"os.replace": os.replace, "shutil.rmtree": shutil.rmtree}[call]

    def refuse(path: Path, *others: Path) -> None:
        if Path(path).is_dir():
            raise PermissionError(13, "Permission denied")
        real(path, *others)

    monkeypatch.setattr(f"graycard.synth.dataset._store.{call}", refuse)
    with pytest.raises(OutputError, match=complaint):
        render_scene(TABLE, TINY, table.parent.parent)


def test_a_mend_uses_the_renderer_of_the_other_views(
    rendered: dict[str, Path], table: Path, in_process: RunPython, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH")
    if not find_llvm().usable:
        pytest.skip("no LLVM library here")
    (table / "truth/views/test_002.exr").unlink()
    done = in_process(table.parent.parent, hide=False)
    assert done.returncode == 0, done.stderr
    assert bits(table.parent) == bits(rendered["tabletop"].parent)


def test_views_of_a_renderer_that_is_not_here_are_made_anew(rendered: dict[str, Path], table: Path) -> None:
    manifest = json.loads((table / "truth/manifest.json").read_text())
    manifest["generator"]["variant"] = "llvm_ad_rgb"
    (table / "truth/manifest.json").write_text(json.dumps(manifest))
    (table / "truth/views/test_002.exr").unlink()
    heard: list[str] = []
    render_scene(TABLE, TINY, table.parent.parent, lambda done, doing: heard.append(doing))
    assert sum("_00" in h for h in heard) == TABLE_RENDERINGS
    assert bits(table.parent) == bits(rendered["tabletop"].parent)


def test_a_scene_that_lost_its_capture_gets_it_back(rendered: dict[str, Path], table: Path) -> None:
    shutil.rmtree(table / "capture")
    render_scene(TABLE, TINY, table.parent.parent)
    assert bits(table.parent) == bits(rendered["tabletop"].parent)


def test_a_mend_that_is_killed_goes_on(rendered: dict[str, Path], table: Path, in_process: RunPython) -> None:
    (table / "truth/views/test_002.exr").unlink()
    killed = in_process(table.parent.parent, kill_at="test_002")
    assert killed.returncode == -signal.SIGKILL
    assert not table.exists()
    render_scene(TABLE, TINY, table.parent.parent)
    assert bits(table.parent) == bits(rendered["tabletop"].parent)


def test_two_processes_make_a_scene_once(tmp_path: Path, in_process: RunPython) -> None:
    """The second waits for the lock, then finds the scene whole: its files are not written again."""
    results: list[subprocess.CompletedProcess[str]] = []
    workers = [threading.Thread(target=lambda: results.append(in_process(tmp_path))) for _ in range(2)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert [r.returncode for r in results] == [0, 0], results
    assert sorted(p.name for p in (tmp_path / "tabletop").iterdir()) == ["glossy-table-0000"]


def test_the_lock_is_held_by_one_and_leaves_nothing(tmp_path: Path) -> None:
    order: list[str] = []
    inside, waiting = threading.Event(), threading.Event()

    def second() -> None:
        inside.wait(10)
        with file_lock(tmp_path / "lock", lambda who: waiting.set()):
            order.append("second")

    thread = threading.Thread(target=second)
    thread.start()
    with file_lock(tmp_path / "lock", lambda who: order.append("waited for nothing")):
        inside.set()
        assert waiting.wait(10)
        order.append("first")
    thread.join()
    assert order == ["first", "second"]
    assert list(tmp_path.iterdir()) == []

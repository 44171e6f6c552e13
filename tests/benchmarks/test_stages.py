# SPDX-License-Identifier: Apache-2.0
"""Fits of a run that share stages: what one has saved is found by the next, and counts as time of both."""

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from graycard import MethodError
from graycard.benchmarks import FitSpec, fit_scene
from graycard.benchmarks._jobs import FitJob
from graycard.benchmarks.planning import clear_stages, staging
from graycard.benchmarks.planning._plan import stages_folder
from graycard.io import silent
from graycard.methods import add_resumed, load_method, resumed_time, settings_of
from graycard.methods.confined import Introduction
from graycard.records import Job
from small_methods import BEFORE_MIB, BEFORE_S


def test_what_is_found_counts_as_time_of_the_fit(make_scene, tmp_path: Path) -> None:
    spec = FitSpec(
        "small_methods:Staged", {}, 0, make_scene(), stages=tmp_path / "stages" / "code" / "capture"
    )
    first, second = (fit_scene(spec, tmp_path / name, silent).cost for name in ("a", "b"))
    assert first.wall_s < BEFORE_S / 2
    assert first.peak_memory_mib < BEFORE_MIB
    assert BEFORE_S < second.wall_s < 1.5 * BEFORE_S
    assert second.peak_memory_mib == BEFORE_MIB


@pytest.mark.parametrize(("method", "own"), [("Staged", ""), ("Staged", "fit.npz"), ("Unstaged", "")])
def test_only_who_asks_for_it_and_was_told_nothing_gets_the_folder(
    method: str, own: str, make_scene, tmp_path: Path
) -> None:
    stages = tmp_path / "stages" / "code" / "capture"
    given = str(tmp_path / "own" / own) if own else ""
    spec = FitSpec(f"small_methods:{method}", {"checkpoint": given}, 0, make_scene(), stages=stages)
    fit_scene(spec, tmp_path / "p", silent, tmp_path / "saved")
    told = (tmp_path / "saved" / "told").read_text()
    assert told == (f"{stages}/" if method == "Staged" and not given else given)


def test_nobody_needs_to_listen() -> None:
    add_resumed(3.0)
    with resumed_time() as outer:
        add_resumed(1.0)
        with resumed_time() as inner:
            add_resumed(2.0, 7.0)
            add_resumed(3.0, 5.0)
    assert (outer.seconds, inner.seconds, inner.peak_mib) == (1.0, 5.0, 7.0)


def test_who_says_that_it_is_not_staged_is_not(make_scene, tmp_path: Path) -> None:
    stages = tmp_path / "stages" / "code" / "capture"
    spec = FitSpec("small_methods:Off", {}, 0, make_scene(), stages=stages)
    fit_scene(spec, tmp_path / "p", silent, tmp_path / "saved")
    assert (tmp_path / "saved" / "told").read_text() == ""


def test_stages_of_others_are_closed(make_scene, tmp_path: Path) -> None:
    (tmp_path / "stages" / "other").mkdir(parents=True)
    (tmp_path / "stages" / "other" / "stage").write_text(
        "what a row that was handed the truth has made of it"
    )
    stages = tmp_path / "stages" / "code" / "capture"
    spec = FitSpec("small_methods:Peeks", {}, 0, make_scene(), stages=stages)
    with pytest.raises(MethodError, match="truth is closed"):
        fit_scene(spec, tmp_path / "p", silent)


def test_stages_are_found_by_the_same_code_on_the_same_capture_alone(make_scene, tmp_path: Path) -> None:
    def place(code: str, scene: Path, threads: int = 1) -> Path:
        return stages_folder(tmp_path, Introduction("", (), {}, (), f"graycard 0.1.0 {code}"), scene, threads)

    scene, other = make_scene(), make_scene(scene="tiny-0001")
    assert place("a1", scene) == place("a1", scene)
    assert len({place("a1", scene), place("a2", scene), place("a1", other), place("a1", scene, 2)}) == 4


def test_goris_is_staged_and_what_comes_later_is_no_part_of_its_first_stage() -> None:
    method = load_method("goris")
    plain = settings_of(method, {})
    later = {
        "references": 5,
        "least_effect": 0.1,
        "distilled": True,
        "effect_mask": False,
        "hole_weight": 0.5,
    }
    assert getattr(method, "staged", False)
    assert settings_of(method, later).first == plain.first == plain
    assert settings_of(method, {"weights": 0.2}).first != plain


@pytest.mark.parametrize("locks", ["kernel", "files"])
def test_a_bench_that_ends_leaves_the_folders_that_another_one_uses(
    make_scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, locks: str
) -> None:
    """A confined fit may write to its folder, and could not make it anew."""
    monkeypatch.setenv("GRAYCARD_LOCKS", locks)
    scene, run = make_scene(), tmp_path / "run"
    stages = run / "stages" / "code" / "capture"
    job = Job("dark", scene.name, "row", 0, {}, "row")
    plan = [FitJob(job, "hash", scene, run / "jobs" / "row", 1, run / "jobs", stages=stages)]
    spec = FitSpec("small_methods:Waits", {}, 0, scene, stages=stages)
    with ThreadPoolExecutor() as pool, staging(run):
        first = pool.submit(fit_scene, spec, run / "p", silent)
        while not (stages / "begun").exists():
            assert not first.done(), first.result()
        clear_stages(run, plan)
        (stages / "go on").touch()
        assert first.result().cost.wall_s > 0
    assert (stages / "late").exists()
    clear_stages(run, plan)
    assert not (stages / "late").exists()
    assert (run / "stages").exists() == (locks == "files")


def test_stages_may_be_a_link_to_another_disk(tmp_path: Path) -> None:
    (tmp_path / "scratch").mkdir()
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "stages").symlink_to(tmp_path / "scratch")
    with staging(tmp_path / "run"):
        assert (tmp_path / "scratch").is_dir()


def test_stages_that_were_removed_meanwhile_are_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened, removed = os.open, []

    def open_late(path: str | Path, flags: int, *rest: int) -> int:
        if Path(path).name == "stages" and not removed:
            removed.append(os.rmdir(path))
        return opened(path, flags, *rest)

    monkeypatch.setattr(os, "open", open_late)
    with staging(tmp_path):
        assert (tmp_path / "stages").is_dir()
    assert removed == [None]


def test_clearing_leaves_what_another_bench_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GRAYCARD_LOCKS", "files")
    stages = tmp_path / "stages" / "code" / "capture"
    (stages / "folder").mkdir(parents=True)
    for name in (".a.safetensors.abcdefgh.partial", "b.safetensors"):
        (stages / name).touch()
    job = Job("dark", "room", "row", 0, {}, "row")
    clear_stages(tmp_path, [FitJob(job, "", tmp_path, tmp_path, 1, stages=stages)])
    assert sorted(path.name for path in stages.iterdir()) == [".a.safetensors.abcdefgh.partial", "folder"]

# SPDX-License-Identifier: Apache-2.0
"""Kernels compiled beforehand: what is missing and no more, in other processes, whatever becomes of them."""

import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
import torch

from graycard import Camera, MethodError, UnknownNameError
from graycard.benchmarks import FitSpec, fit_scene
from graycard.io import silent
from graycard.methods import Compiled, load_method, splat
from graycard.methods.confined import confined
from graycard.methods.splat import rasterize, warm_kernels
from graycard.methods.splat.raster._backward import backward
from graycard.methods.splat.raster._forward import forward
from graycard.methods.splat.raster._project_backward import unproject
from graycard.methods.splat.raster._project_forward import project
from graycard.methods.splat.warm import _processes
from graycard.methods.splat.warm._jobs import JOBS, PARTS, Job
from graycard.processes import Places

TWICE = """
from graycard.methods.splat import warm_kernels
from graycard.methods.splat.ops._harmonics_backward import colours_backward
from graycard.methods.splat.ops._harmonics_forward import colours_forward
from graycard.methods.splat.warm._jobs import JOBS
print(warm_kernels(["harmonics"]))
JOBS["harmonics"].run()
print([sum(one.stats.cache_misses.values()) for one in (colours_forward, colours_backward)])
"""


@pytest.fixture
def done() -> list[str]:
    """Return the jobs that were run in this process."""
    return []


@pytest.fixture
def no_stamps(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, done: list[str]) -> Path:
    """Jobs that compile nothing, of which none is done."""
    jobs = {name: Job(lambda name=name: done.append(name), job.seconds) for name, job in JOBS.items()}
    monkeypatch.setattr(_processes, "JOBS", jobs)
    monkeypatch.setattr(_processes, "stamps_folder", lambda: tmp_path / "stamps")
    return tmp_path / "stamps"


def started(*code: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-c", *code])


def test_what_is_missing_is_compiled_once_and_loaded_by_the_next(tmp_path: Path):
    """A kernel whose loop came from the cache may be the first of a process.

    Numba does not start its threads then: the process would end. The first process compiles the loop, the
    second takes it, and the third takes what took it.
    """
    code = "from graycard.methods.splat.warm._jobs import JOBS; JOBS['photometric'].run()"
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    assert subprocess.run([sys.executable, "-c", code], env=environment, check=False).returncode == 0
    found = []
    for _ in range(2):
        found.append(subprocess.check_output([sys.executable, "-c", TWICE], env=environment, text=True))
    assert found == ["['harmonics']\n[0, 0]\n", "[]\n[0, 0]\n"]


def test_a_job_that_is_done_is_not_done_again(no_stamps: Path, done: list[str]):
    _processes.compile_here(["harmonics", "photometric"])
    assert warm_kernels(["harmonics", "photometric"]) == []
    assert done == ["harmonics", "photometric"]


def test_a_dead_process_leaves_its_jobs_to_this_one(
    no_stamps: Path, monkeypatch: pytest.MonkeyPatch, done: list[str]
):
    monkeypatch.setattr(_processes, "_started", lambda names: started("raise SystemExit(3)"))
    assert warm_kernels(["harmonics", "trace"]) == ["harmonics", "trace"]
    assert done == ["harmonics", "trace"]
    assert warm_kernels(["harmonics", "trace"]) == []


def test_a_cache_that_cannot_be_written_starts_no_process(
    no_stamps: Path, monkeypatch: pytest.MonkeyPatch, done: list[str]
):
    def never(names: Sequence[str]) -> subprocess.Popen[bytes]:
        raise AssertionError(names)

    monkeypatch.setattr(_processes, "_started", never)
    no_stamps.write_text("a file where the folder should be")
    assert warm_kernels(["harmonics"]) == []
    assert done == []


def test_progress_says_how_many_jobs_are_done(no_stamps: Path, monkeypatch: pytest.MonkeyPatch):
    code = "import sys, time, pathlib; time.sleep(0.5); [pathlib.Path(p).touch() for p in sys.argv[1:]]"

    def slow(names: Sequence[str]) -> subprocess.Popen[bytes]:
        return started(code, *(str(no_stamps / name) for name in names))

    monkeypatch.setattr(_processes, "_started", slow)
    said: list[tuple[float, str]] = []
    warm_kernels(["harmonics", "photometric"], lambda share, doing: said.append((share, doing)))
    assert said[0] == (0.0, "compiling kernels, once for all fits: 0 of 2")
    assert said[-1] == (1.0, "kernels are compiled")
    assert [share for share, _ in said] == sorted(share for share, _ in said)


def test_an_unknown_part_is_refused():
    with pytest.raises(UnknownNameError, match="part of the engine"):
        warm_kernels(["maps 5"])


def test_jobs_are_dealt_longest_first():
    dealt = _processes.hands(["photometric", "trace", "draw 3, shaped", "pull 3, shaped"], 2)
    assert dealt == [["trace", "photometric"], ["draw 3, shaped", "pull 3, shaped"]]


def test_parts_name_jobs():
    assert {name for names in PARTS.values() for name in names} == set(JOBS)


def test_a_fit_uses_what_the_jobs_compiled():
    """A job whose arguments have other types would compile kernels that no fit calls."""
    for name in PARTS["maps 3"]:
        JOBS[name].run()
    kernels = project, forward, backward, unproject
    before = [list(kernel.signatures) for kernel in kernels]
    ones, turn = torch.ones(1, 3, requires_grad=True), torch.tensor([[1.0, 0, 0, 0]])
    surfels = splat.Surfels(ones, turn, torch.ones(1, 2), torch.full((1,), 0.5), torch.ones(1, 3))
    camera = Camera(40, 24, np.array([[30.0, 0, 20], [0, 30, 12], [0, 0, 1]]), np.eye(4))
    drawn = rasterize(surfels, camera, offsets=torch.zeros(1, 2, requires_grad=True))
    (drawn.features.sum() + drawn.depth.sum()).backward()
    assert [list(kernel.signatures) for kernel in kernels] == before


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[list[str]]:
    """The parts that are to be compiled, without any being compiled; the cache is empty."""
    parts: list[list[str]] = []
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    monkeypatch.setattr(splat, "warm_kernels", lambda wanted, progress: parts.append(wanted))
    return parts


def test_kernels_of_a_method_are_compiled_before_its_fit(
    asked: list[list[str]], make_scene: Callable[..., Path], tmp_path: Path
):
    scene = make_scene()
    with pytest.raises(MethodError, match="expected no fit, got one"):
        fit_scene(FitSpec("small_methods:Compiles", {}, 0, scene), tmp_path / "p", silent)
    assert asked == [["harmonics"]]


def test_only_kernels_that_a_method_needs_are_compiled(asked: list[list[str]], tmp_path: Path):
    for name in ("2dgs", "gray"):
        (tmp_path / name).mkdir()
        with confined(name, tmp_path / name, Places(str(tmp_path / name))) as method:
            method.compile()
    assert asked == [list(splat.SURFEL_KERNELS)]


def test_kernels_that_there_are_not_are_refused(make_scene: Callable[..., Path], tmp_path: Path):
    spec = FitSpec("small_methods:CompilesNothing", {}, 0, make_scene())
    with pytest.raises(UnknownNameError, match="part of the engine that exists, got 'maps 5'"):
        fit_scene(spec, tmp_path / "p", silent)


@pytest.mark.parametrize("name", ["2dgs", "2dgs-oracle", "appearance", "goris", "gsid", "r3dg", "darkgs"])
def test_methods_name_parts_that_exist(name: str):
    method = load_method(name)
    assert isinstance(method, Compiled)
    assert set(method.kernels) <= set(PARTS)

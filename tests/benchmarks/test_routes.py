# SPDX-License-Identifier: Apache-2.0
"""Data that are closed to a fit stay closed, whatever way a method's code tries."""

import os
import platform
import socket
import sqlite3
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from safetensors.numpy import save_file

from graycard import open_capture
from graycard.benchmarks import FitSpec, fit_scene
from graycard.benchmarks._handed import GUARDS
from graycard.dataset import manifest_of
from graycard.io import sha256_of_files, silent, write_manifest
from graycard.processes import landlock_version
from routes_to_truth import ROUTES

WITHOUT_LANDLOCK = frozenset(
    {
        # native code and programs that are not told a path that is closed
        "base64_command", "dir_fd", "environment",
        "forkserver", "spawned", "shell_glob", "standard_input", "terminal",
        "native_open", "native_stream", "native_hard_link", "native_system", "native_system_call",
        "openexr", "pytorch_file", "safetensors_file", "mitsuba_bitmap",
        # rules that Python can change
        "without_hook",
        # other processes, the network, and folders that are not data
        "memory_of_parent_by_native_code", "trace_of_parent", "parent_memory", "parent_environment",
        "parent_command", "parent_folder", "parent_signal", "end_of_parent", "network", "listening",
        "listening_without_address", "fast_open", "datagram", "socket_with_a_path", "letter_to_a_path",
        "message_to_a_path", "system_v_memory",
        "shared_memory", "write_beside_code", "write_home", "kernel_cache",
    }
)  # fmt: skip
"""Ways that docs/explanation/security.md names as open where the kernel has no Landlock."""
NOWHERE = frozenset(
    {
        "names_in_arguments",
        "names_in_frames",
        "names_in_memory",
        "scene_by_name",
        "scene_by_manifest",
        "token",
    }
)
"""Ways that lead nowhere as the process is not told: its variables hold neither the scene nor secrets."""
FEWEST = 61
"""Ways that outsiders tried."""


@pytest.fixture
def scene(make_scene: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A scene with pictures beside it, a run folder with results of others, and a server on this machine."""
    scene = make_scene()
    look, run = scene.parents[1] / "look", tmp_path / "run"
    look.mkdir()
    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(look / "scene.png")
    for name in ("jobs/other/job.json", "report/index.html", "run.json"):
        (run / name).parent.mkdir(parents=True, exist_ok=True)
        (run / name).write_text("{}")
    with closing(sqlite3.connect(run / "jobs" / "data.db")) as data:
        data.executescript("create table data(x); insert into data values (1)")
    save_file({"x": np.zeros(3)}, run / "weights.safetensors")
    (tmp_path / "home").mkdir()
    (scene.parent / "victim").mkdir()
    for name in ("one", "two", "folder/file", "tree/file"):
        (scene / "truth" / "victims" / name).parent.mkdir(parents=True, exist_ok=True)
        (scene / "truth" / "victims" / name).write_text("victim")
    (scene / "capture" / "victim").write_text("victim")
    write_manifest(scene / "capture", manifest_of(open_capture(scene / "capture", check=False)))
    with (
        socket.create_server(("127.0.0.1", 0)) as server,
        socket.socket(socket.AF_UNIX) as named,
        socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as letters,
    ):
        with monkeypatch.context() as inside:
            inside.chdir(run)  # such a path may have 107 bytes
            named.bind("socket")
            letters.bind("letters")
        named.listen()
        for name, value in {
            "ROUTES_SCENE": scene, "ROUTES_ASIDE": run, "ROUTES_HOME": tmp_path / "home",
            "ROUTES_PORT": server.getsockname()[1], "ROUTES_TOKEN": "secret",
            "GRAYCARD_PASS": "ROUTES_SCENE,ROUTES_ASIDE ROUTES_HOME ROUTES_PORT",
        }.items():  # fmt: skip
            monkeypatch.setenv(name, str(value))
        yield scene


def found_by(scene: Path, tmp_path: Path) -> tuple[set[str], str]:
    """Return the ways that gave anything, and how the truth was closed."""
    fitted = fit_scene(
        FitSpec("routes_to_truth:Routes", {}, 0, scene),
        tmp_path / "p",
        silent,
        jobs=tmp_path / "run" / "jobs",
    )
    assert len(fitted.cost.counts) >= len(ROUTES) >= FEWEST
    assert fitted.access.refused, "the hook sees the plain ways"
    assert GUARDS.fullmatch(fitted.access.guard)
    return {name for name, got in fitted.cost.counts.items() if got}, fitted.access.guard


@pytest.mark.skipif(not landlock_version(), reason="this kernel has no Landlock")
def test_landlock_closes_every_way(scene: Path, tmp_path: Path):
    before = sha256_of_files(tmp_path)
    found, guard = found_by(scene, tmp_path)
    assert found == set()
    assert guard.startswith("landlock-")
    assert "+seccomp-1+" in guard or platform.machine() not in ("x86_64", "aarch64")
    after = {name: hashed for name, hashed in sha256_of_files(tmp_path).items() if not name.startswith("p/")}
    assert after == before


NVIDIA = """
import graycard.processes._inside as inside
import graycard.processes._places as places
inside.has_nvidia = places.has_nvidia = lambda: True
"""


@pytest.mark.skipif(not landlock_version(), reason="this kernel has no Landlock")
def test_no_way_leads_further_where_a_gpu_is(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    start_children_with(NVIDIA, tmp_path / "site", monkeypatch)
    found, _ = found_by(scene, tmp_path)
    assert found == set()


OFF = """
import graycard.processes._landlock as landlock
import graycard.processes._seccomp as seccomp
landlock.landlock_version = lambda: 0
seccomp._CALLS = {}
"""
NOT_EVEN_THE_HOOK = """
import graycard.processes._guard as guard
guard.Guard.install = lambda self: None
"""


def start_children_with(code: str, folder: Path, patch: pytest.MonkeyPatch) -> None:
    """Let Python processes that are started run some code first."""
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(code)
    patch.setenv("PYTHONPATH", os.pathsep.join([str(folder), *sys.path]))


def test_without_landlock_the_hook_closes_plain_ways(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    start_children_with(OFF, tmp_path / "site", monkeypatch)
    found, guard = found_by(scene, tmp_path)
    assert guard == "audit-hook-2"
    assert found <= WITHOUT_LANDLOCK
    assert "native_open" in found, "docs/explanation/security.md says so"


def test_every_way_leads_somewhere_where_nothing_is_closed(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Else the tests above prove nothing."""
    start_children_with(OFF + NOT_EVEN_THE_HOOK, tmp_path / "site", monkeypatch)
    spec = FitSpec("routes_to_truth:Routes", {}, 0, scene)
    found = fit_scene(spec, tmp_path / "p", silent).cost.counts
    assert {name for name, got in found.items() if not got} == NOWHERE

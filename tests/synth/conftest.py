# SPDX-License-Identifier: Apache-2.0
"""Renderer variants, a small scene made by hand, and tiny scenes that are rendered once."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from graycard import TRACKS, Camera, Light, RenderError, View, look_at
from graycard.io import to_builtins
from graycard.synth import Ball, Matte, Quad, Scene, SceneSpec, Thing, render_scene, use_renderer
from graycard.synth.renderer._variant import LLVM_RGB, SCALAR
from tiny_tables import HIDDEN, RENDER, TABLE, TINY, RunPython
from without_llvm import hide_llvm

Judge = Callable[[str, float, float], None]


@pytest.fixture(scope="session")
def run_python() -> Callable[..., subprocess.CompletedProcess[str]]:
    """``run_python(code, *arguments, **environment)`` in a process of its own.

    It is not traced: under ``--cov=graycard.synth`` coverage would import numpy twice there.
    """

    def run(code: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
        kept = {name: value for name, value in os.environ.items() if not name.startswith("COV")}
        command = [sys.executable, "-c", code, *arguments]
        return subprocess.run(command, env=kept | environment, capture_output=True, text=True, check=False)

    return run


@pytest.fixture(scope="session", autouse=True)
def loaded() -> None:
    """Dr.Jit looks for LLVM once a process: let it, before a test hides the library."""
    use_renderer()


@pytest.fixture(params=[SCALAR, LLVM_RGB])
def variant(request: pytest.FixtureRequest) -> str:
    """Each variant of the renderer that this machine can run, in use."""
    try:
        return use_renderer(variant=request.param).variant
    except RenderError as reason:
        pytest.skip(str(reason))


@pytest.fixture
def scalar() -> str:
    """The variant that every machine has, in use: nothing to compile."""
    return use_renderer(variant=SCALAR).variant


@pytest.fixture
def no_llvm(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine without LLVM."""
    hide_llvm(monkeypatch)


@pytest.fixture
def judge(request: pytest.FixtureRequest) -> Judge:
    """``judge(what, figure, bar)`` fails above the bar or without a number; figures go to ``--junitxml``."""

    def check(what: str, figure: float, bar: float) -> None:
        # not record_property: it warns, and a warning is an error, under the default kind of JUnit file
        request.node.user_properties.append((what, f"{figure:.3g} (bar {bar:.3g})"))
        assert figure <= bar, f"expected {what} of at most {bar:.3g}, got {figure:.3g}"

    return check


@pytest.fixture
def make_plane() -> Callable[..., Scene]:
    """A Lambertian floor of albedo (0.5, 0.4, 0.3) and perhaps a ball, seen obliquely from above."""

    def make(
        lights: tuple[Light, ...] = (), ball: Ball | None = None, sky: np.ndarray | None = None
    ) -> Scene:
        floor = Thing("floor", Quad((0, 0, 0), (4, 0, 0), (0, 4, 0)), Matte((0.5, 0.4, 0.3)))
        balls = (Thing("ball", ball, Matte((0.6, 0.5, 0.2))),) if ball else ()
        pose = look_at(np.array([1.2, -2.0, 2.5]), np.array([0.1, 0.2, 0.0]))
        camera = Camera.from_fov(24, 20, 50.0, pose)
        return Scene((floor, *balls), lights, (View("train_000", "train", camera),), sky)

    return make


@pytest.fixture(scope="session")
def in_process(run_python: RunPython) -> RunPython:
    """``in_process(out, spec, threads, kill_at, hide)`` renders in a process of its own."""

    def run(
        out: Path, spec: SceneSpec = TABLE, threads: int | None = None, kill_at: str = "", hide: bool = True
    ) -> subprocess.CompletedProcess[str]:
        request = json.dumps([to_builtins(spec), to_builtins(TINY), str(out), threads, kill_at])
        return run_python(RENDER, request, **(HIDDEN if hide else {}))

    return run


@pytest.fixture(scope="session")
def told() -> dict[str, list[tuple[float, str]]]:
    """Progress that the rendering of each track has told of."""
    return {track: [] for track in TRACKS}


@pytest.fixture(scope="session")
def rendered(
    tmp_path_factory: pytest.TempPathFactory, told: dict[str, list[tuple[float, str]]]
) -> dict[str, Path]:
    """One tiny scene a track, not to be changed."""
    with pytest.MonkeyPatch.context() as patch:
        hide_llvm(patch)
        out = tmp_path_factory.mktemp("rendered")
        specs = [SceneSpec("dark", "corridor", 0), TABLE, SceneSpec("multilight", "studio", 0)]
        found = {}
        for spec in specs:
            heard = told[spec.track]
            found[spec.track] = render_scene(
                spec, TINY, out, lambda done, doing, heard=heard: heard.append((done, doing)), threads=2
            )
        return found


@pytest.fixture
def table(rendered: dict[str, Path], tmp_path: Path, no_llvm: str) -> Path:
    """A copy of the tabletop scene in a dataset of its own."""
    target = tmp_path / "dataset" / "tabletop" / rendered["tabletop"].name
    shutil.copytree(rendered["tabletop"], target)
    return target

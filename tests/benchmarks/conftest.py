# SPDX-License-Identifier: Apache-2.0
"""A real run, as small as can be: three tracks, four methods, rendered by Mitsuba."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from graycard.cli import main
from tiny_benches import run_here
from valid_runs import write_valid_run

SUITE = """
name = "tiny"
version = 1
title = "As small as can be"
[render]
width = 24
height = 20
train_views = 3
test_views = 2
samples = 16
max_depth = 3
{scenes}
[[methods]]
name = "truth"
[[methods]]
name = "gray"
settings = {{ reflectance = {reflectance} }}
[[methods]]
name = "input"
[[methods]]
name = "retinex"
"""
SCENES = {"dark": "corridor", "tabletop": "glossy-table", "multilight": "studio"}


def write_suite(path: Path, tracks: tuple[str, ...] = tuple(SCENES), reflectance: float = 0.18) -> Path:
    """A suite file with one scene for each track, seeds from 1000 up."""
    scenes = "".join(
        f'[[scenes]]\ntrack = "{track}"\nfamily = "{SCENES[track]}"\nseed = 1000\n' for track in tracks
    )
    path.write_text(SUITE.format(scenes=scenes, reflectance=reflectance))
    return path


@pytest.fixture(scope="session")
def tiny_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run folder of an undisturbed bench of the tiny suite; not to be changed."""
    folder = tmp_path_factory.mktemp("bench")
    suite = write_suite(folder / "tiny.toml")
    assert main(["bench", str(suite), "--out", str(folder / "run")]) == 0
    return folder / "run"


@pytest.fixture
def suite_of(tmp_path: Path) -> Callable[..., Path]:
    """``suite_of(tracks=("dark",), reflectance=0.3)`` writes a variant of the tiny suite, gives its path."""

    def write(**options: object) -> Path:
        return write_suite(tmp_path / "tiny.toml", **options)  # pyright: ignore

    return write


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Benches that do their jobs in this process, for what is not about workers and confinement."""
    run_here(monkeypatch)


@pytest.fixture(scope="session")
def made_run(tmp_path_factory: pytest.TempPathFactory, write_tiny: Callable[..., Path]) -> Path:
    """A whole and valid run; not to be changed."""
    return write_valid_run(tmp_path_factory.mktemp("validity") / "run", write_tiny)


@pytest.fixture
def run(made_run: Path, tmp_path: Path) -> Path:
    """A copy of it to break."""
    return Path(shutil.copytree(made_run, tmp_path / "run"))

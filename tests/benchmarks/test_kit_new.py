# SPDX-License-Identifier: Apache-2.0
"""A skeleton that works at once: it keeps the contract, passes its own tests, and stands in a leaderboard."""

import os
import subprocess
import sys
import tomllib
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from graycard.benchmarks import _runner, load_suite, run_bench
from graycard.benchmarks.kit import check_method, class_of, new_method
from graycard.cli import main
from graycard.io import silent
from graycard.methods.confined import _start
from graycard.records import read_comparison
from kit_here import checked_here
from tiny_benches import made_without_renderer

SUITE = """
name = "first"
version = 1
title = "demo_method beside 2dgs"
[render]
[[scenes]]
track = "dark"
family = "corridor"
seed = 1001
[[methods]]
name = "2dgs"
settings = { iterations = 3, surfels = 50 }
[[methods]]
name = "demo_method:DemoMethod"
label = "demo_method"
"""


def clean(folder: Path) -> dict[str, str]:
    """Return an environment in which graycard is found, and nothing of its tests."""
    paths = [str(Path(__file__).parents[2] / "src"), str(folder)]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return new_method("demo_method", tmp_path_factory.mktemp("outside"))


def test_it_writes_a_package_with_tests_workflow_and_card(package: Path):
    files = {path.relative_to(package).as_posix() for path in package.rglob("*") if path.is_file()}
    assert files == {
        "pyproject.toml", "README.md", "suite.toml", ".gitignore", ".github/workflows/ci.yml",
        "src/demo_method/__init__.py", "src/demo_method/_method.py", "tests/test_demo_method.py",
    }  # fmt: skip
    told = tomllib.loads((package / "pyproject.toml").read_text())
    assert told["project"]["entry-points"]["graycard.methods"] == {"demo_method": "demo_method:DemoMethod"}
    assert [m.name for m in load_suite(str(package / "suite.toml")).methods] == [
        "gray",
        "2dgs",
        "demo_method",
    ]


@pytest.mark.slow
def test_its_own_tests_pass(package: Path):
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(package)]
    done = subprocess.run(
        command, cwd=package, env=clean(package / "src"), capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "3 passed" in done.stdout


@pytest.mark.slow
def test_it_stands_in_a_leaderboard_beside_2dgs(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write_tiny: Callable[..., Path]
):
    monkeypatch.syspath_prepend(package / "src")
    processes = _runner.run_all, _start.started
    made_without_renderer(monkeypatch, partial(write_tiny, points=True))
    monkeypatch.setattr(_runner, "run_all", processes[0])
    monkeypatch.setattr(_start, "started", processes[1])
    (tmp_path / "first.toml").write_text(SUITE)
    record = run_bench(load_suite(str(tmp_path / "first.toml")), tmp_path / "run", 1, silent)
    assert {r.job.method: r.reason for r in record.results} == {"2dgs": "", "demo_method": ""}
    comparison = read_comparison(tmp_path / "run")
    assert comparison is not None
    rows = {m.method for m in comparison.find("dark", "novel_view.psnr").methods}
    assert rows == {"2dgs", "demo_method"}
    assert main(["report", str(tmp_path / "run")]) == 0
    assert "demo_method" in (tmp_path / "run" / "report" / "index.html").read_text()


def test_one_file_is_a_whole_method(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    made = new_method("sun-fade", tmp_path, one_file=True)
    assert made == tmp_path / "sun_fade.py"
    assert "demo" not in made.read_text().lower()
    assert "def test_it_keeps_the_contract" in made.read_text()
    checked_here(monkeypatch, tmp_path / "tmp", tmp_path / "data")
    (tmp_path / "tmp").mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    assert check_method("sun_fade:SunFadeMethod").faults == ()


@pytest.mark.parametrize(
    ("name", "wanted"),
    [("demo_method", "DemoMethod"), ("sun-fade", "SunFadeMethod"), ("a2", "A2Method"), ("method", "Method")],
)
def test_the_class_is_named_by_the_method(name: str, wanted: str):
    assert class_of(name) == wanted


@pytest.mark.parametrize(
    "name",
    ["../x", "/tmp/x", "a/b", "a b", "a.b", "", ".", "-x", "--one", "2x", "A", "é", "x" * 41, "a__b", "a\n",
     "class", "match", "con", "numpy", "json", "graycard", "gray", "2dgs", "pytest"],
)  # fmt: skip
@pytest.mark.parametrize("options", [[], ["--one-file"]])
def test_names_that_cannot_be_are_refused_and_nothing_is_written(
    name: str, options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    (tmp_path / "in").mkdir()
    try:
        code = main(["new-method", name, "--out", str(tmp_path / "in"), *options])
    except SystemExit as end:  # the command line takes it for an option
        code = end.code
    assert code == 2
    assert capsys.readouterr().err
    assert [*tmp_path.rglob("*")] == [tmp_path / "in"]


@pytest.mark.parametrize("there", ["file", "folder", "link"])
@pytest.mark.parametrize("one_file", [False, True])
def test_nothing_is_overwritten(
    there: str, one_file: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    place = tmp_path / ("mine_too.py" if one_file else "mine_too")
    {
        "file": lambda: place.write_text("mine"),
        "folder": place.mkdir,
        "link": lambda: place.symlink_to(tmp_path / "nowhere"),
    }[there]()
    options = ["--one-file"] if one_file else []
    assert main(["new-method", "mine_too", "--out", str(tmp_path), *options]) == 2
    assert "mine_too" in capsys.readouterr().err
    assert [*tmp_path.iterdir()] == [place]
    assert there != "file" or place.read_text() == "mine"

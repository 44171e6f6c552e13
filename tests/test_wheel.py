# SPDX-License-Identifier: Apache-2.0
"""A wheel that was made of the source distribution works without a checkout, and its results are valid.

GRAYCARD_NEWEST_PYTHON names another Python for the light installation, as /opt/python3.13/bin/python3.
"""

import json
import os
import shutil
import site
import subprocess
import sys
import tarfile
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PUBLISHED = ROOT / "reports" / "published" / "matte"
MOST_MB = 600
pytestmark = pytest.mark.slow


def run(*command: object, cwd: Path, code: int = 0) -> str:
    """Run a command without what this process knows of the checkout; return all that it has printed."""
    dropped = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")
    environment = {name: value for name, value in os.environ.items() if name not in dropped}
    words = [str(word) for word in command]
    done = subprocess.run(words, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == code, f"{words}\n{done.stdout}\n{done.stderr}"
    return done.stdout + done.stderr


def build(source: Path, kind: str, out: Path) -> Path:
    """Build a distribution by the setuptools of this environment; nothing is downloaded."""
    out.mkdir(exist_ok=True)
    code = f"from setuptools import build_meta; build_meta.build_{kind}({str(out)!r})"
    run(sys.executable, "-c", code, cwd=source)
    (found,) = out.iterdir()
    return found


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of the source distribution of what git knows of this checkout."""
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        pytest.skip("needs git and a checkout")
    if find_spec("setuptools") is None:
        pytest.skip("needs setuptools")
    folder = tmp_path_factory.mktemp("wheel")
    copy = folder / "copy"
    names = run("git", "ls-files", "-z", cwd=ROOT).split("\0")
    for name in names:
        if name and (ROOT / name).is_file() and not (ROOT / name).is_symlink():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, copy / name)
    with tarfile.open(build(copy, "sdist", folder / "sdist")) as archive:
        archive.extractall(folder / "unpacked", filter="data")
    (unpacked,) = (folder / "unpacked").iterdir()
    assert (unpacked / "requirements-light.txt").is_file()
    return build(unpacked, "wheel", folder / "wheel")


def environment_at(folder: Path, python: str = sys.executable) -> Path:
    """Make a virtual environment, and return its folder of programs."""
    run(python, "-m", "venv", folder, cwd=folder.parent)
    return folder / ("Scripts" if sys.platform == "win32" else "bin")


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel in an environment of its own, which borrows this one's packages behind its own."""
    folder = tmp_path_factory.mktemp("whole")
    programs = environment_at(folder / "env")
    run(programs / "pip", "install", "--no-deps", "--no-index", wheel, cwd=folder)
    (own,) = (folder / "env").glob("lib/python*/site-packages")
    (own / "borrowed.pth").write_text("\n".join(site.getsitepackages()) + "\n")
    return programs


def test_a_run_of_a_wheel_is_made_judged_gated_and_published(installed: Path, tmp_path: Path):
    graycard = installed / "graycard"
    run(graycard, "bench", "ci", "--tracks", "dark", "--out", "run", cwd=tmp_path)
    assert (tmp_path / "run" / "report" / "index.html").stat().st_size > 10_000
    record = json.loads((tmp_path / "run" / "run.json").read_text())["environment"]
    assert record["git_commit"] is None
    assert record["installed"]["changed"] == []
    assert "check-result: valid" in run(graycard, "check-result", "run", cwd=tmp_path)
    run(graycard, "gate", "run", "--baseline", "base.json", "--write", cwd=tmp_path)
    assert "gate: passed" in run(graycard, "gate", "run", "--baseline", "base.json", cwd=tmp_path)
    run(graycard, "report", "run", "--summary", "md", cwd=tmp_path)
    run(graycard, "publish", "run", "--out", "published", cwd=tmp_path)
    assert (tmp_path / "published" / "run.json").is_file()


def test_a_changed_wheel_is_no_identity(installed: Path, tmp_path: Path):
    (changed,) = installed.parent.glob("lib/python*/site-packages/graycard/eval/__init__.py")
    before = changed.read_bytes()
    try:
        changed.write_bytes(before + b"\n")
        shown = run(installed / "graycard", "doctor", cwd=tmp_path)
        assert "1 files changed" in shown
    finally:
        changed.write_bytes(before)


def test_all_that_ships_is_found_without_a_checkout(installed: Path, tmp_path: Path):
    graycard = installed / "graycard"
    assert "smoke" in run(graycard, "scenes", cwd=tmp_path)
    assert ", 0 cannot be loaded" in run(graycard, "methods", cwd=tmp_path)
    assert "GOR-IS (CVPR 2026)" in run(graycard, "claims", cwd=tmp_path)
    assert "bash" in run(graycard, "completion", "bash", cwd=tmp_path)


def test_a_light_installation_compares_gates_and_reports(wheel: Path, tmp_path: Path):
    python = os.environ.get("GRAYCARD_NEWEST_PYTHON", sys.executable)
    programs = environment_at(tmp_path / "env", python)
    try:  # a list that cannot be installed has to fail, so another package tells
        run(programs / "pip", "download", "-q", "--no-deps", "-d", tmp_path / "any", "six", cwd=tmp_path)
    except AssertionError:
        pytest.skip("needs an index of packages")
    run(programs / "pip", "install", "-q", "-r", ROOT / "requirements-light.txt", cwd=tmp_path)
    run(programs / "pip", "install", "-q", "--no-deps", "--no-index", wheel, cwd=tmp_path)
    size = sum(p.stat().st_size for p in (tmp_path / "env").rglob("*") if p.is_file() and not p.is_symlink())
    assert size / 1e6 < MOST_MB
    graycard, record = programs / "graycard", tmp_path / "run"
    record.mkdir()
    shutil.copy(PUBLISHED / "run.json", record)
    run(graycard, "gate", "run", "--baseline", "base.json", "--write", cwd=tmp_path)
    assert "gate: passed" in run(graycard, "gate", "run", "--baseline", "base.json", cwd=tmp_path)
    assert "compare: " in run(graycard, "compare", "run", cwd=tmp_path)
    run(graycard, "report", "run", "--summary", "junit", "--out", "junit.xml", cwd=tmp_path)
    run(graycard, "report", "run", cwd=tmp_path)
    shown = run(graycard, "render", "dark", "--out", "data", cwd=tmp_path, code=2)
    assert "expected the package mitsuba, which this needs, got none. Run `pip install torch --index" in shown
    assert "without colour-science" in run(graycard, "doctor", cwd=tmp_path)

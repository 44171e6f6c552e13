# SPDX-License-Identifier: Apache-2.0
"""A package that is not there is named with the command that installs it; other errors stay what they are."""

import pickle
import subprocess
import sys

import pytest

from graycard import _missing, missing_package

WITHOUT = """
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {gone}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Absent())
from graycard.cli import main
if __name__ == "__main__":
    sys.exit(main({args}))
"""
GONE = ("torch", "mitsuba", "drjit", "numba", "llvmlite", "colour")
"""Modules that a light installation has not."""


def run_without(gone: tuple[str, ...], *args: str) -> subprocess.CompletedProcess[str]:
    """Run a verb where some packages are not there, as in a light installation."""
    code = WITHOUT.format(gone=gone, args=[*args])
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("module", "package"),
    [("torch", "torch"), ("cv2.typing", "opencv-python-headless"), ("drjit", "mitsuba")],
)
def test_a_package_of_graycards_is_named(module: str, package: str):
    found = missing_package(ModuleNotFoundError(f"No module named {module!r}", name=module))
    assert found is not None
    assert str(found).startswith(f"expected the package {package}, which this needs, got none. Run `")
    again = pickle.loads(pickle.dumps(found))
    assert (str(again), again.package) == (str(found), package)


@pytest.mark.parametrize(
    "cause",
    [ModuleNotFoundError("No module named 'herlab'", name="herlab"), ImportError("torch"), KeyError(), None],
)
def test_other_errors_are_none_of_this(cause: BaseException | None):
    assert missing_package(cause) is None


def test_all_that_is_missing_comes_by_one_command(monkeypatch: pytest.MonkeyPatch):
    there = {"numpy"}
    needs = ["numpy>=2.0", "torch>=2.6", "mitsuba>=3.9.1,<3.10", "numba"]
    monkeypatch.setattr(_missing, "_required", lambda: needs)
    monkeypatch.setattr(_missing, "_is_installed", lambda name: name in there)
    monkeypatch.setattr(sys, "base_prefix", "elsewhere")
    index = "--index-url https://download.pytorch.org/whl/cpu"
    both = f"`pip install torch {index} && pip install 'mitsuba>=3.9.1,<3.10' numba`"
    assert _missing.install_command("torch") == both
    there |= {"torch"}
    assert _missing.install_command("numba") == "`pip install 'mitsuba>=3.9.1,<3.10' numba`"
    assert _missing.install_command("viser") == "`pip install viser`", "it belongs to an extra"


def test_markers_of_other_machines_are_left_out(monkeypatch: pytest.MonkeyPatch):
    lines = ["numpy>=2.0", 'llvm<20; sys_platform == "linux" and x', 'ruff; extra == "dev"']
    monkeypatch.setattr(_missing, "requires", lambda name: lines)
    monkeypatch.setattr(sys, "platform", "darwin")
    assert _missing._required() == ["numpy>=2.0"]
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    assert _missing._required() == ["numpy>=2.0", "llvm<20"]


def test_verbs_that_need_it_name_it():
    done = run_without(GONE, "fit", "2dgs", "SCENE", "--help")
    assert done.returncode == 2
    assert "graycard: expected the package torch, which this needs, got none. Run `" in done.stderr
    assert "Traceback" not in done.stderr


def test_methods_that_need_it_are_listed_with_what_they_need():
    done = run_without(GONE, "methods")
    assert done.returncode == 0, done.stderr
    assert "cannot be loaded: needs torch" in done.stdout
    assert done.stderr.count("advice: run `") == 1
    assert "methods: 4 work" in done.stdout

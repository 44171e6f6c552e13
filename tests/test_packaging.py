# SPDX-License-Identifier: Apache-2.0
"""Every folder that holds code ships in the wheel, under one name, with one dependency direction."""

import ast
import os
import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
OURS = {"dev", "docs", "test"}
"""Extras for who works on graycard."""
FOLDERS = ("benchmarks", "eval", "methods", "reports", "synth")
MUST_NOT_KNOW = {
    "src/graycard/*.py": ("synth", "methods", "eval", "benchmarks", "reports"),
    **{
        f"src/graycard/{room}/**/*.py": ("synth", "methods", "eval", "benchmarks", "reports")
        for room in ("cli", "exchange", "io", "layers", "networks", "processes", "records")
    },
    "synth/**/*.py": ("methods", "eval", "benchmarks", "reports"),
    "methods/**/*.py": ("synth", "eval", "benchmarks", "reports"),
    "eval/**/*.py": ("synth", "methods", "benchmarks", "reports"),
    "benchmarks/**/*.py": ("reports",),
    "reports/**/*.py": ("synth", "methods", "eval", "benchmarks"),
}


def read_project() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text())


def test_every_package_is_listed():
    setuptools = read_project()["tool"]["setuptools"]
    roots = [(ROOT / folder, f"graycard.{folder}") for folder in FOLDERS]
    roots += [(p.parent, f"graycard.{p.parent.name}") for p in (ROOT / "src/graycard").glob("*/__init__.py")]
    on_disk = {
        ".".join([name, *init.parent.relative_to(root).parts])
        for root, name in roots
        for init in root.rglob("__init__.py")
    }
    assert sorted(setuptools["packages"]) == sorted(["graycard", *on_disk])


def test_each_folder_has_its_link():
    links = [ROOT / "src" / "graycard" / folder for folder in FOLDERS]
    if not any(link.is_symlink() for link in links):
        pytest.skip("a checkout without links (core.symlinks=false): the mapping in pyproject serves it")
    assert all(os.path.samefile(link, ROOT / link.name) for link in links)


def test_types_are_checked_in_every_folder_once():
    """Pyright does not follow links: what it is not told of outright, it never reads."""
    pyright = read_project()["tool"]["pyright"]
    assert sorted(pyright["include"]) == sorted([*FOLDERS, "src", "tests"])
    assert sorted(pyright["exclude"]) == sorted(f"src/graycard/{folder}" for folder in FOLDERS)


@pytest.mark.parametrize("pattern", MUST_NOT_KNOW)
def test_dependencies_point_one_way(pattern: str):
    """Scene -> predictions -> scores -> runs -> reports. Only the command line imports all, lazily."""
    for path in ROOT.glob(pattern):
        tree = ast.parse(path.read_text())
        body = tree.body if pattern.startswith("src/graycard/cli/") else ast.walk(tree)
        names = [n.module or "" for n in body if isinstance(n, ast.ImportFrom)]
        names += [a.name for n in body if isinstance(n, ast.Import) for a in n.names]
        bad = [n for n in names for far in MUST_NOT_KNOW[pattern] if n.startswith(f"graycard.{far}")]
        assert not bad, f"{path.relative_to(ROOT)} imports {bad}"


@pytest.mark.parametrize("heavy", ["torch", "mitsuba", "skimage", "cv2", "colour"])
def test_the_command_line_starts_without(heavy: str):
    code = f"import sys, graycard.cli; sys.exit({heavy!r} in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_constraints_pin_every_dependency():
    project = read_project()["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["test"]]
    names = {w.split(">")[0].split("=")[0].strip().lower().replace("_", "-") for w in wanted}
    pins = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if "==" in line]
    assert names <= {pin.split("==")[0].lower().replace("_", "-") for pin in pins}


def test_a_light_installation_has_the_ranges_of_a_whole_one():
    """And leaves out what no verb imports that scores, compares, gates or reports."""
    lines = (ROOT / "requirements-light.txt").read_text().splitlines()
    light = {line for line in lines if line and not line.startswith("#")}
    whole = {*read_project()["project"]["dependencies"]}
    assert light < whole
    left_out = {Requirement(line).name for line in whole - light}
    assert left_out == {"colour-science", "karellen-llvm-core", "mitsuba", "numba", "torch"}


def texts() -> dict[str, str]:
    """Return the source and the pages that users may meet, by path."""
    paths = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]
    paths += [path for path in (ROOT / "src" / "graycard").rglob("*.py") if "/template/" not in str(path)]
    paths += [*(ROOT / "docs").rglob("*.md"), *ROOT.glob("*.md"), *ROOT.glob("*.txt")]
    return {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in paths}


def names_that_are_none(text: str, extras: dict[str, list[str]]) -> list[str]:
    """Return names of extras in a text that do not exist, and packages in place of extras."""
    named = [name for found in re.findall(r"graycard\[([\w, -]+)\]", text) for name in found.split(",")]
    wrong = [name.strip() for name in named if name.strip() not in extras]
    wanted = {Requirement(line).name: name for name in {*extras} - OURS for line in extras[name]}
    installs = re.findall(r"pip install '?([A-Za-z][\w.-]*)(?=['`\s\"])", text)
    return wrong + [name for name in installs if name in wanted and name != "graycard"]


def test_messages_and_pages_name_extras_that_exist():
    extras = read_project()["project"]["optional-dependencies"]
    found = {path: wrong for path, text in texts().items() if (wrong := names_that_are_none(text, extras))}
    assert found == {}
    assert sum("graycard[" in text for text in texts().values()) > 12, "they are looked at"


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("pip install 'graycard[colmap]'", ["colmap"]),
        ("pip install 'graycard[view,cuda]'", ["cuda"]),
        ("Run `pip install matplotlib`", ["matplotlib"]),
        ("pip install 'graycard[view, cameras]'", []),
        ("pip install torch", []),
    ],
)
def test_an_extra_that_is_none_is_seen(text: str, wrong: list[str]):
    assert names_that_are_none(text, read_project()["project"]["optional-dependencies"]) == wrong


def test_the_page_on_installation_lists_the_extras():
    extras = read_project()["project"]["optional-dependencies"]
    page = (ROOT / "docs" / "how-to" / "install.md").read_text()
    assert {*re.findall(r"^\| `graycard\[(\w+)\]` \|", page, re.MULTILINE)} == {*extras} - OURS
    (everything,) = map(Requirement, extras["all"])
    assert everything.extras == {*extras} - OURS - {"all"}


def test_each_pin_is_one_that_all_installed_packages_allow():
    """An extra that the pins shut out would never be tested."""
    lines = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if "==" in line]
    pins = {canonicalize_name(name): version for name, _, version in (line.partition("==") for line in lines)}
    asked = 0
    for package in metadata.distributions():
        for wanted in map(Requirement, package.requires or ()):
            pin = pins.get(canonicalize_name(wanted.name))
            if pin is None or (wanted.marker and not wanted.marker.evaluate({"extra": ""})):
                continue
            asked += 1
            assert wanted.specifier.contains(pin), f"{package.name} wants {wanted}, constraints.txt has {pin}"
    assert asked > 50


@pytest.mark.xdist_group("packaging")
def test_workers_are_told_which_tests_belong_together(request: pytest.FixtureRequest):
    """pytest 9.2 hid it from pytest-xdist 3.8: each worker then built every shared fixture."""
    if not request.config.getoption("loadgroup", False):
        pytest.skip("needs workers, `pytest -n 2 --dist loadgroup`, as `make test` has them")
    assert request.node.nodeid.endswith("@packaging")

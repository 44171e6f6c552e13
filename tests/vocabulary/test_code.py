# SPDX-License-Identifier: Apache-2.0
"""Reached code of small packages made for the test."""

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from graycard.io import code_hash, reached_code

Reach = Callable[..., set[str]]


@pytest.fixture
def reach(tmp_path: Path) -> Reach:
    """``reach({"pkg/a.py": code, ...}, "pkg.a")`` gives the names of what is reached."""

    def find(files: Mapping[str, str], *roots: str) -> set[str]:
        write(tmp_path, files)
        return set(reached_code(roots, {"pkg": tmp_path / "pkg"}))

    return find


def write(folder: Path, files: Mapping[str, str]) -> None:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


DOOR = {
    "pkg/__init__.py": "from pkg._one import one as one\nfrom pkg._two import two as two\n",
    "pkg/_one.py": "from pkg._deep import deep\none = 1\n",
    "pkg/_two.py": "two = 2\n",
    "pkg/_deep.py": "deep = 3\n",
}
ONE = {"pkg", "pkg._one", "pkg._deep", "pkg.user"}
WHOLE = ONE | {"pkg._two"}


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("from pkg import one", ONE),
        ("def late():\n    from pkg import one", ONE),
        ("from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from pkg import one", ONE),
        ("try:\n    from . import one\nexcept ImportError:\n    one = None", ONE),
        ("import pkg\nx = pkg.one.real", ONE),
        ("import pkg as p\nx = p.one", ONE),
        ("NAME = 'pkg._one:one'", ONE),
        ("from ._one import one", ONE),
        ("import pkg._one\nx = pkg._one.one", ONE),
        ("import pkg._one as o\nx = getattr(o, 'one')", ONE),
        ("from importlib import import_module\nx = import_module('pkg._one')", ONE),
        ("from importlib import import_module\nx = import_module('._one', __package__)", ONE),
        ("x = __import__('pkg._one')", ONE),
        ("import pkg", WHOLE),
        ("import pkg\nx = getattr(pkg, 'o' + 'ne')", WHOLE),
        ("import pkg\nx = pkg.one, pkg.something", WHOLE),
        ("from pkg import *", WHOLE),
        ("from importlib import import_module as load\nname = 'pkg.'\nload(name + '_one')", WHOLE),
        ("def load(name):\n    return __import__(name)", WHOLE),
        ("import pkg, pkgutil\nx = list(pkgutil.iter_modules(pkg.__path__))", WHOLE),
        ("def load(name):\n    return __import__(f'pkg.{name}')", WHOLE),
        ("import numpy, nowhere.at_all\nTEXT = 'pkg.nothing and pkg.'", {"pkg", "pkg.user"}),
    ],
)
def test_an_import_leads_to_where_the_name_is_made(reach: Reach, code: str, expected: set[str]) -> None:
    found = reach({**DOOR, "pkg/user.py": code}, "pkg.user")
    assert {name for name in found if ":" not in name} == expected


def test_doors_behind_doors(reach: Reach) -> None:
    files = {
        "pkg/__init__.py": "from pkg.inner import one as two\n",
        "pkg/inner/__init__.py": "from pkg.inner._a import one as one\nfrom pkg.inner._b import b as b\n",
        "pkg/inner/_a.py": "from pkg import two\none = 1\n",
        "pkg/inner/_b.py": "b = 1\n",
    }
    assert reach(files, "pkg:two") == {"pkg", "pkg:two", "pkg.inner", "pkg.inner:one", "pkg.inner._a"}


def test_what_a_module_imports_is_also_what_others_have_from_it(reach: Reach) -> None:
    files = {
        **DOOR,
        "pkg/between.py": "try:\n    import pkg as door\nfinally:\n    x = door.one",
        "pkg/user.py": "from pkg.between import door\nx = door.two",
    }
    assert {"pkg._one", "pkg._two"} <= reach(files, "pkg.user")


def test_names_that_lead_to_each_other_end(reach: Reach) -> None:
    files = {"pkg/__init__.py": "from pkg.a import x as x", "pkg/a.py": "from pkg import x"}
    assert reach(files, "pkg:x") == {"pkg", "pkg:x", "pkg.a", "pkg.a:x"}


def test_what_a_door_does_itself_counts_with_what_it_uses(reach: Reach) -> None:
    files = {**DOOR, "pkg/__init__.py": DOOR["pkg/__init__.py"] + "total = two + 1\n", "pkg/user.py": ""}
    assert reach(files, "pkg.user") == {"pkg", "pkg._two", "pkg.user"}


def test_a_package_without_a_door(reach: Reach) -> None:
    files = {"pkg/room/a.py": "from pkg.room import b", "pkg/room/b.py": "", "pkg/room/c.py": ""}
    assert reach(files, "pkg.room.a") == {"pkg", "pkg.room", "pkg.room.a", "pkg.room.b"}
    assert reach({}, "pkg.room.*") == {"pkg", "pkg.room", "pkg.room.a", "pkg.room.b", "pkg.room.c"}


@pytest.mark.parametrize("line", ["from pkg._h import *", "import pkg._h"])
def test_what_a_door_imports_for_more_than_a_name_counts(reach: Reach, line: str) -> None:
    files = {"pkg/__init__.py": f"{line}\nfrom pkg._one import one", "pkg/_h.py": "X = 1"}
    assert "pkg._h" in reach(files | {"pkg/_one.py": "one = 1"}, "pkg._one")


def test_files_beside_a_module_that_looks_for_its_own_place(reach: Reach) -> None:
    files = {"pkg/a.py": "from pathlib import Path\nHERE = Path(__file__).parent", "pkg/data/t.toml": "a = 1"}
    assert reach(files, "pkg.a") == {"pkg", "pkg.a", "pkg/data/t.toml"}
    assert "pkg/data/t.toml" not in reach({"pkg/b.py": ""}, "pkg.b")


EDITS = [
    ("x = 1", "x = 2", False),
    ("x = 1", "x = True", False),
    ("x = 0.0", "x = -0.0", False),
    ("x = 'a'", "x = b'a'", False),
    ("x = a.b.c", "x = a.c.b", False),
    ("f(a)", "f(*a)", False),
    ("f(a=1, b=2)", "f(a=1, c=2)", False),
    ("x = [1], 2", "x = [1, 2]", False),
    ("x: int = 1", "x: float = 1", False),
    ("def f(a, /): ...", "def f(a): ...", False),
    ("assert x", "assert y", False),
    ("x = {**a, 'k': b}", "x = {'k': a, **b}", False),
    ("def f(*, a, b=1): ...", "def f(*, a=1, b): ...", False),
    ("x = f'{a!r}'", "x = f'{a!s}'", False),
    ("async def f(): ...", "def f(): ...", False),
    ("x = 1", "x = 1\ny = 1", False),
    ("def f():\n  if a:\n    b()\n  c()", "def f():\n  if a:\n    b()\n    c()", False),
    ("x = (1)", "x  =  1  # one", True),
    ("x = 'a'", 'x = "a"', True),
    ("x = 'a' 'b'", "x = 'ab'", True),
    ("x = u'a'", "x = 'a'", True),
    ("class A:\n  'said'\n  a: int = 1\n  'said'", "class A:\n    a: int = 1", True),
    ("def f():\n  'said'\n  return 1", '"""About it."""\ndef f():\n  return (\n    1\n  )', True),
]


@pytest.mark.parametrize(("old", "new", "equal"), EDITS)
def test_code_counts_and_words_about_it_do_not(tmp_path: Path, old: str, new: str, equal: bool) -> None:
    hashes = []
    for name, text in (("old", old), ("new", new)):
        write(tmp_path, {f"{name}/pkg.py": text})
        hashes.append(code_hash(["pkg"], {"pkg": tmp_path / name / "pkg.py"}))
    assert (hashes[0] == hashes[1]) is equal


def test_what_is_no_python_counts_by_its_bytes(tmp_path: Path) -> None:
    found = []
    for text in ("x = (", "x = ( ", "x = (\n#"):
        write(tmp_path, {f"{len(found)}/pkg.py": text})
        found.append(code_hash(["pkg"], {"pkg": tmp_path / f"{len(found)}/pkg.py"}))
    assert len(set(found)) == 3


def test_a_root_that_is_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"expected a root that is a module, got 'graycard.evil:x'"):
        code_hash(["graycard.evil:x"])
    with pytest.raises(ValueError, match="got 'pkg.a'"):
        code_hash(["pkg.a"], {"pkg": tmp_path / "pkg.py"})

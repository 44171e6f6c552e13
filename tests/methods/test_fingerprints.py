# SPDX-License-Identifier: Apache-2.0
"""Edits of a copy of the code: work is done again where they are reached, and nowhere else."""

import ast
import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path

import pytest

import graycard
from graycard.benchmarks._sources import scoring_fingerprint
from graycard.io import reached_code
from graycard.io._source import _read
from graycard.methods import BUILT_IN, fingerprint

METHODS = ("gray", "sunfaded", "goris")
SCORES = "scores"
ALL, FITTED = {*METHODS, SCORES}, {"sunfaded", "goris"}
CODE = Path(graycard.__file__).parent
FOLDERS = ("benchmarks", "eval", "methods", "reports", "synth")
TICKS = count(1)
Stale = Callable[[Path, str], set[str]]


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of graycard, whose links to the other folders are folders here."""
    copy = tmp_path_factory.mktemp("tree") / "graycard"
    shutil.copytree(CODE, copy, ignore=shutil.ignore_patterns("__pycache__", *FOLDERS))
    for name in FOLDERS:
        source = Path(__import__(f"graycard.{name}", fromlist=["_"]).__file__ or "").parent
        shutil.copytree(source, copy / name, ignore=shutil.ignore_patterns("__pycache__", "published"))
    return copy


@pytest.fixture(autouse=True)
def followed(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Hash the copy in place of the code that runs."""
    monkeypatch.setattr("graycard.io._code.HOME", tree)


@contextmanager
def edited(path: Path, text: str) -> Iterator[None]:
    """Write a file, and put back what was there."""
    before = path.read_bytes() if path.exists() else None
    try:
        write(path, text.encode())
        yield
    finally:
        path.unlink() if before is None else write(path, before)


def write(path: Path, data: bytes) -> None:
    path.write_bytes(data)
    later = time.time_ns() + next(TICKS) * 1_000_000  # as far apart as edits by hand
    os.utime(path, ns=(later, later))


def prints() -> dict[str, str]:
    return {**{name: fingerprint(name) for name in METHODS}, SCORES: scoring_fingerprint.__wrapped__()}


@pytest.fixture(scope="module")
def before(tree: Path) -> dict[str, str]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("graycard.io._code.HOME", tree)
        return prints()


@pytest.fixture
def stale(before: dict[str, str]) -> Stale:
    """``stale(path, text)`` names what is to be done again while a file of the copy holds another text."""

    def find(path: Path, text: str) -> set[str]:
        with edited(path, text):
            after = prints()
        return {name for name in before if after[name] != before[name]}

    return find


def test_what_is_undone_is_as_it_was(tree: Path, before: dict[str, str]) -> None:
    with edited(tree / "_camera.py", "import numpy"):
        assert not prints().items() & before.items()
    assert prints() == before


def planted(path: Path, old: str, new: str) -> str:
    text = path.read_text()
    assert old in text, f"plant another change: {path.name} has no {old!r} any more"
    return text.replace(old, new, 1)


REACHED = {
    "the method's own module": ("methods/_gray.py", '"normal": -camera', '"normal": camera', {"gray"}),
    "a setting of it": ("methods/sunfaded/_settings.py", "int = 2000", "int = 2001", {"sunfaded"}),
    "a kernel": ("methods/splat/raster/_tiles.py", "(pixel + TILE - 1)", "(pixel + TILE)", FITTED),
    "the vocabulary": ("_camera.py", "inverse = np.eye(4)", "inverse = np.eye(4) * 1", ALL),
    "a helper behind two doors": ("methods/splat/_edit.py", "atol=1e-6", "atol=1e-5", {"goris"}),
    "a constant": ("eval/measures/_ssim.py", "WINDOW = 11", "WINDOW = 13", {SCORES}),
    "a default argument": ("_camera.py", "float] = (0, 0, 1)", "float] = (0, 1, 0)", ALL),
    "an argument of a decorator": (
        "methods/splat/trace/_backward.py", 'error_model="numpy"', 'error_model="python"', {"goris"},
    ),
    "the type of a field": ("predictions.py", "Mapping[RelativePath, str]", "Mapping[Name, str]", ALL),
    "a module that is imported late": (
        "methods/surfels/_compose_kernels.py", "left = 1 - alpha", "left = 2 - alpha", FITTED,
    ),
    "a door's own code": ("__init__.py", '__version__ = "', '__version__ = "1', ALL),
    "the writer of predictions": (
        "methods/_predict.py", "decomposition.render(", "decomposition.lights(", {*METHODS},
    ),
}  # fmt: skip


@pytest.mark.parametrize("place", REACHED)
def test_an_edit_that_is_reached_is_a_reason_to_do_it_again(tree: Path, stale: Stale, place: str) -> None:
    name, old, new, expected = REACHED[place]
    assert stale(tree / name, planted(tree / name, old, new)) == expected


@pytest.mark.parametrize(
    "name", ["methods/goris/_flat.py", "methods/_gray.py", "_camera.py", "eval/measures/_ssim.py"]
)
def test_comments_docstrings_and_layout_are_none(tree: Path, stale: Stale, name: str) -> None:
    text = (tree / name).read_text()
    comment = text.replace("\n\n\n", "\n\n\n# Said otherwise.\n", 1) + "# The end.\n"
    docstring = planted(tree / name, '"""', '"""Said otherwise. ')
    inner = planted(tree / name, '    """', '    """Said otherwise. ')
    layout = text.replace("\n\n\n", "\n\n\n\n\n").replace(" = ", "  =  ")
    unparsed = ast.unparse(ast.parse(text))
    for edit in (comment, docstring, inner, layout, unparsed):
        assert edit != text
        assert stale(tree / name, edit) == set()


@pytest.mark.parametrize(
    "name",
    [
        "cli/_speed.py",
        "cli/_main.py",
        "reports/_page.py",
        "benchmarks/_runner.py",
        "benchmarks/_fit.py",
        "synth/_scene.py",
        "methods/_retinex.py",
        "methods/darkgs/_settings.py",
        "methods/priors/_depth.py",
        "eval/statistics/_interval.py",
        "exchange/colmap/_text.py",
    ],
)
def test_nor_is_code_that_is_not_reached(tree: Path, stale: Stale, name: str) -> None:
    assert stale(tree / name, (tree / name).read_text() + "\nPLANTED = 1\n") == set()


def test_nor_what_else_a_door_offers(tree: Path, stale: Stale) -> None:
    door = tree / "methods" / "__init__.py"
    assert (
        stale(door, door.read_text() + "from graycard.methods._retinex import RetinexMethod as R\n") == set()
    )
    assert stale(tree / "methods" / "notes.md", "Said otherwise.") == set()


def test_a_name_that_a_door_has_from_elsewhere_is_another_one(tree: Path, stale: Stale) -> None:
    door = tree / "layers" / "__init__.py"
    text = planted(door, "import find_fault as find_fault", "import find_layer as find_fault")
    assert stale(door, text) == ALL


def test_a_metric_that_is_added_is_a_reason_to_score_again(tree: Path, stale: Stale) -> None:
    assert stale(tree / "eval" / "metrics" / "_planted.py", "VALUE = 1\n") == {SCORES}


def test_priors_are_one_where_they_answer(tree: Path) -> None:
    path = tree / "methods" / "priors" / "_depth.py"
    before = fingerprint("sunfaded", with_priors=True)
    with edited(path, path.read_text() + "\nPLANTED = 1\n"):
        assert fingerprint("sunfaded", with_priors=True) != before
    assert before != fingerprint("sunfaded")


def test_all_methods_read_each_file_once(tree: Path) -> None:
    _read.cache_clear()
    found = {name: fingerprint(name) for name in BUILT_IN}
    read = _read.cache_info()
    assert read.misses == read.currsize < len(list(tree.rglob("*"))) < read.hits
    assert len(set(found.values())) >= len({target.partition(":")[0] for target in BUILT_IN.values()})


def test_importing_a_module_only_defines_names(tree: Path) -> None:
    """Doors are passed through: nothing may happen at an import that no user of the module asks for."""
    roots = [*BUILT_IN.values(), "graycard.eval.*", "graycard.methods.*"]
    reached = {name for name in reached_code(roots) if ":" not in name and "/" not in name}
    works = {name for name in reached for node in body_of(tree, name) if not is_definition(node)}
    assert works == {
        "graycard.methods._numba",  # says where kernels are kept, before the first is declared
        "graycard.methods.splat.simd._doubles",  # as _vector
        "graycard.methods.splat.simd._parts",  # starts Numba's threads
        "graycard.methods.splat.simd._vector",  # teaches Numba the operators of its own type
        "graycard.methods.splat.warm.__main__",  # a program
    }


def body_of(tree: Path, module: str) -> list[ast.stmt]:
    place = tree.joinpath(*module.split(".")[1:])
    path = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    return ast.parse(path.read_bytes()).body


def is_definition(node: ast.stmt) -> bool:
    match node:
        case ast.Expr():
            return isinstance(node.value, ast.Constant)
        case ast.If(test=ast.Name(id="TYPE_CHECKING")):
            return True
    defines = ast.Import | ast.ImportFrom | ast.FunctionDef | ast.ClassDef | ast.Assign | ast.AnnAssign
    return isinstance(node, defines)

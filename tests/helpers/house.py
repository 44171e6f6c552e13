# SPDX-License-Identifier: Apache-2.0
"""Read the house from its source: modules, what each imports, and the shape of functions."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
STAGES = ("synth", "methods", "eval", "benchmarks", "reports")
KERNELS = ("njit", "vectorize", "_instruction", "intrinsic")
"""Names in decorators of what Numba compiles."""


@dataclass(frozen=True, slots=True)
class Import:
    """One import of a module of graycard."""

    target: str
    """Dotted name of the module or package that is imported from."""
    line: int


@dataclass(frozen=True, slots=True)
class Function:
    """The shape of a function or method."""

    name: str
    line: int
    length: int
    """Lines from ``def`` to the end, without the docstring."""
    parameters: int
    """Without ``self`` and ``cls``."""
    kernel: bool
    """Compiled by Numba."""


@dataclass(frozen=True, slots=True)
class Module:
    """A source file of the package."""

    name: str
    """Name in imports, such as ``graycard.eval.measures._psnr``; a package's is that of its folder."""
    path: Path
    tree: ast.Module
    lines: int

    @property
    def package(self) -> str:
        """The package that it lies in; that of an ``__init__`` is itself."""
        return self.name if self.path.name == "__init__.py" else self.name.rpartition(".")[0]


def _folders() -> Iterator[tuple[str, Path]]:
    """Packages below the root with the folder that holds each; links are not followed."""
    yield "graycard", ROOT / "src" / "graycard"
    for stage in STAGES:
        yield f"graycard.{stage}", ROOT / stage


@cache
def modules() -> dict[str, Module]:
    """Return every module of the package by its dotted name."""
    found = {}
    for package, folder in _folders():
        for path in sorted(folder.rglob("*.py")):
            parts = path.relative_to(folder).with_suffix("").parts
            if package == "graycard" and parts[0] in STAGES:
                continue  # a link to a stage
            name = ".".join([package, *parts]).removesuffix(".__init__")
            text = path.read_text(encoding="utf-8")
            found[name] = Module(name, path, ast.parse(text), text.count("\n"))
    return found


@cache
def imports_of(name: str) -> tuple[Import, ...]:
    """Return what a module imports of graycard, also inside functions."""
    known, found = modules(), []
    for node in ast.walk(known[name].tree):
        match node:
            case ast.ImportFrom(module=str(source)) if source.split(".")[0] == "graycard":
                for alias in node.names:
                    inner = f"{source}.{alias.name}"
                    found.append(Import(inner if inner in known else source, node.lineno))
            case ast.Import():
                ours = [a.name for a in node.names if a.name.split(".")[0] == "graycard"]
                found += [Import(target, node.lineno) for target in ours]
    return tuple(found)


@cache
def door_of(package: str) -> str:
    """Return the package that speaks for another: the nearest at or above it whose ``__init__`` offers names.

    A folder whose ``__init__`` holds a docstring alone is a room of the package above.
    """
    while package != "graycard" and all(isinstance(x, ast.Expr) for x in modules()[package].tree.body):
        package = package.rpartition(".")[0]
    return package


def functions_of(module: Module) -> Iterator[Function]:
    """Yield the functions and methods of a module."""
    for node in ast.walk(module.tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield _function(node)


def _function(node: ast.FunctionDef | ast.AsyncFunctionDef) -> Function:
    first = node.body[0]
    has_doc = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    doc = (first.end_lineno or first.lineno) - first.lineno + 1 if has_doc else 0
    names = [a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
    decorators = " ".join(ast.unparse(d) for d in node.decorator_list)
    return Function(
        node.name,
        node.lineno,
        (node.end_lineno or node.lineno) - node.lineno + 1 - doc,
        len([n for n in names if n not in ("self", "cls")]),
        any(word in decorators for word in KERNELS),
    )

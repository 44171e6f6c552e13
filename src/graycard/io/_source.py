# SPDX-License-Identifier: Apache-2.0
"""Read one Python file for what it does: its code without comments and docstrings, and what it imports."""

import ast
import hashlib
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

Chain = tuple[str, ...]
"""The names of ``a.b.c`` after the first: ``("b", "c")``; empty where the name stands alone."""

_DOTTED = re.compile(r"[A-Za-z_]\w*(\.\w+)+(:[\w.]+|\.)?")
_LISTERS = frozenset({"iter_modules", "walk_packages", "spec_from_file_location", "run_path"})
_LOADERS = _LISTERS | {"import_module", "__import__", "run_module"}
_DATA = frozenset({"__file__", "resources", "get_data"})


@dataclass(frozen=True, slots=True)
class Import:
    """One name that an import statement binds."""

    bound: str
    module: str
    """Absolute, also where the statement is relative."""
    attribute: str = ""
    """Name in the module, ``*`` for all; empty where the module itself is bound."""


@dataclass(frozen=True, slots=True)
class Part:
    """A run of statements: its code, and what the code refers to."""

    digest: str
    """SHA-256 of the syntax tree without comments, docstrings and layout; empty without any statement."""
    imports: tuple[Import, ...] = ()
    """Also those inside of functions and of ``if TYPE_CHECKING``, for annotations of fields are data."""
    uses: Mapping[str, frozenset[Chain]] = field(default_factory=dict)
    """Chains of attributes by the name that they begin with."""
    mentions: frozenset[str] = frozenset()
    """Strings that may name a module, as in a table of plug-ins."""
    loads: bool = False
    """True if it imports modules whose names are not written in it."""
    reads: bool = False
    """True if it looks for files beside it."""


@dataclass(frozen=True, slots=True)
class Source:
    """Facts about one file."""

    whole: Part
    own: Part
    """Source of a door, without its docstring and the imports of its top level: empty where it only
    re-exports. Of any other module, the whole."""
    bound: Mapping[str, tuple[Import, ...]]
    """Imports by the name that they bind."""


def read_source(path: Path, module: str) -> Source:
    """Return what a file says; it is read again only when its time or its size has changed.

    Args:
        path: A Python file, or any other, of which only the bytes count.
        module: Its dotted name, against which relative imports are resolved.

    Raises:
        OSError: It cannot be read.
    """
    now = path.stat()
    return _read(path, module, now.st_mtime_ns, now.st_size)


@lru_cache(maxsize=4096)
def _read(path: Path, module: str, _time: int, _size: int) -> Source:
    data = path.read_bytes()
    try:
        return _source(ast.parse(data).body, path, module) if path.suffix == ".py" else _opaque(data)
    except (SyntaxError, ValueError, RecursionError):
        return _opaque(data)  # fails when it is imported, which is no business of a hash


def _opaque(data: bytes) -> Source:
    part = Part(hashlib.sha256(data).hexdigest())
    return Source(part, part, {})


def _source(body: list[ast.stmt], path: Path, module: str) -> Source:
    is_door = path.name == "__init__.py"
    package = module if is_door else module.rpartition(".")[0]
    whole = _part(body, package)
    bound: dict[str, tuple[Import, ...]] = defaultdict(tuple)
    for found in whole.imports:
        bound[found.bound] += (found,)
    own = [node for node in body if not isinstance(node, ast.Import | ast.ImportFrom)]
    return Source(whole, _part(own, package) if is_door else whole, dict(bound))


def _part(body: Iterable[ast.stmt], package: str) -> Part:
    reader = _Reader(package)
    reader.read_all(body)
    code = "\0".join(reader.code)
    uses = {name: frozenset(chains) for name, chains in reader.uses.items()}
    names = {name for first, chains in uses.items() for chain in chains for name in (first, *chain)}
    return Part(
        hashlib.sha256(code.encode(errors="surrogatepass")).hexdigest() if code else "",
        tuple(reader.imports),
        uses,
        frozenset(reader.mentions),
        reader.loaders > 0,
        not _DATA.isdisjoint(names),
    )


def _imports(node: ast.Import | ast.ImportFrom, package: str) -> list[Import]:
    if isinstance(node, ast.Import):
        return [Import(name.asname or name.name, name.name) for name in node.names]
    parents = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
    module = ".".join([*parents, *([node.module] if node.module else [])])
    return [Import(name.asname or name.name, module, name.name) for name in node.names]


def _absolute(module: str, package: str) -> str:
    """Return the full name of a module that is named as to ``importlib.import_module``."""
    inner = module.lstrip(".")
    above = len(module) - len(inner)
    parents = package.split(".")[: len(package.split(".")) - above + 1] if above else []
    return ".".join([*parents, inner])


def _is_text(node: ast.AST) -> bool:
    """Tell a docstring: a string that stands alone, wherever it does, has no effect."""
    return (
        isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and type(node.value.value) is str
    )


class _Reader:
    """One walk through a syntax tree that writes it down and collects what it refers to."""

    def __init__(self, package: str) -> None:
        self.package = package
        self.code: list[str] = []
        self.imports: list[Import] = []
        self.uses: dict[str, set[Chain]] = defaultdict(set)
        self.mentions: set[str] = set()
        self.loaders = 0
        """Uses of a loader of modules, less those with the name of the module written there."""

    def read_all(self, nodes: Iterable[ast.AST]) -> None:
        """Read nodes one after another, docstrings left out."""
        for node in nodes:
            if not _is_text(node):
                self.read(node)

    def read(self, node: ast.AST) -> None:
        """Write a node down, and all below it."""
        match node:
            case ast.Attribute() | ast.Name():
                return self._read_chain(node)
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
                self.uses[node.name].add(())
            case ast.Constant(value=str(text)) if _DOTTED.fullmatch(text):
                self.mentions.add(text)
            case ast.Import() | ast.ImportFrom():
                found = _imports(node, self.package)
                self.imports += found
                self.loaders += any(x.attribute in _LOADERS and x.bound not in _LOADERS for x in found)
            case ast.Call(
                func=ast.Name(id=name) | ast.Attribute(attr=name), args=[ast.Constant(value=str(text)), *_]
            ) if name in _LOADERS - _LISTERS:
                self.loaders -= 1
                self.imports.append(Import("", _absolute(text, self.package)))
        self.code.append(type(node).__name__)
        for name in node._fields:
            self._read_field(name, getattr(node, name, None))
        self.code.append(")")

    def _read_field(self, name: str, value: object) -> None:
        """Write a field down; what is empty differs between versions of Python and is left out."""
        if value is None or value == [] or name == "kind":
            return
        self.code.append(name)
        if isinstance(value, ast.AST):
            self.read(value)
        elif isinstance(value, list):
            for item in value:
                self.read_all([item]) if isinstance(item, ast.AST) else self.code.append(repr(item))
            self.code.append("]")
        else:
            self.code.append(repr(value))

    def _read_chain(self, node: ast.AST) -> None:
        """Write ``a.b.c`` down as one."""
        names: list[str] = []
        while isinstance(node, ast.Attribute):
            names.insert(0, node.attr)
            node = node.value
        self.code.append("." + ".".join(names))
        self.loaders += not _LOADERS.isdisjoint(names)
        if isinstance(node, ast.Name):
            self.code.append(node.id)
            self.uses[node.id].add(tuple(names))
            self.loaders += node.id in _LOADERS
        else:
            self.read(node)

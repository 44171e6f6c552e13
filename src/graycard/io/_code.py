# SPDX-License-Identifier: Apache-2.0
"""Hash the code that a piece of work can reach, so that only a change of that code makes it be done again.

Reached is a module that is imported, anywhere in a module that is reached. An import through a door, an
``__init__`` that re-exports, leads to the module that defines the name, not to all that the door imports. So
the hash rests on a rule of the house: importing a module does nothing but define names.

Whatever cannot be resolved is taken whole: a door that is handed on as an object, a package whose modules are
listed or loaded by names made at run time, a string that names a module, the files beside a module that looks
for its own place. Other distributions are not read: their versions stand in the run record.
"""

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec
from pathlib import Path

from graycard.io._files import sha256
from graycard.io._source import Chain, Import, Part, Source, read_source

OURS = "graycard"
HOME = Path(__file__).parents[1]
ALL = "*"
"""Stands for every module of a package, in a root such as ``graycard.eval.metrics.*``."""


def code_hash(roots: Iterable[str], folders: Mapping[str, Path] | None = None) -> str:
    """Return SHA-256 over the code that is reached from some roots: equal code, equal hash.

    Comments, docstrings and layout do not count, nor does where the code lies.

    Args:
        roots: ``module``, ``module:attribute``, or ``package.*`` for all modules of a package.
        folders: Folder or file of each top-level package that is followed besides graycard as installed.

    Raises:
        ValueError: A root is no module of these packages.
    """
    return hashlib.sha256(repr(sorted(reached_code(roots, folders).items())).encode()).hexdigest()


def reached_code(roots: Iterable[str], folders: Mapping[str, Path] | None = None) -> dict[str, str]:
    """Return SHA-256 of each module, data file and resolved re-export that is reached from some roots.

    Args:
        roots: As in :func:`code_hash`.
        folders: As in :func:`code_hash`.

    Raises:
        ValueError: A root is no module of these packages.
    """
    closure = _Closure({OURS: HOME} | dict(folders or {}))
    for root in roots:
        module, _, attribute = root.removesuffix(f".{ALL}").partition(":")
        if closure.find(module) is None:
            raise ValueError(f"expected a root that is a module, got {root!r}. Mend its name")
        closure.follow(module, (ALL,) if root.endswith(f".{ALL}") else _chain(attribute))
    return closure.digests


class _Closure:
    """Everything that is reached so far."""

    def __init__(self, folders: Mapping[str, Path]) -> None:
        self.digests: dict[str, str] = {}
        self._folders = folders
        self._places: dict[str, Path | None] = {}
        self._done: set[tuple[str, Chain]] = set()
        self._taken: set[str] = set()

    def follow(self, module: str, chain: Chain) -> None:
        """Take what ``module.a.b`` stands for, with chain ``("a", "b")``; nothing for other packages."""
        place = self.find(module)
        if place is None or (module, chain) in self._done:
            return
        self._done.add((module, chain))
        self._enter(module)
        if not _is_door(place):
            self._take(module)
            self._pass(module, chain)
        elif not self._pass(module, chain) and not self._source(module).own.uses.keys() & set(chain[:1]):
            self._take(module)
            if chain[:1] in ((ALL,), ("__path__",)):
                self._take_all(module)

    def find(self, module: str) -> Path | None:
        """Return the file of a module, or its folder if it has no door; None for what is not followed."""
        if module not in self._places:
            self._places[module] = self._found(module)
        return self._places[module]

    def _found(self, module: str) -> Path | None:
        parent, _, name = module.rpartition(".")
        if not parent:
            place = self._folders.get(module)
            return place if place is None or place.is_file() else _file_of(place)
        above = self.find(parent)
        if above is None or not _is_door(above):
            return None
        found = _file_of(_folder_of(above) / name)
        return _installed(module) if found is None and parent == OURS and _folder_of(above) == HOME else found

    def _source(self, module: str) -> Source:
        place = self.find(module)
        assert place is not None, "only modules that were found are read"
        return _NOTHING if place.is_dir() else read_source(place, module)

    def _enter(self, module: str) -> None:
        """Count the code of the doors on the way, for it runs; what they re-export does not count."""
        names = module.split(".")
        for count in range(1, len(names) + 1):
            door = ".".join(names[:count])
            place = self.find(door)
            if place is None or not _is_door(place) or door in self.digests:
                continue
            source = self._source(door)
            self.digests[door] = source.own.digest
            self._take_part(door, source.own)
            for name in source.bound.keys() & source.own.uses.keys():
                for found in source.bound[name]:
                    self._import(found, source.own)
            self._take_effects(source, ours=names[0] == OURS)

    def _take_effects(self, source: Source, *, ours: bool) -> None:
        """Take what a door imports for more than a name: ``*``, and modules that may do something."""
        for found in (one for several in source.bound.values() for one in several):
            if found.attribute == ALL or not (ours or found.attribute):
                self.follow(found.module, ())

    def _take(self, module: str) -> None:
        """Count a module whole, and all that it imports."""
        if module in self._taken:
            return
        self._taken.add(module)
        whole = self._source(module).whole
        self.digests[module] = whole.digest
        self._take_part(module, whole)

    def _take_part(self, module: str, part: Part) -> None:
        for found in part.imports:
            self._import(found, part)
        for text in part.mentions:
            self._mention(text)
        if part.loads:
            place = self.find(module)
            self._take_all(module if place is not None and _is_door(place) else module.rpartition(".")[0])
        if part.reads:
            self._take_data(module)

    def _import(self, found: Import, part: Part) -> None:
        """Follow an import to what is used of it; to all of it where that cannot be told."""
        if found.attribute == ALL:
            return self.follow(found.module, ())
        chains = part.uses.get(found.bound.partition(".")[0]) or frozenset({()})
        module, head = found.module, (found.attribute,) if found.attribute else ()
        if not found.attribute and found.bound == found.module:  # `import a.b` binds a
            module, *rest = found.module.split(".")
            if not any(chain[: len(rest)] == tuple(rest) for chain in chains):
                self.follow(found.module, ())
        for chain in chains:
            self.follow(module, (*head, *chain))
        return None

    def _pass(self, module: str, chain: Chain) -> bool:
        """Follow a name on to where a module has it from; tell whether it is from elsewhere."""
        if not chain:
            return False
        inner, bound = f"{module}.{chain[0]}", self._source(module).bound.get(chain[0], ())
        for found in bound:
            self.digests[f"{module}:{chain[0]}"] = f"{found.module}:{found.attribute}"
            self.follow(found.module, (*((found.attribute,) if found.attribute else ()), *chain[1:]))
        place = self.find(module)
        if place is None or not _is_door(place) or self.find(inner) is None:
            return bool(bound)
        self.follow(inner, chain[1:])
        return True

    def _mention(self, text: str) -> None:
        """Follow a string that names a module, or begins the name of one."""
        module, _, attribute = text.partition(":")
        if text.endswith("."):
            return self.follow(text[:-1], (ALL,))
        names = module.split(".")
        for count in range(len(names), 1, -1):
            known = ".".join(names[:count])
            if self.find(known) is not None:
                return self.follow(known, (*names[count:], *_chain(attribute)))
        return None

    def _take_all(self, package: str) -> None:
        """Take every module of a package and of those below it."""
        place = self.find(package)
        if place is None or not _is_door(place):
            return
        folder = _folder_of(place)
        for path in sorted(folder.rglob("*.py")):
            names = path.relative_to(folder).with_suffix("").parts
            names = names[:-1] if names[-1] == "__init__" else names
            self.follow(".".join((package, *names)), ())

    def _take_data(self, module: str) -> None:
        """Count the files beside a module of a package that looks for its own place."""
        place = self.find(module)
        package = module if place is not None and _is_door(place) else module.rpartition(".")[0]
        if place is not None and place.is_file() and package:
            for path in _data(place.parent):
                self.digests[f"{package}/{path.relative_to(place.parent).as_posix()}"] = sha256(path)


_NOTHING = Source(Part(""), Part(""), {})


def _data(folder: Path) -> Iterator[Path]:
    """Yield all files below a folder but code, compiled code and what is hidden."""
    for path in sorted(folder.rglob("*")):
        hidden = any(name.startswith(".") for name in path.relative_to(folder).parts)
        if path.is_file() and not hidden and path.suffix not in (".py", ".pyc"):
            yield path


def _chain(attribute: str) -> Chain:
    return tuple(attribute.split(".")) if attribute else ()


def _is_door(place: Path) -> bool:
    return place.name == "__init__.py" or place.is_dir()


def _folder_of(place: Path) -> Path:
    return place if place.is_dir() else place.parent


def _file_of(place: Path) -> Path | None:
    """Return the file of a module that may be a package; the folder where that has no door."""
    modules = (place.with_name(f"{place.name}{suffix}") for suffix in (".py", *EXTENSION_SUFFIXES))
    files = (path for path in (place / "__init__.py", *modules) if path.is_file())
    return next(files, place if place.is_dir() else None)


def _installed(module: str) -> Path | None:
    """Return where a package of ours lies in an installation that has no link to it."""
    spec = find_spec(module)
    return Path(spec.origin) if spec is not None and spec.origin is not None else None

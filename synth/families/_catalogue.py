# SPDX-License-Identifier: Apache-2.0
"""The table of scene families, and what a spec says in words."""

import ast
import dataclasses
import hashlib
import inspect
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from graycard import UnknownNameError
from graycard.io import dumps, from_builtins, to_builtins
from graycard.records import knob_text
from graycard.synth._spec import SceneSpec, SecretSpec
from graycard.synth.families._cluttered_lab import ClutteredLab
from graycard.synth.families._corridor import Corridor
from graycard.synth.families._family import Family
from graycard.synth.families._gallery import Gallery
from graycard.synth.families._objects import Objects
from graycard.synth.families._shelf_room import ShelfRoom
from graycard.synth.families._studio import Studio
from graycard.synth.families._tables import CurvedTable, GlossyTable, MarbleTable, MatteTable, MetalTable

_FAMILIES: tuple[type[Family], ...] = (
    Corridor,
    ShelfRoom,
    ClutteredLab,
    GlossyTable,
    MetalTable,
    MarbleTable,
    CurvedTable,
    MatteTable,
    Studio,
    Gallery,
    Objects,
)


def all_families() -> dict[str, type[Family]]:
    """All scene families by name, in the order of the documentation."""
    return {family.name: family for family in _FAMILIES}


def family_of(spec: SceneSpec) -> Family:
    """Return the family of a spec with its knobs set.

    Raises:
        UnknownNameError: There is no such family, or it is of another track.
        RecordError: A knob is unknown, of another type, or out of its range.
    """
    known = {f"{f.track}/{f.name}": f for f in _FAMILIES}
    name = f"{spec.track}/{spec.family}"
    if name not in known:
        raise UnknownNameError("scene family", name, known)
    return from_builtins(known[name], dict(spec.knobs), source=f"the knobs of {name}")


@dataclass(frozen=True, slots=True)
class Knob:
    """One knob of a family."""

    name: str
    default: float | int | str
    allowed: str
    """Its range with its unit, or its words."""
    meaning: str


def knobs(family: type[Family]) -> list[Knob]:
    """Return the knobs of a family, in the order in which they are defined."""
    meanings = _attribute_docstrings(family)
    fields: tuple[Any, ...] = dataclasses.fields(family)  # pyright: ignore[reportArgumentType] -- they are
    return [Knob(f.name, f.default, _allowed(f.name, f.metadata), meanings.get(f.name, "")) for f in fields]


def _allowed(name: str, metadata: Mapping[str, Any]) -> str:
    if "words" in metadata:
        return ", ".join(metadata["words"])
    low, high = metadata["range"]
    return knob_text(name, f"{low:g} to {high:g}")


def _attribute_docstrings(cls: type) -> dict[str, str]:
    """Return the strings below the annotated attributes of a class and of its bases, by attribute."""
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__[:-1]):
        body = ast.parse(textwrap.dedent(inspect.getsource(base))).body[0].body  # pyright: ignore
        for attribute, after in pairwise(body):
            match attribute, after:
                case (
                    ast.AnnAssign(target=ast.Name(id=name)),
                    ast.Expr(value=ast.Constant(value=str(text))),
                ):
                    found[name] = " ".join(text.split())
    return found


def resolved_knobs(spec: SceneSpec) -> dict[str, Any]:
    """Every knob of a spec with its value, the defaults included.

    Raises:
        UnknownNameError: There is no such family, or it is of another track.
        RecordError: A knob is unknown, of another type, or out of its range.
    """
    return to_builtins(family_of(spec))


def default_knobs(spec: SceneSpec) -> dict[str, Any]:
    """Return every knob of a spec's family with its default.

    Raises:
        UnknownNameError: There is no such family, or it is of another track.
        RecordError: A knob of the spec is unknown, of another type, or out of its range.
    """
    return to_builtins(type(family_of(spec))())


def scene_name(spec: SceneSpec) -> str:
    """Name of the scene's folder: family and seed, and a digest of the knobs that were changed, if any.

    For example ``corridor-0000`` and ``corridor-0000-1f4c2a``: a method sees the name, and must not
    learn the knobs from it. A secret scene has a name of its own.

    Raises:
        UnknownNameError: There is no such family, or it is of another track.
        RecordError: A knob is unknown, of another type, or out of its range.
    """
    knobs, defaults = resolved_knobs(spec), default_knobs(spec)
    changed = {name: value for name, value in knobs.items() if value != defaults[name]}
    digest = hashlib.sha256(dumps(changed).encode()).hexdigest()[:6]
    if isinstance(spec, SecretSpec):
        return spec.name
    return f"{spec.family}-{spec.seed:04d}" + (f"-{digest}" if changed else "")


def describe(spec: SceneSpec) -> str:
    """One line that says what is to be seen, for reports.

    Raises:
        UnknownNameError: There is no such family, or it is of another track.
        RecordError: A knob is unknown, of another type, or out of its range.
    """
    title = family_of(spec).title
    changed = ", ".join(
        f"{name.replace('_', ' ')} {value if isinstance(value, str) else knob_text(name, format(value, 'g'))}"
        for name, value in sorted(spec.knobs.items())
    )
    tail = f"; {changed}" if changed else ""
    seed = "secret seed" if isinstance(spec, SecretSpec) else f"seed {spec.seed}"
    return f"{title[0].upper()}{title[1:]} ({seed}{tail})"

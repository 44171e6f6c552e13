# SPDX-License-Identifier: Apache-2.0
"""Find methods: our own, installed by others, or named outright as ``module:attribute``.

Our own stand in a literal table, since an entry point of an editable install is invisible until the
install is run again. Others offer theirs as entry points of the group ``graycard.methods``. Nothing is
imported to list names, and a plug-in that fails to import hurts nobody but itself.
"""

import inspect
import os
import sys
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from graycard import (
    MethodError,
    MissingPackageError,
    UnknownNameError,
    __version__,
    find_layer,
    missing_package,
)
from graycard.io import code_hash, from_builtins, to_builtins
from graycard.methods._contract import COMPOSITION, LIGHTS, RELIGHTING, Ask, Method

GROUP = "graycard.methods"

BUILT_IN = {
    "truth": "graycard.methods._truth:TruthMethod",
    "gray": "graycard.methods._gray:GrayMethod",
    "input": "graycard.methods._input:InputMethod",
    "retinex": "graycard.methods._retinex:RetinexMethod",
    "2dgs": "graycard.methods.surfels:SurfelMethod",
    "2dgs-oracle": "graycard.methods.surfels:OracleSurfelMethod",
    "appearance": "graycard.methods.appearance:AppearanceMethod",
    "darkgs": "graycard.methods.darkgs:DarkGsMethod",
    "sunfaded": "graycard.methods.sunfaded:SunFadedMethod",
    "sunfaded-oracle": "graycard.methods.sunfaded:OracleSunFadedMethod",
    "gsid": "graycard.methods.gsid:GsidMethod",
    "gsir": "graycard.methods.gsid:GsirMethod",
    "r3dg": "graycard.methods.r3dg:R3dgMethod",
    "do-nothing": "graycard.methods.removal:KeepMethod",
    "removal": "graycard.methods.removal:RemovalMethod",
    "removal-per-view": "graycard.methods.removal:PerViewMethod",
    "removal-one-reference": "graycard.methods.removal:OneReferenceMethod",
    "grouping": "graycard.methods.removal:GroupingMethod",
    "goris": "graycard.methods.goris:GorisMethod",
}

RESERVED = ("seed", "out", "save", "priors", "donor")
"""Options of ``graycard fit`` itself; a setting of such a name could not be reached."""

_AROUND = ("graycard:open_capture", "graycard.methods:write_predictions")
"""Code of ours through which a method is given its capture and its predictions become files."""
_ANSWERING = ("graycard:open_truth", "graycard.methods.priors:make_priors")
_INSTALLED = ("site-packages", "dist-packages")
"""Folders in which neighbours have nothing to do with each other."""

_MEMBERS = ("summary", "needs", "settings_type", "fit", "load")


@dataclass(frozen=True, slots=True)
class Listing:
    """A row of ``graycard methods``."""

    name: str
    origin: str
    """Distribution and version that offers it."""
    summary: str | None
    """None if it could not be loaded."""
    reason: str = ""
    """Why it could not be loaded."""
    mend: str = ""
    """The command that installs what it needs, where a package is missing."""


def offers() -> dict[str, list[EntryPoint]]:
    """Every offer of a method by name; nothing is imported."""
    found: dict[str, list[EntryPoint]] = defaultdict(list)
    for name, target in BUILT_IN.items():
        found[name].append(EntryPoint(name, target, GROUP))
    for point in _offered(tuple(sys.path)):
        found[point.name].append(point)
    return dict(sorted(found.items()))


@cache
def _offered(places: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """Return what others offer in some places; a look at all that is installed takes tens of milliseconds."""
    return tuple(entry_points(group=GROUP))


def load_method(name: str) -> Method:
    """Return the method of a registered name or of ``module:attribute``.

    A module that is named outright is also looked for in the working directory.

    Raises:
        UnknownNameError: No method has this name.
        MethodError: It fails to import, is offered twice, or does not follow the contract.
        MissingPackageError: It needs a package of graycard's that is not installed.
    """
    point = _find(name)
    try:
        found = point.load()
        method = found() if inspect.isclass(found) else found
    except (Exception, SystemExit) as cause:  # a plug-in may raise anything at all
        if missing := missing_package(cause):
            raise missing from None
        raise MethodError(
            f"method {name!r} ({point.value}, {origin(point)}) cannot be imported: {type(cause).__name__}: "
            f"{cause}. Mend it; other methods are not affected"
        ) from cause
    return _checked(name, method)


def listings() -> list[Listing]:
    """Every method that is offered; what fails to load says why."""
    return [_listing(name, points) for name, points in offers().items()]


def settings_of(method: Method, changes: Mapping[str, Any]) -> Any:
    """Return the method's settings with some changed.

    Raises:
        UnknownNameError: A name is no setting.
        MethodError: A value is of the wrong type or out of range.
    """
    known = [f.name for f in fields(method.settings_type)]
    unknown = sorted(set(changes) - set(known))
    if unknown:
        raise UnknownNameError("setting", unknown[0], known)
    return from_builtins(
        method.settings_type, {**to_builtins(method.settings_type()), **changes}, MethodError, "settings"
    )


def fingerprint(name: str, *, with_priors: bool = False) -> str:
    """Return what a method's predictions depend on besides its job: its version and the hash of its code.

    The code is all that the module of the method can reach in graycard, and for a method of others in their
    own package, or in the modules beside it that it imports (see :func:`graycard.io.code_hash`); further that
    which opens captures and writes predictions. After an edit of it, all that the method made is made anew.

    Args:
        name: A registered name or ``module:attribute``.
        with_priors: Whether the method is handed priors or truth: then the code counts that makes them.

    Raises:
        UnknownNameError: No method has this name.
        MethodError: It is offered twice, or imports what no fit may read.
    """
    point = _find(name)
    spec = find_spec(point.module)
    if spec is None or spec.origin is None or not Path(spec.origin).is_file():
        return origin(point)
    roots = (f"{point.module}:{point.attr}", *_AROUND, *(_ANSWERING if with_priors else ()))
    try:
        code = code_hash(roots, _folders_of(point.module.partition(".")[0]))
    except PermissionError as cause:
        raise MethodError(
            f"method {name!r} imports {cause.filename}, which no fit may read. Import that in a module "
            "that the method does not import"
        ) from None
    return f"{origin(point)} {code}"


def _folders_of(top: str) -> dict[str, Path]:
    """Return where the top-level package of a method lies, and those beside it that it may import."""
    spec = find_spec(top)
    if top == "graycard" or spec is None:
        return {}
    packages = list(spec.submodule_search_locations or ())
    place = Path(packages[0] if packages else spec.origin or "")
    beside = () if place.parent.name in _INSTALLED else place.parent.iterdir()
    code = {path.stem: path for path in beside if path.is_dir() or path.suffix == ".py"}
    return {name: path for name, path in code.items() if name != "graycard"} | {top: place}


def origin(point: EntryPoint) -> str:
    """Distribution and version that offers a method."""
    if point.dist is None:
        return f"graycard {__version__}" if point.name in BUILT_IN else "named outright"
    return f"{point.dist.name} {point.dist.version}"


def module_of(name: str) -> str:
    """Return the module of a method; nothing is imported.

    Raises:
        UnknownNameError: No method has this name.
        MethodError: It is offered twice.
    """
    return _find(name).module


def _find(name: str) -> EntryPoint:
    if ":" in name:
        if os.getcwd() not in sys.path:
            sys.path.append(os.getcwd())  # a console script, unlike `python -m`, does not look there
        return EntryPoint(name, name, GROUP)
    match offers().get(name, []):
        case [point]:
            return point
        case []:
            raise UnknownNameError("method", name, offers(), "A method of your own: module:attribute")
        case several:
            listing = ", ".join(f"{p.value} ({origin(p)})" for p in several)
            raise MethodError(
                f"expected one offer of method {name!r}, got {len(several)}: {listing}. "
                "Name the one you mean as module:attribute"
            )


def _checked(name: str, method: Any) -> Method:
    """Return a method that follows the contract; meet what is none before any time is spent on it."""
    missing = [member for member in _MEMBERS if not hasattr(method, member)]
    if missing:
        raise MethodError(f"expected {name!r} to be a method, got {method!r} without {', '.join(missing)}")
    asks = getattr(method, "asks", ())
    faults = [
        ("a summary that is a string", method.summary, isinstance(method.summary, str)),
        ("needs that is a tuple of names", method.needs, _is_tuple_of(str, method.needs)),
        (
            "a settings_type that is a dataclass",
            method.settings_type,
            _is_dataclass_type(method.settings_type),
        ),
        ("asks that is a tuple of Ask", asks, _is_tuple_of(Ask, asks)),
        ("fit and load that can be called", method.fit, callable(method.fit) and callable(method.load)),
    ]
    for expected, got, fine in faults:
        if not fine:
            raise MethodError(f"expected {name!r} to have {expected}, got {got!r}")
    for needed in method.needs:
        if needed not in (LIGHTS, RELIGHTING, COMPOSITION):
            find_layer(needed)
    for setting in fields(method.settings_type):
        if setting.name in RESERVED:
            raise MethodError(
                f"expected settings of {name!r} other than {', '.join(RESERVED)}, got {setting.name}"
            )
        if setting.default is MISSING and setting.default_factory is MISSING:
            raise MethodError(f"expected a default for each setting of {name!r}, got none for {setting.name}")
    return method


def _is_tuple_of(kind: type, value: Any) -> bool:
    return isinstance(value, tuple) and all(isinstance(item, kind) for item in value)


def _is_dataclass_type(value: Any) -> bool:
    return isinstance(value, type) and is_dataclass(value)


def _listing(name: str, points: list[EntryPoint]) -> Listing:
    where = ", ".join(origin(p) for p in points)
    try:
        return Listing(name, where, load_method(name).summary)
    except MissingPackageError as error:
        return Listing(name, where, None, f"needs {error.package}", error.command)
    except (MethodError, UnknownNameError) as error:
        return Listing(name, where, None, str(error))

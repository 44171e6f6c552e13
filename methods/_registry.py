# SPDX-License-Identifier: Apache-2.0
"""Find methods: our own, installed by others, or named outright as ``module:attribute``.

Our own stand in a literal table, since an entry point of an editable install is invisible until the
install is run again. Others offer theirs as entry points of the group ``graycard.methods``. Nothing is
imported to list names, and a plug-in that fails to import hurts nobody but itself.
"""

import hashlib
import importlib
import inspect
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, fields
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from graycard import MethodError, UnknownNameError, __version__, decode, encode
from graycard.methods._contract import Method

GROUP = "graycard.methods"

BUILT_IN = {
    "truth": "graycard.methods._truth:TruthMethod",
    "gray": "graycard.methods._gray:GrayMethod",
    "input": "graycard.methods._input:InputMethod",
    "retinex": "graycard.methods._retinex:RetinexMethod",
}


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


def offers() -> dict[str, list[EntryPoint]]:
    """Every offer of a method by name; nothing is imported."""
    found: dict[str, list[EntryPoint]] = defaultdict(list)
    for name, target in BUILT_IN.items():
        found[name].append(EntryPoint(name, target, GROUP))
    for point in entry_points(group=GROUP):
        found[point.name].append(point)
    return dict(sorted(found.items()))


def load_method(name: str) -> Method:
    """The method of a registered name or of ``module:attribute``.

    Raises:
        UnknownNameError: No method has this name.
        MethodError: It fails to import, is offered twice, or does not follow the contract.
    """
    point = _find(name)
    try:
        found = point.load()
        method = found() if inspect.isclass(found) else found
    except (Exception, SystemExit) as cause:  # a plug-in may raise anything at all
        raise MethodError(
            f"expected method {name!r} ({point.value}, {origin(point)}) to import, got "
            f"{type(cause).__name__}: {cause}. Mend or uninstall it; other methods are not affected"
        ) from cause
    if not isinstance(method, Method):
        missing = [
            verb for verb in ("summary", "needs", "settings_type", "fit", "load") if not hasattr(method, verb)
        ]
        raise MethodError(f"expected {name!r} to be a method, got {method!r} without {', '.join(missing)}")
    return method


def listings() -> list[Listing]:
    """Every method that is offered; what fails to load says why."""
    return [_listing(name, points) for name, points in offers().items()]


def settings_of(method: Method, changes: Mapping[str, Any]) -> Any:
    """The method's settings with some changed.

    Raises:
        MethodError: A name is no setting, or a value is of the wrong type or out of range.
    """
    known = [f.name for f in fields(method.settings_type)]
    unknown = sorted(set(changes) - set(known))
    if unknown:
        raise UnknownNameError("setting", unknown[0], known)
    return decode(
        method.settings_type, {**encode(method.settings_type()), **changes}, MethodError, "settings"
    )


def fingerprint(name: str) -> str:
    """What a method's predictions depend on besides its job: its origin and version.

    A ``module:attribute`` has no version, so the hash of its source stands in.

    Raises:
        UnknownNameError: No method has this name.
        MethodError: It is offered twice, or its module does not import.
    """
    if ":" not in name:
        return origin(_find(name))
    method = load_method(name)
    source = inspect.getsourcefile(type(method))
    return hashlib.sha256(Path(source).read_bytes()).hexdigest() if source else name


def origin(point: EntryPoint) -> str:
    """Distribution and version that offers a method."""
    if point.dist is None:
        return f"graycard {__version__}" if point.name in BUILT_IN else "named outright"
    return f"{point.dist.name} {point.dist.version}"


def _find(name: str) -> EntryPoint:
    if ":" in name:
        importlib.invalidate_caches()
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


def _listing(name: str, points: list[EntryPoint]) -> Listing:
    where = ", ".join(origin(p) for p in points)
    try:
        return Listing(name, where, load_method(name).summary)
    except MethodError as error:
        return Listing(name, where, None, str(error))

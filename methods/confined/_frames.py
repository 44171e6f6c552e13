# SPDX-License-Identifier: Apache-2.0
"""Lines of a method's own code: where they lie, and tracebacks that show them alone."""

import sys
import traceback
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import graycard
from graycard import MethodError, UnknownNameError
from graycard.methods._registry import module_of

_INSTALLED = ("site-packages", "dist-packages")
"""Folders in which neighbours have nothing to do with each other."""
_OURS = str(Path(__file__).parents[1])
"""Folder of graycard's methods."""
_HERE = str(Path(__file__).parent)
_HOUSE = Path(graycard.__file__).parent


def places_of_code(name: str) -> tuple[str, ...]:
    """Return files and folders of a method's code; none where nobody knows. Nothing of it is imported.

    Args:
        name: A registered name or ``module:attribute``.
    """
    try:
        top = module_of(name).partition(".")[0]
        spec = find_spec(top)
    except (MethodError, UnknownNameError, ImportError, ValueError):
        return ()
    if spec is None:
        return (top,)  # no line is one of its own
    if spec.name == "graycard":
        return (_OURS,)
    if spec.submodule_search_locations:
        return tuple(map(str, map(Path, spec.submodule_search_locations)))
    place = Path(spec.origin or "")
    return (str(place if place.parent.name in _INSTALLED else place.parent),)


@cache
def is_own(file: str, own: tuple[str, ...]) -> bool:
    """Tell whether a file of code is one of the method's, libraries in its folder left out."""
    path = Path(file)
    if path.is_relative_to(_HERE):
        return False  # what calls a method is none
    return any(
        path.is_relative_to(place) and not {*_INSTALLED} & {*path.parts[len(Path(place).parts) :]}
        for place in own
    )


def own_trace(error: BaseException, own: tuple[str, ...]) -> str:
    """Return the traceback of an error, cut to the method's own lines; the whole one if there are none."""
    told = traceback.TracebackException.from_exception(error)
    _cut(told, own)
    return "".join(told.format())


def _cut(told: traceback.TracebackException | None, own: tuple[str, ...]) -> None:
    """Leave frames of the method's own files alone, in an error and in what it came from."""
    if told is None:
        return
    kept = [frame for frame in told.stack if is_own(frame.filename, own)]
    found = kept or [frame for frame in told.stack if own and not _is_machinery(frame.filename)]
    if own:
        told.stack = traceback.StackSummary.from_list(found)
    _cut(told.__cause__, own)
    _cut(told.__context__, own)


def _is_machinery(file: str) -> bool:
    """Tell whether a file is one of graycard's, or of what imports modules."""
    return file.startswith("<frozen ") or "importlib" in Path(file).parts or Path(file).is_relative_to(_HOUSE)


def is_called_by(own: tuple[str, ...], depth: int = 1) -> bool:
    """Tell whether a line of the method's own code is what led here."""
    frame = sys._getframe(depth)
    while frame is not None:
        if is_own(frame.f_code.co_filename, own):
            return True
        frame = frame.f_back
    return False

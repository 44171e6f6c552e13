# SPDX-License-Identifier: Apache-2.0
"""Protocols by name."""

from graycard import UnknownNameError
from graycard.eval.protocols._base import Protocol
from graycard.eval.protocols._graycard import GRAYCARD
from graycard.eval.protocols._published import PUBLISHED

ALL = "all"
"""Stands for every protocol."""


def all_protocols() -> tuple[Protocol, ...]:
    """All protocols, graycard's own first."""
    return (GRAYCARD, *PUBLISHED)


def find_protocols(name: str) -> tuple[Protocol, ...]:
    """The protocol of a name or id, as in ``"gs-ir"`` or ``"gs-ir-1"``; every one for ``"all"``.

    Raises:
        UnknownNameError: There is none.

    Example:
        >>> [p.id for p in find_protocols("gs-ir")]
        ['gs-ir-1']
    """
    if name == ALL:
        return all_protocols()
    if found := tuple(p for p in all_protocols() if name in (p.name, p.id)):
        return found
    raise UnknownNameError("protocol", name, [ALL, *(p.name for p in all_protocols())])

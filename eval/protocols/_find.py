# SPDX-License-Identifier: Apache-2.0
"""Protocols by name."""

from collections.abc import Mapping

from graycard import UnknownNameError
from graycard.eval.protocols._base import Protocol
from graycard.eval.protocols._graycard import GRAYCARD
from graycard.eval.protocols.catalogue._published import FORMER, GROUPS_OF_PROTOCOLS, PUBLISHED

ALL = "all"
"""Stands for every protocol."""


def all_protocols() -> tuple[Protocol, ...]:
    """Return all protocols, graycard's own first."""
    return (GRAYCARD, *PUBLISHED)


def find_protocols(name: str) -> tuple[Protocol, ...]:
    """Return the protocols of a name, an id or a group, as in ``"gs-ir"``, ``"gs-ir-2"`` or ``"albedo"``.

    Args:
        name: ``"all"`` stands for every protocol, ``"albedo"`` for graycard's own and every published one
            that ends in an error of base colour. The other groups hold published ones alone:
            ``"appearance"`` and ``"perceptual"`` (SSIM and LPIPS of base colour), ``"views"``,
            ``"relighting"``, ``"geometry"`` and ``"materials"``.

    Raises:
        UnknownNameError: There is none, or none of that version any more.

    Examples:
        >>> [p.id for p in find_protocols("gs-ir")]
        ['gs-ir-2']
    """
    groups = _groups()
    if name in groups:
        return groups[name]
    if found := tuple(p for p in all_protocols() if name in (p.name, p.id)):
        return found
    advice = f"{name} {FORMER[name]}: score by a newer version" if name in FORMER else ""
    raise UnknownNameError("protocol", name, [*groups, *(p.name for p in all_protocols())], advice)


def _groups() -> Mapping[str, tuple[Protocol, ...]]:
    """Return the protocols of each group, by name."""
    albedo = {"albedo": (GRAYCARD, *GROUPS_OF_PROTOCOLS["albedo"])}
    return {ALL: all_protocols(), **GROUPS_OF_PROTOCOLS, **albedo}

# SPDX-License-Identifier: Apache-2.0
"""The import doctor: rows that say what an import did to cameras and pixels, and what looks wrong."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

NAMED = 3
"""Names up to which a row lists them."""


@dataclass(frozen=True, slots=True)
class ImportRow:
    """One thing that an import found or did."""

    what: str
    """A word or two, as ``distortion``."""
    count: int
    """Number of photographs, cameras or points that it is about."""
    said: str
    """A sentence that says what was done to them."""
    warns: bool = False
    """True if it looks wrong."""


def merge_rows(rows: Iterable[ImportRow]) -> tuple[ImportRow, ...]:
    """Return rows in their order, those that say the same of the same added up."""
    found: dict[tuple[str, str, bool], ImportRow] = {}
    for row in rows:
        key = row.what, row.said, row.warns
        found[key] = replace(row, count=found[key].count + row.count) if key in found else row
    return tuple(found.values())


def some(names: Iterable[str]) -> str:
    """Return the first names, and how many more there are."""
    listed = list(names)
    more = len(listed) - NAMED
    return ", ".join(listed[:NAMED]) + (f" and {more} more" if more > 0 else "")


def plural(count: int, one: str) -> str:
    """Return a count with its noun, as ``2 cameras``."""
    return f"{count} {one}{'s' * (count != 1)}"

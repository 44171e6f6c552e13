# SPDX-License-Identifier: Apache-2.0
"""Find the file of each view by the pattern of its layer."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from graycard._capture import View
from graycard._errors import PredictionError
from graycard.io import check_relative_path, inside

_INDEX = re.compile(r"\{index(\+\d+)?(?::0?(\d*)d)?\}")
_BRACES = re.compile(r"\{[^{}]*\}?|\}")
_MOST = 10_000
"""Files of a folder up to which a star is looked for."""


@dataclass(frozen=True, slots=True)
class Place:
    """A view and its numbers, by which other code may name its files."""

    view: View
    number: int
    """Among the views that are adopted, from 0."""
    number_of_split: int
    """Among those of its own split."""
    count: int
    count_of_split: int


def places_of(views: Sequence[View]) -> list[Place]:
    """Number the views, which are in the order that other code has them."""
    counts = {split: sum(v.split == split for v in views) for split in ("train", "test")}
    seen = dict.fromkeys(counts, 0)
    found = []
    for number, view in enumerate(views):
        found.append(Place(view, number, seen[view.split], len(views), counts[view.split]))
        seen[view.split] += 1
    return found


def check_pattern(pattern: str, where: str) -> None:
    """Prove that a pattern is one.

    Raises:
        PredictionError: Braces hold another name, or the path leads out of the folder.
    """
    plain = _INDEX.sub("0", pattern).replace("{view}", "v").replace("{split}", "test")
    if strange := _BRACES.findall(plain):
        raise PredictionError(
            f"expected {{view}}, {{index}}, {{index:05d}}, {{index+1:05d}} or {{split}} in '{where}', got "
            f"{strange[0]}"
        )
    try:
        check_relative_path(plain.replace("*", "x"))
    except ValueError as cause:
        raise PredictionError(f"{cause}, in '{where}'") from cause


def is_stack(pattern: str) -> bool:
    """Tell whether one file holds several views: its name tells none apart."""
    return "{view}" not in pattern and not _INDEX.search(pattern)


def number_in(place: Place, pattern: str) -> tuple[int, int]:
    """Return the number of a view, and of how many, that a pattern counts: of its split where it names it."""
    if "{split}" in pattern:
        return place.number_of_split, place.count_of_split
    return place.number, place.count


def filled(pattern: str, place: Place) -> str:
    """Return a pattern with the names and numbers of a view."""

    def number(match: re.Match[str]) -> str:
        counted = number_in(place, pattern)[0] + int(match[1] or 0)
        return f"{counted:0{int(match[2] or 0)}d}"

    indexed = _INDEX.sub(number, pattern)
    return indexed.replace("{split}", place.view.split).replace("{view}", place.view.name)


def find_file(root: Path, pattern: str, place: Place, star: str = "") -> Path | None:
    """Return the file of a view; None where there is none.

    Args:
        root: Folder of the outputs.
        pattern: Of the layer.
        place: The view.
        star: What stands for ``*``; empty for the one name that fits.

    Raises:
        PredictionError: Several files fit, or the path leads out of the folder.
    """
    name = filled(pattern.replace("*", star) if star else pattern, place)
    if "*" not in name:
        path = inside(root, name, error=PredictionError)
        return path if path.is_file() else None
    found = sorted(set(_matches(root, name)))
    if len(found) > 1:
        raise PredictionError(
            f"expected one file for {name} in {root}, got {', '.join(found[:3])}. Give --star what stands "
            "for *"
        )
    return inside(root, found[0], error=PredictionError) if found else None


def _matches(root: Path, name: str) -> Iterator[str]:
    """Yield paths of files that fit a name with stars, each of which stands within one folder's name."""
    reached = [Path()]
    for part in name.split("/"):
        if "*" not in part:
            reached = [path / part for path in reached]
            continue
        fits = re.compile(".*".join(map(re.escape, part.split("*"))))
        reached = [
            path / entry.name
            for path in reached
            if (root / path).is_dir()
            for entry in sorted((root / path).iterdir())[:_MOST]
            if not entry.name.startswith(".") and fits.fullmatch(entry.name)
        ]
    yield from (path.as_posix() for path in reached if (root / path).is_file())

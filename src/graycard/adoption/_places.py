# SPDX-License-Identifier: Apache-2.0
"""Find the file of each view by the pattern of its layer."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from graycard._capture import View
from graycard._errors import PredictionError
from graycard.io import check_relative_path, inside

_INDEX = re.compile(r"\{index(\+\d+)?(?::(?:0(\d*))?d)?\}")
"""Numbers: plain, or with zeros before them."""
_PADDED = re.compile(r"\{index(\+\d+)?:(\d+)d?\}")
"""Numbers with a width, which Python fills with spaces, or of which it knows no more than the width."""
_BRACES = re.compile(r"\{[^{}]*\}?|\}")
_MOST = 1_000_000
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
    """Return number the views, which are in the order that other code has them."""
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
            f"{strange[0]}{_advice(strange[0])}"
        )
    try:
        check_relative_path(plain.replace("*", "x"))
    except ValueError as cause:
        raise PredictionError(f"{cause}, in '{where}'") from cause


def _advice(strange: str) -> str:
    """Return the number with zeros that a number with a width perhaps means."""
    if padded := _PADDED.fullmatch(strange):
        return f". Write {{index{padded[1] or ''}:0{int(padded[2])}d}} where zeros fill the number"
    return ""


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


def one_beyond(pattern: str, places: Sequence[Place]) -> list[Place]:
    """Return the places after the last, which a pattern that numbers views would name; none for others."""
    if not _INDEX.search(pattern):
        return []
    last = {place.view.split if "{split}" in pattern else "": place for place in places}
    return [replace(p, number=p.count, number_of_split=p.count_of_split) for p in last.values()]


class Files:
    """Files of a folder of outputs; each folder in it is listed once."""

    def __init__(self, root: Path, star: str = "") -> None:
        """Look below a folder.

        Args:
            root: Folder of the outputs.
            star: What stands for ``*``; empty for the one name that fits.
        """
        self.root, self._star = root, star
        self._listed: dict[Path, list[str]] = {}

    def find(self, pattern: str, place: Place) -> Path | None:
        """Return the file of a view; None where there is none.

        Raises:
            PredictionError: Several files fit, there are too many, or the path leads out of the folder.
        """
        name = filled(pattern.replace("*", self._star) if self._star else pattern, place)
        if "*" not in name:
            path = inside(self.root, name, error=PredictionError)
            return path if path.is_file() else None
        found = sorted(set(self._matches(name)))
        if len(found) > 1:
            raise PredictionError(
                f"expected one file for {name} in {self.root}, got {', '.join(found[:3])}. Give --star what "
                "stands for *"
            )
        return inside(self.root, found[0], error=PredictionError) if found else None

    def _matches(self, name: str) -> Iterator[str]:
        """Yield paths of files that fit a name with stars, each of which stands within one folder's name."""
        reached = [Path()]
        for part in name.split("/"):
            if "*" not in part:
                reached = [path / part for path in reached]
                continue
            head, *_, tail = part.split("*")
            fits = re.compile(".*".join(map(re.escape, part.split("*"))))
            reached = [
                path / entry
                for path in reached
                for entry in self._names(path)
                if entry.startswith(head) and entry.endswith(tail) and fits.fullmatch(entry)
            ]
        yield from (path.as_posix() for path in reached if (self.root / path).is_file())

    def _names(self, folder: Path) -> list[str]:
        """Return the names in a folder, those of hidden files left out; none where it is no folder."""
        if folder not in self._listed:
            there = self.root / folder
            every = there.iterdir() if there.is_dir() else iter(())
            names = [entry.name for entry in islice(every, _MOST + 1)]
            if len(names) > _MOST:
                raise PredictionError(
                    f"expected up to {_MOST} files in {there}, got more. Name them without *, or by --star"
                )
            self._listed[folder] = sorted(name for name in names if not name.startswith("."))
        return self._listed[folder]

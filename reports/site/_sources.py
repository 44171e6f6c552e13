# SPDX-License-Identifier: Apache-2.0
"""The published folders that a site is made of, and the histories above them."""

import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from graycard import RecordError
from graycard.io import check_name, from_builtins, read_bytes, read_json
from graycard.records import (
    CLAIMS,
    HISTORY,
    PUBLISHED_PAGE,
    RUN_FILE,
    SUITE_FILE,
    Ledger,
    VerdictHistory,
    is_published_run,
    read_ledger,
)
from graycard.reports.history._keep import read_kept
from graycard.reports.history._reasons import Reasons
from graycard.reports.site._anchors import Anchors

SITE = "ledger.json"
"""A site for programs, and the list of its files."""
_SIGNS = (PUBLISHED_PAGE, RUN_FILE, CLAIMS, SUITE_FILE)
"""Files of a published run: a folder with one of them that is no such run may be a damaged one."""
TABLES_FILE = "tables.json"
"""Ledger of papers' tables held against themselves, beside a history."""
_ANCHOR = re.compile(rb'\b(?:id="|href="#)(claim-[^"]+)"')
"""Place of a claim in a report, or a link to one that is drawn when it is asked for."""


@dataclass(frozen=True, slots=True)
class Published:
    """One published folder."""

    name: str
    anchor: str
    """Name of its place in a page."""
    folder: Path
    ledger: Ledger | None
    anchors: frozenset[str]
    """Claims that its report can be opened at, by the part of the address behind ``#``."""

    @property
    def report(self) -> Path:
        """Return the full report."""
        return self.folder / PUBLISHED_PAGE


@dataclass(frozen=True, slots=True)
class Kept:
    """A history with the words of people."""

    folder: Path
    history: VerdictHistory
    reasons: Reasons


def published_runs(places: Sequence[Path]) -> tuple[Published, ...]:
    """Return the published runs at some places, each a published folder or one that holds such.

    A run that is named twice is there once. What lies beside runs is left out: see :func:`beside_runs`.

    Raises:
        RecordError: A place holds none, two have one name, or a ledger is damaged.
    """
    beside = {place.resolve() for place in beside_runs(places)}
    found = [
        folder
        for place in places
        if Path(place).resolve() not in beside
        for folder in _folders_at(Path(place))
    ]
    folders = list({folder.resolve(): folder for folder in found}.values())
    names = [folder.resolve().name for folder in folders]
    if not folders:
        raise RecordError("expected published runs, got none. Make one: `graycard publish`")
    if twice := sorted(str(folder) for folder in folders if names.count(folder.resolve().name) > 1):
        raise RecordError(
            f"expected published runs of different names, got {', '.join(twice)}. Rename a folder"
        )
    anchors = Anchors()
    return tuple(_published(folder, anchors) for folder in folders)


def beside_runs(places: Iterable[Path]) -> tuple[Path, ...]:
    """Return what lies beside published runs and is none.

    Of places these are all that do, as ``published/*`` of a shell gives them. Of a folder that holds runs
    these are the folders that may be damaged ones.
    """
    found = [own for place in places for own in _beside(Path(place))]
    return tuple({own.resolve(): own for own in found}.values())


def histories(runs: Iterable[Published]) -> tuple[Kept, ...]:
    """Return the histories above published runs, each once.

    Raises:
        RecordError: One is damaged.
    """
    above = dict.fromkeys(run.folder.resolve().parent for run in runs)
    return tuple(Kept(folder, *read_kept(folder)) for folder in above if (folder / HISTORY).is_file())


def tables_of(kept: Iterable[Kept]) -> tuple[Ledger, ...]:
    """Return the ledgers of papers' own tables beside histories.

    Raises:
        RecordError: One is damaged.
    """
    paths = (one.folder / TABLES_FILE for one in kept)
    return tuple(
        from_builtins(Ledger, read_json(path), RecordError, str(path)) for path in paths if path.is_file()
    )


def _folders_at(place: Path) -> list[Path]:
    if is_published_run(place):
        return [place]
    if found := _runs_in(place):
        return found
    raise RecordError(
        f"expected a published run, or a folder of such, at {place}, got none. Make one: `graycard publish`"
    )


def _beside(place: Path) -> list[Path]:
    if is_published_run(place):
        return []
    if _runs_in(place):
        return [folder for folder in _folders_in(place) if _may_be_damaged(folder)]
    return [place] if place.exists() and _runs_in(Path(os.path.abspath(place)).parent) else []


def _may_be_damaged(folder: Path) -> bool:
    """Tell if a folder has a file of a published run and is none; an earlier site is no such folder."""
    if is_published_run(folder):
        return False
    signs = [name for name in _SIGNS if (folder / name).is_file()]
    return bool(signs) and not (signs == [PUBLISHED_PAGE] and (folder / SITE).is_file())


def _runs_in(place: Path) -> list[Path]:
    return [folder for folder in _folders_in(place) if is_published_run(folder)]


def _folders_in(place: Path) -> list[Path]:
    return sorted(path for path in place.iterdir() if path.is_dir()) if place.is_dir() else []


def _published(folder: Path, taken: Anchors) -> Published:
    name = folder.resolve().name
    try:
        check_name(name)
    except ValueError as fault:
        raise RecordError(f"{fault}. Rename the folder {folder}") from fault
    anchors = frozenset(found.decode() for found in _ANCHOR.findall(read_bytes(folder / PUBLISHED_PAGE)))
    return Published(name, taken.take(name), folder, read_ledger(folder), anchors)

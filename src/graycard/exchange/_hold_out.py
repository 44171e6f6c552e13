# SPDX-License-Identifier: Apache-2.0
"""Choose held-out photographs: by the layout's own lists, by a count, or by names."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path, PurePath
from typing import Any

from graycard._errors import DatasetError, UnknownNameError
from graycard.exchange._cameras import PosedPhotograph
from graycard.exchange._doctor import ImportRow, some
from graycard.io import read_bytes

USUAL = 8
"""Each how many-th photograph the field holds out, from the first: LLFF, mip-NeRF 360, 3DGS."""


def hold_out(
    shots: Sequence[PosedPhotograph], wanted: str | None
) -> tuple[list[PosedPhotograph], ImportRow, dict[str, Any]]:
    """Return shots with some of them held out, a row about it, and how it is recorded.

    Args:
        shots: Sorted by name; layouts with lists have marked theirs.
        wanted: A count N for indices 0, N, 2N, … (0 for none), a text file with a name a line, or names
            with commas between them; None for the lists of the layout, else each eighth.

    Raises:
        UnknownNameError: A name is that of no photograph.
        DatasetError: The count is 1 or negative, the file cannot be read, or nothing is left to train on.
    """
    listed = any(shot.held_out for shot in shots)
    if wanted is None and listed:
        split, said, record = list(shots), "as the folder lists them", {"split": "as listed"}
    elif wanted is None or _is_count(wanted):
        every = USUAL if wanted is None else _count(wanted)
        split, said = _each(shots, every), f"{_each_of(every)} by name, from the first"
        said = said if every else "none, as asked"
        record = {"hold_out_every": every}
    else:
        names = _names(wanted)
        split, said, record = _named(shots, names), "as --hold-out names them", {"split": "as chosen"}
    if wanted is not None and listed:
        said += "; lists of the folder are passed over"
    out = [shot.name for shot in split if shot.held_out]
    if len(out) == len(split):
        raise DatasetError(f"expected a photograph that is not held out, got {len(split)} that are")
    shown = f"{said}: {some(out)}" if out else said
    return split, ImportRow("held out", len(out), shown), record


def check_hold_out(wanted: str | None) -> None:
    """Refuse a choice that is none, before anything is read.

    Raises:
        DatasetError: The count is 1 or negative, the file cannot be read, or there is no name.
    """
    if wanted is not None and not (_is_count(wanted) and _count(wanted) >= 0):
        _names(wanted)


def _each_of(every: int) -> str:
    ending = {2: "nd", 3: "rd"}.get(every % 10, "th") if every // 10 % 10 != 1 else "th"
    return f"each {every}{'st' if every % 10 == 1 and every % 100 != 11 else ending}"


def _count(text: str) -> int:
    count = int(text)
    if count < 0 or count == 1:
        raise DatasetError(f"expected to hold out every 2nd photograph or fewer, or 0 for none, got {count}")
    return count


def _is_count(text: str) -> bool:
    return text.strip().removeprefix("-").isdecimal()


def _each(shots: Sequence[PosedPhotograph], every: int) -> list[PosedPhotograph]:
    return [replace(s, held_out=bool(every) and i % every == 0) for i, s in enumerate(shots)]


def _names(wanted: str) -> list[str]:
    """Return names from a file, one a line, or from a text with commas."""
    parts = wanted.split(",")
    if Path(wanted).is_file():
        try:
            parts = read_bytes(Path(wanted)).decode("utf-8-sig").splitlines()
        except (OSError, UnicodeDecodeError) as cause:
            raise DatasetError(
                f"expected names of photographs in {wanted}, one a line, got {cause}"
            ) from cause
        parts = [line for line in parts if not line.strip().startswith("#")]
    names = [name for name in map(str.strip, parts) if name]
    if not names:
        raise DatasetError(
            f"expected names of photographs to hold out, got none in {wanted!r}. Give 0 to hold out none"
        )
    return names


def _named(shots: Sequence[PosedPhotograph], names: Sequence[str]) -> list[PosedPhotograph]:
    chosen = set()
    for name in names:
        found = [i for i, shot in enumerate(shots) if _is_called(shot, name)]
        if not found:
            raise UnknownNameError("photograph", name, (shot.name for shot in shots))
        chosen.update(found)
    return [replace(shot, held_out=i in chosen) for i, shot in enumerate(shots)]


def _is_called(shot: PosedPhotograph, name: str) -> bool:
    """Tell whether a name is that of a view, or of its file: with or without its suffix and its folders."""
    parts = PurePath(name).parts
    return name == shot.name or any(
        parts == path.parts[-len(parts) :] for path in (shot.image, shot.image.with_suffix(""))
    )

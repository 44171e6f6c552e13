# SPDX-License-Identifier: Apache-2.0
"""OpenEXR: which part and channels are the picture, its primaries, its windows."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from graycard._errors import DatasetError
from graycard.exchange.pictures._pixels import LINEAR, Encoding, Header, Note, Pixels
from graycard.exchange.pictures._profiles import profile_note
from graycard.io import REC709, ExrPart, are_rec709, read_exr, read_exr_headers

_MAIN = ("", "rgb", "rgba", "beauty", "combined", "c", "color", "colour", "image", "main", "radiance")
"""Names that programs give to the picture among other layers, in lower case."""


_OF_EXPOSURE = ("expTime", "aperture", "isoSpeed", "whiteLuminance")
_SQUARE = 1e-3
"""Share by which pixels may be wider than high and still be square."""


@dataclass(frozen=True, slots=True)
class _Candidate:
    """Channels that could be the picture."""

    part: ExrPart
    name: str
    planes: dict[str, np.ndarray]
    """By ``R``, ``G``, ``B``, ``A`` or ``Y``."""


def read_header(path: Path) -> Header:
    """Return the size that a viewer shows: that of the display window.

    Raises:
        DatasetError: It is damaged.
    """
    left, top, right, bottom = read_exr_headers(path, DatasetError)[0].display_window
    return Header(right - left + 1, bottom - top + 1)


def read_pixels(path: Path) -> Pixels:
    """Return the picture of an EXR file, placed in its display window; alpha is as stored.

    Raises:
        DatasetError: It is damaged, holds no picture or several, or says colours that are not linear.
    """
    parts = read_exr(path, DatasetError)
    chosen, notes = _choose(parts, path)
    planes = [chosen.planes[c] for c in ("RGB" if "R" in chosen.planes else "Y")]
    if any(plane.dtype.kind != "f" for plane in planes):
        raise DatasetError(f"expected light as floats in {path}, got whole numbers. Convert it")
    half = all(plane.dtype.itemsize == 2 for plane in planes)
    light = [plane.astype(np.float32, copy=False) for plane in planes]
    values = light[0] if len(light) == 1 else np.stack(light, axis=-1)
    alpha = chosen.planes.get("A")
    encoding = _encoding(chosen.part.header, path)
    said = Note("file", f"EXR, {'half' if half else 'float'}{', grey' * (values.ndim == 2)}")
    told = () if encoding.primaries == REC709 else (profile_note(encoding, "chromaticities"),)
    return Pixels(
        values,
        None if alpha is None else alpha.astype(np.float32, copy=False),
        encoding,
        premultiplied=True,
        notes=(said, *told, *notes, *_about_windows(chosen.part), *_about_header(chosen.part.header)),
    )


def _choose(parts: Sequence[ExrPart], path: Path) -> tuple[_Candidate, tuple[Note, ...]]:
    """Return the picture among all layers: the nameless one, the only one, or the one with the usual name.

    Raises:
        DatasetError: There is none, or more than one.
    """
    found = [candidate for part in parts for candidate in _candidates(part)]
    coloured = [c for c in found if "R" in c.planes] or [c for c in found if "Y" in c.planes]
    if not coloured:
        names = ", ".join(name for part in parts for name in part.planes())
        raise DatasetError(f"expected channels R, G, B in {path}, got {names}")
    chosen = coloured
    for names in (("",), _MAIN):
        if len(chosen) != 1:
            chosen = [c for c in coloured if c.name.rpartition(".")[2].lower() in names]
    named = ", ".join(c.name or "one without a name" for c in coloured)
    if len(chosen) != 1:
        raise DatasetError(f"expected one picture in {path}, got several: {named}. Keep one of them")
    if len(coloured) == 1:
        return chosen[0], ()
    note = Note("layers", f"{chosen[0].name or 'the one without a name'} is the picture of {named}")
    return chosen[0], (note,)


def _candidates(part: ExrPart) -> list[_Candidate]:
    groups: dict[str, dict[str, np.ndarray]] = {}
    for channel, plane in part.planes().items():
        stem, _, suffix = channel.rpartition(".")
        groups.setdefault(stem, {})[suffix.upper()] = plane
    return [
        _Candidate(part, stem or part.name, planes)
        for stem, planes in groups.items()
        if {"R", "G", "B"} <= planes.keys() or ("Y" in planes and not {"X", "Z", "RY", "BY"} & planes.keys())
    ]


def _encoding(header: Mapping[str, Any], path: Path) -> Encoding:
    """Return linear light of the primaries that a header names; of Rec.709 where it names none.

    Raises:
        DatasetError: It says that colours are not linear.
    """
    space = header.get("colorInteropID")
    if isinstance(space, str) and space not in ("", "data", "unknown") and not space.startswith("lin_"):
        raise DatasetError(
            f"expected linear light in {path}, got colours of {space}. Convert them to linear Rec.709"
        )
    given = header.get("chromaticities")
    if given is None and isinstance(space, str) and space.startswith("lin_") and "rec709" not in space:
        raise DatasetError(
            f"expected chromaticities beside colours of {space} in {path}, got none. Write them, or convert "
            "to Rec.709"
        )
    if not isinstance(given, Sequence):
        return Encoding(LINEAR)
    primaries = tuple(float(x) for x in given)
    return Encoding(LINEAR, REC709 if are_rec709(primaries) else primaries)


def _about_header(header: Mapping[str, Any]) -> Iterator[Note]:
    """Yield notes on attributes that say something about light or pixels and are passed over."""
    if asked := [name for name in _OF_EXPOSURE if name in header]:
        yield Note("exposure", f"{', '.join(asked)} of EXR not asked: light is taken as it is stored")
    ratio = header.get("pixelAspectRatio", 1.0)
    if isinstance(ratio, int | float) and abs(ratio - 1) > _SQUARE:
        yield Note("pixels", f"{ratio:g} times as wide as high, as EXR says: taken as square", warns=True)


def _about_windows(part: ExrPart) -> tuple[Note, ...]:
    data, display = part.data_window, part.display_window
    if data == display:
        return ()
    cut = data[0] < display[0] or data[1] < display[1] or data[2] > display[2] or data[3] > display[3]
    lacks = data[0] > display[0] or data[1] > display[1] or data[2] < display[2] or data[3] < display[3]
    done = ["what lies outside of it is cut off"] * cut + ["what is missing is black"] * lacks
    return (Note("windows", f"data window placed in the display window: {', '.join(done)}", warns=lacks),)

# SPDX-License-Identifier: Apache-2.0
"""Colours of points as programs keep them in PLY: bytes, 16 bits, floats, and zonal terms of splats."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from graycard._errors import DatasetError

GREY = 128
_SETS = (
    ("red", "green", "blue"),
    ("diffuse_red", "diffuse_green", "diffuse_blue"),
    ("r", "g", "b"),
    ("red_0", "green_0", "blue_0"),
)
_PARTS = {
    *(name for names in _SETS for name in names if len(name) > 1),
    "intensity",
    "scalar_intensity",
    "grey",
    "gray",
    "colour",
    "color",
    "rgb",
}
"""Names of what looks like a colour or a part of one."""
GREYED = "no colours: grey"
_SPLAT = ("f_dc_0", "f_dc_1", "f_dc_2")
_ZONAL = 0.5 / np.sqrt(np.pi)
"""The spherical harmonic of degree 0, which a splat's colour is stored as a factor of."""
_BRIGHT = 16
"""Number up to which fractions may be light above 1: among those of 0 to 255 all would be nearly black."""
_BYTE, _WORD = 255, 65535


def point_colours(vertices: np.ndarray, path: Path) -> tuple[np.ndarray, str]:
    """Return sRGB colours of vertices, shape ``(N, 3)``, uint8, and where they come from.

    Whole numbers above 255 are 16 bits; floats above 1 are 0 to 255, above 255 0 to 65535. But fractions of
    which few are above 1, and none far, are 0 to 1, and light beyond is cut. The first set of names that is
    there counts, in any case. Without any, points are grey.

    Args:
        vertices: A structured array.
        path: Of the file, for messages.

    Raises:
        DatasetError: Colours are negative, not finite, or above the range of 16 bits.
    """
    names = vertices.dtype.names or ()
    known = {name.lower(): name for name in reversed(names)}
    for wanted in _SETS:
        if {*wanted} <= {*known}:
            own = [known[name] for name in wanted]
            found = _stack(vertices, own)
            top = _top(found, path)
            kind = {1: "floats of 0 to 1", _BYTE: "0 to 255", _WORD: "16 bits, rounded to 8"}[top]
            cut = int((found > top).any(axis=-1).sum())
            colours = np.rint(_BYTE * np.minimum(found.astype(np.float64) / top, 1)).astype(np.uint8)
            told = f", of {cut} cut there" if cut else ""
            return colours, f"colours from {', '.join(own)}: {kind}{told}"
    if {*_SPLAT} <= {*names}:
        factors = _stack(vertices, _SPLAT).astype(np.float64)
        if not np.isfinite(factors).all():
            raise DatasetError(f"expected finite f_dc_0, f_dc_1, f_dc_2 in {path}, got others. Mend them")
        colours = np.rint(_BYTE * np.clip(0.5 + _ZONAL * factors, 0, 1)).astype(np.uint8)
        return colours, "colours from f_dc_0, f_dc_1, f_dc_2 of a splat, seen from nowhere in particular"
    others = [name for name in names if name.lower() in _PARTS]
    said = f"{GREYED}, as {', '.join(others)} alone is none" if others else GREYED
    return np.full((len(vertices), 3), GREY, dtype=np.uint8), said


def _stack(vertices: np.ndarray, names: Sequence[str]) -> np.ndarray:
    return np.stack([vertices[name] for name in names], axis=-1)


def _top(found: np.ndarray, path: Path) -> int:
    """Return the number that is white in full.

    Raises:
        DatasetError: No range fits.
    """
    least, most = (found.min(), found.max()) if found.size else (0, 0)
    floating = found.dtype.kind == "f"
    if floating and least >= 0 and 1 < most < _BRIGHT and np.mean(found > 1) < 0.5 and (found % 1 != 0).any():
        return 1
    tops = (1, _BYTE, _WORD) if floating else (_BYTE, _WORD)
    top = next((top for top in tops if least >= 0 and most <= top), None)
    if top is None:
        wanted = "0 to 1, 255 or 65535" if floating else "0 to 255 or 65535"
        raise DatasetError(
            f"expected colours from {wanted} in {path}, got {least:g} to {most:g}. Scale or mend them"
        )
    return top

# SPDX-License-Identifier: Apache-2.0
"""The compressed PLY of SuperSplat and of gsplat's ``ply_compressed``: 16 bytes a Gaussian, 256 a chunk.

As in ``src/lib/readers/decompress-ply.ts`` of playcanvas/splat-transform, and in gsplat 1.5,
``splat2ply_bytes_compressed``. Element ``chunk`` has the bounds of position, log scale and colour. Element
``vertex`` has four words: position and scale (11, 10, 11 bits), the three smaller parts of a quaternion (10
bits each, the place of the largest above them), colour with opacity (8 bits each). Element ``sh``, if it is
there, has a byte for each ``f_rest``.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from graycard import DatasetError
from graycard.methods.splat import SH_DC

CHUNK = 256
"""Gaussians that share bounds."""
WORDS = ("packed_position", "packed_rotation", "packed_scale", "packed_color")
_PLACES, _SIZES, _COLOURS = (
    (("min_x", "max_x"), ("min_y", "max_y"), ("min_z", "max_z")),
    tuple((f"min_scale_{axis}", f"max_scale_{axis}") for axis in "xyz"),
    tuple((f"min_{channel}", f"max_{channel}") for channel in "rgb"),
)
_OTHERS = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
"""Places of the three smaller parts by that of the largest."""


def is_packed(elements: Mapping[str, np.ndarray]) -> bool:
    """Tell whether the elements of a PLY are those of the compressed layout."""
    vertices = elements.get("vertex")
    return vertices is not None and WORDS[0] in (vertices.dtype.names or ())


def unpacked(elements: Mapping[str, np.ndarray], path: Path) -> dict[str, np.ndarray]:
    """Return the columns of INRIA's layout, float64.

    Raises:
        DatasetError: An element or a property is missing, has another type, or too few rows.
    """
    chunks, vertices = elements.get("chunk"), elements["vertex"]
    if chunks is None or len(chunks) != -(-len(vertices) // CHUNK):
        have = "none" if chunks is None else str(len(chunks))
        raise DatasetError(
            f"expected a chunk for each {CHUNK} of {len(vertices)} packed vertices at {path}, got {have}. "
            "Export it again"
        )
    _check(vertices, WORDS, "u4", path)
    _check(chunks, [name for pair in (*_PLACES, *_SIZES) for name in pair], "f4", path)
    words = {name: vertices[name].astype(np.uint32) for name in WORDS}
    colour, opacity = _bytes(words["packed_color"])
    if "min_r" in (chunks.dtype.names or ()):  # files of before 2024 have colours without bounds
        colour = _between(chunks, _COLOURS, colour)
    with np.errstate(divide="ignore"):
        logits = np.log(opacity) - np.log1p(-opacity)
    place = _between(chunks, _PLACES, _triple(words["packed_position"]))
    size = _between(chunks, _SIZES, _triple(words["packed_scale"]))
    columns = {
        **_named(("x", "y", "z"), place),
        **_named(("f_dc_0", "f_dc_1", "f_dc_2"), (colour - 0.5) / SH_DC),
        "opacity": logits,
        **_named(("scale_0", "scale_1", "scale_2"), size),
        **_named(("rot_0", "rot_1", "rot_2", "rot_3"), _quaternions(words["packed_rotation"])),
    }
    return columns | _harmonics(elements.get("sh"), len(vertices), path)


def _check(rows: np.ndarray, names: Sequence[str], kind: str, path: Path) -> None:
    types = {name: rows.dtype[name].str[1:] for name in rows.dtype.names or ()}
    wrong = [name for name in names if types.get(name) != kind]
    if wrong:
        raise DatasetError(
            f"expected packed properties of type {kind} at {path}, got none of {', '.join(wrong)}. Export "
            "it again"
        )


def _named(names: Sequence[str], values: np.ndarray) -> dict[str, np.ndarray]:
    return {name: values[:, column] for column, name in enumerate(names)}


def _share(words: np.ndarray, shift: int, bits: int) -> np.ndarray:
    """Return some bits of words as a share of the most that they can be."""
    most = (1 << bits) - 1
    return ((words >> np.uint32(shift)) & np.uint32(most)) / most


def _triple(words: np.ndarray) -> np.ndarray:
    return np.stack([_share(words, 21, 11), _share(words, 11, 10), _share(words, 0, 11)], axis=1)


def _bytes(words: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Colours, and opacities."""
    return np.stack([_share(words, shift, 8) for shift in (24, 16, 8)], axis=1), _share(words, 0, 8)


def _between(chunks: np.ndarray, pairs: Sequence[tuple[str, str]], shares: np.ndarray) -> np.ndarray:
    """Shares as values between the bounds of their chunks."""
    chunk = np.arange(len(shares)) // CHUNK
    low, high = (
        np.stack([chunks[pair[end]] for pair in pairs], axis=1).astype(np.float64)[chunk] for end in (0, 1)
    )
    return low * (1 - shares) + high * shares


def _quaternions(words: np.ndarray) -> np.ndarray:
    small = np.stack([_share(words, shift, 10) for shift in (20, 10, 0)], axis=1)
    small = (small - 0.5) * np.sqrt(2)
    largest = (words >> np.uint32(30)).astype(np.int64)
    found = np.empty((len(words), 4))
    rows = np.arange(len(words))
    found[rows[:, None], _OTHERS[largest]] = small
    found[rows, largest] = np.sqrt(np.maximum(0, 1 - (small**2).sum(axis=1)))
    return found


def _harmonics(rows: np.ndarray | None, count: int, path: Path) -> dict[str, np.ndarray]:
    """Columns ``f_rest`` from bytes: 0 and 255 are the bounds, others stand in the middle of their step."""
    if rows is None:
        return {}
    if len(rows) != count:
        raise DatasetError(
            f"expected harmonics for {count} Gaussians at {path}, got {len(rows)}. Export it again"
        )
    names = [name for name in rows.dtype.names or () if name.startswith("f_rest_")]
    _check(rows, names, "u1", path)
    steps = np.where(np.arange(256) == 255, 1.0, (np.arange(256) + 0.5) / 256)
    steps[0] = 0.0
    return {name: (steps[rows[name]] - 0.5) * 8 for name in names}

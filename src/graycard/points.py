# SPDX-License-Identifier: Apache-2.0
"""Sparse points with the pixels that they were found at, and the PLY file that holds both.

Viewers read the ``vertex`` element; the ``observation`` element after it is ours and is passed over by them.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from graycard._errors import DatasetError
from graycard._point_colours import point_colours
from graycard.io import read_ply, write_bytes

_VERTEX = np.dtype([(n, "<f4") for n in "xyz"] + [(n, "u1") for n in ("red", "green", "blue")])
_TRACKED = np.dtype([*_VERTEX.descr, ("views", "<u2")])
_OBSERVATION = np.dtype([("point", "<i4"), ("view", "<i4"), ("x", "<f4"), ("y", "<f4")])
_NAMES = {"u1": "uchar", "<u2": "ushort", "<i4": "int", "<f4": "float"}


@dataclass(frozen=True, eq=False)
class Points:
    """Points on surfaces, as structure from motion finds them: noisy, and some of them wrong.

    Raises:
        ValueError: Shapes do not match, or an observation is of a point that is not there.
    """

    positions: np.ndarray
    """Shape ``(N, 3)``, world, metres."""
    colors: np.ndarray
    """Shape ``(N, 3)``, uint8: sRGB-encoded at the capture's exposure, as photographs are shown."""
    point: np.ndarray
    """Shape ``(M,)``: for each observation, the index of its point."""
    view: np.ndarray
    """Shape ``(M,)``: for each observation, the index of its view in ``capture.views``."""
    pixel: np.ndarray
    """Shape ``(M, 2)``: for each observation, its image coordinates ``(x, y)``, pixel centres at +0.5."""
    said: str = ""
    """Place of the colours in the file that they were read from, in words."""

    def __post_init__(self) -> None:
        count, seen = len(self.positions), len(self.point)
        shapes = [a.shape for a in (self.positions, self.colors, self.point, self.view, self.pixel)]
        if shapes != [(count, 3), (count, 3), (seen,), (seen,), (seen, 2)]:
            raise ValueError(f"expected points (N, 3), (N, 3), (M,), (M,), (M, 2), got {shapes}")
        if seen and not (self.point.min() >= 0 and self.point.max() < count):
            raise ValueError(f"expected observations of points 0 to {count - 1}, got {self.point.max()}")

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def views(self) -> np.ndarray:
        """In how many photographs each point was found, shape ``(N,)``; 0 where it is not known."""
        return np.bincount(self.point, minlength=len(self))

    def take(self, kept: np.ndarray) -> "Points":
        """Only some points, with their observations; ``kept`` has shape ``(N,)``, bool."""
        number = np.cumsum(kept) - 1
        seen = kept[self.point]
        return Points(
            self.positions[kept],
            self.colors[kept],
            number[self.point[seen]],
            self.view[seen],
            self.pixel[seen],
            self.said,
        )


def without_tracks(positions: np.ndarray, colors: np.ndarray, said: str = "") -> Points:
    """Points of which nobody says where they were seen; shapes ``(N, 3)``."""
    none = np.zeros(0, dtype=np.int64)
    return Points(positions, colors, none, none, np.zeros((0, 2)), said)


def no_points() -> Points:
    """Return a cloud without any."""
    return without_tracks(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.uint8))


def write_points(path: Path, points: Points, *, tracks: bool = True) -> None:
    """Write a binary little-endian PLY; positions are rounded to float32.

    Args:
        path: The file.
        points: What to write.
        tracks: Also write ``views`` of each vertex and the ``observation`` element.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    vertices = np.zeros(len(points), _TRACKED if tracks else _VERTEX)
    for axis, name in enumerate("xyz"):
        vertices[name] = points.positions[:, axis]
    for channel, name in enumerate(("red", "green", "blue")):
        vertices[name] = points.colors[:, channel]
    elements = {"vertex": vertices}
    if tracks:
        vertices["views"] = points.views
        columns = points.point, points.view, *points.pixel.T
        seen = np.zeros(len(points.point), _OBSERVATION)
        for name, column in zip(seen.dtype.names or (), columns, strict=True):
            seen[name] = column
        elements["observation"] = seen
    write_bytes(path, _header(elements) + b"".join(a.tobytes() for a in elements.values()))


def read_points(path: Path) -> Points:
    """Return the points of a PLY file, binary or text, of ours or of another program.

    Colours may be bytes, 16 bits, floats or the first term of a splat; :attr:`Points.said` says which.
    Without an ``observation`` element nothing says where points were seen.

    Raises:
        DatasetError: The file is missing, cut off, or no PLY; a position is not finite, or a colour is
            out of any range that programs use.
    """
    elements = read_ply(path, DatasetError, "points").elements
    vertices = elements.get("vertex")
    if vertices is None or not set("xyz") <= set(vertices.dtype.names or ()):
        raise DatasetError(f"expected a PLY with x, y, z of each vertex at {path}, got {list(elements)}")
    positions = np.stack([vertices[n].astype(np.float64) for n in "xyz"], axis=-1)
    colors, said = point_colours(vertices, path)
    if not np.isfinite(positions).all():
        raise DatasetError(f"expected finite positions in {path}, got others. Leave these points out")
    seen = elements.get("observation")
    if seen is None or seen.dtype.names != _OBSERVATION.names:
        return without_tracks(positions, colors, said)
    pixel = np.stack([seen["x"], seen["y"]], axis=-1).astype(np.float64)
    try:
        return Points(positions, colors, seen["point"], seen["view"], pixel, said)
    except ValueError as cause:
        raise DatasetError(f"{path}: {cause}") from cause


def _header(elements: dict[str, np.ndarray]) -> bytes:
    lines = ["ply", "format binary_little_endian 1.0", "comment world metres, z up; colours sRGB"]
    for element, rows in elements.items():
        lines.append(f"element {element} {len(rows)}")
        for name, kind in ((n, rows.dtype[n].str) for n in rows.dtype.names or ()):
            lines.append(f"property {_NAMES[kind.replace('|', '')]} {name}")
    return ("\n".join([*lines, "end_header"]) + "\n").encode()

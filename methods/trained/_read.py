# SPDX-License-Identifier: Apache-2.0
"""Read a trained splat: PLY of any program, compressed PLY, and ``.splat``; others are refused by name."""

from pathlib import Path

import numpy as np

from graycard import DatasetError
from graycard.io import read_bytes, read_ply
from graycard.methods.splat import SH_DC
from graycard.methods.trained._columns import splat_of
from graycard.methods.trained._packed import is_packed, unpacked
from graycard.methods.trained._trained import Primitive, TrainedSplat

RECORD = np.dtype([("place", "<f4", 3), ("size", "<f4", 3), ("colour", "u1", 4), ("turn", "u1", 4)])
"""One Gaussian of a ``.splat`` file (antimatter15/splat; gsplat's ``splat2splat_bytes``): red, green, blue,
opacity, and the quaternion (w, x, y, z) as 128 times itself plus 128."""
CONVERTED = {
    ".spz": "Niantic's SPZ", ".ksplat": "the format of mkkellogg's viewer", ".sog": "PlayCanvas's SOG",
    ".splatv": "a splat that moves", ".json": "settings", ".pt": "a checkpoint", ".pth": "a checkpoint",
    ".ckpt": "a checkpoint", ".npz": "arrays",
}  # fmt: skip
"""Formats that are refused, by suffix."""


def read_splat(path: Path, primitive: Primitive | None = None) -> TrainedSplat:
    """Read a trained splat.

    Args:
        path: A PLY, text or binary in either byte order, plain or compressed; or a ``.splat``.
        primitive: What its Gaussians are drawn as; None lets the file decide: two scales are a disc's.

    Raises:
        DatasetError: The file is missing, damaged, of another format, or holds what cannot be drawn.
    """
    path = Path(path)
    if path.is_dir():
        raise DatasetError(f"expected the file of a trained splat, got the folder {path}. Give the PLY in it")
    suffix = path.suffix.lower()
    if suffix in CONVERTED:
        raise DatasetError(
            f"expected a trained splat as PLY or .splat, got {path} ({CONVERTED[suffix]}). Convert it: the "
            "program that made it exports PLY; SuperSplat and splat-transform convert other formats"
        )
    if suffix == ".splat":
        found = splat_of(_records(path), path, primitive)
    else:
        ply = read_ply(path, DatasetError, "a trained splat")
        found = splat_of(_columns(ply.elements, path), path, primitive, ply.comments)
    if len(found) == 0:
        raise DatasetError(f"expected Gaussians in {path}, got none. Give a file that training wrote")
    return found


def _columns(elements: dict[str, np.ndarray], path: Path) -> dict[str, np.ndarray]:
    if is_packed(elements):
        return unpacked(elements, path)
    vertices = elements.get("vertex")
    if vertices is None:
        raise DatasetError(
            f"expected a PLY with an element vertex at {path}, got {', '.join(elements) or 'none'}. Give the "
            "file of a trained splat"
        )
    return {name: vertices[name] for name in vertices.dtype.names or ()}


def _records(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of INRIA's layout, of a file without a header."""
    try:
        data = read_bytes(path)
    except OSError as cause:
        raise DatasetError(f"expected a trained splat at {path}, got {cause.strerror or cause}") from cause
    if len(data) % RECORD.itemsize:
        raise DatasetError(
            f"expected whole records of {RECORD.itemsize} bytes in {path}, got {len(data)} bytes. The file "
            "is cut off or of another format"
        )
    rows = np.frombuffer(data, RECORD)
    share = rows["colour"].astype(np.float64) / 255
    with np.errstate(divide="ignore", invalid="ignore"):  # what is no size becomes NaN, and is refused
        logits, sizes = np.log(share[:, 3]) - np.log1p(-share[:, 3]), np.log(rows["size"].astype(np.float64))
    turn = rows["turn"].astype(np.float64) / 128 - 1
    return {
        **{name: rows["place"][:, axis] for axis, name in enumerate(("x", "y", "z"))},
        **{f"f_dc_{channel}": (share[:, channel] - 0.5) / SH_DC for channel in range(3)},
        "opacity": logits,
        **{f"scale_{axis}": sizes[:, axis] for axis in range(3)},
        **{f"rot_{part}": turn[:, part] for part in range(4)},
    }

# SPDX-License-Identifier: Apache-2.0
"""Pictures as other programs write them, made byte by byte where no library at hand writes them."""

import json
import struct
import zlib
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import OpenEXR

from graycard import look_at

D50 = (0.9642, 1.0, 0.8249)
SRGB_D50 = ((0.43607, 0.22249, 0.01392), (0.38515, 0.71687, 0.09708), (0.14307, 0.06061, 0.71410))
"""Red, green and blue of sRGB in XYZ of D50, as in the profile of the ICC."""
P3_D50 = ((0.51512, 0.2412, -0.00105), (0.29198, 0.69225, 0.04189), (0.1571, 0.06657, 0.78407))
"""Those of Display P3, as in Apple's profile."""
ADOBE_D50 = ((0.60974, 0.31111, 0.01947), (0.20528, 0.62567, 0.06087), (0.14919, 0.06322, 0.74457))
SRGB_CURVE = struct.pack(
    ">4s4xHH5i",
    b"para", 3, 0, *(round(65536 * x) for x in (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)),
)  # fmt: skip
"""IEC 61966-2-1 as the third kind of parametric curve."""


def gamma_curve(gamma: float) -> bytes:
    """Return a curve that is one power."""
    return struct.pack(">4s4xIH2x", b"curv", 1, round(256 * gamma))


def icc_profile(
    name: str, colorants: Sequence[Sequence[float]] = SRGB_D50, curve: bytes = SRGB_CURVE
) -> bytes:
    """Return an ICC profile of a display from XYZ of its primaries under D50, and one curve for all three."""

    def xyz(values: Iterable[float]) -> bytes:
        return struct.pack(">4s4x3i", b"XYZ ", *(round(65536 * v) for v in values))

    text = name.encode()
    desc = struct.pack(">4s4xI", b"desc", len(text) + 1) + text + b"\0" + bytes(78)
    tags = [(b"desc", desc), (b"wtpt", xyz(D50)), (b"cprt", b"text" + bytes(4) + b"free\0")]
    for channel, colorant in zip("rgb", colorants, strict=True):
        tags += [(f"{channel}XYZ".encode(), xyz(colorant)), (f"{channel}TRC".encode(), curve)]
    start, table, body = 128 + 4 + 12 * len(tags), b"", b""
    for tag, data in tags:
        table += tag + struct.pack(">II", start + len(body), len(data))
        body += data + bytes(-len(data) % 4)
    size = start + len(body)
    head = struct.pack(">I4sI4s4s4s", size, b"test", 0x04200000, b"mntr", b"RGB ", b"XYZ ")
    head += struct.pack(">6H4s", 2026, 1, 1, 0, 0, 0, b"acsp") + bytes(28)
    head += struct.pack(">3i", *(round(65536 * v) for v in D50))
    return head.ljust(128, b"\0") + struct.pack(">I", len(tags)) + table + body


def png_bytes(values: np.ndarray, colour_type: int, chunks: Iterable[tuple[bytes, bytes]] = ()) -> bytes:
    """Return a PNG of uint8 or uint16 values ``(H, W)`` or ``(H, W, C)``, with further chunks."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    height, width = values.shape[:2]
    depth = 8 * values.dtype.itemsize
    big = values.astype(f">u{depth // 8}")
    rows = b"".join(b"\0" + big[i].tobytes() for i in range(height))
    header = struct.pack(">IIBBBBB", width, height, depth, colour_type, 0, 0, 0)
    between = b"".join(chunk(*pair) for pair in chunks)
    pixels = chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + between + pixels


def write_exr(
    path: Path, channels: dict[str, np.ndarray], windows: Sequence[Sequence[int]] = (), **header: object
) -> None:
    """Write an EXR file of one part.

    Args:
        path: The file.
        channels: As OpenEXR takes them.
        windows: Data and display window, each first column and row, last column and row.
        header: Further attributes.
    """
    names = ("dataWindow", "displayWindow")
    given = {
        n: (np.array(w[:2], np.int32), np.array(w[2:], np.int32))
        for n, w in zip(names, windows, strict=False)
    }
    whole = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **given, **header}
    OpenEXR.File(whole, {n: np.ascontiguousarray(c) for n, c in channels.items()}).write(str(path))


def write_transforms(
    folder: Path, images: Sequence[str], size: tuple[int, int], masks: Sequence[str] = (), **more: object
) -> Path:
    """Write a ``transforms.json`` with a pinhole for each image, all of one size; return the folder."""
    flip, frames = np.diag([1.0, -1.0, -1.0, 1.0]), []
    for i, name in enumerate(images):
        pose = look_at(np.array([2.0, i / 4, 1.0]), np.zeros(3)) @ flip
        frames.append({"file_path": name, "transform_matrix": pose.tolist()})
        if masks:
            frames[-1]["mask_path"] = masks[i]
    width, height = size
    index = {
        "w": width,
        "h": height,
        "fl_x": 9,
        "fl_y": 9,
        "cx": width / 2,
        "cy": height / 2,
        "frames": frames,
    }
    (folder / "transforms.json").write_text(json.dumps({**index, **more}))
    return folder

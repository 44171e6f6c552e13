# SPDX-License-Identifier: Apache-2.0
"""COLMAP's binary form: ``cameras.bin``, ``images.bin``, ``points3D.bin``, little-endian.

COLMAP's own reader takes files that break off without a word, or asks for memory without bound. So each
count is held here against what is left of its file. Rigs and frames add nothing: images have their poses.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from graycard._errors import DatasetError
from graycard.exchange._lens import Intrinsics, make_intrinsics
from graycard.exchange.colmap._model import Model, ModelImage, ModelPoints, check_tracks, pose_of
from graycard.io import check_label, read_bytes, write_bytes

CAMERAS, IMAGES, POINTS = "cameras.bin", "images.bin", "points3D.bin"
MODELS = (
    ("SIMPLE_PINHOLE", 3), ("PINHOLE", 4), ("SIMPLE_RADIAL", 4), ("RADIAL", 5), ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8), ("FULL_OPENCV", 12), ("FOV", 5), ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5), ("THIN_PRISM_FISHEYE", 12), ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
    ("SIMPLE_DIVISION", 4), ("DIVISION", 5), ("SIMPLE_FISHEYE", 3), ("FISHEYE", 4), ("EUCM", 6),
    ("EQUIRECTANGULAR", 2),
)  # fmt: skip
"""Names of camera models and their numbers of parameters, in the order of COLMAP's ids."""
_KEYPOINT = np.dtype([("xy", "<f8", 2), ("point", "<u8")])
_TRACK = np.dtype([("image", "<u4"), ("keypoint", "<u4")])
_LARGEST_SIDE = 2**20
LARGEST = 2**31
"""Bytes of a file, at most."""


def read_binary(folder: Path) -> Model:
    """Read a binary model.

    Raises:
        DatasetError: A file is missing, breaks off, goes on after its end, or holds numbers that are none.
    """
    cameras = _read_cameras(_Reader.open(folder / CAMERAS))
    images = _read_images(_Reader.open(folder / IMAGES))
    if not (folder / POINTS).is_file():
        return Model(cameras, images)
    points = _read_points(_Reader.open(folder / POINTS))
    check_tracks(points, {i: len(image.keypoints) for i, image in images.items()}, str(folder / POINTS))
    return Model(cameras, images, points)


def count_images(folder: Path) -> int:
    """Return how many images a binary model says that it has.

    Raises:
        DatasetError: There is no such file, or it breaks off.
    """
    return _Reader.open(folder / IMAGES).count(1)


def write_binary(
    folder: Path,
    cameras: Sequence[tuple[int, int, Sequence[float]]],
    images: Sequence[tuple[str, int, Sequence[float], np.ndarray]],
    points: Sequence[tuple[np.ndarray, np.ndarray, float, Sequence[tuple[int, int]]]],
) -> None:
    """Write a model of pinholes; cameras, images and points have the ids 1, 2, 3, …

    Args:
        folder: Where to.
        cameras: Width, height, and fx, fy, cx, cy of each.
        images: Name, camera id, quaternion (w, x, y, z) with translation, and keypoints x, y, point id of
            each; shape ``(N, 3)``.
        points: Position, colour, error, and image id and keypoint of each observation.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    data = [struct.pack("<Q", len(cameras))]
    data += [struct.pack("<IiQQ4d", i, 1, w, h, *numbers) for i, (w, h, numbers) in enumerate(cameras, 1)]
    write_bytes(folder / CAMERAS, b"".join(data))
    data = [struct.pack("<Q", len(images))]
    for i, (name, camera, pose, keypoints) in enumerate(images, 1):
        rows = np.zeros(len(keypoints), _KEYPOINT)
        rows["xy"], rows["point"] = keypoints[:, :2], keypoints[:, 2]
        data += [struct.pack("<I7dI", i, *pose, camera), name.encode(), b"\0"]
        data += [struct.pack("<Q", len(rows)), rows.tobytes()]
    write_bytes(folder / IMAGES, b"".join(data))
    data = [struct.pack("<Q", len(points))]
    for i, (position, color, error, track) in enumerate(points, 1):
        data += [struct.pack("<Q3d3BdQ", i, *position, *color.tolist(), error, len(track))]
        data += [np.array(track, "<u4").tobytes()]
    write_bytes(folder / POINTS, b"".join(data))


@dataclass(slots=True)
class _Reader:
    """The rest of a file that is being read."""

    path: Path
    data: memoryview
    start: int = 0

    @staticmethod
    def open(path: Path) -> "_Reader":
        try:
            return _Reader(path, memoryview(read_bytes(path, LARGEST)))
        except OSError as cause:
            raise DatasetError(
                f"expected a COLMAP binary file at {path}, got {cause.strerror or cause}. Export the model "
                "again"
            ) from cause

    def take(self, layout: str) -> tuple[Any, ...]:
        """Return the numbers of a layout of :mod:`struct`."""
        packed = struct.Struct("<" + layout)
        self._need(packed.size)
        found = packed.unpack_from(self.data, self.start)
        self.start += packed.size
        return found

    def count(self, smallest: int) -> int:
        """Return a number of entries, each of ``smallest`` bytes or more, that the file has room for."""
        (count,) = self.take("Q")
        self._need(count * smallest)
        return count

    def table(self, kind: np.dtype, count: int) -> np.ndarray:
        """Return as many rows."""
        self._need(count * kind.itemsize)
        rows = np.frombuffer(self.data, kind, count, self.start)
        self.start += count * kind.itemsize
        return rows

    def text(self) -> str:
        """Return the text up to the next zero byte."""
        window = bytes(self.data[self.start : self.start + 4096])
        raw, end, _ = window.partition(b"\0")
        try:
            if not end:
                raise ValueError("no end of it in 4096 bytes")
            text = check_label(raw.decode("utf-8"))
        except ValueError as cause:
            raise DatasetError(
                f"expected the name of an image in {self.path} at byte {self.start}, got {cause}. Rename it"
            ) from cause
        self.start += len(raw) + 1
        return text

    def end(self) -> None:
        """Refuse what follows the last entry."""
        if self.start < len(self.data):
            raise DatasetError(
                f"expected {self.path} to end at byte {self.start}, got {len(self.data) - self.start} bytes "
                "more. Export the model again"
            )

    def _need(self, size: int) -> None:
        if size > len(self.data) - self.start:
            raise DatasetError(
                f"expected {size} bytes more in {self.path} at byte {self.start}, got "
                f"{len(self.data) - self.start}: it is cut off or damaged. Export the model again"
            )


def _read_cameras(file: _Reader) -> dict[int, Intrinsics]:
    cameras: dict[int, Intrinsics] = {}
    for _ in range(file.count(24)):
        number, kind, width, height = file.take("IiQQ")
        where = f"{file.path}, camera {number}"
        if not (0 <= kind < len(MODELS) and 0 < width <= _LARGEST_SIDE and 0 < height <= _LARGEST_SIDE):
            raise DatasetError(
                f"expected a camera model from 0 to {len(MODELS) - 1} and a size in {where}, got model "
                f"{kind} of {width}x{height}. Export the model again"
            )
        name, count = MODELS[kind]
        if number in cameras:
            raise DatasetError(f"expected camera ids that differ in {file.path}, got {number} again")
        cameras[number] = make_intrinsics(name, (width, height), file.take(f"{count}d"), where)
    file.end()
    return cameras


def _read_images(file: _Reader) -> dict[int, ModelImage]:
    images: dict[int, ModelImage] = {}
    for _ in range(file.count(73)):
        number, *pose, camera = file.take("I7dI")
        name, where = file.text(), f"{file.path}, image {number}"
        if number in images:
            raise DatasetError(f"expected image ids that differ in {file.path}, got {number} again")
        keypoints = file.table(_KEYPOINT, file.count(_KEYPOINT.itemsize))["xy"]
        images[number] = ModelImage(name, camera, pose_of(pose[:4], pose[4:], where), keypoints, where)
    file.end()
    return images


def _read_points(file: _Reader) -> ModelPoints:
    count = file.count(51)
    positions, colors = np.zeros((count, 3)), np.zeros((count, 3), np.uint8)
    lengths, tracks = np.zeros(count, np.int64), []
    for row in range(count):
        _, *numbers, length = file.take("Q3d3BdQ")
        tracks.append(file.table(_TRACK, length))
        positions[row], colors[row], lengths[row] = numbers[:3], numbers[3:6], length
    file.end()
    if not np.isfinite(positions).all():
        raise DatasetError(f"expected finite positions in {file.path}, got others. Leave these points out")
    track = np.concatenate(tracks) if tracks else np.zeros(0, _TRACK)
    point = np.repeat(np.arange(count), lengths)
    return ModelPoints(
        positions, colors, point, track["image"].astype(np.int64), track["keypoint"].astype(np.int64)
    )

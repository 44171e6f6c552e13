# SPDX-License-Identifier: Apache-2.0
"""COLMAP's text form: ``cameras.txt``, ``images.txt`` (world to camera, OpenCV axes), ``points3D.txt``."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from graycard._errors import DatasetError
from graycard.exchange._lens import Intrinsics, make_intrinsics
from graycard.exchange.colmap._model import Model, ModelImage, ModelPoints, pose_of
from graycard.io import read_bytes, write_bytes

CAMERAS, IMAGES, POINTS = "cameras.txt", "images.txt", "points3D.txt"
_FIELDS = "POINT3D_ID X Y Z R G B ERROR TRACK[]"


def read_text(folder: Path) -> Model:
    """Read a text model.

    Raises:
        DatasetError: A file is missing or malformed; the message names the line.
    """
    cameras = _read_cameras(folder / CAMERAS)
    images = _read_images(folder / IMAGES)
    path = folder / POINTS
    if not path.is_file():
        return Model(cameras, images)
    counts = {number: len(image.keypoints) for number, image in images.items()}
    return Model(cameras, images, _read_points(_lines(path), counts, path))


def count_images(folder: Path) -> int:
    """Return how many images a text model has.

    Raises:
        DatasetError: There is no such file, or it is malformed.
    """
    return sum(1 for _ in _image_lines(folder / IMAGES))


def write_text(
    folder: Path,
    cameras: Sequence[tuple[int, int, Sequence[float]]],
    images: Sequence[tuple[str, int, Sequence[float], np.ndarray]],
    points: Sequence[tuple[np.ndarray, np.ndarray, float, Sequence[tuple[int, int]]]],
) -> None:
    """Write a model of pinholes; arguments as of :func:`graycard.exchange.colmap._binary.write_binary`.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    lines = ["# CAMERA_ID MODEL WIDTH HEIGHT fx fy cx cy"]
    lines += [f"{i} PINHOLE {w} {h} {_text(numbers)}" for i, (w, h, numbers) in enumerate(cameras, 1)]
    _write_lines(folder / CAMERAS, lines)
    lines = [
        "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME; the line after each: POINTS2D[] as X Y POINT3D_ID"
    ]
    for i, (name, camera, pose, keypoints) in enumerate(images, 1):
        fields = [f"{_text(row[:2])} {int(row[2])}" for row in keypoints]
        lines += [f"{i} {_text(pose)} {camera} {name}", " ".join(fields)]
    _write_lines(folder / IMAGES, lines)
    lines = ["# POINT3D_ID X Y Z R G B ERROR TRACK[] as IMAGE_ID POINT2D_IDX"]
    for i, (position, color, error, track) in enumerate(points, 1):
        pairs = "".join(f" {image} {keypoint}" for image, keypoint in track)
        lines.append(f"{i} {_text(position)} {color[0]} {color[1]} {color[2]} {error!r}{pairs}")
    _write_lines(folder / POINTS, lines)


def _text(numbers: Iterable[float]) -> str:
    return " ".join(repr(float(x)) for x in numbers)


def _write_lines(path: Path, lines: Sequence[str]) -> None:
    write_bytes(path, ("\n".join(lines) + "\n").encode())


def _read_cameras(path: Path) -> dict[int, Intrinsics]:
    cameras: dict[int, Intrinsics] = {}
    for number, line in _lines(path):
        fields, where = line.split(), f"{path}, line {number}"
        if not fields or fields[0].startswith("#"):
            continue
        if len(fields) < 5:
            raise DatasetError(f"expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS[] in {where}, got {line!r}")
        camera, width, height = (int(n) for n in _numbers([fields[0], *fields[2:4]], int, where))
        if camera in cameras:
            raise DatasetError(f"expected camera ids that differ in {path}, got {camera} again in {where}")
        parameters = tuple(_numbers(fields[4:], float, where))
        cameras[camera] = make_intrinsics(fields[1], (width, height), parameters, where)
    return cameras


def _read_images(path: Path) -> dict[int, ModelImage]:
    images: dict[int, ModelImage] = {}
    for fields, keypoints, where in _image_lines(path):
        image, camera = (int(n) for n in _numbers([fields[0], fields[8]], int, where))
        if image in images:
            raise DatasetError(f"expected image ids that differ in {path}, got {image} again in {where}")
        numbers = _numbers(fields[1:8], float, where)
        pixels = np.array(_numbers(keypoints, float, where)).reshape(-1, 3)[:, :2]
        images[image] = ModelImage(fields[9], camera, pose_of(numbers[:4], numbers[4:], where), pixels, where)
    return images


def _image_lines(path: Path) -> Iterator[tuple[list[str], list[str], str]]:
    """Yield the ten fields of each image, its keypoints, and where they stand."""
    lines = _lines(path)
    for number, line in lines:
        fields, where = line.split(maxsplit=9), f"{path}, line {number}"
        if not fields or fields[0].startswith("#"):
            continue
        if len(fields) != 10:
            raise DatasetError(
                f"expected IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME in {where}, got {line!r}. "
                "Each image has two lines, the second with keypoints or empty"
            )
        _, keypoints = next(lines, (0, ""))
        if len(keypoints.split()) % 3:
            raise DatasetError(
                f"expected keypoints X Y POINT3D_ID or an empty line after {where}, got {keypoints[:80]!r}"
            )
        yield [*fields[:9], fields[9].strip()], keypoints.split(), where


def _read_points(lines: Iterable[tuple[int, str]], counts: Mapping[int, int], path: Path) -> ModelPoints:
    positions: list[list[float]] = []
    colors: list[list[int]] = []
    seen: list[tuple[int, int, int]] = []
    for number, line in lines:
        fields = line.split()
        if not fields or fields[0].startswith("#"):
            continue
        position, color, track = _point(fields, counts, f"{path}, line {number}")
        seen += [(len(positions), *observation) for observation in track]
        positions.append(position)
        colors.append(color)
    table = np.array(seen, np.int64).reshape(-1, 3)
    return ModelPoints(
        np.array(positions, np.float64).reshape(-1, 3),
        np.array(colors, np.uint8).reshape(-1, 3),
        table[:, 0],
        table[:, 1],
        table[:, 2],
    )


def _point(
    fields: list[str], counts: Mapping[int, int], where: str
) -> tuple[list[float], list[int], list[tuple[int, int]]]:
    """Return position, colour, and image and keypoint of each observation."""
    try:
        position, color = [float(f) for f in fields[1:4]], [int(f) for f in fields[4:7]]
        if len(fields) < 8 or len(fields) % 2 or not np.isfinite(position).all():
            raise ValueError(f"{len(fields)} fields")
        if not all(0 <= value <= 255 for value in color):
            raise ValueError(f"the colour {' '.join(fields[4:7])}")
        numbers = [int(f) for f in fields[8:]]
        track = list(zip(numbers[::2], numbers[1::2], strict=True))
        for image, keypoint in track:
            if not 0 <= keypoint < counts.get(image, 2**62) or not 0 <= image < 2**32:
                raise ValueError(f"keypoint {keypoint} of image {image}")
    except (ValueError, IndexError, OverflowError) as cause:
        raise DatasetError(
            f"expected {_FIELDS} of keypoints that are there in {where}, got {cause}"
        ) from cause
    return position, color, track


def _numbers(fields: Sequence[str], kind: Callable[[str], float], where: str) -> list[float]:
    try:
        return [kind(field) for field in fields]
    except ValueError as cause:
        shown = " ".join(fields[:12])
        raise DatasetError(f"expected numbers in {where}, got {shown}: {cause}") from cause


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    try:
        text = read_bytes(path, 2**30).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as cause:
        raise DatasetError(f"expected a COLMAP text file at {path}, got {cause}") from cause
    return iter(enumerate(text.splitlines(), 1))

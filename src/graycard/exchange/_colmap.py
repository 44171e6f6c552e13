# SPDX-License-Identifier: Apache-2.0
"""COLMAP's text model: ``cameras.txt``, ``images.txt`` (world to camera, OpenCV axes), ``points3D.txt``.

Held-out views are a model of their own in ``held_out/``: programs that read a model open each of its images.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from graycard._camera import Camera
from graycard._capture import Capture, View
from graycard._errors import DatasetError
from graycard.exchange._cameras import PosedPhotograph, make_camera, source_file, view_name, write_photographs
from graycard.exchange._colmap_points import PointLines, parse_points, point_lines
from graycard.io import decode_text, read_bytes, write_bytes
from graycard.points import Points

MODEL_FOLDERS = ("sparse/0", "sparse", "")
HELD_OUT = "held_out"
_CAMERAS, _IMAGES, _POINTS = "cameras.txt", "images.txt", "points3D.txt"
_UNDISTORT = "Undistort the photographs first, as with `colmap image_undistorter`"
_Intrinsics = tuple[tuple[int, int], tuple[float, float], tuple[float, float]]


def write_colmap(capture: Capture, folder: Path) -> None:
    """Write a capture as ``images/``, ``sparse/0/``, ``held_out/`` and, where granted, ``masks/``.

    Raises:
        DatasetError: A photograph is missing or broken.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    write_photographs(capture, folder, ".png.png")
    _write_model(folder / MODEL_FOLDERS[0], capture.train, point_lines(capture))
    if capture.test:
        _write_model(folder / HELD_OUT, capture.test, PointLines({}, []))


def find_model(folder: Path) -> Path | None:
    """Where a COLMAP model lies in a folder; None if there is none.

    Raises:
        DatasetError: There is one, in COLMAP's binary form.
    """
    places = [folder / place for place in MODEL_FOLDERS]
    for place in places:
        if (place / _CAMERAS).is_file():
            return place
    binary = next((p for p in places if (p / "cameras.bin").is_file()), None)
    if binary is not None:
        raise DatasetError(
            f"expected COLMAP text in {binary}, got its binary form. Run `colmap model_converter "
            f"--input_path {binary} --output_path {binary} --output_type TXT`"
        )
    return None


def read_colmap(folder: Path, model: Path) -> list[PosedPhotograph]:
    """The shots of a COLMAP model, those of ``held_out/`` too; the images are not yet looked at.

    Raises:
        DatasetError: A file is missing or malformed, a camera is distorted, or a pose is none.
    """
    shots = _read_model(folder, model, held_out=False)
    if (folder / HELD_OUT / _CAMERAS).is_file():
        shots += _read_model(folder, folder / HELD_OUT, held_out=True)
    return shots


def read_colmap_points(model: Path, numbers: Mapping[str, int]) -> Points | None:
    """The points of a COLMAP model; None if it holds none.

    Args:
        model: The folder of the model.
        numbers: Index of each training view by name; a point that no other view sees is left out.

    Raises:
        DatasetError: A file is malformed, or a track names an image or a keypoint that is not there.
    """
    path = model / _POINTS
    if not path.is_file():
        return None
    keypoints = {f[0]: (numbers.get(view_name(f[9])), k) for f, k, _ in _image_lines(model / _IMAGES)}
    return parse_points(_lines(path), keypoints, path)


def _write_model(folder: Path, views: Sequence[View], points: PointLines) -> None:
    cameras = list(dict.fromkeys(_camera_fields(v.camera) for v in views))
    numbered = [f"{i} {fields}" for i, fields in enumerate(cameras, 1)]
    _write_lines(folder / _CAMERAS, ["# CAMERA_ID MODEL WIDTH HEIGHT fx fy cx cy", *numbered])
    lines = [
        "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME; the line after each: POINTS2D[] as X Y POINT3D_ID"
    ]
    for i, view in enumerate(views, 1):
        camera_id = 1 + cameras.index(_camera_fields(view.camera))
        lines += [
            f"{i} {_pose_fields(view.camera)} {camera_id} {view.name}.png",
            points.keypoints.get(view.name, ""),
        ]
    _write_lines(folder / _IMAGES, lines)
    _write_lines(
        folder / _POINTS, ["# POINT3D_ID X Y Z R G B ERROR TRACK[] as IMAGE_ID POINT2D_IDX", *points.points]
    )


def _camera_fields(camera: Camera) -> str:
    K = camera.K
    numbers = " ".join(repr(float(x)) for x in (K[0, 0], K[1, 1], K[0, 2], K[1, 2]))
    return f"PINHOLE {camera.width} {camera.height} {numbers}"


def _pose_fields(camera: Camera) -> str:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(camera.world_to_camera[:3, :3]).as_quat()
    return " ".join(repr(float(number)) for number in (w, x, y, z, *camera.world_to_camera[:3, 3]))


def _write_lines(path: Path, lines: Sequence[str]) -> None:
    write_bytes(path, ("\n".join(lines) + "\n").encode())


def _read_model(folder: Path, model: Path, held_out: bool) -> list[PosedPhotograph]:
    cameras = _read_cameras(model / _CAMERAS)
    shots = []
    for fields, _, where in _image_lines(model / _IMAGES):
        camera_id, name = fields[8:]
        if camera_id not in cameras:
            known = ", ".join(cameras) or "none"
            raise DatasetError(f"expected a camera of {_CAMERAS} in {where}, got {camera_id}. Known: {known}")
        pose = _pose(_numbers(fields[1:8], float, where), where)
        mask = source_file(folder / "masks", f"{name}.png", where)
        camera = make_camera(*cameras[camera_id], pose, where)
        image = source_file(folder / "images", name, where)
        shots.append(
            PosedPhotograph(view_name(name), camera, image, mask if mask.is_file() else None, held_out)
        )
    return shots


def _read_cameras(path: Path) -> dict[str, _Intrinsics]:
    """Size, focal lengths and principal point by camera id."""
    cameras: dict[str, _Intrinsics] = {}
    for number, line in _lines(path):
        fields, where = line.split(), f"{path}, line {number}"
        if not fields or fields[0].startswith("#"):
            continue
        if len(fields) < 5:
            raise DatasetError(f"expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS[] in {where}, got {line!r}")
        if fields[0] in cameras:
            raise DatasetError(f"expected camera ids that differ in {path}, got {fields[0]} again in {where}")
        cameras[fields[0]] = _intrinsics(fields, where)
    return cameras


def _intrinsics(fields: Sequence[str], where: str) -> _Intrinsics:
    model, count = fields[1], {"PINHOLE": 4, "SIMPLE_PINHOLE": 3}
    if model not in count:
        raise DatasetError(
            f"expected a PINHOLE or SIMPLE_PINHOLE camera in {where}, got {model}. {_UNDISTORT}"
        )
    if len(fields) != 4 + count[model]:
        raise DatasetError(f"expected {count[model]} parameters of {model} in {where}, got {len(fields) - 4}")
    width, height = _numbers(fields[2:4], int, where)
    *focal, cx, cy = _numbers(fields[4:], float, where)
    return (int(width), int(height)), (focal[0], focal[-1]), (cx, cy)


def _image_lines(path: Path) -> Iterator[tuple[list[str], list[str], str]]:
    """The ten fields of each image, its keypoints, and where they stand."""
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
                f"expected keypoints X Y POINT3D_ID or an empty line after {where}, got {keypoints!r}"
            )
        yield [*fields[:9], fields[9].strip()], keypoints.split(), where


def _pose(numbers: Sequence[float], where: str) -> np.ndarray:
    """Camera to world, shape ``(4, 4)``, from a quaternion (w, x, y, z) and a translation, both inverse."""
    from scipy.spatial.transform import Rotation

    w, x, y, z = numbers[:4]
    length = np.linalg.norm(numbers[:4])
    if not (np.isfinite(numbers).all() and abs(length - 1) < 0.1):
        raise DatasetError(
            f"expected a unit quaternion and a finite translation in {where}, got {list(numbers)}. "
            "Leave this image out"
        )
    rotation = Rotation.from_quat([x, y, z, w]).as_matrix()  # normalises
    pose = np.eye(4)
    pose[:3, :3] = rotation.T
    pose[:3, 3] = -rotation.T @ numbers[4:]
    return pose


def _numbers(fields: Sequence[str], kind: Callable[[str], float], where: str) -> list[float]:
    try:
        return [kind(field) for field in fields]
    except ValueError as cause:
        raise DatasetError(f"expected numbers in {where}, got {' '.join(fields)}: {cause}") from cause


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    try:
        text = decode_text(read_bytes(path, 2**30))
    except (OSError, UnicodeDecodeError) as cause:
        raise DatasetError(f"expected a COLMAP text file at {path}, got {cause}") from cause
    return iter(enumerate(text.splitlines(), 1))

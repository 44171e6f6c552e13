# SPDX-License-Identifier: Apache-2.0
"""nerfstudio's ``transforms.json``: OpenGL camera axes (x right, y up, z backward), camera to world."""

from pathlib import Path
from typing import Any

import numpy as np

from graycard._camera import Camera
from graycard._capture import Capture, View
from graycard._errors import DatasetError
from graycard.exchange._cameras import (
    PosedPhotograph,
    image_name,
    make_camera,
    source_file,
    view_name,
    write_photographs,
)
from graycard.io import read_json, write_json
from graycard.points import Points, read_points, without_tracks, write_points

INDEX = "transforms.json"
CLOUD = "sparse_pc.ply"
PINHOLE_MODELS = ("PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE", "OPENCV", "SIMPLE_RADIAL", "RADIAL")
"""Models that are a pinhole when all their distortion is zero."""
DISTORTION = ("k1", "k2", "k3", "k4", "p1", "p2")
INTRINSICS = ("w", "h", "fl_x", "fl_y", "cx", "cy")
_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])  # OpenCV camera axes to OpenGL ones, and back


def write_nerfstudio(capture: Capture, folder: Path) -> None:
    """Write a capture as ``transforms.json``, ``images/``, ``sparse_pc.ply`` and, where granted, ``masks/``.

    Frames of held-out views stand last, named in ``test_filenames``, without a file. Training checks itself
    on training photographs (``val_filenames``), since nerfstudio refuses a folder without such a list.

    Raises:
        DatasetError: A photograph is missing or broken.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    write_photographs(capture, folder, ".png")
    train, test = ([image_name(v) for v in views] for views in (capture.train, capture.test))
    index = {
        "camera_model": "PINHOLE",
        "orientation_override": "none",
        "frames": [_frame(view, capture.target is not None) for view in (*capture.train, *capture.test)],
        "train_filenames": train,
        "val_filenames": train,
        "test_filenames": test,
    }
    points = capture.points()
    if len(points):
        write_points(folder / CLOUD, points, tracks=False)
        index["ply_file_path"] = CLOUD
    write_json(folder / INDEX, index)


def read_nerfstudio(folder: Path) -> list[PosedPhotograph]:
    """The shots of a folder with ``transforms.json``; the images are not yet looked at.

    Raises:
        DatasetError: The file is missing or malformed, a camera is distorted, or a pose is none.
    """
    path = folder / INDEX
    index = read_json(path, DatasetError)
    frames = index.get("frames") if isinstance(index, dict) else None
    if not isinstance(frames, list) or not all(isinstance(f, dict) for f in frames):
        raise DatasetError(f"expected a list 'frames' of objects in {path}, got {type(frames).__name__}")
    train, val, test = (
        _names_listed(index, f"{split}_filenames", path) for split in ("train", "val", "test")
    )
    held_out = (val | test) - train
    return [_shot(frame, index, held_out, folder, f"{path}, frame {i}") for i, frame in enumerate(frames)]


def read_nerfstudio_points(folder: Path) -> Points | None:
    """The points that ``transforms.json`` names, without tracks; None if it names none.

    Raises:
        DatasetError: Their file is missing or broken.
    """
    name = read_json(folder / INDEX, DatasetError).get("ply_file_path")
    if name is None:
        return None
    if not isinstance(name, str):
        raise DatasetError(f"expected ply_file_path as text in {folder / INDEX}, got {name!r}")
    found = read_points(source_file(folder, name, str(folder / INDEX)))
    return without_tracks(found.positions, found.colors, found.said)


def _frame(view: View, masked: bool) -> dict[str, Any]:
    camera = view.camera
    numbers = camera.width, camera.height, camera.K[0, 0], camera.K[1, 1], camera.K[0, 2], camera.K[1, 2]
    return {
        "file_path": image_name(view),
        **({"mask_path": f"masks/{view.name}.png"} if masked else {}),
        **dict(zip(INTRINSICS, numbers, strict=True)),
        "transform_matrix": camera.camera_to_world @ _FLIP,
    }


def _shot(
    frame: dict[str, Any], index: dict[str, Any], held_out: set[str], folder: Path, where: str
) -> PosedPhotograph:
    image, mask = frame.get("file_path"), frame.get("mask_path")
    if not isinstance(image, str) or not isinstance(mask, str | None):
        raise DatasetError(
            f"expected file_path (and mask_path) as text in {where}, got {image!r} and {mask!r}"
        )
    return PosedPhotograph(
        view_name(image),
        _camera({**index, **frame}, where),
        source_file(folder, image, where),
        None if mask is None else source_file(folder, mask, where),
        image in held_out,
    )


def _camera(entry: dict[str, Any], where: str) -> Camera:
    """The camera of a frame; what the frame does not say is said for all frames at the top."""
    model = str(entry.get("camera_model", "PINHOLE")).upper()
    bent = {k: entry[k] for k in DISTORTION if entry.get(k)}
    if model not in PINHOLE_MODELS or bent:
        raise DatasetError(
            f"expected a pinhole camera without distortion in {where}, got {model} with {bent or 'no'} "
            "distortion. Undistort the photographs first, as with `colmap image_undistorter`"
        )
    w, h, fx, fy, cx, cy = (_number(entry, name, where) for name in INTRINSICS)
    return make_camera((int(w), int(h)), (fx, fy), (cx, cy), _pose(entry, where), where)


def _number(entry: dict[str, Any], name: str, where: str) -> float:
    value = entry.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or (name in "wh" and value % 1):
        kind = "a whole number" if name in "wh" else "a number"
        raise DatasetError(f"expected {name} as {kind} in {where} or for all frames, got {value!r}. Add it")
    return float(value) if name not in "wh" else int(value)


def _pose(entry: dict[str, Any], where: str) -> np.ndarray:
    """Camera to world, shape ``(4, 4)``, OpenCV axes."""
    given = entry.get("transform_matrix")
    try:
        matrix = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        matrix = np.empty(0)
    if matrix.shape not in ((4, 4), (3, 4)):
        raise DatasetError(f"expected transform_matrix as 4x4 numbers in {where}, got {given!r}")
    return np.vstack([matrix[:3], matrix[3:] if len(matrix) == 4 else [[0, 0, 0, 1]]]) @ _FLIP


def _names_listed(index: dict[str, Any], key: str, path: Path) -> set[str]:
    names = index.get(key, [])
    if not isinstance(names, list) or not all(isinstance(n, str) for n in names):
        raise DatasetError(f"expected {key} as a list of file names in {path}, got {names!r}")
    known = {f.get("file_path") for f in index["frames"]}
    if unknown := sorted(set(names) - known):
        raise DatasetError(f"expected {key} in {path} to name frames, got {unknown[0]!r}, which is none")
    return set(names)

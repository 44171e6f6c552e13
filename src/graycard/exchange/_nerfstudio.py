# SPDX-License-Identifier: Apache-2.0
"""nerfstudio's ``transforms.json``: OpenGL camera axes (x right, y up, z backward), camera to world."""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from graycard._capture import Capture, View
from graycard._errors import DatasetError
from graycard.exchange._cameras import (
    PosedPhotograph,
    image_name,
    make_shot,
    photograph_file,
    source_file,
    view_name,
    write_photographs,
)
from graycard.exchange._doctor import ImportRow, some
from graycard.exchange._lens import Intrinsics, make_intrinsics
from graycard.exchange.pictures import find_picture, read_header
from graycard.io import read_json, write_json
from graycard.points import Points, read_points, without_tracks, write_points

INDEX = "transforms.json"
CLOUD = "sparse_pc.ply"
PERSPECTIVE = ("PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE", "OPENCV", "SIMPLE_RADIAL", "RADIAL", "FULL_OPENCV")
"""Models of OpenCV's radial and tangential distortion, each with the same keys."""
FISHEYES = ("OPENCV_FISHEYE", "FISHEYE", "SIMPLE_FISHEYE", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE")
DISTORTION = ("k1", "k2", "k3", "k4", "p1", "p2")
"""Keys in the order of ``distortion_params``."""
_BENDS = re.compile(r"[kps]\d+|s[xy]\d+|tau_?[xy]|omega|b[12]", re.IGNORECASE)
"""Keys by which programs write distortion of one kind or another."""
INTRINSICS = ("w", "h", "fl_x", "fl_y", "cx", "cy")
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])  # OpenCV camera axes to OpenGL ones, and back


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


def read_nerfstudio(folder: Path) -> tuple[list[PosedPhotograph], list[ImportRow]]:
    """Return the shots of a folder with ``transforms.json``; of the images at most the size is looked at.

    Where the file lists training frames, frames of no list are left out, and a row says so.

    Raises:
        DatasetError: The file is missing or malformed, a camera is of an unknown model, or a pose is none.
    """
    path = folder / INDEX
    index = read_json(path, DatasetError)
    frames = frames_of(index, path)
    train, val, test = (
        _names_listed(index, f"{split}_filenames", path) for split in ("train", "val", "test")
    )
    held_out = (val | test) - train
    shots = [shot_of(frame, index, folder, f"{path}, frame {i}") for i, frame in enumerate(frames)]
    names = [frame["file_path"] for frame in frames]
    shots = [replace(shot, held_out=name in held_out) for shot, name in zip(shots, names, strict=True)]
    deep = sum("depth_file_path" in frame for frame in frames)
    rows = [ImportRow("depths", deep, "of depth_file_path are not read")] if deep else []
    if not train:
        return shots, rows
    named = train | held_out
    kept = [shot for shot, name in zip(shots, names, strict=True) if name in named]
    others = [shot.name for shot, name in zip(shots, names, strict=True) if name not in named]
    said = f"left out, as no list of {INDEX} names them: {some(others)}"
    return kept, [*rows, *([ImportRow("cameras", len(others), said, warns=True)] if others else [])]


def frames_of(index: Any, path: Path) -> list[dict[str, Any]]:
    """Return the frames of a file of cameras.

    Raises:
        DatasetError: It has none, or one is no object.
    """
    frames = index.get("frames") if isinstance(index, dict) else None
    if isinstance(frames, dict):  # numbered, as TensoIR writes its captures
        frames = list(frames.values())
    if not isinstance(frames, list) or not all(isinstance(f, dict) for f in frames):
        raise DatasetError(f"expected a list 'frames' of objects in {path}, got {type(frames).__name__}")
    return frames


def shot_of(frame: Mapping[str, Any], index: Mapping[str, Any], folder: Path, where: str) -> PosedPhotograph:
    """Return the photograph of a frame; what the frame does not say is said for all frames at the top.

    Args:
        frame: An entry of ``frames``.
        index: The whole file.
        folder: Where its paths begin.
        where: File and entry, for messages.

    Raises:
        DatasetError: A number is missing or none, a path leads out, or the lens is not known.
    """
    image, mask = frame.get("file_path"), frame.get("mask_path")
    if not isinstance(image, str) or not isinstance(mask, str | None):
        raise DatasetError(
            f"expected file_path (and mask_path) as text in {where}, got {image!r} and {mask!r}"
        )
    file = photograph_file(folder, image, where)
    entry = {**index, **frame}
    shot = make_shot(file, view_name(image), _intrinsics(entry, file, where), _pose(entry, where), where)
    return replace(shot, mask=None if mask is None else source_file(folder, mask, where))


def _intrinsics(entry: Mapping[str, Any], file: Path, where: str) -> Intrinsics:
    """Return size, focal lengths, principal point and lens of a frame.

    Without ``fl_x`` the field's rule for rendered photographs holds: ``camera_angle_x`` across the width,
    square pixels, and the principal point in the middle. Without a size the photograph says it.
    """
    if "fl_x" in entry or "camera_angle_x" not in entry:
        w, h, fx, fy, cx, cy = (_number(entry, name, where) for name in INTRINSICS)
        return _bent(entry, (int(w), int(h)), (fx, fy, cx, cy), where)
    if "w" in entry and "h" in entry:
        w, h = (int(_number(entry, name, where)) for name in "wh")
    else:
        header = read_header(find_picture(file))
        w, h = header.width, header.height
    angle = _number(entry, "camera_angle_x", where)
    if not 0 < angle < np.pi:
        raise DatasetError(f"expected camera_angle_x between 0 and pi in {where}, got {angle:g}. Mend it")
    fx = 0.5 * w / np.tan(0.5 * angle)
    fy = 0.5 * h / np.tan(0.5 * _number(entry, "camera_angle_y", where)) if "camera_angle_y" in entry else fx
    cx, cy = (_number(entry, n, where) if n in entry else side / 2 for n, side in (("cx", w), ("cy", h)))
    return _bent(entry, (w, h), (fx, fy, cx, cy), where)


def _bent(
    entry: Mapping[str, Any], size: tuple[int, int], pinhole: tuple[float, ...], where: str
) -> Intrinsics:
    """Return the camera with its distortion in whatever way a file writes it; anything else is refused."""
    model, bends = str(entry.get("camera_model", "PINHOLE")).upper(), _distortion(entry, where)
    if entry.get("is_fisheye"):
        model = "OPENCV_FISHEYE"
    known = {"FULL_OPENCV": ("k5", "k6"), **dict.fromkeys(FISHEYES, ("k4",))}.get(model, ())
    if model == "FULL_OPENCV":
        known = ("k4", *known)
    usual = ("k1", "k2", "k3") if model in FISHEYES else ("k1", "k2", "k3", "p1", "p2")
    strange = {key: value for key, value in bends.items() if key not in {*usual, *known}}
    if model not in (*PERSPECTIVE, *FISHEYES) or strange:
        named = ", ".join(f"{key} {value:g}" for key, value in strange.items())
        raise DatasetError(
            f"expected a camera of model {', '.join((*PERSPECTIVE, *FISHEYES))} with distortion that it "
            f"knows in {where}, got {model}{' with ' + named if named else ''}. Name the right camera_model "
            "(k4 to k6 are of FULL_OPENCV, k4 of OPENCV_FISHEYE too), or undistort the photographs first"
        )
    k1, k2, p1, p2, k3, k4, k5, k6 = (
        bends.get(k, 0.0) for k in ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    )
    if model in FISHEYES:
        return make_intrinsics("OPENCV_FISHEYE", size, (*pinhole, k1, k2, k3, k4), where)
    if k3 or k4 or k5 or k6:
        return make_intrinsics("FULL_OPENCV", size, (*pinhole, k1, k2, p1, p2, k3, k4, k5, k6), where)
    return make_intrinsics("OPENCV", size, (*pinhole, k1, k2, p1, p2), where)


def _distortion(entry: Mapping[str, Any], where: str) -> dict[str, float]:
    """Return the coefficients that are not zero, by key; ``distortion_params`` are k1 to k4, p1, p2."""
    listed = entry.get("distortion_params") or []
    if not isinstance(listed, list) or len(listed) > len(DISTORTION):
        raise DatasetError(
            f"expected distortion_params as up to {len(DISTORTION)} numbers, {', '.join(DISTORTION)}, in "
            f"{where}, got {listed!r}. Mend them"
        )
    named = {key.lower(): value for key, value in entry.items() if _BENDS.fullmatch(key)}
    listed = dict(zip(DISTORTION, listed, strict=False))
    if twice := [k for k, value in listed.items() if value and named.get(k, value) != value]:
        raise DatasetError(
            f"expected distortion once in {where}, got {twice[0]} {named[twice[0]]!r} and another in "
            "distortion_params. Leave one out"
        )
    found = {key: _number({**listed, **named}, key, where) for key in (*listed, *named)}
    return {key: value for key, value in found.items() if value}


def _number(entry: Mapping[str, Any], name: str, where: str) -> float:
    value = entry.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or (name in "wh" and value % 1):
        kind = "a whole number" if name in "wh" else "a number"
        raise DatasetError(f"expected {name} as {kind} in {where} or for all frames, got {value!r}. Add it")
    return float(value) if name not in "wh" else int(value)


def read_nerfstudio_points(folder: Path) -> Points | None:
    """Return the points that ``transforms.json`` names, without tracks; None if it names none.

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
        "transform_matrix": camera.camera_to_world @ FLIP,
    }


def _pose(entry: Mapping[str, Any], where: str) -> np.ndarray:
    """Camera to world, shape ``(4, 4)``, OpenCV axes."""
    given = entry.get("transform_matrix")
    try:
        matrix = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        matrix = np.empty(0)
    if matrix.shape not in ((4, 4), (3, 4)):
        raise DatasetError(f"expected transform_matrix as 4x4 numbers in {where}, got {given!r}")
    return np.vstack([matrix[:3], matrix[3:] if len(matrix) == 4 else [[0, 0, 0, 1]]]) @ FLIP


def _names_listed(index: dict[str, Any], key: str, path: Path) -> set[str]:
    names = index.get(key, [])
    if not isinstance(names, list) or not all(isinstance(n, str) for n in names):
        raise DatasetError(f"expected {key} as a list of file names in {path}, got {names!r}")
    known = {f.get("file_path") for f in frames_of(index, path)}
    if unknown := sorted(set(names) - known):
        raise DatasetError(f"expected {key} in {path} to name frames, got {unknown[0]!r}, which is none")
    return set(names)

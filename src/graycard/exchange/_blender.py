# SPDX-License-Identifier: Apache-2.0
"""The layout of NeRF-synthetic: ``transforms_train.json``, ``_val`` and ``_test``, as Blender wrote it.

Cameras are those of nerfstudio (OpenGL axes); one ``camera_angle_x`` stands for all of them.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from graycard._camera import Camera
from graycard._capture import Capture, View
from graycard._errors import DatasetError
from graycard.exchange._cameras import PosedPhotograph
from graycard.exchange._doctor import ImportRow
from graycard.exchange._nerfstudio import FLIP, frames_of, shot_of
from graycard.exchange._photographs import write_photograph
from graycard.io import read_json, write_json

SPLITS = ("train", "val", "test")
TRAIN = "transforms_train.json"
HELD_OUT = "held_out/transforms.json"
"""Cameras without photographs in a folder that we wrote, where no loader looks: each opens what is listed."""
_NEAR = 1e-6
"""Pixels by which focal lengths and principal points may differ and still be one camera."""


def read_blender(folder: Path) -> tuple[list[PosedPhotograph], list[ImportRow]]:
    """Return the shots of a folder with ``transforms_train.json``, and what there is to say of them.

    All but those of ``train`` are held out.

    Raises:
        DatasetError: A file is missing or malformed, or a pose is none.
    """
    shots: list[PosedPhotograph] = []
    rows: list[ImportRow] = []
    seen: set[Path] = set()
    for split, path in (*((s, folder / f"transforms_{s}.json") for s in SPLITS), ("test", folder / HELD_OUT)):
        if not path.is_file():
            continue
        index = read_json(path, DatasetError)
        frames = frames_of(index, path)
        if shots and "w" not in index:  # photographs of held-out views need not be there
            index = {**index, "w": shots[0].size[0], "h": shots[0].size[1]}
        found = [_shot(frame, index, path.parent, f"{path}, frame {i}") for i, frame in enumerate(frames)]
        new = [shot for shot in found if shot.image not in seen]
        if again := len(found) - len(new):
            rows.append(ImportRow("views", again, f"of {path.name} taken once: other lists have them too"))
        seen |= {shot.image for shot in new}
        shots += [replace(shot, held_out=split != "train") for shot in new]
        rows += _lights(frames)
    return shots, rows


def write_blender(capture: Capture, folder: Path) -> None:
    """Write a capture as NeRF-synthetic: ``transforms_*.json`` and ``train/<view>.png``, opaque RGBA.

    Loaders open each photograph of all three lists, and take the last channel for alpha. So
    ``transforms_val.json`` and ``transforms_test.json`` repeat training photographs, and cameras of held-out
    views stand in ``held_out/transforms.json``.

    Raises:
        DatasetError: Cameras differ or have another than square pixels around a centred principal point,
            which this layout cannot say; or a photograph is missing or broken.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    angle = angle_of([view.camera for view in capture.views])
    files = _files(capture.views)
    for view in capture.train:
        linear = capture.photograph(view) * capture.exposure
        write_photograph(folder / f"{files[view.name]}.png", linear, opaque=True)
    lists = {**{f"transforms_{split}.json": capture.train for split in SPLITS}, HELD_OUT: capture.test}
    for name, views in lists.items():
        frames = [_frame(view, files[view.name]) for view in views]
        if frames:
            write_json(folder / name, {"camera_angle_x": angle, "frames": frames})


def _files(views: Sequence[View]) -> dict[str, str]:
    """Return the path of each view, without suffix; import joins folder and name, so no name is doubled."""
    names = {view.name for view in views}
    short = {v.name: v.name.removeprefix(f"{v.split}_") for v in views}
    return {
        v.name: f"./{v.split}/{v.name if short[v.name] in ('', *(names - {v.name})) else short[v.name]}"
        for v in views
    }


def angle_of(cameras: list[Camera]) -> float:
    """Return the angle across the width that all cameras have, radians.

    Raises:
        DatasetError: They differ, or are no plain ones.
    """
    first = cameras[0]
    w, h, f = first.width, first.height, first.K[0, 0]
    plain = np.array([[f, 0, w / 2], [0, f, h / 2], [0, 0, 1]])
    odd = [c for c in cameras if (c.width, c.height) != (w, h) or np.abs(c.K - plain).max() > _NEAR]
    if odd:
        raise DatasetError(
            "expected cameras of one size and one focal length, with square pixels and the principal point "
            f"in the middle, as this layout can say, got {len(odd)} of {len(cameras)} that are not. Export "
            "as nerfstudio or colmap"
        )
    return float(2 * np.arctan(0.5 * w / f))


def _shot(frame: dict[str, Any], index: dict[str, Any], folder: Path, where: str) -> PosedPhotograph:
    return replace(shot_of(frame, index, folder, where), cutout=True)


def _frame(view: View, file: str) -> dict[str, Any]:
    return {
        "file_path": file,
        "rotation": 0.0,
        "transform_matrix": view.camera.camera_to_world @ FLIP,
    }


def _lights(frames: list[dict[str, Any]]) -> list[ImportRow]:
    lit = {frame["light_idx"] for frame in frames if isinstance(frame.get("light_idx"), int)}
    if len(lit) < 2:
        return []
    said = f"taken under {len(lit)} different lights, as light_idx says; they are imported as one scene"
    return [ImportRow("views", len(frames), said, warns=True)]

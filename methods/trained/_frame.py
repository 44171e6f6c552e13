# SPDX-License-Identifier: Apache-2.0
"""Place a splat's world in that of a scene: programs move, turn and scale what they train on."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tokenize import TokenError
from typing import Literal, get_args

import numpy as np

from graycard import Camera, DatasetError
from graycard.io import read_bytes, read_json

FrameKind = Literal["nerfstudio", "matrix"]
FRAMES = get_args(FrameKind)
RIGID = 1e-3
"""Largest distance from one of a rotation times its transpose: files hold float32, and fewer digits."""


@dataclass(frozen=True, eq=False)
class Frame:
    """A similarity from the world of a scene to that of a splat: ``scale * turn @ x + shift``."""

    turn: np.ndarray
    """Shape ``(3, 3)``, a rotation."""
    shift: np.ndarray
    """Shape ``(3,)``, in the unit of the splat."""
    scale: float = 1.0
    """Units of the splat a metre."""

    def camera(self, camera: Camera) -> Camera:
        """Return the same camera in the world of the splat: what is seen there is what is seen
        here, scaled.
        """
        pose = np.eye(4)
        pose[:3, :3] = self.turn @ camera.camera_to_world[:3, :3]
        pose[:3, 3] = self.scale * self.turn @ camera.position + self.shift
        return Camera(camera.width, camera.height, camera.K, pose)


SAME = Frame(np.eye(3), np.zeros(3))
"""A splat that was trained in the scene's own world."""


def read_frame(kind: FrameKind, path: Path, applied: Path | None = None) -> Frame:
    """Read how a program has moved the world.

    Args:
        kind: ``nerfstudio``: its ``dataparser_transforms.json`` (beside ``config.yml``), which holds a
            ``transform`` of shape (3, 4) that it applied first, and a ``scale`` that it applied then.
            ``matrix``: a file with the 16 numbers of a (4, 4) matrix from the scene's world to the splat's,
            as text, JSON or NPY.
        path: The file.
        applied: ``transforms.json`` that the scene was imported from, if ``ns-process-data`` of nerfstudio
            wrote it: it has moved the world before.

    Raises:
        DatasetError: It is missing, or holds no similarity.
    """
    found = _of_nerfstudio(Path(path), applied) if kind == "nerfstudio" else _of_matrix(Path(path))
    matrix = np.asarray(found, dtype=np.float64)
    if not np.isfinite(matrix).all():
        raise DatasetError(f"expected finite numbers in {path}, got {matrix.tolist()}")
    return _similarity(matrix, Path(path))


def _of_nerfstudio(path: Path, applied: Path | None) -> np.ndarray:
    """From the coordinates of ``transforms.json`` to those that were trained in.

    ``transform`` begins at the original coordinates, as COLMAP's, from which ``applied_transform`` and
    ``applied_scale`` led to those of the file (``nerfstudio_dataparser.py``): these are taken back.
    """
    data, before = _record(path), {} if applied is None else _record(applied)
    last = np.array([0.0, 0.0, 0.0, 1.0])
    whole = np.vstack([_numbers(data.get("transform"), path, (3, 4)), last])
    first = np.vstack(
        [_numbers(before.get("applied_transform", np.eye(3, 4)), applied or path, (3, 4)), last]
    )
    scale = _number(data, "scale", path)
    scale /= _number({"applied_scale": 1.0, **before}, "applied_scale", applied or path)
    if abs(np.linalg.det(first)) < 1e-9:
        raise DatasetError(
            f"expected an applied_transform that can be undone in {applied}, got {first[:3].tolist()}"
        )
    return np.diag([scale, scale, scale, 1.0]) @ whole @ np.linalg.inv(first)


def _record(path: Path) -> dict[str, object]:
    data = read_json(path, DatasetError)
    return data if isinstance(data, dict) else {}


def _number(data: dict[str, object], key: str, path: Path) -> float:
    value = data.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not value:
        raise DatasetError(
            f"expected a number other than 0 as {key} in {path}, got {value!r}. Give the file of nerfstudio"
        )
    return float(value)


def _of_matrix(path: Path) -> np.ndarray:
    try:
        if path.suffix.lower() == ".npy":
            return _numbers(np.load(path, allow_pickle=False), path, (4, 4))
        text = read_bytes(path).decode("utf-8-sig")
        values = json.loads(text) if text.lstrip().startswith("[") else text.replace(",", " ").split()
    except OSError as cause:
        raise DatasetError(f"expected a matrix at {path}, got {cause.strerror or cause}") from cause
    except (ValueError, EOFError, RecursionError, SyntaxError, TokenError) as cause:
        raise DatasetError(f"expected a matrix at {path}, got a file that is none: {cause}") from cause
    return _numbers(values, path, (4, 4))


def _numbers(values: object, path: Path, shape: Sequence[int]) -> np.ndarray:
    """Return an array of a shape, from nested or flat lists."""
    try:
        found = np.array(values, dtype=np.float64)
        return found.reshape(shape)
    except (TypeError, ValueError) as cause:
        raise DatasetError(
            f"expected {' x '.join(map(str, shape))} numbers in {path}, got {str(values)[:80]}"
        ) from cause


def _similarity(matrix: np.ndarray, path: Path) -> Frame:
    """Return the parts of a matrix.

    Raises:
        DatasetError: It mirrors, shears, or scales axes differently.
    """
    volume = np.linalg.det(matrix[:3, :3])
    scale = np.cbrt(volume)
    turn = matrix[:3, :3] / scale if volume > 0 else matrix[:3, :3]
    rigid = volume > 0 and np.allclose(turn @ turn.T, np.eye(3), atol=RIGID)
    if not rigid or not np.allclose(matrix[3], [0, 0, 0, 1], atol=1e-9):
        raise DatasetError(
            f"expected a turn, a scale above 0 and a shift in {path}, got {matrix.round(4).tolist()}. Give "
            "the matrix from the scene's world to the splat's, last row 0 0 0 1"
        )
    u, _, vt = np.linalg.svd(turn)
    return Frame(u @ vt, matrix[:3, 3], float(scale))

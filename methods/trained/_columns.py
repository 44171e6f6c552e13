# SPDX-License-Identifier: Apache-2.0
"""From the columns of a file to a trained splat: the names, the order and the activations of the field.

The layout is that of INRIA's ``GaussianModel.save_ply`` (graphdeco-inria/gaussian-splatting,
``scene/gaussian_model.py``): x y z nx ny nz f_dc_0..2 f_rest_* opacity scale_* rot_0..3. Scales are
logarithms, opacities logits, quaternions (w, x, y, z) of any length; ``f_rest`` goes channel by channel.

- 2D Gaussian Splatting (hbb1/2d-gaussian-splatting) writes the same with two scales.
- nerfstudio (``scripts/exporter.py``, ``ExportGaussianSplat``) the same; with ``--ply-color-mode rgb`` it
  has red, green, blue (uchar) in the place of ``f_dc``.
- gsplat (``exporter.py``, ``splat2ply_bytes``) the same without normals.
- OpenSplat (``model.cpp``, ``savePly``) as INRIA's.
- brush (``brush-serde/src/export.rs``) in another order, and "SplatRenderMode: mip" as a comment.

Properties are found by name, so that their order does not matter.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import torch

from graycard import DatasetError
from graycard.methods.splat import DISCS, SH_DC, Gaussians, Surfels
from graycard.methods.trained._trained import Primitive, TrainedSplat

POSITION, DC, RGB = ("x", "y", "z"), ("f_dc_0", "f_dc_1", "f_dc_2"), ("red", "green", "blue")
TURN = ("rot_0", "rot_1", "rot_2", "rot_3")
SCALES = ("scale_0", "scale_1", "scale_2")
SMOOTHED = "filter_3D"
"""Column of Mip-Splatting: sizes and opacities that are not yet those that are drawn."""
NORMALS = ("nx", "ny", "nz")
DEGREES = {0: 0, 9: 1, 24: 2, 45: 3}
"""Degree of the harmonics by the number of ``f_rest`` columns."""
MANY = 20
"""Gaussians from which on it is no chance that numbers are all of one kind."""
SMALLEST, LARGEST = 1e-12, 1e12
"""Standard deviations in the unit of the file: a smaller one is drawn as this, a larger one is refused."""


def splat_of(
    columns: Mapping[str, np.ndarray],
    path: Path,
    primitive: Primitive | None = None,
    comments: Sequence[str] = (),
) -> TrainedSplat:
    """Return the splat that columns by name describe.

    Args:
        columns: One number a Gaussian each, in any type.
        path: For messages.
        primitive: What they are drawn as; None lets the file decide.
        comments: Of the file.

    Raises:
        DatasetError: Columns are missing or hold what none can be drawn with.
    """
    kind = primitive or _kind(columns, comments)
    _check_names(columns, path, kind)
    axes = SCALES[: 2 if kind == "2dgs" else 3]
    centres, scales = _block(columns, POSITION, path), _sizes(columns, axes, path)
    numbers = centres, _turns(columns, path), scales, _opacities(columns, path), np.empty((len(centres), 0))
    tensors = [torch.from_numpy(values.astype(np.float32, copy=False)) for values in numbers]
    shapes = Surfels(*tensors) if kind == "2dgs" else Gaussians(*tensors)
    return TrainedSplat(
        shapes,
        torch.from_numpy(_coefficients(columns, path)),
        any(comment.lower().replace(" ", "") == "splatrendermode:mip" for comment in comments),
        tuple(name for name in columns if not _is_used(name)),
        tuple(_doubts(columns, axes)),
    )


def _doubts(columns: Mapping[str, np.ndarray], axes: Sequence[str]) -> Iterator[str]:
    """Yield what looks as if activations had been applied before, or a rotation been lost."""
    many = len(columns["opacity"]) >= MANY
    if many and columns["opacity"].min() >= 0 and columns["opacity"].max() <= 1:
        yield (
            "opacities lie between 0 and 1, all of them: training writes logits, so these may have been "
            "through the sigmoid before"
        )
    if many and all(columns[name].min() > 0 for name in axes):
        yield (
            "scales are above 0, all of them: training writes logarithms, so these may be sizes, which are "
            "drawn far too large"
        )
    none = (np.stack([columns[name] for name in TURN]) == 0).all(axis=0)
    if none.any():
        yield f"{none.sum()} of {len(none)} rotations have length zero: these Gaussians are not turned"


def _kind(columns: Mapping[str, np.ndarray], comments: Sequence[str]) -> Primitive:
    flat = "scale_1" in columns and "scale_2" not in columns
    return "2dgs" if flat or any(comment == DISCS for comment in comments) else "3dgs"


def _is_used(name: str) -> bool:
    known = (*POSITION, *DC, *RGB, *TURN, *SCALES, *NORMALS, "opacity")
    return name in known or name.startswith("f_rest_")


def _check_names(columns: Mapping[str, np.ndarray], path: Path, kind: Primitive) -> None:
    """Refuse columns that are no trained splat, or one that is stored in a way that is not known here."""
    if set(POSITION) <= columns.keys() and not {"opacity", "scale_0", "rot_0"} & columns.keys():
        raise DatasetError(
            f"expected a trained splat at {path}, got a cloud of points. Give the PLY that training wrote, "
            "as point_cloud/iteration_30000/point_cloud.ply"
        )
    colour = DC if DC[0] in columns or RGB[0] not in columns else RGB
    axes = SCALES[: 2 if kind == "2dgs" else 3]
    missing = [name for name in (*POSITION, *colour, "opacity", *axes, *TURN) if name not in columns]
    if missing:
        raise DatasetError(
            f"expected the properties of a {kind} splat at {path}, got none of {', '.join(missing)}. Export "
            "it again in the layout of INRIA's code"
        )
    if SMOOTHED in columns:
        raise DatasetError(
            f"expected sizes and opacities as they are drawn at {path}, got {SMOOTHED} of Mip-Splatting "
            "beside them. Give the file that its create_fused_ply.py writes"
        )


def _block(columns: Mapping[str, np.ndarray], names: Sequence[str], path: Path) -> np.ndarray:
    """Columns side by side, float32 ``(N, len(names))``.

    Raises:
        DatasetError: A number is none.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # what float32 cannot hold is refused as infinite
        block = np.stack([columns[name] for name in names], axis=1).astype(np.float32)
    _refuse(~np.isfinite(block), names, path, "finite numbers")
    return block


def _refuse(bad: np.ndarray, names: Sequence[str], path: Path, rule: str) -> None:
    if bad.any():
        row, column = (int(index) for index in np.argwhere(bad)[0])
        many = int(bad.any(axis=1).sum())
        raise DatasetError(
            f"expected {rule} in {path}, got another {names[column]} in row {row} ({many} such rows). Leave "
            "these Gaussians out and export again"
        )


def _sizes(columns: Mapping[str, np.ndarray], names: Sequence[str], path: Path) -> np.ndarray:
    """Return standard deviations, ``(N, axes)``: exp of what is stored, where minus infinity is an empty
    axis.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        sizes = np.exp(np.stack([columns[name] for name in names], axis=1).astype(np.float64))
    _refuse(~(sizes <= LARGEST), names, path, f"logarithms of sizes up to {LARGEST:g}")
    return np.maximum(sizes, SMALLEST).astype(np.float32)


def _turns(columns: Mapping[str, np.ndarray], path: Path) -> np.ndarray:
    """Return unit quaternions, ``(N, 4)``; one of length zero turns nothing, as in INRIA's code."""
    turns = _block(columns, TURN, path).astype(np.float64)
    lengths = np.linalg.norm(turns, axis=1, keepdims=True)
    none = lengths == 0
    return np.where(none, [1.0, 0, 0, 0], turns / np.where(none, 1.0, lengths)).astype(np.float32)


def _opacities(columns: Mapping[str, np.ndarray], path: Path) -> np.ndarray:
    """Return the sigmoid of what is stored, ``(N,)``; infinite logits are those of 0 and 1."""
    with np.errstate(over="ignore", invalid="ignore"):
        logits = np.asarray(columns["opacity"], dtype=np.float64)
        _refuse(np.isnan(logits)[:, None], ["opacity"], path, "logits of opacities")
        return (1 / (1 + np.exp(-logits))).astype(np.float32)


def _coefficients(columns: Mapping[str, np.ndarray], path: Path) -> np.ndarray:
    """Harmonics, ``(N, K, 3)``."""
    if DC[0] in columns:
        constant = _block(columns, DC, path)
    else:
        constant = (_block(columns, RGB, path) / np.float32(255) - np.float32(0.5)) / np.float32(SH_DC)
    rest = sum(name.startswith("f_rest_") for name in columns)
    names = [f"f_rest_{number}" for number in range(rest)]
    if rest not in DEGREES or not set(names) <= columns.keys():
        raise DatasetError(
            f"expected 0, 9, 24 or 45 properties f_rest_0, f_rest_1, … at {path}, for harmonics of "
            f"degree 0 to 3, got {rest}. Export fewer degrees"
        )
    if not rest:
        return constant[:, None]
    others = _block(columns, names, path).reshape(len(constant), 3, rest // 3)
    return np.concatenate([constant[:, None], others.transpose(0, 2, 1)], axis=1)

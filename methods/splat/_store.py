# SPDX-License-Identifier: Apache-2.0
"""Surfels on disk: safetensors to go on with, PLY to look at in other people's viewers."""

import json
from dataclasses import fields
from pathlib import Path

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from graycard import MethodError
from graycard.io import write_bytes
from graycard.methods.splat._surfels import Surfels

FORMAT = {"format": "graycard-surfels", "version": "1"}
SH_DC = 0.5 / np.sqrt(np.pi)
"""The constant spherical harmonic Y00: viewers show ``0.5 + SH_DC * f_dc``."""
DISCS = "graycard surfels: the third scale, if there is one, is empty"
"""Comment of PLY files, by which a reader knows discs from ellipsoids."""
ALL_SH = 16
"""Harmonics up to degree three."""
FLAT = 1e-6
"""Metres: the third scale that makes a disc of what viewers take for an ellipsoid."""


def save_surfels(path: Path, surfels: Surfels) -> None:
    """Write surfels as safetensors, whole or not at all, bit by bit as they are.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    tensors = {f.name: getattr(surfels, f.name).detach().cpu().contiguous() for f in fields(surfels)}
    write_bytes(path, save(tensors, metadata=FORMAT))


def load_surfels(path: Path) -> Surfels:
    """Surfels that :func:`save_surfels` wrote, on the CPU.

    Raises:
        MethodError: The file is missing, damaged, or holds something else.
    """
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - no mapping
        if metadata != FORMAT:
            raise ValueError(f"metadata {json.dumps(metadata)}")
        return Surfels(**tensors)
    except (OSError, SafetensorError, TypeError, ValueError) as cause:
        raise MethodError(f"expected surfels that graycard saved in {path}, got: {cause}") from cause


def export_ply(path: Path, surfels: Surfels, colours: torch.Tensor, scale_axes: int = 3) -> None:
    """Write surfels as a binary PLY in the layout of 3D Gaussian Splatting, which viewers read.

    Log scales, logit opacities, quaternions ``(w, x, y, z)``, and the colour as the spherical
    harmonic of degree zero.

    Args:
        path: Where to.
        surfels: What to write.
        colours: shape ``(N, 3)``, what a viewer shows: sRGB-encoded, 0 to 1.
        scale_axes: 3 for viewers, which know ellipsoids (the third axis is a micrometre); 2 for the
            layout of 2D Gaussian Splatting.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
        ValueError: Colours of another shape, or another number of axes.
    """
    if tuple(colours.shape) != (len(surfels), 3) or scale_axes not in (2, 3):
        raise ValueError(
            f"expected colours of shape ({len(surfels)}, 3) and 2 or 3 scale axes, "
            f"got {tuple(colours.shape)} and {scale_axes}"
        )
    _write_ply(path, surfels, (colours[:, None] - 0.5) / SH_DC, scale_axes)


def export_harmonics_ply(
    path: Path, surfels: Surfels, coefficients: torch.Tensor, scale_axes: int = 3
) -> None:
    """Write surfels whose colours change with the view as a binary PLY, as :func:`export_ply` does.

    Viewers show one half plus the sum of coefficients times harmonics, cut off at zero, and take that
    for sRGB-encoded. Coefficients of linear radiance are to be fitted anew to encoded colours first, or
    what is shown is too dark.

    Args:
        path: Where to.
        surfels: What to write.
        coefficients: shape ``(N, K, 3)``, K = 1, 4, 9 or 16, in the order of
            :func:`spherical_harmonics_colours`. The file has all 16, the missing ones as zeros, since
            viewers ask for 45 columns ``f_rest``; these go channel by channel.
        scale_axes: As in :func:`export_ply`.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
        ValueError: Coefficients of another shape, or another number of axes.
    """
    fits = coefficients.ndim == 3 and coefficients.shape[::2] == (len(surfels), 3)
    if not fits or coefficients.shape[1] not in (1, 4, 9, ALL_SH) or scale_axes not in (2, 3):
        raise ValueError(
            f"expected coefficients of shape ({len(surfels)}, 1 or 4 or 9 or 16, 3) and 2 or 3 scale axes, "
            f"got {tuple(coefficients.shape)} and {scale_axes}"
        )
    missing = ALL_SH - coefficients.shape[1]
    _write_ply(path, surfels, torch.nn.functional.pad(coefficients, (0, 0, 0, missing)), scale_axes)


def _write_ply(path: Path, surfels: Surfels, coefficients: torch.Tensor, scale_axes: int) -> None:
    columns = _ply_columns(surfels, coefficients, scale_axes)
    header = ["ply", "format binary_little_endian 1.0", f"comment {DISCS}", f"element vertex {len(surfels)}"]
    header += [f"property float {name}" for name in columns] + ["end_header", ""]
    table = np.stack(list(columns.values()), axis=1).astype("<f4")
    write_bytes(path, "\n".join(header).encode("ascii") + table.tobytes())


def _ply_columns(surfels: Surfels, coefficients: torch.Tensor, scale_axes: int) -> dict[str, np.ndarray]:
    """Return the columns by their names in the field, in the order in which they are written."""
    nearly = torch.finfo(torch.float32).eps  # of opacity 0 and 1, whose logits are infinite
    logits = torch.logit(surfels.opacities.double(), eps=nearly)
    normals = torch.zeros_like(surfels.centres)  # the format has them, and leaves them empty
    logs = torch.nn.functional.pad(surfels.scales, (0, scale_axes - 2), value=FLAT).log()
    rest = coefficients[:, 1:].mT.flatten(1)  # channel by channel
    blocks = {
        ("x", "y", "z"): surfels.centres,
        ("nx", "ny", "nz"): normals,
        ("f_dc_0", "f_dc_1", "f_dc_2"): coefficients[:, 0],
        tuple(f"f_rest_{number}" for number in range(rest.shape[1])): rest,
        ("opacity",): logits[:, None],
        tuple(f"scale_{axis}" for axis in range(scale_axes)): logs,
        tuple(f"rot_{axis}" for axis in range(4)): surfels.rotations,
    }
    return {
        name: block.detach().cpu().numpy()[:, column]
        for names, block in blocks.items()
        for column, name in enumerate(names)
    }

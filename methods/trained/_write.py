# SPDX-License-Identifier: Apache-2.0
"""Write surfels for viewers and for the code of others, from the file that a saved decomposition holds."""

from pathlib import Path
from typing import Literal, get_args

import numpy as np
import torch

from graycard import MethodError
from graycard.io import write_bytes
from graycard.methods.splat import SH_DC, Surfels, export_harmonics_ply
from graycard.methods.trained._read import RECORD
from graycard.methods.trained._trained import TrainedSplat

SplatFormat = Literal["ply", "2dgs", "splat"]
SPLAT_FORMATS = get_args(SplatFormat)
FLAT = 1e-6
"""Metres: the third size of a disc in a format that knows ellipsoids only."""


def write_splat(path: Path, splat: TrainedSplat, kind: SplatFormat) -> None:
    """Write surfels.

    Args:
        path: The file.
        splat: Discs.
        kind: ``ply``, which viewers of Gaussian splats read: a third size of a micrometre, and a comment by
            which :func:`read_splat` knows discs; ``2dgs``, the layout of 2D Gaussian Splatting, two sizes;
            ``splat``, 32 bytes a disc, without what changes with the view.

    Raises:
        MethodError: They are ellipsoids.
        OutputError: The file cannot be written, or the disk is full.
    """
    if not isinstance(splat.shapes, Surfels):
        raise MethodError(
            f"expected surfels to write to {path}, got ellipsoids. Give what graycard has fitted"
        )
    if kind == "splat":
        write_bytes(path, _records(splat.shapes, splat.coefficients).tobytes())
    else:
        export_harmonics_ply(path, splat.shapes, splat.coefficients, 2 if kind == "2dgs" else 3)


def _records(surfels: Surfels, coefficients: torch.Tensor) -> np.ndarray:
    """Return the largest and most opaque first, as viewers load them."""
    weight = surfels.opacities * surfels.scales.prod(dim=1)
    order = torch.argsort(weight, descending=True, stable=True)
    rows = np.zeros(len(surfels), RECORD)
    rows["place"] = surfels.centres[order].numpy()
    rows["size"] = torch.nn.functional.pad(surfels.scales[order], (0, 1), value=FLAT).numpy()
    colours = torch.cat([0.5 + SH_DC * coefficients[:, 0], surfels.opacities[:, None]], dim=1)[order]
    rows["colour"] = (colours * 255).round().clamp(0, 255).numpy()
    rows["turn"] = (surfels.rotations[order] * 128 + 128).round().clamp(0, 255).numpy()
    return rows

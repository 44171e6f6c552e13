# SPDX-License-Identifier: Apache-2.0
"""Files of trained splats, byte by byte as the exporters of other programs write them."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np
import torch

from graycard.methods.splat import Gaussians

Shape = TypeVar("Shape")

Raw = dict[str, torch.Tensor]
"""Tensors of a training: means, log scales, quaternions, logits, ``sh0`` (N, 1, 3), ``shN`` (N, K - 1, 3)."""


def plain(kind: Callable[..., Shape], *geometry: object) -> Shape:
    """Discs or ellipsoids in float32, without features, of centres, rotations, scales and opacities."""
    centres, rotations, scales, opacities = (
        torch.as_tensor(np.asarray(values)).float() for values in geometry
    )
    return kind(centres, rotations, scales, opacities, torch.empty(len(centres), 0))


def raw_splat(gaussians: Gaussians, degree: int, seed: int = 0) -> Raw:
    """The parameters whose activations are these Gaussians, with colours of a degree, float32."""
    r = np.random.default_rng(seed)
    count, harmonics = len(gaussians), (degree + 1) ** 2
    length = torch.from_numpy(r.uniform(0.5, 2, (count, 1)))  # quaternions of training have any length
    raw = {
        "means": gaussians.centres,
        "scales": gaussians.scales.log(),
        "quats": gaussians.rotations * length,
        "opacities": torch.logit(gaussians.opacities),
        "sh0": torch.from_numpy(r.normal(0, 1.0, (count, 1, 3))),
        "shN": torch.from_numpy(r.normal(0, 0.15, (count, harmonics - 1, 3))),
    }
    return {name: values.float() for name, values in raw.items()}


def inria_columns(raw: Raw) -> dict[str, np.ndarray]:
    """Columns in the order of INRIA's ``construct_list_of_attributes``; the harmonics channel by channel."""
    rest = raw["shN"].transpose(1, 2).flatten(1)
    blocks = {
        ("x", "y", "z"): raw["means"],
        ("nx", "ny", "nz"): torch.zeros_like(raw["means"]),
        ("f_dc_0", "f_dc_1", "f_dc_2"): raw["sh0"][:, 0],
        tuple(f"f_rest_{number}" for number in range(rest.shape[1])): rest,
        ("opacity",): raw["opacities"][:, None],
        tuple(f"scale_{axis}" for axis in range(raw["scales"].shape[1])): raw["scales"],
        ("rot_0", "rot_1", "rot_2", "rot_3"): raw["quats"],
    }
    return {
        name: block[:, column].numpy() for names, block in blocks.items() for column, name in enumerate(names)
    }


def brush_columns(raw: Raw) -> dict[str, np.ndarray]:
    """The order of brush (``brush-serde/src/export.rs``): no normals, and colours at the end."""
    columns = inria_columns(raw)
    first = ["x", "y", "z", "scale_0", "scale_1", "scale_2", "opacity", "rot_0", "rot_1", "rot_2", "rot_3"]
    colours = [name for name in columns if name.startswith("f_")]
    return {name: columns[name] for name in (*first, *colours)}


def write_ply(
    path: Path,
    columns: dict[str, np.ndarray],
    form: str = "binary_little_endian",
    comments: tuple[str, ...] = (),
) -> Path:
    """Write columns as a PLY: bytes are float but for unsigned ones, in the order that is named."""
    order = ">" if form == "binary_big_endian" else "<"
    kinds = {name: "u1" if values.dtype == np.uint8 else f"{order}f4" for name, values in columns.items()}
    rows = np.zeros(len(next(iter(columns.values()))), np.dtype(list(kinds.items())))
    for name, values in columns.items():
        rows[name] = values
    head = [
        "ply",
        f"format {form} 1.0",
        *(f"comment {text}" for text in comments),
        f"element vertex {len(rows)}",
    ]
    head += [f"property {'uchar' if kind == 'u1' else 'float'} {name}" for name, kind in kinds.items()]
    text = "\n".join(" ".join(repr(number) for number in row) for row in rows.tolist()) + "\n"
    data = text.encode() if form == "ascii" else rows.tobytes()
    path.write_bytes("\n".join([*head, "end_header", ""]).encode() + data)
    return path

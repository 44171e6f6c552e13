# SPDX-License-Identifier: Apache-2.0
"""Six mistakes of newcomers, to be planted in predictions that are right otherwise."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from graycard import View, srgb_encode

Layers = dict[str, np.ndarray]


@dataclass(frozen=True)
class Mistake:
    """A mistake, the score that its hint stands beside, and how the hint begins."""

    name: str
    make: Callable[[Layers, View, float], Layers]
    """``(layers, view, exposure) -> layers with the mistake``."""
    beside: str
    says: str

    def __str__(self) -> str:
        return self.name


def _to_camera(normals: np.ndarray, view: View) -> np.ndarray:
    return normals @ view.camera.camera_to_world[:3, :3]


MISTAKES = (
    Mistake(
        "as-displayed",
        lambda layers, view, exposure: {"radiance": srgb_encode(layers["radiance"] * exposure)},
        "novel_view.psnr",
        "radiance looks as displayed (sRGB, exposed): write linear W/m²/sr",
    ),
    Mistake(
        "exposed",
        lambda layers, view, exposure: {"radiance": layers["radiance"] * exposure},
        "novel_view.psnr",
        "radiance looks multiplied by the exposure: write W/m²/sr",
    ),
    Mistake(
        "opencv-normals",
        lambda layers, view, exposure: {"normal": _to_camera(layers["normal"], view)},
        "normal.mean_angle",
        "normal looks like camera axes (x right, y down): rotate to the world",
    ),
    Mistake(
        "opengl-normals",
        lambda layers, view, exposure: {"normal": _to_camera(layers["normal"], view) * (1, -1, -1)},
        "normal.mean_angle",
        "normal looks like camera axes (x right, y up): rotate to the world",
    ),
    Mistake(
        "bgr",
        lambda layers, view, exposure: {"base_color": layers["base_color"][..., ::-1]},
        "albedo.psnr.channel",
        "base_color looks like B, G, R: write R, G, B",
    ),
    Mistake(
        "upside-down",
        lambda layers, view, exposure: {name: values[::-1] for name, values in layers.items()},
        "novel_view.psnr",
        "pictures look mirrored: top and bottom are exchanged",
    ),
)

# SPDX-License-Identifier: Apache-2.0
"""A trained splat as a camera of the scene sees it."""

from dataclasses import dataclass

import numpy as np
import torch

from graycard import Camera
from graycard.methods.splat import (
    FeatureMaps,
    GaussianMaps,
    Gaussians,
    Maps,
    rasterize,
    rasterize_gaussians,
    spherical_harmonics_colours,
)
from graycard.methods.surfels import depth_layer, normal_layer
from graycard.methods.trained._frame import SAME, Frame
from graycard.methods.trained._trained import TrainedSplat

KERNELS = {"3dgs": ("gaussians 3", "harmonics"), "2dgs": ("maps 3", "harmonics")}
"""Parts of the engine that a primitive needs."""


@dataclass(frozen=True)
class Picture:
    """Picture, depth and normals of a splat for one camera."""

    colour: np.ndarray
    """Shape ``(H, W, 3)``, in the encoding that it was trained in, over the background."""
    depth: np.ndarray
    """Shape ``(H, W)``, metres: of the surface (discs) or of the centre (ellipsoids) at which half of the
    light is gone; +inf where less than half of a pixel is covered."""
    normal: np.ndarray | None
    """Shape ``(H, W, 3)``, unit length, in the world of the scene; None for ellipsoids."""


@torch.no_grad()
def render_splat(
    splat: TrainedSplat,
    camera: Camera,
    frame: Frame = SAME,
    background: float = 0.0,
    antialiased: bool = False,
) -> Picture:
    """Draw a splat for a camera of the scene.

    Args:
        splat: What was trained.
        camera: Of the scene.
        frame: Where the splat's world lies.
        background: Value of all channels behind the splat, in its encoding.
        antialiased: Lower opacities as pictures are dilated; discs know no such thing.

    Raises:
        MethodError: There is not enough memory.
    """
    there = frame.camera(camera)
    shapes = splat.shapes
    seen = spherical_harmonics_colours(splat.coefficients, shapes.centres, there.position, splat.degree)
    colours = (seen + 0.5).clamp(min=0)
    if isinstance(shapes, Gaussians):
        drawn = rasterize_gaussians(shapes, there, colours, antialiased=antialiased)
        return Picture(_over(drawn, background), _depth(drawn, frame), None)
    drawn = rasterize(shapes, there, colours)
    normal = normal_layer(drawn, there) @ frame.turn.astype(
        np.float32
    )  # from the splat's world to the scene's
    return Picture(_over(drawn, background), _depth(drawn, frame), normal)


def _over(drawn: FeatureMaps, background: float) -> np.ndarray:
    return (drawn.features + (1 - drawn.alpha)[:, :, None] * background).numpy()


def _depth(drawn: Maps | GaussianMaps, frame: Frame) -> np.ndarray:
    return (depth_layer(drawn) / frame.scale).astype(np.float32)

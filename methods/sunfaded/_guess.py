# SPDX-License-Identifier: Apache-2.0
"""Guesses of a prior about the geometry of training views: of the photographs, and anew of the albedo."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import torch

from graycard import Capture
from graycard.io import Room
from graycard.methods._contract import Ask, Priors
from graycard.methods._priors import PHOTOGRAPH
from graycard.methods._tensors import float_tensor
from graycard.methods.sunfaded._model import draw
from graycard.methods.sunfaded._settings import SunFadedSettings
from graycard.methods.surfels import srgb_decode_tensor

GEOMETRY_ASKS = tuple(Ask(kind, (PHOTOGRAPH, "base_color"), optional=True) for kind in ("depth", "normal"))


@dataclass(frozen=True, eq=False)
class GeometryGuess:
    """Depth and normals of a view as a prior sees them; None where it says nothing."""

    depth: torch.Tensor | None = None
    """Shape ``(H, W)``, float32: of any scale and offset."""
    normal: torch.Tensor | None = None
    """Shape ``(H, W, 3)``, float32: world, of unit length, zero where there is nothing."""


def guesses(capture: Capture, priors: Priors, images: Iterable[np.ndarray]) -> list[GeometryGuess]:
    """Ask the prior about an image of each training view.

    Args:
        capture: The views.
        priors: What answers; where nothing does, there is no guess.
        images: Shape ``(H, W, 3)``, linear, display range; one a view.

    Raises:
        MethodError: An answer is not sound.
    """
    found = []
    with Room() as room:
        for view, image in zip(capture.train, images, strict=True):
            depth = float_tensor(priors.depth(image, view)) if "depth" in priors.kinds else None
            normal = float_tensor(priors.normal(image, view)) if "normal" in priors.kinds else None
            found.append(room.keep(GeometryGuess(depth, normal)))
    return found


def exposed_photographs(capture: Capture) -> Iterator[np.ndarray]:
    """Images that a prior sees first: the training photographs, linear, display range."""
    for view in capture.train:
        yield capture.photograph(view) * np.float32(capture.exposure)


def drawn_albedos(
    capture: Capture, values: Mapping[str, torch.Tensor], settings: SunFadedSettings
) -> Iterator[np.ndarray]:
    """Images that a prior sees then: the albedo of the training views as it has been found, linear."""
    for view in capture.train:
        with torch.no_grad():
            image = draw(values, view.camera, settings).features[..., :3]
            shown = image if settings.space == "linear" else srgb_decode_tensor(image)
        yield shown.numpy()

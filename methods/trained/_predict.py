# SPDX-License-Identifier: Apache-2.0
"""From a trained splat to the predictions folder that is scored."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import torch

from graycard import Capture, MethodError, Predictions, Progress
from graycard.dataset import is_in_display_white
from graycard.layers import find_fault
from graycard.methods.splat import warm_kernels
from graycard.methods.surfels import srgb_decode_tensor
from graycard.methods.trained._frame import SAME, Frame
from graycard.methods.trained._render import KERNELS, Picture, render_splat
from graycard.methods.trained._trained import TrainedSplat
from graycard.predictions import clear_predictions, finish_predictions, write_view

Encoding = Literal["srgb", "linear"]


@dataclass(frozen=True)
class Look:
    """Choices of how the numbers of a splat are read."""

    encoding: Encoding = "srgb"
    """Encoding of its colours: ``srgb`` after training on photographs, ``linear`` after training on linear
    images."""
    exposed: bool | None = None
    """True if it was trained on light times the exposure of the capture, as `graycard export` writes it;
    False if on light in the unit of the capture. None takes the latter for imported photographs,
    whose unit is display white, and the former for any other."""
    background: float = 0.0
    """Value of all channels that it was trained over, in its encoding."""
    antialiased: bool | None = None
    """True if it was trained with antialiasing; None lets the file say."""
    frame: Frame = SAME
    """Place of its world in that of the scene."""


@dataclass(frozen=True)
class DrawnSplat:
    """Predictions that were drawn of a splat."""

    predictions: Predictions
    unseen: tuple[str, ...]
    """Views in which nothing of it is seen."""


def write_splat_predictions(
    splat: TrainedSplat,
    capture: Capture,
    folder: Path,
    progress: Progress,
    look: Look | None = None,
    name: str = "splat",
) -> DrawnSplat:
    """Render a splat for every view of a capture, training views too: gauges are fitted on these.

    Args:
        splat: What was trained.
        capture: Of the scene.
        folder: The predictions folder; predictions that it holds are replaced.
        progress: Called now and then.
        look: How its numbers are to be read.
        name: What the predictions are called.

    Returns:
        The index that was written (radiance and depth, and normals of discs), and the views without anything.

    Raises:
        MethodError: There is not enough memory, or the pictures hold what no file of predictions should.
        OutputError: The folder cannot be written to, or holds something else.
    """
    look = look or Look()
    antialiased = splat.antialiased if look.antialiased is None else look.antialiased
    exposure = _exposure_of(look, capture)
    clear_predictions(folder)
    unseen: list[str] = []
    warm_kernels(KERNELS[splat.primitive], progress)
    for done, view in enumerate(capture.views):
        progress(done / len(capture.views), f"rendering {view.name}")
        picture = render_splat(splat, view.camera, look.frame, look.background, antialiased)
        unseen += [] if _is_anything_seen(picture, look.background) else [view.name]
        layers = _layers(picture, look.encoding, exposure)
        for layer, values in layers.items():
            if fault := find_fault(layer, values, view.camera.height, view.camera.width):
                raise MethodError(f"view {view.name}: {fault}. The splat holds colours that are out of range")
        write_view(folder, view.name, layers)
    written = Predictions(name, capture.track, capture.scene)
    finish_predictions(folder, written)
    return DrawnSplat(written, tuple(unseen))


def _is_anything_seen(picture: Picture, background: float) -> bool:
    """Tell whether a pixel is covered by half, or is a code of 8 bits off the background."""
    return bool(np.isfinite(picture.depth).any() or (np.abs(picture.colour - background) > 1 / 255).any())


def _exposure_of(look: Look, capture: Capture) -> float:
    """Return the factor between light of the capture and light that the splat was trained on."""
    exposed = look.exposed
    if exposed is None:
        exposed = capture.root is None or not is_in_display_white(capture.root.parent)
    return capture.exposure if exposed else 1.0


def _layers(picture: Picture, encoding: Encoding, exposure: float) -> dict[str, np.ndarray]:
    """Layers by name, in the units of the format."""
    colour = torch.from_numpy(picture.colour)
    linear = srgb_decode_tensor(colour) if encoding == "srgb" else colour
    layers = {"radiance": (linear / exposure).numpy(), "depth": picture.depth}
    return layers if picture.normal is None else {**layers, "normal": picture.normal}

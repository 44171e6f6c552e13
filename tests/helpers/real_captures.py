# SPDX-License-Identifier: Apache-2.0
"""A capture as a user has one: photographs of 8 bits with cameras, some of them held out, and no truth."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from graycard import Predictions, View, open_capture, open_truth, srgb_decode
from graycard.dataset import open_held_out
from graycard.exchange import export_capture, import_capture
from graycard.predictions import finish_predictions, write_view

Change = Callable[[View, np.ndarray], np.ndarray]


def import_tiny(folder: Path, write_tiny: Callable[..., Path], leave_out: tuple[str, ...] = ()) -> Path:
    """Import photographs of the tiny scene, held-out ones too, and return the scene's folder."""
    scene = write_tiny(folder / "rendered", train=6, test=3)
    export_capture(scene, "nerfstudio", folder / "away")
    truth, capture = open_truth(scene / "truth"), open_capture(scene / "capture")
    for view in capture.test:
        if view.name not in leave_out:
            shown = np.clip(truth.layers(view)["radiance"] * capture.exposure, 0, 1)
            codes = np.rint(255 * encode_by_hand(shown)).astype(np.uint8)
            Image.fromarray(codes).save(folder / "away" / "images" / f"{view.name}.png")
    return import_capture(folder / "away", folder / "mine", "dark", "cellar")


def import_bracketed(folder: Path, write_tiny: Callable[..., Path], factors: Sequence[float]) -> Path:
    """Import photographs of the tiny scene whose EXIF tells other exposures, in turn; each ends at white."""
    scene = write_tiny(folder / "rendered", train=6, test=3)
    export_capture(scene, "nerfstudio", folder / "away")
    truth, capture = open_truth(scene / "truth"), open_capture(scene / "capture")
    for number, view in enumerate(sorted(capture.views, key=lambda view: view.name)):
        factor = factors[number % len(factors)]
        level = np.clip(truth.layers(view)["radiance"] * capture.exposure * factor, 0, 1)
        exif = Image.Exif()
        exif.get_ifd(0x8769)[0x829A] = 0.01 * factor
        codes = np.rint(255 * encode_by_hand(level)).astype(np.uint8)
        Image.fromarray(codes).save(folder / "away" / "images" / f"{view.name}.png", exif=exif.tobytes())
    return import_capture(folder / "away", folder / "mine", "dark", "cellar")


def encode_by_hand(linear: np.ndarray) -> np.ndarray:
    """Return sRGB by the two branches of the standard, apart from graycard's own function."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0) ** (1 / 2.4) - 0.055)


def predict_photographs(folder: Path, scene: Path, change: Change = lambda view, light: light) -> Path:
    """Write predictions that are the photographs, changed, with a made-up albedo and depth."""
    held = open_held_out(scene)
    capture = held.capture
    for view in (*capture.train, *held.views):
        light = capture.photograph(view) if view.split == "train" else held.photograph(view)
        layers = {"radiance": change(view, light), "base_color": light * 0.5, "depth": light[..., 0] + 1}
        write_view(folder, view.name, layers)
    finish_predictions(folder, Predictions("mine", capture.track, capture.scene))
    return folder


def codes_of(scene: Path, view: str) -> np.ndarray:
    """Return the linear light of a photograph as it was handed to the import, by Pillow."""
    path = scene.parents[2] / "away" / "images" / f"{view}.png"
    return srgb_decode(np.asarray(Image.open(path)) / 255)

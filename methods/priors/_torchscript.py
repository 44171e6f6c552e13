# SPDX-License-Identifier: Apache-2.0
"""Networks in TorchScript files: an image to an image, and inpainting as LaMa does it."""

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch.nn.functional import pad

from graycard import MethodError, srgb_decode, srgb_encode
from graycard.methods._priors import ImageKind, Question

STEP = 8
"""Pixels that the sides of LaMa's images are a multiple of."""
LIKELY = 0.5
"""Probability from which on a pixel belongs to a mask."""
OPENGL = np.array([1.0, -1.0, -1.0])
"""Networks give normals along x right, y up, z towards the camera; the camera looks along z, with y down."""


@dataclass(frozen=True, slots=True, eq=False)
class ScriptedNetwork:
    """Answers with a module that takes the encoded image, ``(1, 3, H, W)`` in [0, 1].

    It gives one channel, or three, of the same size: metres for ``depth``, camera coordinates (x right, y up,
    z towards the camera) for ``normal``, linear values in [0, 1] for ``base_color``, ``roughness`` and
    ``metallic``, a probability for ``mask``.
    """

    kind: ImageKind
    module: torch.nn.Module

    def answer(self, question: Question) -> np.ndarray:
        """Return what the module says.

        Raises:
            MethodError: It breaks, or gives images of another size.
        """
        shown = srgb_encode(question.image)
        given = _run(self.module, _tensor(shown))
        channels = 3 if self.kind in ("normal", "base_color") else 1
        if given.shape != (1, channels, *shown.shape[:2]):
            raise MethodError(
                f"expected {(1, channels, *shown.shape[:2])} from the network for {self.kind}, got "
                f"{tuple(given.shape)}"
            )
        values = given[0].permute(1, 2, 0).double().numpy()
        if self.kind == "normal":
            lengths = np.maximum(np.linalg.norm(values, axis=-1, keepdims=True), 1e-12)
            return (values / lengths * OPENGL) @ question.view.camera.camera_to_world[:3, :3].T
        if self.kind == "base_color":
            return values
        return values[..., 0] > LIKELY if self.kind == "mask" else values[..., 0]


@dataclass(frozen=True, slots=True, eq=False)
class InpaintingNetwork:
    """Fills in holes with a module like LaMa's: image and hole (1 inside) to image, encoded, in [0, 1].

    Radiance is shown encoded for display; any other layer is stretched to its range outside the hole. The
    sides are padded to multiples of eight by mirroring.
    """

    module: torch.nn.Module

    def answer(self, question: Question) -> np.ndarray:
        """Return the image as the module fills it in.

        Raises:
            MethodError: It breaks, or gives an image of another size; or all is hole.
        """
        image, hole = np.asarray(question.image, np.float64), question.hole
        if hole is None or not hole.any():
            return image
        if hole.all():
            raise MethodError("expected a hole with something around it, got one that is the whole image")
        if question.of == "radiance":
            return srgb_decode(self._filled(srgb_encode(np.where(hole[..., None], 0.0, image)), hole))
        low, high = image[~hole].min(), max(image[~hole].max(), image[~hole].min() + 1e-12)
        stretched = np.clip((image - low) / (high - low), 0, 1)
        if image.ndim == 3:
            return low + (high - low) * self._filled(stretched, hole)
        three = np.repeat(stretched[..., None], 3, axis=-1)
        return low + (high - low) * self._filled(three, hole).mean(axis=-1)

    def _filled(self, shown: np.ndarray, hole: np.ndarray) -> np.ndarray:
        """Return an image ``(H, W, 3)`` in [0, 1] with its hole filled in."""
        height, width = hole.shape
        more = (0, -width % STEP, 0, -height % STEP)
        image = pad(_tensor(shown), more, mode="reflect")
        inside = pad(_tensor(hole[..., None]), more, mode="reflect")
        given = _run(self.module, image, inside)
        if given.shape != image.shape:
            raise MethodError(
                f"expected {tuple(image.shape)} from the network for inpainting, got {tuple(given.shape)}"
            )
        return given[0, :, :height, :width].permute(1, 2, 0).double().clamp(0, 1).numpy()


def load_torchscript(path: Path) -> torch.nn.Module:
    """Return the module in a TorchScript file, on the CPU.

    Raises:
        MethodError: It cannot be read.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # the form in which LaMa is published
            return torch.jit.load(str(path), map_location="cpu").eval()
    except (RuntimeError, ValueError, OSError) as cause:
        raise MethodError(
            f"expected a TorchScript module at {path}, got: {_first_line(cause)}. Save one by torch.jit.save"
        ) from cause


def _run(module: torch.nn.Module, *inputs: torch.Tensor) -> torch.Tensor:
    """Return what a module gives for its inputs.

    Raises:
        MethodError: It breaks, or gives no tensor.
    """
    try:
        with torch.inference_mode():
            given = module(*inputs)
    except RuntimeError as cause:
        raise MethodError(f"the network failed: {_first_line(cause)}") from cause
    if not isinstance(given, torch.Tensor):
        raise MethodError(f"expected the network to give a tensor, got {type(given).__name__}")
    return given


def _tensor(image: np.ndarray) -> torch.Tensor:
    """Return an image ``(H, W, C)`` as ``(1, C, H, W)``, float32."""
    return torch.from_numpy(np.ascontiguousarray(np.moveaxis(image, -1, 0)[None], dtype=np.float32))


def _first_line(cause: Exception) -> str:
    return next(iter(str(cause).strip().splitlines()), type(cause).__name__)

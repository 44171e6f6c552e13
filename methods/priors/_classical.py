# SPDX-License-Identifier: Apache-2.0
"""Priors without weights: what could be said about a photograph before there were networks."""

from dataclasses import dataclass, field

import numpy as np
import torch

from graycard import Capture, View, luminance, srgb_encode
from graycard.methods._priors import Question
from graycard.methods._retinex import RetinexSettings, split
from graycard.methods.priors._filling import filled
from graycard.methods.priors._slopes import normals_of
from graycard.methods.surfels import SweptView, sweep_depth

ROUGHNESS, METALLIC = 0.5, 0.0
MARGIN = 1.6
"""Margin: how far the depths that are looked at go beyond those of the sparse points, as a factor."""
DARKEST = 1e-3
"""Luminance, relative to the brightest, at which a flash sees nothing any more."""
RANGE = (0.5, 20.0)
"""Metres between which surfaces are sought where a capture has no sparse points."""


@dataclass(frozen=True, slots=True, eq=False)
class Classical:
    """Answers with algorithms from before networks.

    Depth is that of a plane sweep against the photographs; where the light is on the camera, it is that of a
    flash whose light falls off with the square of the distance, which is wrong wherever paint is not even or
    a surface is tilted. Normals are those of that depth. Base colour is by Retinex. Roughness is 0.5, and
    metals are not known. Holes are filled in by a biharmonic function, or by Telea's fast marching.
    """

    capture: Capture
    algorithm: str = ""
    """Algorithm: how holes are filled in, where it answers about them."""
    _shown: dict[str, torch.Tensor] = field(default_factory=dict, repr=False)
    """Encoded luminance of training photographs, by view: read once."""

    def answer(self, question: Question) -> np.ndarray:
        """Answers about an image."""
        image = np.asarray(question.image, np.float64)
        match question.kind:
            case "depth":
                return self._depth(image, question.view)
            case "normal":
                return normals_of(self._depth(image, question.view), question.view.camera)
            case "base_color":
                return np.clip(split(image, RetinexSettings()), 0, 1)
            case "roughness":
                return np.full(image.shape[:2], ROUGHNESS)
            case "metallic":
                return np.full(image.shape[:2], METALLIC)
            case _:
                return filled(image, question.hole, self.algorithm)

    def _depth(self, image: np.ndarray, view: View) -> np.ndarray:
        near, far = self._range(view)
        if self.capture.light_on_camera:
            return _depth_from_flash(image, float(np.sqrt(near * far)))
        here = SweptView(view.camera, _grey(image), near / MARGIN, far * MARGIN)
        others = [v for v in self.capture.train if v.name != view.name]
        views = [here] + [SweptView(v.camera, self._photograph(v), here.near, here.far) for v in others]
        depth = sweep_depth(views, 0)
        return np.where(np.isfinite(depth), depth, np.sqrt(near * far))

    def _photograph(self, view: View) -> torch.Tensor:
        if view.name not in self._shown:
            shown = np.asarray(self.capture.photograph(view), np.float64) * self.capture.exposure
            self._shown[view.name] = _grey(shown)
        return self._shown[view.name]

    def _range(self, view: View) -> tuple[float, float]:
        """Least and largest z-depth of the sparse points in a view, metres."""
        pixels, depth = view.camera.project(self.capture.points().positions)
        size = (view.camera.width, view.camera.height)
        seen = (depth > 0) & (pixels >= 0).all(axis=-1) & (pixels < size).all(axis=-1)
        return (float(depth[seen].min()), float(depth[seen].max())) if seen.any() else RANGE


def _grey(image: np.ndarray) -> torch.Tensor:
    """Return encoded luminance, as stereo compares it, shape ``(H, W)``, float32."""
    return torch.from_numpy(srgb_encode(luminance(image)).astype(np.float32))


def _depth_from_flash(image: np.ndarray, middle: float) -> np.ndarray:
    """Depth at which an even surface would look as bright, ``d = sqrt(k / Y)``; its median is ``middle``."""
    y = luminance(image)
    falloff = 1 / np.sqrt(np.maximum(y, DARKEST * max(float(y.max()), 1e-30)))
    return middle * falloff / np.median(falloff)

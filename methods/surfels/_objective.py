# SPDX-License-Identifier: Apache-2.0
"""Loss of a step: how far a drawn view is from its photograph, and surfels that do not agree."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import torch

from graycard import Camera, Capture, Sensor, View
from graycard.io import Room
from graycard.methods.splat import (
    CENTRES,
    LearningRateSchedule,
    LossResult,
    Maps,
    Window,
    depth_normal_map,
    harmonics_basis,
    image_radius,
    no_offsets,
    photometric_map,
    rasterize,
    rasterize_features,
    spherical_harmonics_colours,
    surfels_of,
    view_at,
)
from graycard.methods.surfels._colour import srgb_encode_tensor
from graycard.methods.surfels._compose import composed
from graycard.methods.surfels._settings import SurfelSettings
from graycard.methods.surfels._start import COEFFICIENTS, DETAIL

FULL = 0.99
"""Share of white from which a pixel is taken for full: about a level of 8 bits below it."""
DEGREE_EVERY = 1 / 30
"""Share of the budget after which the next degree of the harmonics is fitted too (Kerbl et al. 2023)."""


Tone = Callable[[Mapping[str, torch.Tensor], torch.Tensor, int], torch.Tensor]
"""From parameters, the surfels' encoded colours ``(N, 3)`` and the number of a training view to the colours
that this photograph has them in."""


@dataclass(frozen=True, eq=False)
class Tones:
    """Appearance: how photographs differ in of the same surfels."""

    shown: Tone
    rates: Mapping[str, LearningRateSchedule]
    """Learning rates of its parameters by name."""


@dataclass(frozen=True, eq=False)
class EncodedPhotograph:
    """A training view as a fit looks at it."""

    camera: Camera
    encoded: torch.Tensor
    """Shape ``(H, W, 3)``: exposed and encoded."""
    sky: torch.Tensor
    """Shape ``(H, W, K)``: harmonics of the direction of each pixel."""
    weight: torch.Tensor | None = None
    """Shape ``(H, W)``: how much each pixel counts; None: all alike."""
    full: torch.Tensor | None = None
    """Shape ``(H, W, 3)``, bool: where the sensor was full, so that there was this light or more; None:
    nowhere, or nobody knows."""

    def at(self, window: Window) -> "EncodedPhotograph":
        """Return a part of the view."""
        weight, full = (None if x is None else window.of(x) for x in (self.weight, self.full))
        return EncodedPhotograph(
            window.camera(self.camera), window.of(self.encoded), window.of(self.sky), weight, full
        )

    def taken(self, picture: torch.Tensor) -> torch.Tensor:
        """Return an encoded picture, ``(H, W, 3)``, cut off where the sensor was full, as it cut off."""
        if self.full is None:
            return picture
        return torch.where(self.full, torch.minimum(picture, self.encoded), picture)


def photographs(capture: Capture, settings: SurfelSettings) -> list[EncodedPhotograph]:
    """Return the training views, exposed and encoded, and where they are full if exposures differ."""
    found = []
    with Room() as room:
        for view in capture.train:
            linear = torch.from_numpy(np.asarray(capture.photograph(view), np.float32) * capture.exposure)
            sky = sky_basis(view.camera, settings.sky_degree)
            full = _full(linear, view, capture.sensor)
            encoded = srgb_encode_tensor(linear)
            found.append(room.keep(EncodedPhotograph(view.camera, encoded, sky, full=full)))
    return found


def _full(linear: torch.Tensor, view: View, sensor: Sensor | None) -> torch.Tensor | None:
    """Return where a photograph is full; None where all photographs have one white.

    Photographs of other exposures are full at other light: one and the same sky would be as many things as
    there are exposures, none of them true.
    """
    if sensor is None or not sensor.exposures:
        return None
    full = linear >= FULL / sensor.exposure(view.name)
    return full if bool(full.any()) else None


def exposed_photograph(capture: Capture, view: View) -> np.ndarray:
    """Return what priors are shown of a training view: linear, display range, shape ``(H, W, 3)``,
    float64.
    """
    return np.asarray(capture.photograph(view), np.float64) * capture.exposure


def sky_basis(camera: Camera, degree: int) -> torch.Tensor:
    """Harmonics of the direction of each pixel, shape ``(H, W, (degree + 1)^2)``, float32."""
    return torch.from_numpy(harmonics_basis(camera.rays(), degree).astype(np.float32))


def colours(values: Mapping[str, torch.Tensor], eye: np.ndarray, degree: int) -> torch.Tensor:
    """Return encoded colours of the surfels as an eye sees them, shape ``(N, 3)``."""
    coefficients = torch.cat([values[COEFFICIENTS], values[DETAIL]], dim=1)
    return spherical_harmonics_colours(coefficients, values[CENTRES], eye, degree) + 0.5


@dataclass(frozen=True, eq=False)
class SurfelObjective:
    """The loss of one view a step, each view once in a round, in an order that the seed decides."""

    views: list[EncodedPhotograph]
    settings: SurfelSettings
    seed: int
    tones: Tones | None = None
    """None: surfels have the same colours in all photographs."""

    def __call__(self, values: Mapping[str, torch.Tensor], step: int) -> LossResult:
        """Return the loss of a step, with what else the fit is told."""
        number, settings = view_at(step, len(self.views), self.seed), self.settings
        view = self.views[number]
        share = step / settings.iterations
        seen = colours(values, view.camera.position, min(settings.degree, int(share / DEGREE_EVERY)))
        seen = seen if self.tones is None else self.tones.shown(values, seen, number)
        offsets = no_offsets(seen)
        surfels = surfels_of(values, seen)
        weighs = self._weights(share)
        if weighs == (0.0, 0.0):
            drawn = rasterize_features(surfels, view.camera, offsets=offsets)
            extra = torch.zeros(())
        else:
            drawn = rasterize(surfels, view.camera, offsets=offsets)
            extra = disagreement(drawn, view.camera, weighs)
        picture = view.taken(composed(drawn, view.sky, values))
        difference = photometric_map(picture, view.encoded, settings.ssim_share)
        if view.weight is not None:
            difference = difference * view.weight[..., None]
        loss = difference.mean() + extra
        loss = loss + settings.cover_weight * (1 - drawn.alpha.mean())
        size = view.camera.width, view.camera.height
        return LossResult(loss, offsets, image_radius(values, view.camera), size)

    def _weights(self, share: float) -> tuple[float, float]:
        """Start of normals and of distortion."""
        settings = self.settings
        return (
            settings.normal_weight if share >= settings.normal_start else 0.0,
            settings.distortion_weight if share >= settings.distortion_start else 0.0,
        )


def disagreement(drawn: Maps, camera: Camera, weights: tuple[float, float]) -> torch.Tensor:
    """Return normals that are not those of the depth, and surfels that are spread along rays.

    Args:
        drawn: What ``camera`` sees.
        camera: It.
        weights: Of the former and of the latter.
    """
    normal, distortion = weights
    loss = distortion * drawn.distortion.mean()
    if normal > 0:
        loss = loss + normal * depth_normal_map(drawn.depth, drawn.normal, drawn.alpha, camera).mean()
    return loss

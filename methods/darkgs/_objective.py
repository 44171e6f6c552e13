# SPDX-License-Identifier: Apache-2.0
"""Loss of a step: the mean absolute difference of linear radiance, and surfels that do not agree."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from graycard import Camera, Capture
from graycard.io import Room
from graycard.methods._priors import Lamp
from graycard.methods.darkgs._lamp import MeasuredLamp, warming
from graycard.methods.darkgs._model import shade
from graycard.methods.darkgs._settings import DarkGsSettings
from graycard.methods.splat import (
    CENTRES,
    LossResult,
    image_radius,
    l1_map,
    no_offsets,
    rasterize,
    surfels_of,
    view_at,
)
from graycard.methods.surfels import disagreement


@dataclass(frozen=True, eq=False)
class ExposedPhotograph:
    """A training view as a fit looks at it."""

    camera: Camera
    exposed: torch.Tensor
    """Shape ``(H, W, 3)``: linear, radiance times exposure."""


def photographs(capture: Capture) -> list[ExposedPhotograph]:
    """Return the training views, linear and exposed."""
    found = []
    with Room() as room:
        for view in capture.train:
            exposed = np.asarray(capture.photograph(view), np.float32) * np.float32(capture.exposure)
            found.append(room.keep(ExposedPhotograph(view.camera, torch.from_numpy(exposed))))
    return found


@dataclass(frozen=True, eq=False)
class DarkGsObjective:
    """The loss of one view a step, each view once in a round, in an order that the seed decides."""

    views: Sequence[ExposedPhotograph]
    lamp: Lamp | MeasuredLamp
    """Lamp as calibrated, in camera axes."""
    exposure: float
    settings: DarkGsSettings
    seed: int

    def __call__(self, values: Mapping[str, torch.Tensor], step: int) -> LossResult:
        """Return the loss of a step, with what else the fit is told."""
        settings, share = self.settings, step / self.settings.iterations
        view = self.views[view_at(step, len(self.views), self.seed)]
        shaded = shade(values, view.camera, self._lamp_at(share), self.exposure)
        offsets = no_offsets(values[CENTRES])
        surfels = surfels_of(values, shaded.lamp + shaded.ambient)
        drawn = rasterize(surfels, view.camera, offsets=offsets)
        loss = l1_map(drawn.features, view.exposed).mean()
        loss = loss + settings.cover_weight * (1 - drawn.alpha).mean()
        if share >= settings.geometry_start:
            weights = settings.normal_weight, settings.distortion_weight
            loss = loss + disagreement(drawn, view.camera, weights)
        size = view.camera.width, view.camera.height
        return LossResult(loss, offsets, image_radius(values, view.camera), size)

    def _lamp_at(self, share: float) -> Lamp | MeasuredLamp:
        """Return the lamp when a share of the budget is spent."""
        way = share / self.settings.warm_up if self.settings.warm_up > 0 else 1.0
        return warming(self.lamp, min(way, 1.0))

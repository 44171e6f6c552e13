# SPDX-License-Identifier: Apache-2.0
"""Inputs of the second stage: surfels, tiles of the views, and light that is found with rays."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import torch

from graycard.io import Room
from graycard.methods.gsid._bounces import Bounces, bounced_light
from graycard.methods.gsid._draw import reach_in_view
from graycard.methods.gsid._lights import POSITIONS, lamps_from, sky_from
from graycard.methods.gsid._model import OPEN, SOFTEN, Reach, ground_of, matte_of
from graycard.methods.gsid._objective import DeferredView, GsidObjective
from graycard.methods.gsid._settings import GsidSettings
from graycard.methods.shading import lamp_visibility, surroundings_of
from graycard.methods.splat import Parameters, Surfels, surfels_of, windows_of


@dataclass(frozen=True, eq=False)
class LightStage:
    """Inputs of the second stage."""

    surfels: Surfels
    shots: Sequence[DeferredView]
    settings: GsidSettings
    extent: float
    seed: int
    bounces: Bounces | None = None
    """Between the surfels; None: light goes no further than to what it falls on."""
    traced: dict[tuple[float, ...], torch.Tensor] = field(default_factory=dict)
    """By places of lamps: the shares of shape ``(N,)`` of their light that arrive at the surfels. Rays to a
    place are traced once."""

    @property
    def steps(self) -> int:
        """Number of steps of this stage."""
        return self.settings.iterations - self.settings.geometry_steps

    def reached(self, places: torch.Tensor) -> torch.Tensor:
        """Shares of the light of lamps at places ``(K, 3)`` that arrive at the surfels, shape ``(N, K)``."""
        keys = [tuple(place) for place in places.tolist()]
        missing = [number for number, key in enumerate(keys) if key not in self.traced]
        found = lamp_visibility(self.surfels, self.surfels.centres, places[missing], self.extent)
        self.traced.update((keys[number], found[:, i]) for i, number in enumerate(missing))
        columns = [self.traced[key] for key in keys]
        return torch.stack(columns, dim=1) if columns else found


def renewed(stage: LightStage, parameters: Parameters) -> LightStage:
    """Return the stage with the surfels of the current parameters."""
    if stage.settings.geometry_rate == 0:
        return stage
    surfels, opened = surfels_of(parameters.surfels), parameters.surfels[OPEN]
    room = Room()
    shots = [replace(s, ground=room.keep(ground_of(surfels, s.ground.camera, opened))) for s in stage.shots]
    return replace(stage, surfels=surfels, shots=shots, traced={})


def at_half_size(stage: LightStage, parameters: Parameters) -> LightStage:
    """Return the stage with undivided views of half the width and height: cheap trials on all views."""
    room = Room()
    shots = [room.keep(shot.at_half_size(stage.surfels, parameters.surfels[OPEN])) for shot in stage.shots]
    largest = max(max(shot.shown.shape) for shot in shots)
    return replace(
        stage, shots=shots, settings=replace(stage.settings, tile=max(largest, stage.settings.tile))
    )


def at_tile_size(stage: LightStage, parameters: Parameters) -> LightStage:
    """Return the stage with views halved until no side is longer than one and a half tiles: at the cost of a
    tile a view all of them can be looked at.
    """
    smaller, most = stage, 1.5 * stage.settings.tile
    while max(max(shot.shown.shape[:2]) for shot in smaller.shots) > most:
        smaller = at_half_size(smaller, parameters)
    return smaller


def objective_in(stage: LightStage, parameters: Parameters) -> GsidObjective:
    """Return the loss, with rays traced to where the lamps are."""
    settings, tiles, reached = stage.settings, [], []
    for shot, reach in zip(stage.shots, reach_in(stage, parameters), strict=True):
        height, width = shot.shown.shape[:2]
        windows = windows_of(height, width, settings.tile)
        tiles += [shot.at(window) for window in windows]
        # surfels are shaded whole, whatever part of the view is drawn
        reached += [reach if settings.shading == "forward" else reach.at(window) for window in windows]
    return GsidObjective(tiles, reached, settings, stage.extent, stage.seed)


def reach_in(stage: LightStage, parameters: Parameters) -> list[Reach]:
    """Return the light that arrives in each training view."""
    reached = bounced = None
    if stage.settings.visibility == "traced":
        reached = stage.reached(parameters.shared[POSITIONS])
    if stage.bounces is not None:
        values = parameters.all
        sky = surroundings_of(sky_from(values))
        bounced = bounced_light(
            stage.bounces,
            matte_of(values),
            lamps_from(values),
            sky,
            values[OPEN],
            SOFTEN * stage.extent,
            reached=stage.reached(parameters.shared[POSITIONS]),
        ).sum(dim=1, keepdim=True)
    arrived, settings, room = Reach(reached, bounced), stage.settings, Room()
    found = (reach_in_view(stage.surfels, shot.ground, arrived, settings) for shot in stage.shots)
    return [one if one is arrived else room.keep(one) for one in found]

# SPDX-License-Identifier: Apache-2.0
"""Inputs of the second stage: surfels, tiles of the views, and light that is found with rays."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import torch

from graycard.io import Room
from graycard.methods.gsid._bounces import Bounces, bounced_light
from graycard.methods.gsid._draw import reach_in_view
from graycard.methods.gsid._lights import POSITIONS, lamps_from, sky_from
from graycard.methods.gsid._model import OPEN, SOFTEN, Reach, matte_of
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
    traced: "_Shares" = field(default_factory=dict)
    """By places of lamps: the shares of shape ``(N,)`` of their light that arrive at the surfels. Rays to a
    place are traced once."""
    traced_to_nodes: "_Shares" = field(default_factory=dict)
    """The same at the nodes of the bounces, ``(M,)``, which are a small part of the surfels."""

    @property
    def steps(self) -> int:
        """Number of steps of this stage."""
        return self.settings.iterations - self.settings.geometry_steps

    def reached(self, places: torch.Tensor) -> torch.Tensor:
        """Shares of the light of lamps at places ``(K, 3)`` that arrive at the surfels, shape ``(N, K)``."""
        return self._shares_at(self.surfels.centres, places, self.traced)

    def reached_nodes(self, bounces: Bounces, places: torch.Tensor) -> torch.Tensor:
        """Shares of the light of lamps that arrive at the nodes of the bounces, shape ``(M, K)``."""
        nodes = self.surfels.centres[torch.from_numpy(bounces.nodes)]
        return self._shares_at(nodes, places, self.traced_to_nodes)

    def _shares_at(self, points: torch.Tensor, places: torch.Tensor, known: "_Shares") -> torch.Tensor:
        """Return shares of light at points; places that are known are not traced again."""
        keys = [tuple(place) for place in places.tolist()]
        missing = [number for number, key in enumerate(keys) if key not in known]
        found = lamp_visibility(self.surfels, points, places[missing], self.extent)
        known.update((keys[number], found[:, i]) for i, number in enumerate(missing))
        columns = [known[key] for key in keys]
        return torch.stack(columns, dim=1) if columns else found


_Shares = dict[tuple[float, ...], torch.Tensor]
"""Shares of the light of lamps, by their places."""


def renewed(stage: LightStage, parameters: Parameters) -> LightStage:
    """Return the stage with the surfels of the current parameters.

    Views stay as they are: where surfels move, steps draw them anew.
    """
    if stage.settings.geometry_rate == 0:
        return stage
    return replace(stage, surfels=surfels_of(parameters.surfels), traced={}, traced_to_nodes={})


def at_half_size(stage: LightStage, parameters: Parameters, times: int = 1) -> LightStage:
    """Return the stage with undivided views whose width and height are halved so many times: cheap trials on
    all views.
    """
    if times == 0:
        return stage
    room, opened = Room(), parameters.surfels[OPEN]
    shots = [room.keep(shot.at_half_size(stage.surfels, opened, times)) for shot in stage.shots]
    tile = max(_longest_side(stage) // 2, stage.settings.tile)
    return replace(stage, shots=shots, settings=replace(stage.settings, tile=tile))


def at_tile_size(stage: LightStage, parameters: Parameters) -> LightStage:
    """Return the stage with views halved until no side is longer than one and a half tiles: at the cost of a
    tile a view all of them can be looked at.
    """
    side, times = _longest_side(stage), 0
    while side > 1.5 * stage.settings.tile:
        side, times = side // 2, times + 1
    return at_half_size(stage, parameters, times)


def _longest_side(stage: LightStage) -> int:
    """Pixels along the longest side of any view."""
    return max(max(shot.shown.shape[:2]) for shot in stage.shots)


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
            reached=stage.reached_nodes(stage.bounces, parameters.shared[POSITIONS]),
        ).sum(dim=1, keepdim=True)
    arrived, settings, room = Reach(reached, bounced), stage.settings, Room()
    found = (reach_in_view(stage.surfels, shot.ground.camera, arrived, settings) for shot in stage.shots)
    return [one if one is arrived else room.keep(one) for one in found]

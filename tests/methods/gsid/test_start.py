# SPDX-License-Identifier: Apache-2.0
"""Start of the second stage: it explains the photographs as the model shows them."""

from dataclasses import replace

import pytest
import torch

from graycard.methods.gsid import GsidSettings, _start
from graycard.methods.gsid._candidates import FirstLights
from graycard.methods.gsid._lights import first_lights
from graycard.methods.gsid._model import SHADOW, SIDE, lit_side
from graycard.methods.gsid._objective import GsidObjective
from graycard.methods.gsid._settings import Visibility
from graycard.methods.gsid._stage import LightStage, objective_in
from graycard.methods.gsid._start import first_parameters, search_in
from graycard.methods.splat import Parameters
from lit_sheets import EXTENT, LAMPS, World

SETTINGS = GsidSettings(iterations=160, sky_size=4, lamps=2, bounces=False)


def stage_of(world: World, settings: GsidSettings) -> LightStage:
    return LightStage(world.surfels, world.shots, settings, EXTENT, 0)


def surface_of(world: World) -> dict[str, torch.Tensor]:
    return {**world.surface, SIDE: lit_side(world.surfels, world.normals)}


def start_of(world: World, settings: GsidSettings) -> Parameters:
    return first_parameters(stage_of(world, settings), surface_of(world))


def loss_of(world: World, settings: GsidSettings, parameters: Parameters) -> float:
    return objective_in(stage_of(world, settings), parameters).over_all(parameters.all)


def test_a_vector_knows_the_shadow_of_the_board(world: World):
    """Nearly as good a start as rays have, and better than vectors that know of no shadow."""
    vectors = start_of(world, SETTINGS)
    unaware = {**vectors.surfels, SHADOW: -world.normals}
    found, without = (loss_of(world, SETTINGS, p) for p in (vectors, replace(vectors, surfels=unaware)))
    traced = replace(SETTINGS, visibility="traced")
    best = loss_of(world, traced, start_of(world, traced))
    assert found < 0.9 * without
    assert found < 1.2 * best


def test_strengths_are_those_of_what_vectors_tell(world: World):
    """The photographs have shadows of vectors, which are not the shadows of rays."""
    surface, settings = surface_of(world), replace(SETTINGS, lobes=1)
    surface[SHADOW] = torch.tensor([0.5, 0.3, 0.6]).expand_as(world.normals).clone()
    places = torch.tensor([lamp.position for lamp in LAMPS])
    true = torch.tensor([[[1.5, 1.2, 0.9]], [[0.5, 0.7, 1.0]]])
    lights = first_lights(FirstLights(places, true, torch.zeros(3), torch.full((6, 3), 0.05)), settings)
    lights["log lamp sharpness"][:] = -9
    stage, parameters = stage_of(world, settings), Parameters(surface, lights)
    objective = objective_in(stage, parameters)
    shots = [
        replace(shot, linear=objective.picture(parameters.all, number).whole)
        for number, shot in enumerate(world.shots)
    ]
    search = search_in(replace(stage, shots=shots), surface)
    told, traced = (search.lights_at(places, traced=t).intensities for t in (False, True))
    torch.testing.assert_close(told, true, rtol=0.02, atol=0)
    assert (traced - true).abs().max() > 0.1


def test_lamps_are_chosen_on_views_of_the_size_of_a_tile(world: World, monkeypatch: pytest.MonkeyPatch):
    """Whatever the size of photographs, that costs as much; the stage itself stays as it is."""
    looked_at: list[tuple[int, ...]] = []

    def noted(stage: LightStage, parameters: Parameters) -> GsidObjective:
        looked_at.extend(shot.shown.shape[:2] for shot in stage.shots)
        return objective_in(stage, parameters)

    monkeypatch.setattr(_start, "objective_in", noted)
    losses = []
    for tile, size in ((12, (16, 18)), (36, (32, 36))):
        looked_at.clear()
        found = start_of(world, replace(SETTINGS, tile=tile))
        assert set(looked_at) == {size}
        losses.append(loss_of(world, SETTINGS, found))
    assert losses[0] == pytest.approx(losses[1], rel=0.05), "small views show which lamps explain large ones"


@pytest.mark.parametrize(
    "visibility", [*(pytest.param(name, marks=pytest.mark.slow) for name in ("vector", "traced")), "none"]
)
def test_more_lamps_begin_no_worse(world: World, visibility: Visibility):
    """The start of rows ``gsid-env-ao``, ``gsid-lamps-1`` and ``gsid-lamps-8``."""
    losses = []
    for lamps in (0, 1, 8):
        settings = replace(SETTINGS, visibility=visibility, lamps=lamps, lamp_weight=0)
        losses.append(loss_of(world, settings, start_of(world, settings)))
    assert losses[1] <= losses[0] + 1e-6
    assert losses[2] <= losses[1] + 1e-6

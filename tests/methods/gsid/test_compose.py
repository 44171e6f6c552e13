# SPDX-License-Identifier: Apache-2.0
"""An object of one scene among the surfels of another."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from graycard import Composition, Donor, methods
from graycard.methods.gsid import GsidScene, GsidSettings
from graycard.methods.gsid._candidates import FirstLights
from graycard.methods.gsid._lights import first_lights
from graycard.methods.gsid._model import OPEN, SHADOW, SIDE, lit_side
from graycard.methods.gsid._settings import Visibility
from graycard.methods.shading import sky_visibility
from graycard.methods.splat import Parameters, moved_surfels, rasterize, surfels_of
from lit_sheets import EXTENT, World

ALIKE = GsidSettings(visibility="traced", lamps=1, lobes=1, sky_size=4, bounces=False, occlusion=False)
THERE = np.array([[0.0, -1.0, 0.0, 2.0], [1.0, 0.0, 0.0, -1.0], [0.0, 0.0, 1.0, 0.3], [0.0, 0.0, 0.0, 1.0]])
"""From the world in which the floor and the board are one scene to that of the donor."""


def scene_of(surface: dict[str, torch.Tensor], settings: GsidSettings, lamp: float) -> GsidScene:
    """Under a lamp and an even sky; of another place and strength in the donor."""
    lights = FirstLights(
        torch.tensor([[0.5, -0.3, 1.2]]), torch.full((1, 1, 3), lamp), torch.zeros(3), torch.full((6, 3), 0.1)
    )
    return GsidScene(Parameters(surface, first_lights(lights, settings)), settings, 1.0, EXTENT)


def taken(surface: dict[str, torch.Tensor], chosen: torch.Tensor) -> dict[str, torch.Tensor]:
    return {name: values[chosen] for name, values in surface.items()}


def parted(world: World) -> tuple[dict[str, torch.Tensor], torch.Tensor]:
    """The surface, and which surfels are the board's."""
    surface = world.surface | {SIDE: lit_side(world.surfels, world.normals)}
    return surface, surface["centres"][:, 2] > 0.2


def guest_of(
    surface: dict[str, torch.Tensor], board: torch.Tensor, world: World, lamp: float = 9.0
) -> methods.Guest:
    """The whole scene elsewhere, under another lamp, and where its photographs see the board."""
    donor = scene_of(moved_surfels(surface, THERE, [SHADOW]), ALIKE, 9.0)
    cameras = [
        replace(shot.ground.camera, camera_to_world=THERE @ shot.ground.camera.camera_to_world)
        for shot in world.shots
    ]
    marked = surfels_of(donor.parameters.surfels, board[:, None].float())
    masks = [(rasterize(marked, camera).features[..., 0] > 0.5).numpy() for camera in cameras]
    names = [str(number) for number in range(len(cameras))]
    return methods.Guest(donor, dict(zip(names, cameras, strict=True)), dict(zip(names, masks, strict=True)))


def composition() -> Composition:
    donor = Donor("multilight", "objects", 1000, {}, "board", 2)
    return Composition(donor, np.linalg.inv(THERE), 2)


def picture(scene: GsidScene, world: World) -> np.ndarray:
    return scene.render(world.shots[0].ground.camera, ["radiance"])["radiance"]


@pytest.mark.parametrize("visibility", ["traced", "vector"])
def test_a_board_that_is_put_over_its_floor_again_is_the_whole_scene(world: World, visibility: Visibility):
    """Lit by the host's lights, with its shadow on the floor, whatever its own vectors knew at home."""
    surface, board = parted(world)
    told = replace(ALIKE, visibility=visibility)
    whole = scene_of(surface, replace(ALIKE, visibility="traced"), 2.0)
    floor = scene_of(taken(surface, ~board), told, 2.0)
    surface[SHADOW] = surface[SHADOW] + torch.tensor([0.0, 0.5, 3.0])
    composed = floor.compose(composition(), guest_of(surface, board, world))
    assert composed is not None
    error = np.abs(picture(composed, world) - picture(whole, world))
    before = np.abs(picture(floor, world) - picture(whole, world))
    assert error.mean() < 0.05 * before.mean()
    assert len(composed.parameters) - int((~board).sum()) == pytest.approx(int(board.sum()), rel=0.1)


def test_what_stands_over_a_floor_hides_the_sky_from_it(world: World):
    surface, board = parted(world)
    settings = replace(ALIKE, occlusion=True)
    host = scene_of(taken(surface, ~board), settings, 2.0)
    composed = host.compose(composition(), guest_of(surface, board, world))
    assert composed is not None
    count = len(host.parameters)
    opened, centres = composed.parameters.surfels[OPEN][:count], host.parameters.surfels["centres"]
    below = (centres[:, :2] - torch.tensor([0.1, 0.1])).norm(dim=1) < 0.1
    far = centres[:, :2].norm(dim=1) > 1.2
    assert opened[below].mean() < 0.6 * opened[far].mean()
    alone = sky_visibility(surfels_of(host.parameters.surfels), world.normals[~board], EXTENT)
    torch.testing.assert_close(opened[far], alone[far], atol=0.1, rtol=0)


def test_masks_of_nothing_leave_the_scene_as_it_is(world: World):
    surface, board = parted(world)
    guest = guest_of(surface, board, world)
    nothing = replace(guest, masks={name: np.zeros_like(mask) for name, mask in guest.masks.items()})
    host = scene_of(taken(surface, ~board), ALIKE, 2.0)
    composed = host.compose(composition(), nothing)
    assert composed is not None
    np.testing.assert_array_equal(picture(composed, world), picture(host, world))


def test_without_a_guest_of_its_own_method_nothing_is_provided(world: World):
    surface, board = parted(world)
    host, guest = scene_of(surface, ALIKE, 2.0), guest_of(surface, board, world)
    assert isinstance(host, methods.Composable)
    assert host.compose(composition()) is None
    assert isinstance(guest.decomposition, GsidScene)
    other = replace(guest, decomposition=replace(guest.decomposition, method="gsir"))
    assert host.compose(composition(), other) is None

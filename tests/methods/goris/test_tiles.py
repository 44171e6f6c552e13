# SPDX-License-Identifier: Apache-2.0
"""A step with light transport looks at a tile of a view: it is drawn as the whole is, and has its turn."""

import pytest
import torch

from glossy_sheets import EXTENT, GlossyWorld, glossy_world, seen, shots_of_world, with_settings
from graycard.methods.goris._model import DIFFUSE, FRESNEL, REGION, ROUGHNESS, SURROUNDINGS
from graycard.methods.goris._objective import LightObjective
from graycard.methods.goris._remove import RemovalTarget, _tiled
from graycard.methods.goris._training_views import TrainingView, tiles_of
from graycard.methods.splat import CENTRES, ROTATIONS, Window, view_at, windows_of
from graycard.methods.surfels import COEFFICIENTS, DETAIL

HEIGHT, WIDTH = 36, 44
WINDOW = Window(12, 36, 10, 30)
"""Window with floor, boards and sky."""
MOVING = (CENTRES, ROTATIONS, COEFFICIENTS, DETAIL, DIFFUSE, FRESNEL, ROUGHNESS, REGION, SURROUNDINGS)
SHARP = with_settings(filter="none")
"""A blur ends with the tile, as it ends with a picture."""


@pytest.fixture(scope="module")
def world() -> GlossyWorld:
    return glossy_world()


def leaves(world: GlossyWorld) -> dict[str, torch.Tensor]:
    return {name: v.clone().requires_grad_(name in MOVING) for name, v in world.parameters.all.items()}


def test_a_tile_shows_what_the_whole_view_shows_there(world: GlossyWorld):
    for camera in world.cameras:
        whole, picture = seen(world.parameters.all, camera, SHARP)
        buffers, tile = seen(world.parameters.all, WINDOW.camera(camera), SHARP)
        for name in ("rough", "diffuse", "f0", "roughness", "glossy", "normal", "points"):
            found, expected = getattr(buffers, name), WINDOW.of(getattr(whole, name))
            torch.testing.assert_close(found, expected, atol=1e-4, rtol=1e-4, msg=name)
        assert float(tile.reflected.max()) > 0.1
        torch.testing.assert_close(tile.encoded, WINDOW.of(picture.encoded), atol=1e-3, rtol=1e-3)


def test_a_tile_has_the_gradients_of_its_part_of_the_whole_view(world: GlossyWorld):
    camera = world.cameras[1]
    weight = torch.rand(HEIGHT, WIDTH, 3, generator=torch.Generator().manual_seed(0))
    found = []
    for part in (Window(0, HEIGHT, 0, WIDTH), WINDOW):
        values = leaves(world)
        looked = WINDOW.of(seen(values, camera, SHARP)[1].encoded)
        if part == WINDOW:
            looked = seen(values, WINDOW.camera(camera), SHARP)[1].encoded
        loss = (looked * WINDOW.of(weight)).sum()
        found.append(torch.autograd.grad(loss, [values[name] for name in MOVING]))
    for name, whole, tile in zip(MOVING, *found, strict=True):
        assert tile.any(), name
        assert float((tile - whole).norm() / whole.norm()) < 1e-3, name


def test_a_part_of_a_view_has_all_that_the_view_has(world: GlossyWorld):
    for shot in shots_of_world(world):
        part = shot.at(WINDOW)
        assert torch.equal(part.glossy, WINDOW.of(shot.glossy))
        assert torch.equal(part.target, WINDOW.of(shot.target))
        assert part.normal is not None
        assert shot.normal is not None
        assert torch.equal(part.normal, WINDOW.of(shot.normal))
        assert part.told == shot.told
        assert torch.equal(part.photograph.encoded, WINDOW.of(shot.photograph.encoded))
        assert torch.equal(part.photograph.sky, WINDOW.of(shot.photograph.sky))
        rays = torch.from_numpy(shot.photograph.camera.rays())
        torch.testing.assert_close(torch.from_numpy(part.photograph.camera.rays()), WINDOW.of(rays))


def test_each_pixel_has_its_turn_in_a_round(world: GlossyWorld):
    """Loss of what a step looks at, told apart by the photograph: every tile of every view once."""
    shots = shots_of_world(world)
    tiles, windows = tiles_of(shots, 18), windows_of(HEIGHT, WIDTH, 18)
    assert len(tiles) == len(windows) * len(shots) == 4 * len(shots)
    for number, shot in enumerate(shots):
        own = tiles[4 * number : 4 * number + 4]
        for window, tile in zip(windows, own, strict=True):
            assert torch.equal(tile.photograph.encoded, window.of(shot.photograph.encoded))
    turns = [view_at(step, len(tiles), 0) for step in range(len(tiles))]
    assert sorted(turns) == list(range(len(tiles)))


def test_a_picture_no_larger_than_a_tile_has_the_same_bits(world: GlossyWorld):
    shots, settings = shots_of_world(world), with_settings(filter="paper")
    found = []
    for some in (shots, tiles_of(shots, settings.tile)):
        values = leaves(world)
        loss = LightObjective(some, settings, EXTENT, 0)(values, 1).loss
        found.append([loss, *torch.autograd.grad(loss, [values[name] for name in MOVING])])
    assert all(torch.equal(whole, tile) for whole, tile in zip(*found, strict=True))


def aim_of(shot: TrainingView, seed: int) -> RemovalTarget:
    draws = torch.Generator().manual_seed(seed)
    kept, rough, glossy, even = (torch.rand(HEIGHT, WIDTH, generator=draws) for _ in range(4))
    return RemovalTarget(kept, rough, glossy, shot.photograph.encoded, {"roughness": even})


def test_a_removal_has_tiles_with_their_targets(world: GlossyWorld):
    shots = shots_of_world(world)
    aims = [aim_of(shot, number) for number, shot in enumerate(shots)]
    tiles, cut = _tiled(shots, aims, with_settings(tile=18))
    assert len(tiles) == len(cut) == 4 * len(shots)
    windows = windows_of(HEIGHT, WIDTH, 18)
    for number, (tile, aim) in enumerate(zip(tiles, cut, strict=True)):
        window, of_view = windows[number % 4], aims[number // 4]
        assert torch.equal(tile.target, window.of(shots[number // 4].target))
        pairs = zip(aim.parts, of_view.parts, strict=True)
        assert all(torch.equal(part, window.of(whole)) for part, whole in pairs)


def test_a_loss_of_whole_holes_has_whole_views(world: GlossyWorld):
    shots = shots_of_world(world)
    aims = [aim_of(shot, 0) for shot in shots]
    assert _tiled(shots, aims, with_settings(tile=18, hole_loss="lpips")) == (shots, aims)

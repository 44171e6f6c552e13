# SPDX-License-Identifier: Apache-2.0
"""Tiles have their light where their middle is, and pixels what lies between."""

import pytest
import torch
from torch.nn.functional import interpolate

from graycard.methods.sunfaded import _tiles
from graycard.methods.sunfaded._settings import LightMap
from graycard.methods.sunfaded._tiles import lamp_map, tile_middles

HEIGHT, WIDTH = 13, 17


@pytest.fixture
def ramp(monkeypatch: pytest.MonkeyPatch) -> torch.Tensor:
    """Points at the row and column of their pixel, under a lamp that sends a point its own place."""
    monkeypatch.setattr(_tiles, "lamp_intensity", lambda values, points: points)
    rows, columns = torch.meshgrid(torch.arange(HEIGHT), torch.arange(WIDTH), indexing="ij")
    return torch.stack([rows, columns, torch.ones_like(rows)], dim=-1).float()


@pytest.mark.parametrize("side", [1, 2, 3, 4, 5, 16, 40])
def test_the_middle_is_the_mean_of_the_pixels_of_a_tile(side: int):
    tiles = torch.arange(WIDTH).float().split(side)
    torch.testing.assert_close(tile_middles(WIDTH, side), torch.stack([tile.mean() for tile in tiles]))


@pytest.mark.parametrize("side", [1, 2, 3, 4, 5, 16, 40])
def test_a_tile_has_the_mean_light_of_a_ramp(ramp: torch.Tensor, side: int):
    """So nothing is moved to a side, whether sizes are even or odd, or the border cuts the tile."""
    found = lamp_map({}, ramp, side, "nearest")
    for axis, length in ((0, HEIGHT), (1, WIDTH)):
        for tile in torch.arange(length).split(side):
            of_tile, true = found.index_select(axis, tile), ramp.index_select(axis, tile)
            expected = true[..., axis].mean(dim=axis, keepdim=True).expand_as(true[..., axis])
            torch.testing.assert_close(of_tile[..., axis], expected)


@pytest.mark.parametrize("side", [1, 2, 3, 4, 5])
def test_between_middles_a_ramp_is_kept(ramp: torch.Tensor, side: int):
    """Beyond the outermost middles light is even."""
    found = lamp_map({}, ramp, side, "bilinear")
    for axis, length in ((0, HEIGHT), (1, WIDTH)):
        middles = tile_middles(length, side)
        expected = ramp[..., axis].clamp(float(middles[0]), float(middles[-1]))
        torch.testing.assert_close(found[..., axis], expected)


@pytest.mark.parametrize(("kind", "side"), [("nearest", 40), ("bilinear", 40), ("bilinear", 17)])
def test_one_tile_has_one_light(ramp: torch.Tensor, kind: LightMap, side: int):
    found = lamp_map({}, ramp, side, kind)
    torch.testing.assert_close(found, ramp.mean(dim=(0, 1)).expand_as(found))


def test_whole_tiles_are_those_of_the_released_code(ramp: torch.Tensor):
    """Points resampled to the tiles and light to the pixels, without aligned corners."""
    points = torch.rand(12, 16, 3, generator=torch.Generator().manual_seed(0))

    def resampled(image: torch.Tensor, size: tuple[int, int]) -> torch.Tensor:
        return interpolate(image.movedim(-1, 0)[None], size, mode="bilinear")[0].movedim(0, -1)

    for side in (2, 4):
        expected = resampled(resampled(points, (12 // side, 16 // side)), (12, 16))
        torch.testing.assert_close(lamp_map({}, points, side, "bilinear"), expected)

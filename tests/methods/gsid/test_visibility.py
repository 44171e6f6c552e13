# SPDX-License-Identifier: Apache-2.0
"""Shadows: rays through surfels against geometry, and the readings of the paper's vector."""

import numpy as np
import pytest
import torch

from graycard.methods.gsid._visibility import VECTOR_FORMS, first_vectors, vector_visibility
from graycard.methods.shading import SLACK, lamp_visibility, outward, sky_visibility
from graycard.methods.splat import Surfels
from lit_sheets import EXTENT, World

OVERHEAD = torch.tensor([[0.1, 0.1, 1.5]])


def _tensors(surfels: Surfels) -> list[torch.Tensor]:
    return [surfels.centres, surfels.rotations, surfels.scales, surfels.opacities, surfels.features[:, :0]]


def points(*places: tuple[float, float, float]) -> torch.Tensor:
    return torch.tensor(places)


def test_the_board_is_in_the_way(world: World):
    under, beside = (0.1, 0.1, 0.0), (1.0, -1.0, 0.0)
    found = lamp_visibility(world.surfels, points(under, beside), OVERHEAD, EXTENT)
    np.testing.assert_allclose(found[:, 0], [0, 1], atol=0.05)


def test_a_surface_does_not_shade_itself(world: World):
    found = lamp_visibility(world.surfels, world.surfels.centres, OVERHEAD, EXTENT)[:, 0]
    board = world.surfels.centres[:, 2] > 0.3
    assert found[board].min() > 0.9
    shade = (world.surfels.centres[:, :2] - 0.1).abs().max(dim=1).values < 0.24
    assert found[~board & ~shade & (world.surfels.centres[:, :2].abs().amax(dim=1) < 1.1)].mean() > 0.9


def test_what_is_behind_the_lamp_is_in_nobodys_way(world: World):
    """The lamp hangs under the board, over the floor."""
    found = lamp_visibility(world.surfels, points((0.1, 0.1, 0.0)), points((0.1, 0.1, 0.2)), EXTENT)
    assert float(found) > 0.95


def test_a_veil_takes_its_share_and_no_more(world: World):
    """A disc of opacity 0.1 right under the lamp: the mean distance that a ray comes is short by a tenth."""
    veil = Surfels(
        torch.tensor([[0.1, 0.1, 1.3]]), torch.tensor([[1.0, 0, 0, 0]]), torch.full((1, 2), 5.0),
        torch.tensor([0.1]), torch.zeros(1, 3),
    )  # fmt: skip
    parts = zip(_tensors(veil), _tensors(world.surfels), strict=True)
    under = Surfels(*(torch.cat(pair) for pair in parts))
    found = lamp_visibility(under, points((1.0, -1.0, 0.0)), OVERHEAD, EXTENT)
    bare = lamp_visibility(world.surfels, points((1.0, -1.0, 0.0)), OVERHEAD, EXTENT)
    assert float(found) == pytest.approx(0.9 * float(bare), rel=0.01)


def test_a_lamp_in_a_surface_lights_it(world: World):
    here = world.surfels.centres[:1]
    assert float(lamp_visibility(world.surfels, here, here, EXTENT)) == pytest.approx(1)


def test_where_nothing_is_light_arrives(world: World):
    found = lamp_visibility(world.surfels, points((5.0, 5.0, 5.0)), OVERHEAD, EXTENT)
    assert float(found) == pytest.approx(1)
    assert lamp_visibility(world.surfels, points((0.0, 0.0, 0.0)), torch.zeros(0, 3), EXTENT).shape == (1, 0)


def test_the_sky_is_seen_from_above_and_hardly_from_under_the_board(world: World):
    found = sky_visibility(world.surfels, world.normals, EXTENT)
    centres = world.surfels.centres
    under = (centres[:, 2] < 0.1) & ((centres[:, :2] - 0.1).norm(dim=1) < 0.08)
    assert found[centres[:, 2] > 0.3].mean() > 0.98
    # 1 - r² / (r² + h²) of discs within the board and around it, from where rays begin
    height = 0.35 - SLACK * EXTENT
    assert 1 - 0.4**2 / (0.4**2 + height**2) < found[under].mean() < 1 - 0.24**2 / (0.24**2 + height**2)


def test_normals_are_on_the_side_of_the_eyes(world: World):
    up = outward(world.surfels, torch.tensor([[0.0, 0.0, 5.0]]))
    down = outward(world.surfels, torch.tensor([[0.0, 0.0, -5.0]]))
    assert (up[:, 2] > 0.99).all()
    torch.testing.assert_close(up, -down)


@pytest.mark.parametrize(
    ("form", "with_it", "aside", "against"),
    [("vector", 0.0, 1.0, 1.0), ("vector_half", 1.0, 0.5, 0.0), ("vector_relu", 1.0, 0.0, 0.0)],
)
def test_readings_of_a_vector(form, with_it: float, aside: float, against: float):
    up = torch.tensor([0.0, 0.0, 3.0])
    toward = torch.tensor([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    torch.testing.assert_close(vector_visibility(form, up, toward), torch.tensor([with_it, aside, against]))


UP, ASIDE = torch.tensor([0.0, 0.0, 1.0]), torch.tensor([0.8, 0.0, 0.6])


def test_vectors_begin_with_what_rays_found():
    """A surfel under two equal lamps, of which none, the one, the other or both are hidden."""
    reached = torch.tensor([[1.0, 1.0], [0.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
    toward = torch.stack([UP, ASIDE]).expand(4, 2, 3)
    given, normals = torch.ones(4, 2), UP.expand(4, 3)
    vectors = first_vectors("vector", normals, toward, given, reached)
    told = vector_visibility("vector", vectors, toward)
    torch.testing.assert_close(told[:3], reached[:3], atol=0.02, rtol=0)
    torch.testing.assert_close(vectors[0], -UP)
    assert told[3].max() < 0.6  # one vector for both: it points between them


@pytest.mark.parametrize("form", VECTOR_FORMS)
def test_no_other_vector_of_those_tried_is_nearer(form):
    drawn = torch.Generator().manual_seed(0)
    toward = torch.nn.functional.normalize(torch.randn(50, 3, 3, generator=drawn), dim=-1)
    given, reached = torch.rand(2, 50, 3, generator=drawn)
    normals = UP.expand(50, 3)
    vectors = first_vectors(form, normals, toward, given, reached)
    torch.testing.assert_close(vectors.norm(dim=1), torch.ones(50))

    def off(tried: torch.Tensor) -> torch.Tensor:
        return (given * (vector_visibility(form, tried, toward) - reached)).square().sum(dim=1)

    for other in (-normals, normals, *toward.unbind(dim=1), *(-toward).unbind(dim=1)):
        assert bool((off(vectors) <= off(other) + 1e-6).all())

# SPDX-License-Identifier: Apache-2.0
"""Light from surface to surface, held against closed forms."""

import numpy as np
import pytest
import torch

from graycard import PointLight
from graycard.methods.gsid._bounces import BOUNCES, Bounces, bounced_light, bounces_between
from graycard.methods.shading import lamp_visibility, lamps_of, surroundings_of
from graycard.methods.splat import Surfels, surfels_from_points

STEP = 0.05


def square(axis: int, at: float, normal: float, half: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """Points of a square across an axis, and its normals along it."""
    steps = np.arange(-half + STEP / 2, half, STEP)
    points = np.zeros((len(steps) ** 2, 3))
    points[:, [a for a in range(3) if a != axis]] = np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2)
    points[:, axis] = at
    return points, np.broadcast_to(normal * np.eye(3)[axis], points.shape)


def built(*squares: tuple[np.ndarray, np.ndarray], size: float = 1.0) -> tuple[Surfels, torch.Tensor]:
    points, normals = (np.concatenate(parts) for parts in zip(*squares, strict=True))
    discs = surfels_from_points(points, normals, np.full_like(points, 0.5))
    sizes, solid = torch.full_like(discs.scales, size * STEP), torch.full((len(points),), 0.99)
    discs = Surfels(discs.centres, discs.rotations, sizes, solid, discs.features)
    return discs, torch.from_numpy(normals.copy()).float()


@pytest.fixture(scope="module")
def box() -> tuple[Surfels, torch.Tensor, Bounces]:
    """The inside of a cube of side 1."""
    surfels, normals = built(*(square(axis, side / 2, -side) for axis in range(3) for side in (-1, 1)))
    return surfels, normals, bounces_between(surfels, normals, 1.0)


def test_in_a_closed_room_all_light_comes_from_its_walls(box: tuple[Surfels, torch.Tensor, Bounces]):
    _, _, bounces = box
    shares = np.asarray(bounces.onto.sum(axis=1)).ravel()
    assert shares.max() <= 1 + 1e-5
    assert np.median(shares) > 0.97
    assert shares.mean() > 0.9


def test_even_walls_that_return_a_half_send_a_geometric_series(box: tuple[Surfels, torch.Tensor, Bounces]):
    """One unit falls on each, and rho is sent on each time."""
    _, _, bounces = box
    one = np.ones((len(bounces.nodes), 2), np.float32)
    sent = bounces.sent_on(one, one * [0.5, 0.8])
    for channel, rho in enumerate((0.5, 0.8)):
        series = sum(rho**n for n in range(1, BOUNCES + 1))
        assert np.median(sent[:, channel]) == pytest.approx(series, rel=0.05)


def test_squares_that_face_each_other_see_a_fifth_of_each_other():
    """Two squares, as far apart as they are wide: the view factor is 0.1998 (Howell, configuration C-11).

    Discs reach a little beyond the rims.
    """
    floor, ceiling = square(2, 0.0, 1.0, half=1.0), square(2, 2.0, -1.0, half=1.0)
    surfels, normals = built(floor, ceiling, size=0.6)
    bounces = bounces_between(surfels, normals, 0.2)
    count = len(floor[0])
    assert bounces.onto[:count].sum(axis=1).mean() == pytest.approx(0.205, rel=0.05)
    assert bounces.onto[count:].sum(axis=1).mean() == pytest.approx(0.205, rel=0.05)
    turned = torch.cat([normals[:count], -normals[count:]])  # the ceiling's lit side is the upper one
    assert bounces_between(surfels, turned, 0.2).onto[:count].sum() == 0


def test_light_by_way_is_found_light_by_light(box: tuple[Surfels, torch.Tensor, Bounces]):
    """Lamps add up; of a lamp in the middle of a white box the energy is what comes out."""
    surfels, _, bounces = box
    count = len(surfels)
    lights = [
        PointLight("a", (0.0, 0.0, 0.0), (1.0, 2.0, 0.0)),
        PointLight("b", (0.2, 0.1, 0.0), (0.5, 0.0, 1.0)),
    ]
    albedo, opened = torch.full((count, 3), 0.5), torch.zeros(count)
    dark = surroundings_of(torch.zeros(6, 2, 2, 3))
    both = bounced_light(bounces, albedo, lamps_of(lights), dark, opened, 0.0)
    assert both.shape == (count, 3, 3)
    assert not both[:, 2].any()  # the sky
    for number, light in enumerate(lights):
        alone = bounced_light(bounces, albedo, lamps_of([light]), dark, opened, 0.0)
        torch.testing.assert_close(alone[:, 0], both[:, number])
    # 4 pi watts on 6 square metres, of which a half is sent on, and a half of that again
    falls = 4 * np.pi / 6
    series = sum(0.5**n for n in range(1, BOUNCES + 1))
    assert float(both[:, 0, 0].mean()) == pytest.approx(falls * series, rel=0.1)


def test_rays_to_the_nodes_alone_find_what_rays_to_all_find(box: tuple[Surfels, torch.Tensor, Bounces]):
    """To the bit: fits trace to the nodes alone."""
    surfels, _, bounces = box
    places = torch.tensor([[0.0, 0.0, 0.0], [0.2, -0.3, 0.1], [0.6, 0.6, 0.6]])
    whole = lamp_visibility(surfels, surfels.centres, places, 0.3)
    part = lamp_visibility(surfels, surfels.centres[bounces.nodes], places, 0.3)
    assert torch.equal(part, whole[torch.from_numpy(bounces.nodes)])
    assert 0 < float(part.mean()) < 1


def test_a_sky_sends_light_by_way_too():
    """A white sky on an open floor beside a wall: the floor gets light of the wall near to it alone."""
    floor, wall = square(2, 0.0, 1.0), square(0, -0.5, 1.0)
    wall = (wall[0] + [0, 0, 0.5], wall[1])
    surfels, normals = built(floor, wall)
    bounces = bounces_between(surfels, normals, 0.3)
    lit = bounced_light(
        bounces, torch.full((len(surfels), 3), 0.7), lamps_of([PointLight("out", (0, 0, 5), (0, 0, 0))]),
        surroundings_of(torch.ones(6, 4, 4, 3)), torch.ones(len(surfels)), 0.0,
    )  # fmt: skip
    on_floor, x = lit[: len(floor[0]), 1, 0], surfels.centres[: len(floor[0]), 0]
    assert on_floor[x < -0.35].mean() > 4 * on_floor[x > 0.35].mean()
    assert on_floor[x < -0.35].mean() < 0.7 * np.pi

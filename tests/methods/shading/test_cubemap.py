# SPDX-License-Identifier: Apache-2.0
"""Cubemaps: the solid angles of their texels, and seeing across their edges."""

import numpy as np
import pytest
import torch

from graycard.methods.shading import from_latitudes, look_up, solid_angles, texel_directions, to_latitudes
from graycard.methods.shading._cubemap import look_up_between, turned_texels


def sphere(seed: int, count: int = 4000) -> torch.Tensor:
    drawn = torch.randn(count, 3, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    return torch.nn.functional.normalize(drawn, dim=-1)


@pytest.mark.parametrize("size", [1, 2, 5, 16])
def test_texels_cover_the_sphere(size: int) -> None:
    assert 6 * solid_angles(size).sum() == pytest.approx(4 * np.pi, rel=1e-13)


def test_a_corner_texel_is_as_large_as_fine_ones_in_it() -> None:
    """``∫ (1 + u² + v²)^-1.5 du dv`` by Gauss: and at the corner it is far from the texel's area."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    x = 0.75 + 0.25 * nodes
    expected = (weights[:, None] * weights * 0.0625 * (1 + x[:, None] ** 2 + x**2) ** -1.5).sum()
    assert solid_angles(4)[3, 3] == pytest.approx(expected, rel=1e-12)
    assert solid_angles(4)[3, 3] < 0.5 * solid_angles(4)[1, 1]


def test_faces_look_along_their_axes() -> None:
    middles = texel_directions(3)[:, 1, 1]
    np.testing.assert_allclose(middles, np.repeat(np.eye(3), 2, axis=0) * np.tile([1, -1], 3)[:, None])


def test_seen_from_inside_no_face_is_mirrored() -> None:
    """To the right and down and ahead are a right-handed system, as in a camera."""
    directions = texel_directions(8)
    right = directions[:, 4, 5] - directions[:, 4, 3]
    down = directions[:, 5, 4] - directions[:, 3, 4]
    assert (np.sum(np.cross(right, down) * directions[:, 4, 4], axis=-1) > 0).all()


@pytest.mark.parametrize("size", [1, 4, 9])
def test_texels_are_found_where_they_look(size: int) -> None:
    texels = torch.rand(6, size, size, 3, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    seen = look_up(texels, torch.from_numpy(texel_directions(size)) * 3)
    torch.testing.assert_close(seen, texels, rtol=0, atol=1e-12)


def test_nothing_jumps_at_edges_and_corners() -> None:
    texels = torch.rand(6, 8, 8, 1, generator=torch.Generator().manual_seed(2), dtype=torch.float64)
    on_edge = sphere(3)
    order = on_edge.abs().argsort(dim=-1, descending=True)
    first, second = order[:, :1], order[:, 1:2]
    largest = on_edge.gather(1, first).abs()
    on_edge = on_edge.scatter(1, second, on_edge.gather(1, second).sign() * largest)
    sides = [on_edge.scatter(1, axis, on_edge.gather(1, axis) * (1 + 1e-9)) for axis in (first, second)]
    torch.testing.assert_close(look_up(texels, sides[0]), look_up(texels, sides[1]), rtol=0, atol=1e-6)


def test_a_smooth_sky_is_seen_as_it_is() -> None:
    def sky(w: torch.Tensor) -> torch.Tensor:
        return torch.stack([1 + w[..., 0], 1 + w[..., 1] * w[..., 2], 1 + w[..., 2]], dim=-1)

    texels = sky(torch.from_numpy(texel_directions(32)))
    torch.testing.assert_close(look_up(texels, sphere(4)), sky(sphere(4)), rtol=0, atol=6e-3)


def test_a_turned_cube_has_each_texel_once() -> None:
    """And the middle of each face becomes that of the first."""
    turned = turned_texels(3)
    np.testing.assert_array_equal(turned.sort(dim=1).values, np.tile(np.arange(54), (6, 1)))
    np.testing.assert_array_equal(turned[0], np.arange(54))
    assert [int(turned[face, 9 * face + 4]) for face in range(6)] == [4] * 6
    assert [int(turned[face, 9 * face]) for face in range(6)] == [0] * 6


def test_gradients() -> None:
    texels = torch.rand(6, 3, 3, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(5))
    at = sphere(6, 12).requires_grad_()
    assert torch.autograd.gradcheck(look_up, (texels.requires_grad_(), at))


def skies_of(sizes: tuple[int, ...]) -> list[torch.Tensor]:
    draw = torch.Generator().manual_seed(8)
    return [torch.rand(6, size, size, 2, generator=draw, dtype=torch.float64) for size in sizes]


def test_between_two_skies_it_is_linear() -> None:
    """In numbers of either side of each, at it, and beyond the ends."""
    skies, at = skies_of((4, 2, 3)), sphere(9, 60).reshape(5, 12, 3)
    levels = torch.tensor([-0.5, 0.0, 0.3, 0.99, 1.0, 1.2, 1.8, 2.0, 2.5, 9.0, 0.5, 1.5], dtype=torch.float64)
    number = levels.clamp(0, 2)
    shares = [(1 - (number - k).abs()).clamp(min=0)[:, None] for k in range(3)]
    expected = sum(share * look_up(sky, at) for share, sky in zip(shares, skies, strict=True))
    torch.testing.assert_close(look_up_between(skies, at, levels), expected, rtol=0, atol=1e-12)


def test_gradients_between_skies() -> None:
    skies, at = skies_of((2, 3)), sphere(10, 9).requires_grad_()
    levels = torch.linspace(0.1, 0.9, 9, dtype=torch.float64).requires_grad_()

    def value(*parts: torch.Tensor) -> torch.Tensor:
        return look_up_between(parts[2:], parts[0], parts[1])

    assert torch.autograd.gradcheck(value, (at, levels, *(sky.requires_grad_() for sky in skies)))


def test_a_level_at_a_sky_or_beyond_the_ends_stays() -> None:
    skies, at = skies_of((2, 3, 2)), sphere(11, 4)
    levels = torch.tensor([0.0, 1.0, 2.5, -1.0], dtype=torch.float64).requires_grad_()
    look_up_between(skies, at, levels).sum().backward()
    assert levels.grad is not None
    assert levels.grad.tolist() == [0, 0, 0, 0]


def test_in_no_direction_nothing_is_seen() -> None:
    assert look_up(skies_of((2,))[0], torch.empty(0, 3)).shape == (0, 2)


@pytest.mark.parametrize("wrong", [0.0, np.nan, np.inf])
def test_in_no_direction_nan_is_seen_and_texels_have_no_part_in_it(wrong: float) -> None:
    skies, at = [sky.requires_grad_() for sky in skies_of((2, 3))], sphere(12, 3)
    at[1] = wrong
    at.requires_grad_()
    seen = look_up_between(skies, at, torch.full((3,), 0.5, dtype=torch.float64))
    assert seen.isnan().any(dim=1).tolist() == [False, True, False]
    gradients = torch.autograd.grad(seen.sum(), [at, *skies])
    assert gradients[0].isnan().any(dim=1).tolist() == [False, True, False]
    assert all(gradient.isfinite().all() for gradient in gradients[1:])


def test_at_no_level_nan_is_seen() -> None:
    levels = torch.tensor([0.5, np.nan], dtype=torch.float64)
    seen = look_up_between(skies_of((2, 3)), sphere(13, 2), levels)
    assert seen.isnan().any(dim=1).tolist() == [False, True]


def test_latitudes_and_back() -> None:
    """A sky of three smooth colours, with its pole and its azimuth where the vocabulary has them."""
    polar, azimuth = np.pi * (np.arange(32) + 0.5)[:, None] / 32, np.pi * (np.arange(64) + 0.5)[None] / 32
    parts = 1 + np.sin(polar) * np.cos(azimuth), 1 + np.sin(polar) * np.sin(azimuth), 1 + np.cos(polar)
    image = np.stack(np.broadcast_arrays(*parts), axis=-1)
    cubemap = from_latitudes(image, 16)
    torch.testing.assert_close(
        cubemap.double(), 1 + torch.from_numpy(texel_directions(16)), rtol=0, atol=5e-3
    )
    np.testing.assert_allclose(to_latitudes(cubemap, 32), image, atol=1.2e-2)


def test_no_light_is_lost_on_the_way_to_a_cubemap() -> None:
    image = np.random.default_rng(7).uniform(0, 1, (16, 32, 3))
    image[3, 5] = 100
    rows = 2 * np.pi / 32 * -np.diff(np.cos(np.pi * np.arange(17) / 16))
    expected = (image * rows[:, None, None]).sum(axis=(0, 1))
    found = (from_latitudes(image, 8, 8).double() * torch.from_numpy(solid_angles(8))[None, ..., None]).sum(
        dim=(0, 1, 2)
    )
    np.testing.assert_allclose(found, expected, rtol=0.02)

# SPDX-License-Identifier: Apache-2.0
"""The lamp on the camera: its network, its tiles, and the cosine at the surface."""

import numpy as np
import pytest
import torch

from graycard import Camera, look_at
from graycard.methods.sunfaded._light import (
    NETWORK,
    POSITION,
    cosine_to_lamp,
    lamp_intensity,
    lamp_parameters,
)
from graycard.methods.sunfaded._tiles import lamp_map, lens_of, points_of, tile_side


def by_hand(values: dict[str, torch.Tensor], point: np.ndarray) -> np.ndarray:
    """The network of one point in plain numpy, from the text of the paper's released code."""
    away = point - values[POSITION].numpy()
    distance = np.linalg.norm(away)
    x, y, z = away / distance
    bands = 2.0 ** np.arange(6)

    def code(number: np.floating) -> list[float]:
        return [*np.sin(bands * number), *np.cos(bands * number)]

    hidden = np.array(code(np.arcsin(y)) + code(np.arctan2(x, z)))
    for layer in range(5):
        weights, biases = (values[f"lamp {kind} {layer}"].numpy() for kind in ("weights", "biases"))
        if layer == 3:
            hidden = np.concatenate([hidden, code(distance / 10)])
        hidden = weights @ hidden + biases
        hidden = np.maximum(hidden, 0) if layer < 4 else np.log1p(np.exp(hidden))
    return hidden


def test_the_network_is_that_of_the_text():
    values = {name: v.double() for name, v in lamp_parameters(3).items()}
    values[POSITION] += torch.tensor([0.3, -0.1, 0.05])
    points = torch.tensor([[0.2, 0.4, 2.0], [-1.0, 0.1, 0.7], [3.0, -2.0, 5.0]], dtype=torch.float64)
    expected = [by_hand(values, point) for point in points.numpy()]
    np.testing.assert_allclose(lamp_intensity(values, points), expected, rtol=1e-9)


def test_a_lamp_begins_about_as_bright_as_asked():
    """A faint one too, and in each channel; without a level it sends about log 2."""
    points = torch.randn(500, 3, generator=torch.Generator().manual_seed(0)) + torch.tensor([0.0, 0, 3])
    level = torch.tensor([0.02, 0.5, 3.0])
    found = lamp_intensity(lamp_parameters(0, level), points).mean(dim=0)
    torch.testing.assert_close(found, level, rtol=0.25, atol=0)
    plain = lamp_intensity(lamp_parameters(0), points).mean(dim=0)
    torch.testing.assert_close(plain, torch.full((3,), np.log(2.0), dtype=torch.float32), rtol=0.25, atol=0)


def test_every_number_of_the_lamp_gets_a_gradient_that_finite_differences_confirm():
    values = {name: v.double().requires_grad_() for name, v in lamp_parameters(0).items()}
    points = torch.tensor([[0.2, 0.4, 2.0], [-1.0, 0.1, 0.7]], dtype=torch.float64)
    normals = torch.nn.functional.normalize(-points, dim=1)

    def light(position: torch.Tensor) -> torch.Tensor:
        moved = {**values, POSITION: position}
        return lamp_intensity(moved, points) * cosine_to_lamp(moved, points, normals)

    start = torch.tensor([0.1, -0.2, 0.05], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(light, (start,))
    for name in NETWORK:
        (gradient,) = torch.autograd.grad(light(start).sum(), values[name])
        assert torch.isfinite(gradient).all()
        assert gradient.abs().max() > 0


def test_a_point_straight_above_the_lamp_has_a_finite_gradient():
    position = torch.zeros(3, requires_grad=True)
    values = {**lamp_parameters(0), POSITION: position}
    light = lamp_intensity(values, torch.tensor([[0.0, 2.0, 0.0], [0.0, -1.0, 0.0]]))
    (gradient,) = torch.autograd.grad(light.sum(), position)
    assert torch.isfinite(gradient).all()


def test_a_lamp_to_the_right_lights_what_faces_right():
    """Camera axes: x to the right. The lamp is 30 cm to the right, the wall 1 m ahead."""
    values = {POSITION: torch.tensor([0.3, 0.0, 0.0])}
    wall = torch.tensor([[0.3, 0.0, 1.0], [-0.7, 0.0, 1.0]])
    facing = torch.tensor([[0.0, 0.0, -1.0]]).expand(2, 3)
    found = cosine_to_lamp(values, wall, facing)[:, 0]
    np.testing.assert_allclose(found, [1.0, np.sqrt(0.5)], rtol=1e-6)
    right, left = torch.tensor([[1.0, 0.0, -1.0]]), torch.tensor([[-1.0, 0.0, -1.0]])
    middle = torch.tensor([[0.0, 0.0, 1.0]])
    assert cosine_to_lamp(values, middle, right) > cosine_to_lamp(values, middle, left)
    assert cosine_to_lamp(values, middle, -facing[:1]) == 0


def test_points_are_those_of_the_camera():
    camera = Camera.from_fov(7, 5, 60, look_at(np.array([1.0, -3, 2]), np.array([0, 0, 0.5])))
    depth = torch.linspace(1, 3, 35).reshape(5, 7)
    points = points_of(depth, lens_of(camera))
    world = points.numpy() @ camera.camera_to_world[:3, :3].T + camera.position
    pixels, z = camera.project(world)
    x, y = np.meshgrid(np.arange(7) + 0.5, np.arange(5) + 0.5)
    np.testing.assert_allclose(pixels, np.stack([x, y], axis=-1), atol=1e-5)
    np.testing.assert_allclose(z, depth, rtol=1e-6)


@pytest.mark.parametrize("kind", ["nearest", "bilinear"])
def test_tiles_of_one_pixel_are_pixels(kind: str):
    values = lamp_parameters(1)
    points = torch.rand(6, 9, 3, generator=torch.Generator().manual_seed(0)) + torch.tensor([0.0, 0, 1])
    found = lamp_map(values, points, 1, kind)  # pyright: ignore[reportArgumentType]
    torch.testing.assert_close(found, lamp_intensity(values, points))


def test_bilinear_tiles_of_a_smooth_surface_come_close_to_pixels():
    """On a plane; with the side of a tile their error falls faster than that of nearest ones."""
    values = lamp_parameters(1)
    y, x = torch.meshgrid(torch.linspace(-0.1, 0.1, 64), torch.linspace(-0.1, 0.1, 64), indexing="ij")
    points = torch.stack([x, y, 2 + 0.3 * x], dim=-1)
    exact = lamp_intensity(values, points)
    inner = slice(8, -8)
    errors = {
        (kind, side): float((lamp_map(values, points, side, kind) - exact)[inner, inner].abs().mean())
        for kind in ("nearest", "bilinear")
        for side in (2, 4)
    }
    assert errors["bilinear", 4] > 2.5 * errors["bilinear", 2]
    assert errors["nearest", 4] > 1.6 * errors["nearest", 2]
    assert errors["bilinear", 4] < 0.2 * errors["nearest", 4]


@pytest.mark.parametrize(("width", "side"), [(1024, 16), (112, 2), (20, 1)])
def test_a_tile_is_a_share_of_the_width(width: int, side: int):
    assert tile_side(width, 1 / 64) == side

# SPDX-License-Identifier: Apache-2.0
"""Light of the calibrated lamp, and surfels under it."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from graycard import Camera, PointLight, SpotLight, angles, look_at
from graycard.methods.darkgs._lamp import TAU, irradiance, warming
from graycard.methods.darkgs._model import AMBIENT, NORMALS, PAINT, albedo_of, shade
from graycard.methods.splat import CENTRES

SPOT = SpotLight("lamp", (0.25, -0.06, 0.1), (-0.2, 0.1, 2.0), (9.0, 8.0, 6.0), 15.0, 38.0, "camera")
BULB = PointLight("lamp", (0.3, -0.1, 0.0), (12.0, 10.0, 8.0), "camera")
CAMERA = Camera.from_fov(24, 20, 50, look_at(np.array([0.2, -2.0, 1.0]), np.array([0.0, 0.0, 0.2])))


def at(angle: float, distance: float) -> torch.Tensor:
    """A point so many degrees off the axis of the spot light."""
    axis = np.array(SPOT.direction) / np.linalg.norm(SPOT.direction)
    aside = np.cross(axis, [0.0, 1.0, 0.0])
    aside /= np.linalg.norm(aside)
    way = np.cos(np.radians(angle)) * axis + np.sin(np.radians(angle)) * aside
    return torch.from_numpy(np.array(SPOT.position) + distance * way)


@pytest.mark.parametrize(
    ("angle", "share"), [(0, 1), (10, 1), (14.9, 1), (26.5, 0.5), (32.25, 0.25), (38.5, 0), (120, 0)]
)
def test_a_spot_light_falls_linearly_to_its_cutoff(angle: float, share: float):
    expected = share * np.array(SPOT.intensity) / (1.7**2 + TAU)
    np.testing.assert_allclose(irradiance(SPOT, at(angle, 1.7)), expected, atol=1e-4)


def test_a_bare_bulb_falls_with_the_square_of_the_distance():
    points = torch.tensor([[0.3, -0.1, 2.0], [2.3, -0.1, 0.0], [0.3, -0.1, 0.0]], dtype=torch.float64)
    found = irradiance(BULB, points)
    np.testing.assert_allclose(found[:2], np.tile(np.array(BULB.intensity) / (4 + TAU), (2, 1)))
    np.testing.assert_allclose(found[2], np.array(BULB.intensity) / TAU)


@pytest.mark.parametrize("lamp", [SPOT, BULB])
def test_its_slope_is_that_of_finite_differences(lamp: SpotLight | PointLight):
    points = torch.stack([at(5, 1.0), at(25, 2.0), at(33, 0.5)]).requires_grad_()
    assert torch.autograd.gradcheck(lambda p: irradiance(lamp, p), (points,))
    on_axis = at(0, 1.0).requires_grad_()
    (slope,) = torch.autograd.grad(irradiance(lamp, on_axis).sum(), on_axis)
    assert torch.isfinite(slope).all()


def test_the_lamp_warms_up_from_the_lens_to_its_place():
    for lamp in (SPOT, BULB):
        first, last = warming(lamp, 0.0), warming(lamp, 1.0)
        assert first.position == (0, 0, 0)
        assert last.position == lamp.position
        assert warming(lamp, 0.5).position == pytest.approx(np.array(lamp.position) / 2)
        assert (first.intensity, first.frame) == (lamp.intensity, "camera")
    first, last = warming(SPOT, 0.0), warming(SPOT, 1.0)
    assert isinstance(first, SpotLight)
    assert isinstance(last, SpotLight)
    assert first.direction == (0, 0, 1)
    assert float(angles(np.array(last.direction), np.array(SPOT.direction))) < 1e-5


def surfel(angle: float) -> dict[str, torch.Tensor]:
    """One surfel ahead of the lamp at two metres, turned so many degrees away from it."""
    lamp = np.array(BULB.position)
    local = lamp + np.array([0.0, 0.0, 2.0])
    normal = np.array([np.sin(np.radians(angle)), 0.0, -np.cos(np.radians(angle))])
    to_world = CAMERA.camera_to_world
    return {
        CENTRES: torch.from_numpy(to_world[:3, :3] @ local + CAMERA.position)[None],
        NORMALS: 3.0 * torch.from_numpy(to_world[:3, :3] @ normal)[None],
        PAINT: torch.tensor([[0.2, 0.4, 0.6]], dtype=torch.float64).expm1().log(),
        AMBIENT: torch.tensor([0.3, 0.2, 0.1], dtype=torch.float64).log(),
    }


@pytest.mark.parametrize(("angle", "cosine"), [(0, 1.0), (60, 0.5), (100, 0.0)])
def test_a_surfel_is_a_matte_surface_whatever_the_length_of_its_normal(angle: float, cosine: float):
    values, exposure = surfel(angle), 0.7
    shaded = shade(values, CAMERA, BULB, exposure)
    albedo = np.array([[0.2, 0.4, 0.6]])
    np.testing.assert_allclose(albedo_of(values), albedo)
    expected = exposure * albedo / np.pi * np.array(BULB.intensity) / (4 + TAU) * cosine
    np.testing.assert_allclose(shaded.lamp, expected, atol=1e-12)
    np.testing.assert_allclose(shaded.ambient, albedo * [0.3, 0.2, 0.1] * cosine, atol=1e-12)


def test_every_number_of_a_surfel_gets_the_slope_of_finite_differences():
    values = {name: v.clone().requires_grad_() for name, v in surfel(30).items()}

    def sent(*numbers: torch.Tensor) -> torch.Tensor:
        shaded = shade(dict(zip(values, numbers, strict=True)), CAMERA, SPOT, 0.7)
        return shaded.lamp + shaded.ambient

    assert torch.autograd.gradcheck(sent, tuple(values.values()))


def test_twice_the_light_is_twice_the_lamps_part():
    values = surfel(20)
    once = shade(values, CAMERA, SPOT, 1.0)
    twice = shade(values, CAMERA, replace(SPOT, intensity=(18.0, 16.0, 12.0)), 1.0)
    torch.testing.assert_close(twice.lamp, 2 * once.lamp)
    torch.testing.assert_close(twice.ambient, once.ambient)

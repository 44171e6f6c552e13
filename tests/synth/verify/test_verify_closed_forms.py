# SPDX-License-Identifier: Apache-2.0
"""Irradiances against textbook values."""

import numpy as np
import pytest

from graycard import (
    Camera,
    EnvironmentLight,
    GaussianLight,
    Light,
    PointLight,
    RectangleLight,
    SphereLight,
    SphericalGaussian,
    SpotLight,
    look_at,
)
from graycard.synth.verify._closed_forms import sky_directions, sky_towards, unblocked_irradiance

CAMERA = Camera.from_fov(8, 8, 50, look_at(np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.0, 0.0])))
ORIGIN, UP = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])


def irradiance(light: Light, point: np.ndarray = ORIGIN, normal: np.ndarray = UP, sky=None) -> np.ndarray:
    found = unblocked_irradiance(light, CAMERA, point, normal, sky)
    assert found is not None
    return found[0]


def test_a_point_light_falls_off_with_the_square_and_the_cosine():
    light = PointLight("p", (0, 3, 4), (10, 20, 30))
    assert irradiance(light) == pytest.approx(np.array([10, 20, 30]) * 0.8 / 25)
    assert irradiance(light, normal=-UP) == pytest.approx(0)


def test_a_light_on_the_camera_moves_with_it():
    light = PointLight("p", (0, 0, 0), (1, 1, 1), "camera")
    assert irradiance(light) == pytest.approx(np.full(3, 3 / 14**1.5))


@pytest.mark.parametrize(("degrees", "share"), [(5, 1.0), (15, 0.5), (19, 0.1), (25, 0.0)])
def test_a_spot_light_is_linear_in_the_angle(degrees: float, share: float):
    x = float(np.tan(np.radians(degrees)))
    light = SpotLight("s", (x, 0, 1), (0, 0, -1), (1, 1, 1), 10, 20)
    cosine = np.cos(np.radians(degrees))
    assert irradiance(light)[0] == pytest.approx(share * cosine**3, rel=1e-9, abs=1e-12)


def test_a_light_of_spherical_gaussians_has_its_amplitude_on_the_axis():
    lobes = (
        SphericalGaussian((0.0, 0.0, -1.0), 7.0, (1.0, 2.0, 3.0)),
        SphericalGaussian((1.0, 0.0, 0.0), 2.0, (1.0, 0.0, 0.0)),
    )
    expected = np.array([1 + np.exp(-2), 2, 3]) / 4
    assert irradiance(GaussianLight("g", (0, 0, 2), lobes)) == pytest.approx(expected)


def test_directions_of_a_light_on_the_camera_are_in_its_axes():
    """The camera looks at the origin, from where the axis of the light seems to be the line of sight."""
    on_axis = SpotLight("s", (0, 0, 0), (0, 0, 1), (1, 1, 1), 1, 2, "camera")
    beside = SpotLight("s", (0, 0, 0), (1, 0, 1), (1, 1, 1), 1, 2, "camera")
    assert irradiance(on_axis) == pytest.approx(np.full(3, 3 / 14**1.5))
    assert irradiance(beside) == pytest.approx(0)


def test_a_small_rectangle_is_a_point_and_shines_to_one_side():
    light = RectangleLight("r", (0, 0, 2), (0.01, 0, 0), (0, -0.01, 0), (5, 5, 5))
    assert irradiance(light)[0] == pytest.approx(5 * 4e-4 / 4, rel=1e-4)
    turned = RectangleLight("r", (0, 0, 2), (0.01, 0, 0), (0, 0.01, 0), (5, 5, 5))
    assert irradiance(turned)[0] == 0


def test_a_rectangle_has_the_form_factor_of_the_textbook():
    """Parallel, above one corner: Howell's catalogue of configuration factors, B-4, a = b = c = 1."""
    light = RectangleLight("r", (0.5, 0.5, 1), (0.5, 0, 0), (0, -0.5, 0), (1, 1, 1))
    form_factor = 1 / np.pi / np.sqrt(2) * np.arctan(1 / np.sqrt(2))
    assert irradiance(light)[0] == pytest.approx(np.pi * form_factor, rel=2e-3)


@pytest.mark.parametrize("distance", [0.6, 1.0, 5.0])
def test_a_sphere_overhead_gives_pi_l_sine_squared(distance: float):
    light = SphereLight("b", (0, 0, distance), 0.5, (2, 2, 2))
    assert irradiance(light)[0] == pytest.approx(2 * np.pi * (0.5 / distance) ** 2, rel=1e-6)


def test_a_uniform_sky_gives_pi_l():
    sky = np.full((64, 128, 3), 0.7, np.float32)
    light = EnvironmentLight("e", "environment.exr")
    assert irradiance(light, sky=sky) == pytest.approx(np.full(3, 0.7 * np.pi), rel=1e-3)
    _, solid_angle = sky_directions(sky)
    assert solid_angle.sum() == pytest.approx(4 * np.pi)


def test_a_sky_is_looked_up_where_its_pixels_are():
    sky = np.random.default_rng(0).random((16, 32, 3)).astype(np.float32)
    directions, _ = sky_directions(sky)
    assert sky_towards(sky, directions) == pytest.approx(sky.reshape(-1, 3), abs=1e-5)
    ramp = np.linspace(0, 1, 16)[:, None, None] * np.ones((16, 32, 3))
    assert sky_towards(ramp, np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]))[:, 0] == pytest.approx([0, 0.5])


def test_an_environment_without_an_image_has_no_formula():
    light = EnvironmentLight("e", "environment.exr")
    assert unblocked_irradiance(light, CAMERA, ORIGIN, UP, None) is None

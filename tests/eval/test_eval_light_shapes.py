# SPDX-License-Identifier: Apache-2.0
"""Direction, size and colour of lights: closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from graycard import (
    Camera,
    GaussianLight,
    LocalLight,
    PointLight,
    PredictionError,
    RectangleLight,
    SphereLight,
    SphericalGaussian,
    SpotLight,
    look_at,
)
from graycard.eval.lights._shapes import (
    axis_of,
    chromaticity_error,
    direction_error,
    extent_error,
    radius_of,
)
from graycard.lights import Vector

CAMERAS = [Camera.from_fov(8, 8, 50, look_at(np.array([x, -3.0, 1]), np.zeros(3))) for x in (-1.0, 2.0)]
SPOT = SpotLight("spot", (0, 0, 2), (0, 0, -2), (4, 2, 1), 20, 40)
PANEL = RectangleLight("panel", (0, 0, 2), (0.5, 0, 0), (0, -0.25, 0), (4, 2, 1))
POINT = PointLight("point", (0, 0, 2), (4, 2, 1))
BALL = SphereLight("ball", (0, 0, 2), 0.3, (4, 2, 1))


def gaussian(*lobes: tuple[Vector, float, float]) -> GaussianLight:
    made = [SphericalGaussian(axis, sharpness, (a, a, a)) for axis, sharpness, a in lobes]
    return GaussianLight("g", (0, 0, 2), tuple(made))


def test_lights_shine_along_their_axes() -> None:
    assert direction_error(SPOT, PANEL, CAMERAS) == 0, "a rectangle shines along u x v, here down"
    assert direction_error(replace(PANEL, half_u=(0, -0.25, 0), half_v=(0.5, 0, 0)), SPOT, CAMERAS) == 180
    lobes = gaussian(((1, 0, 0), 3, 1.0), ((0, 0, -1), 3, 2.0))
    assert direction_error(lobes, SPOT, CAMERAS) == 0, "the brighter lobe"
    tilted = replace(SPOT, direction=(1, 0, -1))
    assert direction_error(tilted, SPOT, CAMERAS) == pytest.approx(45)


@pytest.mark.parametrize("light", [POINT, BALL, gaussian(((1, 0, 0), 0.0, 1.0))])
def test_a_light_without_an_axis_counts_a_right_angle(light: LocalLight) -> None:
    assert not axis_of(light).any()
    assert direction_error(light, SPOT, CAMERAS) == 90


def test_a_light_on_the_camera_turns_with_it() -> None:
    mounted = replace(SPOT, direction=(0, 0, 1), frame="camera")
    expected = np.mean([np.degrees(np.arccos(-c.forward[2])) for c in CAMERAS])
    assert direction_error(mounted, SPOT, CAMERAS) == pytest.approx(expected)
    assert direction_error(mounted, mounted, CAMERAS) == 0


def test_sizes() -> None:
    assert radius_of(BALL) == 0.3
    assert np.pi * radius_of(PANEL) ** 2 == pytest.approx(4 * 0.5 * 0.25)
    assert extent_error(BALL, BALL) == 0
    assert extent_error(replace(BALL, radius=0.6), BALL) == pytest.approx(50)
    assert extent_error(replace(BALL, radius=0.15), BALL) == pytest.approx(50), "half as good as twice"
    assert extent_error(POINT, BALL) == extent_error(SPOT, BALL) == 100


def test_colours() -> None:
    assert chromaticity_error(replace(POINT, intensity=(8, 4, 2)), POINT) == pytest.approx(0, abs=1e-6)
    red, green = replace(POINT, intensity=(3, 0, 0)), replace(POINT, intensity=(0, 5, 0))
    assert chromaticity_error(red, green) == 90
    assert chromaticity_error(BALL, POINT) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("intensity", [(0.0, 0.0, 0.0), (1.0, -1.0, 1.0)])
def test_what_has_no_colour(intensity: Vector) -> None:
    with pytest.raises(PredictionError, match="expected light 'point' with a colour, got"):
        chromaticity_error(replace(POINT, intensity=intensity), POINT)


def test_what_is_not_finite() -> None:
    with pytest.raises(PredictionError, match="expected light 'spot' with a finite direction"):
        direction_error(replace(SPOT, direction=(0, np.nan, 1)), SPOT, CAMERAS)
    with pytest.raises(PredictionError, match="expected light 'ball' with a finite extent"):
        extent_error(replace(BALL, radius=np.inf), BALL)

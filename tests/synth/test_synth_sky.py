# SPDX-License-Identifier: Apache-2.0
"""The environment: what is recorded is what the renderer sees, in the documented directions."""

import numpy as np
import pytest

from graycard import Camera, EnvironmentLight, look_at
from graycard.synth import Scene
from graycard.synth._sky import Window, recorded, room


def directions(height: int) -> np.ndarray:
    """Return directions of the pixels of a recorded environment, by the formula of
    ``graycard.EnvironmentLight``."""
    t = np.pi * (np.arange(height)[:, None] + 0.5) / height
    p = 2 * np.pi * (np.arange(2 * height)[None, :] + 0.5) / (2 * height)
    return np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t) + 0 * p], axis=-1)


def test_zenith_horizon_and_ground() -> None:
    sky = room((1, 2, 3), (4, 5, 6), (7, 8, 9))
    assert sky.shape == (64, 128, 3)
    np.testing.assert_allclose(sky[0, 5], (1, 2, 3))
    np.testing.assert_allclose(sky[-1, 5], (7, 8, 9))
    np.testing.assert_allclose(sky[31], np.broadcast_to((4, 5, 6), (128, 3)), rtol=0.1)


@pytest.mark.parametrize("azimuth", [0.0, 45.0, 200.0, -10.0])
def test_a_window_shines_where_it_is(azimuth: float) -> None:
    sky = room((0, 0, 0), (0, 0, 0), (0, 0, 0), (Window(azimuth, 30, 24, 16, (1, 1, 1)),))
    image = recorded(sky)[..., 0]
    brightest = (directions(64) * image[..., None]).sum(axis=(0, 1))
    brightest /= np.linalg.norm(brightest)
    a, e = np.radians(azimuth), np.radians(30)
    expected = (np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e))
    assert brightest @ expected == pytest.approx(1, abs=2e-3)
    assert image.max() == pytest.approx(1, abs=1e-6)


def test_a_constant_sky_is_recorded_as_such() -> None:
    np.testing.assert_allclose(recorded(np.full((8, 16, 3), 0.7)), 0.7, rtol=1e-6)


def test_the_renderer_sees_what_is_recorded(variant: str) -> None:
    """Every pixel is looked at along its documented direction, in an otherwise empty scene."""
    from graycard.synth.renderer._mitsuba import load_scene

    rng = np.random.default_rng(3)
    sky = rng.uniform(0.1, 1.0, size=(9, 18, 3))
    image = recorded(sky)
    light = EnvironmentLight("sky", "environment.exr")
    loaded = load_scene(Scene((), (light,), (), sky), Camera.from_fov(4, 4, 40, np.eye(4)))
    seen = look_along(loaded, directions(9).reshape(-1, 3))
    np.testing.assert_allclose(seen, image.reshape(-1, 3), rtol=2e-4, atol=2e-5)


def look_along(loaded: object, rays: np.ndarray) -> np.ndarray:
    """Radiance along rays from the origin; each is a camera of one pixel."""
    from graycard.synth.layers._views import _image
    from graycard.synth.renderer._mitsuba import centre_sensor, load

    path = load({"type": "path", "max_depth": 2})
    seen = []
    for ray in rays:
        pose = look_at(np.zeros(3), ray, up=(1, 0, 0) if abs(ray[2]) > 0.9 else (0, 0, 1))
        eye = centre_sensor(Camera.from_fov(1, 1, 0.01, pose))
        seen.append(_image(loaded, eye, path, spp=1)[0, 0])  # pyright: ignore[reportArgumentType]
    return np.array(seen)

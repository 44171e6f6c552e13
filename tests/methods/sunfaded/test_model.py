# SPDX-License-Identifier: Apache-2.0
"""The picture made of albedo, a light that stays and a lamp."""

from typing import Any

import numpy as np
import pytest
import torch

from graycard import Camera, look_at
from graycard.methods.splat import Parameters, parameters_of, surfels_on_surface
from graycard.methods.sunfaded import SunFadedSettings, _model, _tiles
from graycard.methods.sunfaded._light import BANDS, POSITION, lamp_intensity, lamp_parameters
from graycard.methods.sunfaded._model import ALBEDO, AMBIENT, LampPicture, albedo_of, draw, picture_of
from graycard.methods.sunfaded._tiles import lens_of

CAMERA = Camera.from_fov(24, 20, 50, look_at(np.array([0.2, -2.0, 1.0]), np.array([0.0, 0.0, 0.2])))


def floor(albedo: float = 0.4, side: int = 10) -> Parameters:
    """Discs on the floor, all of one albedo; ten a side are far larger than a pixel."""
    x, y = np.meshgrid(np.linspace(-3, 3, side), np.linspace(-2, 4, side))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    up = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
    discs = surfels_on_surface(points, up, np.full_like(points, albedo), side**2, 0)
    shared = {**lamp_parameters(0), AMBIENT: torch.tensor([0.3, 0.2, 0.1])}
    return parameters_of(discs, {ALBEDO: torch.full((len(discs), 3), albedo).logit()}, shared)


def smooth(values: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """The lamp without the upper bands of its codes: about even over the few pixels that a disc blurs."""
    found = {name: v.clone() for name, v in values.items()}
    upper = [n for n in range(24) if n % BANDS]
    found["lamp weights 0"][:, upper] = 0
    found["lamp weights 3"][:, [64 + n for n in range(12) if n % BANDS]] = 0
    return found


def shown(values: dict[str, torch.Tensor], settings: SunFadedSettings) -> LampPicture:
    drawn = draw(values, CAMERA, settings)
    return picture_of(drawn, values, CAMERA, lens_of(CAMERA), settings)


def test_the_unlit_picture_is_albedo_times_ambient_light():
    values, settings = floor().all, SunFadedSettings()
    picture, drawn = shown(values, settings), draw(values, CAMERA, settings)
    expected = 0.4 * drawn.alpha[..., None] * values[AMBIENT]
    torch.testing.assert_close(picture.unlit, expected)
    torch.testing.assert_close(picture.whole, picture.unlit + picture.lit)


@pytest.mark.parametrize(("shading", "side", "error"), [("image", 10, 0.04), ("surfel", 60, 0.08)])
def test_the_lamp_is_intensity_times_cosine(shading: str, side: int, error: float):
    """On a floor the cosine is the lamp's height over its distance, wherever the light is found.

    Each pixel blends several small discs, the nearest ones first, which are nearer to the lamp too.
    """
    values = smooth(floor(side=side).all | {POSITION: torch.tensor([0.3, -0.2, 0.1])})
    settings = SunFadedSettings(shading=shading, tile=1 / 24)  # pyright: ignore[reportArgumentType]
    picture, drawn = shown(values, settings), draw(values, CAMERA, settings)
    lamp = CAMERA.camera_to_world[:3, :3] @ values[POSITION].numpy() + CAMERA.position
    rays = CAMERA.rays()
    points = CAMERA.position - rays * CAMERA.position[2] / rays[..., 2:]
    solid = (drawn.alpha > 0.98).numpy() & (np.linalg.norm(points - CAMERA.position, axis=-1) < 2.5)
    away = lamp - points
    cosine = away[..., 2] / np.linalg.norm(away, axis=-1)
    local = (points - CAMERA.position) @ CAMERA.camera_to_world[:3, :3]
    sent = lamp_intensity(values, torch.from_numpy(local.astype(np.float32))).numpy()
    expected = 0.4 * sent * cosine[..., None]
    assert solid.sum() > 150
    np.testing.assert_allclose(picture.lit[solid], expected[solid], rtol=error)


@pytest.mark.parametrize(
    "reading",
    [{}, {"light_map": "bilinear", "tile": 0.2}, {"shading": "surfel"}, {"space": "srgb"}],
    ids=str,
)
def test_light_and_albedo_trade_a_gain(monkeypatch: pytest.MonkeyPatch, reading: dict[str, Any]):
    """(A, E, i) and (gA, E/g, i/g), a gain for each channel, are the same picture."""
    gain = torch.tensor([0.5, 0.8, 1.6])
    values, settings = floor().all, SunFadedSettings(**reading)
    before = shown(values, settings).whole
    for module in (_tiles, _model):
        monkeypatch.setattr(module, "lamp_intensity", lambda v, points: lamp_intensity(v, points) / gain)
    changed = {**values, ALBEDO: (albedo_of(values) * gain).logit(), AMBIENT: values[AMBIENT] / gain}
    torch.testing.assert_close(shown(changed, settings).whole, before, rtol=1e-6, atol=1e-6)


def test_depth_gets_no_gradient_from_light_and_normals_do():
    values = {name: v.clone().requires_grad_() for name, v in floor().all.items()}
    settings = SunFadedSettings(tile=1 / 24)
    drawn = draw(values, CAMERA, settings)
    light = picture_of(drawn, values, CAMERA, lens_of(CAMERA), settings).lit.sum()
    found = torch.autograd.grad(light, [drawn.depth, drawn.normal], allow_unused=True)
    assert found[0] is None
    assert found[1] is not None
    assert found[1].abs().max() > 0


def test_albedo_is_kept_between_black_and_white():
    values = floor().all
    values[ALBEDO] = torch.linspace(-30, 30, values[ALBEDO].numel()).reshape(-1, 3)
    albedo = shown(values, SunFadedSettings()).albedo
    assert albedo.min() >= 0
    assert albedo.max() <= 1

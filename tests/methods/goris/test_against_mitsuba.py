# SPDX-License-Identifier: Apache-2.0
"""Mirror images in a metal floor: traced through surfels on true surfaces, against the path tracer."""

import numpy as np
import pytest
import torch
from scipy.ndimage import minimum_filter

from graycard import Camera, EnvironmentLight, View, look_at, srgb_encode
from graycard.eval import psnr
from graycard.methods.goris import GorisSettings
from graycard.methods.goris._model import (
    DIFFUSE,
    FRESNEL,
    LABEL,
    REGION,
    ROUGHNESS,
    SURROUNDINGS,
    Buffers,
    picture_of,
)
from graycard.methods.shading import from_latitudes
from graycard.methods.splat import SH_DC, Surfels, parameters_of, rasterize, surfels_on_surface
from graycard.methods.surfels import COEFFICIENTS, DETAIL, SKY
from graycard.synth import Ball, LambertGGX, Matte, Quad, RenderSettings, Scene, Texture, Thing

METAL = (0.9, 0.75, 0.6)
EXPOSURE, EXTENT = 1.2, 2.0
SETTINGS = RenderSettings(96, 80, samples=64, max_depth=4)
PLACES = ((0.0, -2.2, 1.2), (0.9, -2.0, 1.0), (-0.9, -2.0, 1.4), (1.0, -1.5, 0.05), (-0.8, -1.5, 0.05))
"""Places of the training cameras; the last two see undersides."""
HELD_OUT = (0.4, -2.1, 1.1)
SURFELS = 12_000
_FIRM = 12.0
"""Logit of what is 1."""

pytestmark = pytest.mark.usefixtures("llvm")


def metal_floor() -> Scene:
    """Two painted boards and a ball over it, under a sky that is brighter on one side."""
    waves = 0.5 + 0.35 * np.sin(np.linspace(0, 4 * np.pi, 48, endpoint=False))
    paint = np.stack(
        [
            waves[:, None] * np.ones(48),
            0.2 + 0.6 * waves[None] * np.ones((48, 1)),
            0.5 * waves[::-1, None] * np.ones(48),
        ],
        axis=-1,
    )
    things = (
        Thing("floor", Quad((0, 0, 0), (2.5, 0, 0), (0, 2.5, 0)), LambertGGX(METAL, 0.05, 1.0)),
        Thing("board", Quad((-0.5, 0.4, 0.45), (0.4, 0.1, 0), (0, 0, 0.4)), Matte(Texture(paint))),
        Thing("other", Quad((0.6, 0.3, 0.4), (0.3, -0.1, 0), (0, 0, 0.35)), Matte((0.7, 0.25, 0.15))),
        Thing("ball", Ball((0.1, -0.3, 0.3), 0.2), Matte((0.2, 0.4, 0.7))),
    )
    azimuth = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    sky = (0.6 + 0.3 * np.cos(azimuth))[None, :, None] * np.ones((32, 1, 3)) * (0.9, 1.0, 1.2)
    cameras = [
        Camera.from_fov(
            SETTINGS.width, SETTINGS.height, 50, look_at(np.array(place), np.array([0.0, 0.1, 0.2]))
        )
        for place in (*PLACES, HELD_OUT)
    ]
    views = [View(f"train_{n:03d}", "train", camera) for n, camera in enumerate(cameras[:-1])]
    held_out = View("test_000", "test", cameras[-1])
    return Scene(things, (EnvironmentLight("sky", "environment.exr"),), (*views, held_out), sky)


def rendered(scene: Scene, camera: Camera) -> dict[str, np.ndarray]:
    """Return the picture, and the part that the specular lobe returns."""
    from graycard.synth.layers._separation import lobe_light
    from graycard.synth.layers._views import light_images, surface_layers
    from graycard.synth.renderer._mitsuba import load_scene

    loaded = load_scene(scene, camera)
    images = light_images(loaded, camera, [1, 2, 3, 4], SETTINGS)
    found = {"radiance": images[:, 0].mean(axis=0), "specular": lobe_light(images, "specular")}
    return found | surface_layers(loaded, scene, camera)


def surfels_of_boards(seen: list[dict[str, np.ndarray]]) -> Surfels:
    """Discs on all that is matte, in the colours that the pictures show."""
    matte = [layers["roughness"] == 1 for layers in seen]
    points, normals, radiance = (
        np.concatenate([layers[name][mask] for layers, mask in zip(seen, matte, strict=True)]).astype(float)
        for name in ("position", "normal", "radiance")
    )
    return surfels_on_surface(points, normals, np.asarray(srgb_encode(radiance * EXPOSURE)), SURFELS, 0)


def test_a_metal_floor_mirrors_what_mitsuba_says() -> None:
    scene = metal_floor()
    *training, camera = (view.camera for view in scene.views)
    discs = surfels_of_boards([rendered(scene, each) for each in training])
    truth = rendered(scene, camera)
    floor = np.asarray(minimum_filter(truth["object_id"] == 1, size=3), bool)  # outlines are mixed in a pixel
    reflected = _reflected(discs, scene, camera, truth)
    shown, true = (
        np.asarray(srgb_encode(np.clip(values[floor], 0, 1)))
        for values in (reflected, truth["specular"] * EXPOSURE)
    )
    boards = np.abs(true - np.median(true, axis=0)).max(axis=-1) > 0.1
    assert boards.mean() > 0.1, "the floor shows more than the sky"
    assert psnr(float(np.mean((shown - true) ** 2))) > 30
    assert psnr(float(np.mean((shown - true)[boards] ** 2))) > 27


def _reflected(discs: Surfels, scene: Scene, camera: Camera, truth: dict[str, np.ndarray]) -> np.ndarray:
    """The glossy term of the true floor, shape ``(H, W, 3)``, exposed."""
    count, even = len(discs), torch.ones(len(discs), 1)
    own = {
        COEFFICIENTS: ((discs.features - 0.5) / SH_DC)[:, None],
        DETAIL: torch.zeros(count, 15, 3),
        DIFFUSE: torch.zeros(count, 3),
        FRESNEL: torch.zeros(count, 3),
        ROUGHNESS: 0 * even,
        REGION: _FIRM * even,
        LABEL: -_FIRM * even,
    }
    assert scene.sky is not None
    sky = (from_latitudes(scene.sky, 32) * EXPOSURE).log()
    values = parameters_of(discs, own, {SKY: torch.zeros(1, 3), SURROUNDINGS: sky}).all
    plain = torch.zeros(camera.height, camera.width)

    def told(values: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(values.astype(np.float32))

    buffers = Buffers(
        camera,
        torch.from_numpy(camera.rays()),
        drawn=rasterize(discs, camera),
        rough=plain[..., None].expand(-1, -1, 3),
        diffuse=plain[..., None].expand(-1, -1, 3),
        f0=told(truth["f0"]),
        roughness=told(truth["roughness"]),
        glossy=told(truth["object_id"] == 1),
        label=plain,
        normal=told(truth["normal"]),
        points=told(truth["position"]),
    )
    settings = GorisSettings(filter="none")
    return picture_of(values, buffers, settings, EXTENT).reflected.numpy()

# SPDX-License-Identifier: Apache-2.0
"""Laws that hold in any scene: light is conserved, adds up, and scales."""

from collections.abc import Callable
from dataclasses import replace

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
    SpotLight,
    View,
    look_at,
)
from graycard.synth import Ball, Conductor, Glossy, LambertGGX, Matte, Quad, RenderSettings, Scene, Thing
from graycard.synth._scene import Material, surface_of

RENDERS = 36
"""Independent renders of an estimate: enough that 4 sigma of Student's t is a false alarm in 3000."""

Judge = Callable[[str, float, float], None]


def renders(scene: Scene, samples: int, depth: int, first_seed: int = 1, count: int = RENDERS) -> np.ndarray:
    """Independent images by Mitsuba's ``path``, ``(count, H, W, 3)``."""
    from graycard.synth.layers._views import radiance_images
    from graycard.synth.renderer._mitsuba import load_scene

    camera = scene.views[0].camera
    settings = RenderSettings(camera.width, camera.height, samples=count * samples, max_depth=depth)
    seeds = list(range(first_seed, first_seed + count))
    return radiance_images(load_scene(scene, camera), camera, seeds, settings)


def standard_error(estimates: np.ndarray) -> float:
    """Return the standard error of the mean of independent estimates, from their own spread."""
    return float(estimates.std(ddof=1) / np.sqrt(len(estimates)))


def judge_mean(judge: Judge, what: str, estimates: np.ndarray, expected: float) -> None:
    error = standard_error(estimates)
    judge(f"{what}: standard errors from {expected}", abs(estimates.mean() - expected) / error, 4)
    judge(f"{what}: relative standard error", error / expected, 1e-3)


def view(origin: tuple[float, float, float], target: tuple[float, float, float], fov: float) -> View:
    pose = look_at(np.array(origin), np.array(target))
    return View("train_000", "train", Camera.from_fov(12, 12, fov, pose))


# --- furnaces ----------------------------------------------------------------------------------------------


def _vector(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def furnace() -> Scene:
    """Inside a cube whose walls reflect a half and emit 1: L = 1 + 1/2 + 1/4 + ... = 2 everywhere."""
    things, lights = [], []
    for axis in range(3):
        for side in (-1, 1):
            center, u = side * np.eye(3)[axis], np.eye(3)[(axis + 1) % 3]
            v = np.cross(u, center)  # u x v points inward
            wall = Quad(_vector(center), _vector(u), _vector(v))
            name = f"wall-{len(things)}"
            things.append(Thing(name, wall, Matte((0.5, 0.5, 0.5)), name))
            lights.append(RectangleLight(name, wall.center, wall.half_u, wall.half_v, (1.0, 1.0, 1.0)))
    return Scene(tuple(things), tuple(lights), (view((0.3, -0.4, 0.1), (0.2, 0.9, 0.3), 70.0),))


def test_a_closed_furnace_shows_the_sum_of_all_bounces(variant: str, judge: Judge) -> None:
    found = renders(furnace(), samples=36, depth=40).mean(axis=(1, 2, 3))
    judge_mean(judge, "closed furnace", found, 2.0)


@pytest.mark.parametrize("depth", [1, 2, 3, 4, 5, 6])
def test_a_closed_furnace_shows_the_partial_sums(scalar: str, judge: Judge, depth: int) -> None:
    found = renders(furnace(), samples=9, depth=depth).mean(axis=(1, 2, 3))
    expected = 2 - 0.5 ** (depth - 1)
    if depth == 1:
        assert (found == 1).all()
    else:
        judge_mean(judge, f"closed furnace, {depth} segments", found, expected)


def test_the_parts_of_a_closed_furnace(llvm: str, judge: Judge) -> None:
    """Emitted 1, direct 1/2, indirect 1/4 + 1/8 + 1/16, by the tracer that splits light."""
    from graycard.synth.layers._separation import FIRST_PART, PARTS, separated_images
    from graycard.synth.renderer._mitsuba import load_scene

    scene = furnace()
    camera = scene.views[0].camera
    settings = RenderSettings(camera.width, camera.height, samples=RENDERS * 16, max_depth=5)
    seeds = list(range(1, RENDERS + 1))
    images = separated_images(load_scene(scene, camera), camera, seeds, settings).mean(axis=(2, 3, 4))
    assert np.abs(images[:, 1] - 1).max() < 1e-6
    for name, expected in (("direct.diffuse", 0.5), ("indirect.diffuse", 0.4375)):
        parts = images[:, FIRST_PART + PARTS.index(name) :: len(PARTS)]
        judge_mean(judge, f"closed furnace, {name}", parts.sum(axis=1), expected)


def in_a_white_room(material: Material) -> Scene:
    ball = Thing("ball", Ball((0, 0, 0), 2.0), material)
    sky = EnvironmentLight("sky", "environment.exr")
    return Scene((ball,), (sky,), (view((0, -4, 0), (0, 0, 0), 30.0),), np.ones((8, 16, 3)))


def test_a_white_furnace(variant: str, judge: Judge) -> None:
    """A convex Lambertian body under a constant sky of radiance 1 has radiance equal to its albedo."""
    found = renders(in_a_white_room(Matte((1.0, 0.6, 0.1))), samples=64, depth=3).mean(axis=(1, 2))
    for channel, albedo in enumerate((1.0, 0.6, 0.1)):
        judge_mean(judge, f"white furnace, albedo {albedo}", found[:, channel], albedo)


@pytest.mark.parametrize(
    "material",
    [LambertGGX((1.0, 1.0, 1.0), 0.05, 1.0), Glossy((1.0, 1.0, 1.0), 0.05, 1.0)],
    ids=["lambert-ggx", "principled"],
)
def test_a_white_metal_vanishes_in_a_white_room(llvm: str, judge: Judge, material: Material) -> None:
    """A nearly smooth metal of base colour 1: less than 1e-4 is lost between its microfacets."""
    found = renders(in_a_white_room(material), samples=64, depth=3).mean(axis=(1, 2, 3))
    judge("white metal: deviation from 1", abs(found.mean() - 1), 4 * standard_error(found) + 1e-4)
    judge("white metal: standard error", standard_error(found), 5e-4)


# --- superposition and linearity ---------------------------------------------------------------------------

PANEL = RectangleLight("panel", (-0.8, 0.3, 2.0), (0, 0.3, 0), (0.3, 0, 0), (5, 4, 3))
BULB = SphereLight("bulb", (2.3, -0.9, 0.8), 0.25, (8, 8, 9))  # out of sight: its outline would be noise
POINT = PointLight("point", (0.5, -0.8, 1.6), (2.0, 2.5, 3.0))
SPOT = SpotLight("spot", (-0.5, -0.9, 1.8), (0.3, 0.5, -1.0), (6, 6, 5), 12.0, 35.0)
SKY = EnvironmentLight("sky", "environment.exr")
LIGHTS: tuple[Light, ...] = (PANEL, POINT, BULB, SKY, SPOT)


def room(lights: tuple[Light, ...] = LIGHTS) -> Scene:
    """Every kind of material under every kind of light; surfaces of lights that are off stay, black."""
    things = [
        Thing("floor", Quad((0, 0, 0), (3, 0, 0), (0, 3, 0)), Matte((0.6, 0.5, 0.2))),
        Thing("ball", Ball((0.1, 0.1, 0.5), 0.5), Glossy((0.3, 0.5, 0.5), 0.4)),
        Thing("metal", Ball((-0.7, 0.0, 0.3), 0.3), Conductor((0.2, 0.92, 1.1), (3.9, 2.45, 2.14), 0.5)),
    ]
    for surface in (surface_of(PANEL), surface_of(BULB)):
        lit = any(light.name == surface.name for light in lights)
        things.append(surface if lit else replace(surface, light=""))
    sky = np.linspace(0.05, 0.3, 8 * 16 * 3).reshape(8, 16, 3)
    return Scene(tuple(things), lights, (view((1.2, -2.4, 2.2), (0.1, 0.2, 0.4), 55.0),), sky)


def test_five_lights_together_are_the_sum_of_each_alone(llvm: str, judge: Judge) -> None:
    together = renders(room(), samples=784, depth=5).mean(axis=(1, 2, 3))
    alone = [
        renders(room((light,)), samples=256, depth=5, first_seed=1000 * k).mean(axis=(1, 2, 3))
        for k, light in enumerate(LIGHTS, start=1)
    ]
    total = sum(float(one.mean()) for one in alone)
    assert min(one.mean() for one in alone) > 0.005 * total
    error = np.sqrt(standard_error(together) ** 2 + sum(standard_error(one) ** 2 for one in alone))
    difference = abs(float(together.mean()) - total)
    judge("superposition: standard errors", difference / error, 4)
    judge("superposition: relative difference", difference / total, 2e-3)
    judge("superposition: relative standard error", error / total, 5e-4)


def brighter(scene: Scene, factor: float) -> Scene:
    """The same scene with all radiances and intensities times a factor."""
    assert scene.sky is not None
    lights = tuple(_brighter(light, factor) for light in scene.lights)
    return replace(scene, lights=lights, sky=factor * scene.sky)


def _brighter(light: Light, factor: float) -> Light:
    def times(color: tuple[float, float, float]) -> tuple[float, float, float]:
        return factor * color[0], factor * color[1], factor * color[2]

    match light:
        case EnvironmentLight():
            return light  # its radiance is the scene's sky
        case PointLight() | SpotLight():
            return replace(light, intensity=times(light.intensity))
        case GaussianLight():
            lobes = tuple(replace(lobe, amplitude=times(lobe.amplitude)) for lobe in light.lobes)
            return replace(light, lobes=lobes)
        case _:
            return replace(light, radiance=times(light.radiance))


def test_four_times_the_light_is_four_times_the_picture(variant: str, judge: Judge) -> None:
    """At equal seeds, to the bit: a power of two changes no digit, and paths do not depend on the light."""
    once, more = (renders(scene, samples=4, depth=5, count=4) for scene in (room(), brighter(room(), 4.0)))
    assert once.min() > 0
    judge("linearity: largest relative error", np.abs(more / (4 * once) - 1).max(), 0)

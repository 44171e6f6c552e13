# SPDX-License-Identifier: Apache-2.0
"""Every kind of light against its closed form, through our own scene, camera and light conventions.

References are float64. Where a bar is near the resolution of float32 they start from what the renderer was
given after rounding (:func:`rounded`) and from the points that its rays met, which have tests of their own.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from graycard import (
    Camera,
    EnvironmentLight,
    Light,
    PointLight,
    RectangleLight,
    SphereLight,
    SpotLight,
    View,
    look_at,
    world_position,
)
from graycard.synth import Ball, Matte, RenderSettings, Scene, Thing
from graycard.synth._scene import surface_of

ALBEDO = np.array((0.5, 0.4, 0.3))
RENDERS = 36
"""Independent renders of an estimate: enough that 4 sigma of Student's t is a false alarm in 3000."""

Judge = Callable[[str, float, float], None]
MakePlane = Callable[..., Scene]
Point = tuple[float, float, float]
AreaLight = RectangleLight | SphereLight


def rounded(values: object) -> np.ndarray:
    """Return values as float32 holds them, in float64."""
    return np.asarray(values, dtype=np.float32).astype(np.float64)


def at_centres(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Radiance by one bounce and the points that are seen, at the pixel centres: exact for points."""
    from graycard.synth.layers._views import _image, surface_layers
    from graycard.synth.renderer._mitsuba import centre_sensor, load, load_scene

    camera = scene.views[0].camera
    loaded, path = load_scene(scene, camera), load({"type": "path", "max_depth": 2})
    seen = _image(loaded, centre_sensor(camera), path, spp=1)
    return seen, surface_layers(loaded, scene, camera)["position"].astype(np.float64)


def z_score(estimates: np.ndarray, expected: float) -> float:
    """Deviation of the mean of independent estimates in its standard errors, from their own spread."""
    error = estimates.std(ddof=1) / np.sqrt(len(estimates))
    return abs(estimates.mean() - expected) / float(error)


def judge_pixels(judge: Judge, what: str, ratio: np.ndarray) -> None:
    """Judge that independent estimates of found / expected, ``(renders, pixels)``, are 1 within their spread.

    For all pixels together, and for each: the squares of Student's t have a mean of (n - 1) / (n - 3) and,
    with 35 degrees of freedom, a variance of 2.47.
    """
    renders, pixels = ratio.shape
    judge(f"{what}: standard errors of the mean", z_score(ratio.mean(axis=1), 1), 4)
    squares = (ratio.mean(axis=0) - 1) ** 2 / (ratio.var(axis=0, ddof=1) / renders)
    bar = (renders - 1) / (renders - 3) + 4 * np.sqrt(2.47 / pixels)
    judge(f"{what}: mean square of the pixels' standard errors", squares.mean(), bar)
    judge(f"{what}: standard error of the mean", ratio.mean(axis=1).std(ddof=1) / np.sqrt(renders), 1e-3)


def view_of(points_at: Point, origin: Point, width: int = 4, fov: float = 0.01) -> View:
    """A view that sees nearly one point."""
    pose = look_at(np.array(origin), np.array(points_at))
    return View("train_000", "train", Camera.from_fov(width, width, fov, pose))


def irradiances(loaded: Any, view: View, samples: int = 64, albedo: np.ndarray = ALBEDO) -> np.ndarray:
    """Irradiance of the one Lambertian point that a view sees, a row of colours for each render."""
    from graycard.synth.layers._views import radiance_images

    camera = view.camera
    settings = RenderSettings(camera.width, camera.height, samples=RENDERS * samples, max_depth=2)
    images = radiance_images(loaded, camera, list(range(1, RENDERS + 1)), settings)
    return np.pi * images.mean(axis=(1, 2)) / albedo


def direct_irradiance(scene: Scene, light: Light) -> tuple[np.ndarray, np.ndarray]:
    """The truth's own ``direct.irradiance.<light>`` of independent renders, and the points of the floor."""
    from graycard.synth.layers._direct_light import direct_light
    from graycard.synth.layers._separation import light_names
    from graycard.synth.layers._views import surface_layers
    from graycard.synth.renderer._mitsuba import load_scene

    camera = scene.views[0].camera
    loaded = load_scene(scene, camera)
    found = direct_light(loaded, camera, list(range(1, RENDERS + 1)))
    points = surface_layers(loaded, scene, camera)["position"].astype(np.float64)
    return found.sent[:, light_names(loaded, scene).index(light.name)], points


# --- lights without extent ---------------------------------------------------------------------------------

POINTS = [
    PointLight("lamp", (0.4, -0.3, 1.7), (7.0, 6.0, 5.0)),
    PointLight("lamp", (0.5, -0.2, 0.1), (7.0, 6.0, 5.0), "camera"),
]
SPOTS = [
    SpotLight("lamp", (0.4, -0.3, 1.7), (0.1, 0.2, -1.0), (7, 6, 5), 12.0, 40.0),
    SpotLight("lamp", (0.3, -0.1, 0.0), (-0.05, 0.02, 1.0), (7, 6, 5), 9.0, 24.0, "camera"),
]


def under(scene: Scene, light: PointLight | SpotLight, points: np.ndarray) -> np.ndarray:
    """Radiance ``a / pi I cos / d²`` of points of the floor, without the cone of a spot."""
    to_light = rounded(world_position(light, scene.views[0].camera)) - points
    falloff = to_light[..., 2] / np.linalg.norm(to_light, axis=-1) ** 3
    return rounded(ALBEDO) / np.pi * np.array(light.intensity) * falloff[..., None]


def from_axis(scene: Scene, light: SpotLight, points: np.ndarray) -> np.ndarray:
    """Angle at which a spot shines on points, degrees."""
    camera = scene.views[0].camera
    axis = np.array(light.direction)
    axis = camera.camera_to_world[:3, :3] @ axis if light.frame == "camera" else axis
    away = points - world_position(light, camera)
    cosine = away @ axis / np.linalg.norm(away, axis=-1) / np.linalg.norm(axis)
    return np.degrees(np.arccos(cosine))


def test_the_irradiance_layer_of_a_point_light(llvm: str, make_plane: MakePlane, judge: Judge) -> None:
    """The truth's irradiance is that of the light alone, whatever the floor reflects."""
    scene = make_plane((POINTS[0],))
    images, points = direct_irradiance(scene, POINTS[0])
    expected = under(scene, POINTS[0], points) * np.pi / rounded(ALBEDO)
    judge("point light, irradiance layer: largest relative error", np.abs(images / expected - 1).max(), 1e-6)


@pytest.mark.parametrize("light", POINTS, ids=["world", "camera"])
def test_a_point_light_over_a_plane(
    variant: str, make_plane: MakePlane, judge: Judge, light: PointLight
) -> None:
    scene = make_plane((light,))
    seen, points = at_centres(scene)
    judge("point light: largest relative error", np.abs(seen / under(scene, light, points) - 1).max(), 1e-6)


@pytest.mark.parametrize("light", SPOTS, ids=["world", "camera"])
def test_a_spot_light_falls_off_linearly_in_the_angle(
    variant: str, make_plane: MakePlane, judge: Judge, light: SpotLight
) -> None:
    scene = make_plane((light,))
    seen, points = at_centres(scene)
    full, angle = under(scene, light, points), from_axis(scene, light, points)
    share = (light.cutoff_angle - angle) / (light.cutoff_angle - light.beam_width)
    assert {-1, 0, 1} == set(np.sign(np.floor(share[np.abs(share) > 0.02])))  # dark, penumbra, beam
    error = np.abs(seen / full - np.clip(share, 0, 1)[..., None])
    # the angle is the arccosine of a float32: worst where the penumbra begins, four units in the last place
    beam, cutoff = np.radians((light.beam_width, light.cutoff_angle))
    bar = 4 * 2.0**-24 / np.sin(beam) / (cutoff - beam)
    judge("spot light: largest error relative to the same light without a cone", error.max(), bar)
    assert (seen[share < -1e-4] == 0).all()


def test_a_light_from_infinity_on_a_ball(variant: str, judge: Judge) -> None:
    """A point light 1e7 radii away: its rays diverge by 1e-7, so that L = a / pi E max(n.l, 0)."""
    towards, far = np.array((0.3, -0.8, 0.5)), 1e7
    towards /= np.linalg.norm(towards)
    light = PointLight("sun", tuple((far * towards).tolist()), (3 * far**2, 2 * far**2, far**2))
    ball = Thing("ball", Ball((0, 0, 0), 1.0), Matte(tuple(ALBEDO.tolist())))
    scene = Scene((ball,), (light,), (view_of((0, 0, 0), (0, -4, 0), 32, 35.0),))
    seen, points = at_centres(scene)
    expected = ALBEDO / np.pi * (3, 2, 1) * np.maximum(points @ towards, 0)[..., None]
    assert 0.2 < (expected[..., 0] > 0).mean() < 0.8
    judge("directional light on a ball: largest error", np.abs(seen - expected).max(), 1e-6)


# --- lights with extent ------------------------------------------------------------------------------------


def with_surface(scene: Scene, light: AreaLight) -> Scene:
    return Scene((*scene.things, surface_of(light)), (light,), scene.views)


def test_a_disc_over_a_point(variant: str, make_plane: MakePlane, judge: Judge) -> None:
    """E = pi L sin² of the half angle. Our lights have no disc: it is Mitsuba's, over our floor."""
    import mitsuba as mi

    from graycard.synth.renderer._mitsuba import _shape, load

    radius, height, radiance = 0.5, 1.0, 4.0
    down = mi.ScalarTransform4f().look_at([0, 0, height], [0, 0, 0], [0, 1, 0]).scale(radius)
    emitter = {"type": "area", "radiance": {"type": "rgb", "value": [radiance] * 3}}
    disc = {"type": "disk", "to_world": down, "emitter": emitter}
    loaded = load({"type": "scene", "floor": _shape(make_plane().things[0], None), "disc": disc})
    found = irradiances(loaded, view_of((0, 0, 0), (1.5, -1.5, 0.8)), samples=256)
    expected = np.pi * radiance * radius**2 / (radius**2 + height**2)
    judge("disc light: relative error", abs(found.mean() / expected - 1), 2e-4)


BULB = SphereLight("bulb", (0.4, -0.3, 1.3), 0.45, (4.0, 3.0, 2.0))


def test_a_sphere_light_over_a_point(variant: str, make_plane: MakePlane, judge: Judge) -> None:
    """E = pi L (r / d)² on the axis, the same for a large sphere as for a small one."""
    from graycard.synth.renderer._mitsuba import load_scene

    view, distance = view_of((0.4, -0.3, 0), (1.9, -1.8, 0.6)), BULB.position[2]
    loaded = load_scene(with_surface(make_plane(), BULB), view.camera)
    found = irradiances(loaded, view, samples=256).mean(axis=0)
    expected = np.pi * np.array(BULB.radiance) * (BULB.radius / distance) ** 2
    judge("sphere light: relative error", np.abs(found / expected - 1).max(), 2e-4)


def test_the_irradiance_layer_of_a_sphere_light(llvm: str, make_plane: MakePlane, judge: Judge) -> None:
    """E = pi L (r / d)² cos wherever all of the sphere is above the horizon."""
    images, points = direct_irradiance(with_surface(make_plane(), BULB), BULB)
    seen = points[..., 2] < 1e-4  # not the sphere itself
    assert seen.mean() > 0.5
    to_light = np.array(BULB.position) - points[seen]
    distance = np.linalg.norm(to_light, axis=-1)
    expected = np.pi * (BULB.radius / distance) ** 2 * to_light[:, 2] / distance
    ratio = images[:, seen, 0] / BULB.radiance[0] / expected
    judge_pixels(judge, "sphere light, irradiance layer", ratio)


PANEL = RectangleLight("panel", (0.3, 0.1, 0.8), (0, 0.5, 0), (0.3, 0, 0), (5.0, 4.0, 3.0))


def facing_rectangle(light: RectangleLight, points: np.ndarray) -> np.ndarray:
    """Configuration factor from an element of a floor to a rectangle parallel to it, shape ``(...)``.

    Howell's catalogue of configuration factors, B-4: the element is below a corner; the four corners of a
    rectangle elsewhere add up with their signs.
    """
    half = np.abs(np.array(light.half_u) + light.half_v)
    height = light.position[2] - points[..., 2]

    def below_corner(sign_x: int, sign_y: int) -> np.ndarray:
        x = (light.position[0] + sign_x * half[0] - points[..., 0]) / height
        y = (light.position[1] + sign_y * half[1] - points[..., 1]) / height
        long, wide = np.sqrt(1 + x * x), np.sqrt(1 + y * y)
        return (x / long * np.arctan(y / long) + y / wide * np.arctan(x / wide)) / (2 * np.pi)

    return below_corner(1, 1) - below_corner(-1, 1) - below_corner(1, -1) + below_corner(-1, -1)


@pytest.mark.parametrize("where", [(0.3, 0.1, 0.0), (0.6, 0.6, 0.0), (-0.9, 0.4, 0.0)])
def test_a_rectangle_light_over_a_point(
    variant: str, make_plane: MakePlane, judge: Judge, where: Point
) -> None:
    from graycard.synth.renderer._mitsuba import load_scene

    view = view_of(where, (where[0] + 1.5, where[1] - 1.5, 0.5))
    loaded = load_scene(with_surface(make_plane(), PANEL), view.camera)
    found = irradiances(loaded, view)[:, 0] / (np.pi * PANEL.radiance[0])
    factor = float(facing_rectangle(PANEL, np.array(where)))
    judge("rectangle light: standard errors", z_score(found, factor), 4)
    judge("rectangle light: relative error", abs(found.mean() / factor - 1), 2e-3)


def test_the_irradiance_layer_of_a_rectangle_light(llvm: str, make_plane: MakePlane, judge: Judge) -> None:
    images, points = direct_irradiance(with_surface(make_plane(), PANEL), PANEL)
    seen = points[..., 2] < 1e-4
    expected = np.pi * PANEL.radiance[0] * facing_rectangle(PANEL, points[seen])
    ratio = images[:, seen, 0] / expected
    judge_pixels(judge, "rectangle light, irradiance layer", ratio)


# --- the environment ---------------------------------------------------------------------------------------

SKY = EnvironmentLight("sky", "environment.exr")


def test_a_constant_sky_over_a_floor(variant: str, make_plane: MakePlane, judge: Judge) -> None:
    """E = pi L."""
    from graycard.synth.renderer._mitsuba import load_scene

    radiance = np.array((0.9, 0.6, 0.3))
    view = view_of((0, 0, 0), (1.5, -1.5, 0.8))
    loaded = load_scene(make_plane((SKY,), sky=np.broadcast_to(radiance, (8, 16, 3))), view.camera)
    found = irradiances(loaded, view) / (np.pi * radiance)
    judge("constant sky: standard errors", z_score(found[:, 0], 1), 4)
    judge("constant sky: relative error", np.abs(found.mean(axis=0) - 1).max(), 1e-3)


def dot(row: int, column: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """A sky of one bright value on the sky grid; and the vector of its irradiance, ``∫ L w dw``.

    The sky is linear between its values, so a dot is a tent over the polar angle and over the azimuth.
    """
    sky = np.zeros((rows, 2 * rows, 3))
    sky[row, column] = 50.0
    offset = (np.arange(400) + 0.5) / 200 - 1
    polar = np.pi * (row + offset[:, None]) / (rows - 1)
    azimuth = np.pi * (column + 0.5 + offset[None, :]) / rows
    tent = (1 - np.abs(offset[:, None])) * (1 - np.abs(offset[None, :]))
    area = np.maximum(np.sin(polar), 0) * (np.pi / (rows - 1) / 200) * (np.pi / rows / 200)
    share = np.where((polar > 0) & (polar < np.pi), 50.0 * tent * area, 0)
    towards = [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0 * azimuth]
    return sky, np.array([(share * component).sum() for component in towards])


@pytest.mark.parametrize(("row", "column"), [(3, 2), (8, 13), (12, 27), (7, 31)])
def test_a_bright_dot_in_the_sky_shines_from_its_row_and_column(
    llvm: str, judge: Judge, row: int, column: int
) -> None:
    """On a ball seen from the dot: E = n.V, in size and in direction."""
    sky, vector = dot(row, column, 16)
    length = float(np.linalg.norm(vector))
    view = view_of((0, 0, 0), tuple((6 * vector / length).tolist()), 16, 16.0)
    ball = Thing("ball", Ball((0, 0, 0), 1.0), Matte((1.0, 1.0, 1.0)))
    images, normals = direct_irradiance(Scene((ball,), (SKY,), (view,), sky), SKY)
    lit = (normals @ vector) / length > 0.4  # all of the dot is above the horizon there
    assert lit.sum() > 60
    found = [np.linalg.lstsq(normals[lit], image[lit, 0], rcond=None)[0] for image in images]
    across = np.linalg.norm(np.cross(np.mean(found, axis=0), vector)) / length**2
    judge("dot in the sky: angle to its direction, rad", float(across), 3e-4)
    judge("dot in the sky: standard errors", z_score(np.array(found) @ vector / length**2, 1), 4)
    judge("dot in the sky: relative error", abs(np.mean(found, axis=0) @ vector / length**2 - 1), 2e-4)


@pytest.mark.parametrize(("row", "column"), [(3, 2), (12, 27)])
def test_a_bright_dot_in_the_sky_is_seen_at_its_row_and_column(
    scalar: str, judge: Judge, row: int, column: int
) -> None:
    sky, _ = dot(row, column, 16)
    polar, azimuth = np.pi * row / 15, np.pi * (column + 0.5) / 16
    towards = np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)
    seen, _ = at_centres(Scene((), (SKY,), (view_of(towards, (0, 0, 0), 1, 1e-3),), sky))
    judge("dot in the sky: relative error of its radiance", abs(float(seen[0, 0, 0]) / 50 - 1), 1e-4)

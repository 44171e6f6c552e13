# SPDX-License-Identifier: Apache-2.0
"""Changes of the lights of a scene: their number, and their effects."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from graycard import (
    Camera,
    EnvironmentLight,
    GaussianLight,
    Light,
    LocalLight,
    PointLight,
    RectangleLight,
    SphereLight,
    SphericalGaussian,
    SpotLight,
    View,
    look_at,
    luminance,
)
from graycard.synth import Ball, Quad, RenderSettings, Scene, SceneSpec, Thing, all_families, family_of
from graycard.synth._mesh import box
from graycard.synth._scene import BLACK, Matte, surface_of
from graycard.synth._sky import Window, room
from graycard.synth.edits._free_space import bounds, is_seen, looked_at, obstacles
from graycard.synth.edits._light_edits import Edit, light_edits, scaled_light

SETTINGS = RenderSettings(24, 24, 6, 2, 16)
NAMES = tuple(all_families())


@lru_cache(maxsize=2)
def build(name: str, seed: int, **knobs: float | str) -> Scene:
    spec = SceneSpec(all_families()[name].track, name, seed, knobs)
    return family_of(spec).build(seed, SETTINGS)


def edits_of(name: str, seed: int, **knobs: float | str) -> dict[str, Edit]:
    return {edit.record.name: edit for edit in light_edits(build(name, seed, **knobs), seed)}


def local(scene: Scene, name: str) -> LocalLight:
    light = next(x for x in scene.lights if x.name == name)
    assert not isinstance(light, EnvironmentLight)
    return light


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", [0, 1001])
def test_edits_are_repeatable_named_once_and_leave_all_but_lights_alone(name: str, seed: int) -> None:
    scene = build(name, seed)
    edits = light_edits(scene, seed)
    again = light_edits(scene, seed)
    assert [e.record for e in edits] == [e.record for e in again]
    assert [e.scene.lights for e in edits] == [e.scene.lights for e in again]
    assert len({e.record.name for e in edits}) == len(edits)
    for edit in edits:
        assert edit.scene.views is scene.views
        assert edit.record.summary.endswith(".")
        for before, after in zip(scene.things, edit.scene.things, strict=True):
            assert after.name == before.name
            assert before.light or (after.geometry is before.geometry and after.material is before.material)


@pytest.mark.parametrize("name", NAMES)
def test_each_of_two_or_more_lights_is_off_once(name: str) -> None:
    scene, edits = build(name, 1000), edits_of(name, 1000)
    off = {n.removeprefix("without-"): e for n, e in edits.items() if n.startswith("without-")}
    assert list(off) == ([light.name for light in scene.lights] if len(scene.lights) > 1 else [])
    for light, edit in off.items():
        assert [x.name for x in edit.scene.lights] == [x.name for x in scene.lights if x.name != light]
        assert edit.factors == {light: (0.0, 0.0, 0.0)}
        assert not any(thing.light == light for thing in edit.scene.things)
        assert (edit.scene.sky is None) == all(not is_sky(x) for x in edit.scene.lights)


def is_sky(light: Light) -> bool:
    return isinstance(light, EnvironmentLight)


def test_what_the_scenes_of_the_tracks_have_beyond_that() -> None:
    assert {"flash-moved", "flash-recoloured"} < edits_of("corridor", 1000).keys()
    assert edits_of("glossy-table", 1000).keys() == {"without-lamp", "without-room", "recoloured-lamp"}
    studio = [n.partition("-")[0] for n in edits_of("studio", 1000)]
    assert sorted(set(studio)) == ["environment", "moved", "recoloured", "without"]
    assert studio.count("environment") == 2


@pytest.mark.parametrize("seed", range(1000, 1006))
@pytest.mark.parametrize("offset", [0.02, 0.25, 0.4])
def test_the_flash_goes_to_the_other_side_and_keeps_its_aim(seed: int, offset: float) -> None:
    scene = build("corridor", seed, light_offset=offset)
    before = local(scene, "lamp")
    after = local(edits_of("corridor", seed, light_offset=offset)["flash-moved"].scene, "lamp")
    assert isinstance(before, SpotLight)
    assert isinstance(after, SpotLight)
    assert after.frame == "camera"
    assert after.position[0] <= -0.2
    assert (after.intensity, after.cutoff_angle) == (before.intensity, before.cutoff_angle)
    aims = [np.array(x.position) + 3 / x.direction[2] * np.array(x.direction) for x in (before, after)]
    np.testing.assert_allclose(aims[0], aims[1], atol=1e-9)


@pytest.mark.parametrize(("name", "light"), [("corridor", "lamp"), ("glossy-table", "lamp")])
@pytest.mark.parametrize("seed", [1000, 1001, 1002])
def test_another_colour_has_the_same_luminance_and_is_clearly_another(
    name: str, light: str, seed: int
) -> None:
    edit = next(e for n, e in edits_of(name, seed).items() if "recoloured" in n)
    before, after = (local(s, light).axial_intensity for s in (build(name, seed), edit.scene))
    assert luminance(after) == pytest.approx(luminance(before), rel=1e-6)
    assert abs(np.log(after[0] / after[2] * before[2] / before[0])) > 0.8
    assert edit.factors is not None
    np.testing.assert_allclose(before * edit.factors[light], after, rtol=1e-12)


@pytest.mark.parametrize("seed", range(1000, 1010))
def test_a_moved_light_has_air_around_it_and_is_out_of_sight(seed: int) -> None:
    scene = build("studio", seed)
    name, edit = next((n, e) for n, e in edits_of("studio", seed).items() if n.startswith("moved"))
    light = name.removeprefix("moved-")
    before, after = local(scene, light), local(edit.scene, light)
    assert 0.45 <= np.linalg.norm(np.subtract(after.position, before.position)) < 1.2
    assert max(map(abs, after.position[:2])) < 1.8 + 0.8
    assert after.position[0] > -1.8
    assert after.position[1] > -1.8
    assert not is_seen(scene.views, np.array([after.position]))
    assert replace(after, position=before.position, **aim(before)) == before


def aim(light: LocalLight) -> dict[str, LocalLight]:
    return {"direction": light.direction} if isinstance(light, SpotLight) else {}  # pyright: ignore[reportReturnType]


def test_environments_are_all_the_light_there_is_and_unlike_the_captured_one() -> None:
    scene, edits = build("studio", 1000), edits_of("studio", 1000)
    skies = [edits[f"environment-{k}"].scene.sky for k in (1, 2)]
    for number, sky in enumerate(skies, start=1):
        changed = edits[f"environment-{number}"].scene
        assert changed.lights == (EnvironmentLight("sky", "environment.exr"),)
        assert not any(thing.light for thing in changed.things)
        assert sky is not None
        assert sky.shape == (64, 128, 3)
        assert sky.min() >= 0
    views = [scene.sky, *skies]
    for i in range(3):
        for k in range(i):
            a, b = (v.ravel() / np.linalg.norm(v) for v in (views[i], views[k]) if v is not None)
            assert a @ b < 0.8


def stage(lights: tuple[Light, ...], *things: Thing, target: str = "", sky: bool = False) -> Scene:
    """Two cameras that look at (0, 0, 1) from either side of a floor."""
    floor = Thing("floor", Quad((0, 0, 0), (4, 0, 0), (0, 4, 0)), Matte((0.5, 0.5, 0.5)))
    poses = [look_at(np.array([x, -3.0, 2.0]), np.array([0.0, 0.0, 1.0])) for x in (-1.0, 1.0)]
    cameras = [Camera.from_fov(20, 20, 40.0, pose) for pose in poses]
    views = (View("train_000", "train", cameras[0]), View("test_001", "test", cameras[1]))
    return Scene(
        (floor, *things), lights, views, room((1, 1, 1), (1, 1, 1), (1, 1, 1)) if sky else None, target
    )


def names(scene: Scene) -> list[str]:
    return [edit.record.name for edit in light_edits(scene, 5)]


def test_a_single_light_is_not_switched_off_and_only_local_ones_are_moved() -> None:
    lamp, sky = (
        PointLight("lamp", (0.5, 0.2, 2.5), (1, 1, 1)),
        EnvironmentLight("day", "environment.exr"),
    )
    everywhere = ["environment-1", "environment-2"]
    assert names(stage((sky,), sky=True)) == everywhere
    assert names(stage((lamp,))) == ["recoloured-lamp", "moved-lamp", *everywhere]
    assert light_edits(stage((lamp,)), 5)[-1].scene.lights == (
        EnvironmentLight("environment", "environment.exr"),
    )


def test_a_dark_lamp_has_no_colour_to_change() -> None:
    assert "recoloured-lamp" not in names(stage((PointLight("lamp", (0.5, 0.2, 2.5), (0, 0, 0)),)))


def test_where_there_is_no_room_nothing_is_moved() -> None:
    cell = Thing("cell", Ball((0, 0, 2.5), 1.9), BLACK)
    scene = stage((PointLight("lamp", (0.0, 0.0, 2.5), (1, 1, 1)),), cell)
    assert not any(name.startswith("moved") for name in names(scene))
    flash = PointLight("flash", (0.1, 0.0, 0.0), (1, 1, 1), "camera")
    assert "flash-moved" in names(stage((flash,)))
    eye = scene.views[1].camera.position
    helmet = Thing("helmet", Ball((eye[0], eye[1], eye[2]), 0.9), BLACK)
    assert "flash-moved" not in names(stage((flash,), helmet))


def test_the_surface_of_a_moved_light_goes_with_it() -> None:
    bulb = SphereLight("bulb", (0.3, 0.3, 2.6), 0.1, (2, 2, 1))
    moved = next(e for e in light_edits(stage((bulb,), surface_of(bulb)), 5) if "moved" in e.record.name)
    after = local(moved.scene, "bulb")
    assert moved.scene.things[1].geometry == Ball(after.position, 0.1)
    assert moved.factors is None


def test_each_kind_of_local_light_is_recoloured() -> None:
    lobes = tuple(SphericalGaussian((0, 0, z), 2.0, (4, 2, 1)) for z in (1.0, -1.0))
    lights: list[LocalLight] = [
        PointLight("x", (0, 0, 1), (4, 2, 1)),
        SpotLight("x", (0, 0, 1), (0, 0, -1), (4, 2, 1), 10, 20),
        RectangleLight("x", (0, 0, 1), (1, 0, 0), (0, 1, 0), (4, 2, 1)),
        SphereLight("x", (0, 0, 1), 0.5, (4, 2, 1)),
        GaussianLight("x", (0, 0, 1), lobes),
    ]
    for light in lights:
        after = scaled_light(light, (0.5, 1.0, 3.0))
        assert not isinstance(after, EnvironmentLight)
        np.testing.assert_allclose(after.axial_intensity, light.axial_intensity * (0.5, 1.0, 3.0))
        assert scaled_light(after, (2.0, 1.0, 1 / 3)) == light


def test_an_environment_is_not_scaled_as_if_it_were_local() -> None:
    with pytest.raises(ValueError, match="expected a local light, got EnvironmentLight"):
        scaled_light(EnvironmentLight("e", "environment.exr"), (1, 1, 1))


def test_held_out_environments_are_as_bright_as_the_lights_were() -> None:
    """A sky of radiance 1 everywhere and nothing else: 4 pi W/m² over all directions."""
    scene = stage((EnvironmentLight("e", "environment.exr"),), sky=True)
    polar = np.pi * np.arange(64) / 63
    pixel = (np.sin(polar) * (np.pi / 63) * (2 * np.pi / 128))[:, None, None]
    for edit in light_edits(scene, 5):
        assert edit.scene.sky is not None
        fluence = luminance((pixel * edit.scene.sky).sum(axis=(0, 1)))
        assert fluence == pytest.approx(4 * np.pi, rel=2e-3)


def test_boxes_around_shapes() -> None:
    cube = box((0.2, 0.4, 0.6), 0.01).moved((1, 0, 0))
    np.testing.assert_allclose(bounds(cube), [[0.9, -0.2, -0.3], [1.1, 0.2, 0.3]], atol=1e-6)
    np.testing.assert_allclose(bounds(Ball((0, 1, 0), 0.5)), [[-0.5, 0.5, -0.5], [0.5, 1.5, 0.5]])
    np.testing.assert_allclose(bounds(Quad((0, 0, 1), (1, 1, 0), (1, -1, 0))), [[-2, -2, 1], [2, 2, 1]])


@pytest.mark.parametrize(
    ("point", "free"),
    [
        ((0, 0, 1.0), True),
        ((0, 0, 0.05), False),  # on the floor
        ((0, 0, -1.0), False),  # under it
        ((5, 0, -1.0), True),  # beside it
        ((1, 0, 0.55), False),  # in the ball's box
        ((1, 0, 0.75), True),
    ],
)
def test_free_space(point: tuple[float, float, float], free: bool) -> None:
    scene = stage((), Thing("ball", Ball((1, 0, 0.4), 0.2), BLACK))
    assert obstacles(scene).leave_free(np.array([point]), 0.1) == free
    assert obstacles(scene, but=("ball", "floor")).leave_free(np.array([point]), 0.1)


def test_a_room_around_all_cameras_is_no_obstacle() -> None:
    shell = Thing("shell", box((20, 20, 20), 0.1), BLACK)
    assert obstacles(stage((), shell)).leave_free(np.array([[0, 0, 1.0]]), 0.1)


def test_what_cameras_look_at_and_see() -> None:
    views = stage(()).views
    np.testing.assert_allclose(looked_at(views), (0, 0, 1), atol=1e-9)
    assert is_seen(views, np.array([[0, 0, 1.0]]))
    assert not is_seen(views, np.array([[0, -6.0, 1.0], [0, 0, 9.0]]))


def test_windows_are_told_apart_by_their_side() -> None:
    """The two held-out environments light the scene from either side of the cameras."""
    for seed in range(1000, 1005):
        suns = [edits_of("studio", seed)[f"environment-{k}"].scene.sky for k in (1, 2)]
        columns = [int(s.sum(axis=(0, 2)).argmax()) for s in suns if s is not None]
        apart = abs((columns[0] - columns[1] + 64) % 128 - 64) * 360 / 128
        assert apart > 60
    assert room((0, 0, 0), (0, 0, 0), (0, 0, 0), (Window(0, 0, 9, 9, (1, 1, 1)),)).max() > 0.9

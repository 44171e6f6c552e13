# SPDX-License-Identifier: Apache-2.0
"""Masks of a target's effects: against closed forms, in every mask alone, and in pure noise."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from graycard import Camera, EnvironmentLight, Light, PointLight, View, look_at
from graycard.layers import find_fault
from graycard.synth import (
    Ball,
    LambertGGX,
    Matte,
    Quad,
    RenderSettings,
    Scene,
    SceneSpec,
    Thing,
    all_families,
    family_of,
)
from graycard.synth._scene import Material

CENTRE, RADIUS = np.array((0.2, 0.1, 0.6)), 0.4
SEEDS = [1, 2, 3, 4]
LAMPS = (
    PointLight("lamp", (1.6, 0.4, 2.4), (9.0, 8.0, 7.0)),
    PointLight("other", (-1.4, 0.9, 2.2), (5.0, 6.0, 7.0)),
)
SKY = EnvironmentLight("sky", "environment.exr")
NAMES = ("untouched", "footprint", "shadow", "mirror", "bleeding")


pytestmark = pytest.mark.usefixtures("llvm")


def ball_over(floor: Material, *lights: Light, sky: np.ndarray | None = None) -> Scene:
    """A matte red ball, the target, above a large plane, seen obliquely from above."""
    plane = Thing("floor", Quad((0, 0, 0), (6, 0, 0), (0, 6, 0)), floor)
    x, y, z = CENTRE.tolist()
    ball = Thing("ball", Ball((x, y, z), RADIUS), Matte((0.6, 0.1, 0.1)))
    pose = look_at(np.array([0.6, -2.4, 2.2]), np.array([0.1, 0.0, 0.2]))
    camera = Camera.from_fov(40, 36, 60.0, pose)
    return Scene((plane, ball), lights, (View("train_000", "train", camera),), sky, "ball")


def effects(
    scene: Scene, samples: int = 64, max_depth: int = 3, other_seeds: list[int] | None = None
) -> dict[str, np.ndarray]:
    """The masks as bool, by the last part of their names."""
    from graycard.synth.layers._effects import effect_layers, target_footprint
    from graycard.synth.layers._separation import separated_images
    from graycard.synth.renderer._mitsuba import load_scene

    camera, settings = scene.views[0].camera, RenderSettings(40, 36, samples=samples, max_depth=max_depth)
    whole, emptied = (load_scene(scene, camera, without) for without in ("", scene.target))
    present = separated_images(whole, camera, SEEDS, settings)
    absent = separated_images(emptied, camera, other_seeds or SEEDS, settings)
    found = effect_layers(present, absent, target_footprint(whole, scene, camera, SEEDS, settings))
    assert list(found) == [f"effect.{name}" for name in NAMES]
    for name, mask in found.items():
        assert find_fault(name, mask, 36, 40) is None
        assert set(np.unique(mask)) <= {0.0, 1.0}
    return {name.removeprefix("effect."): mask > 0 for name, mask in found.items()}


def floor_points(camera: Camera) -> np.ndarray:
    rays = camera.rays()
    return camera.position - (camera.position[2] / rays[..., 2])[..., None] * rays


def meets_ball(origin: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """Return true for rays that meet the ball, ``(H, W)``."""
    towards = towards / np.linalg.norm(towards, axis=-1, keepdims=True)
    along = ((CENTRE - origin) * towards).sum(-1, keepdims=True)
    return (along[..., 0] > 0) & (np.linalg.norm(origin + along * towards - CENTRE, axis=-1) < RADIUS)


def shadow_of(lamp: PointLight, points: np.ndarray) -> np.ndarray:
    return meets_ball(points, np.array(lamp.position) - points)


def inside(mask: np.ndarray) -> np.ndarray:
    """Pixels whose neighbours all belong to a mask: those at its border are left out."""
    return minimum_filter(mask, 3)


def seen_ball(camera: Camera) -> np.ndarray:
    return meets_ball(camera.position, camera.rays())


@pytest.mark.parametrize("number", [1, 2])
def test_shadows_of_point_lights_are_the_closed_form(number: int) -> None:
    """Direct light alone: every pixel is shadow, or the ball, or untouched, and nothing is mirrored."""
    scene = ball_over(Matte((0.5, 0.4, 0.3)), *LAMPS[:number])
    camera, found = scene.views[0].camera, effects(scene, samples=16, max_depth=2)
    points, ball = floor_points(camera), seen_ball(camera)
    shadow = np.any([shadow_of(lamp, points) for lamp in LAMPS[:number]], axis=0)
    assert found["footprint"][ball].all()
    assert not found["footprint"][inside(~ball)].any()
    assert found["shadow"][inside(shadow & ~ball)].all()
    assert not found["shadow"][inside(~shadow) | ball].any()
    assert found["untouched"][inside(~shadow & ~ball)].all()
    assert not (found["mirror"] | found["bleeding"]).any()
    assert not (found["untouched"] & (found["shadow"] | found["footprint"])).any()
    assert inside(shadow & ~ball).sum() > 15 * number


def test_a_red_ball_bleeds_onto_a_matte_floor_near_it() -> None:
    scene = ball_over(Matte((0.5, 0.5, 0.5)), SKY, sky=np.full((8, 16, 3), 0.5))
    found, camera = effects(scene, samples=256), scene.views[0].camera
    distance = np.linalg.norm(floor_points(camera)[..., :2] - CENTRE[:2], axis=-1)
    outside = ~found["footprint"]
    assert found["bleeding"][outside & (distance < 0.6)].mean() > 0.7
    assert found["bleeding"][outside & (distance > 1.6)].mean() < 0.02
    assert not found["mirror"].any()


def test_a_mirror_shows_the_mirrored_ball_and_no_shadow() -> None:
    """A smooth metal plane under a sky: changed is where the mirrored ray meets the ball."""
    mirror = LambertGGX((0.8, 0.8, 0.8), 0.04, 1.0)
    sky = np.full((8, 16, 3), 0.5)
    scene = ball_over(mirror, SKY, sky=sky)
    camera, found = scene.views[0].camera, effects(scene)
    mirrored = meets_ball(floor_points(camera), camera.rays() * [1, 1, -1])
    ball = seen_ball(camera)
    expected = inside(mirrored & ~ball)
    assert expected.sum() > 12
    assert found["mirror"][expected].all()
    assert not found["mirror"][np.logical_not(maximum_filter(mirrored, 3)) | ball].any()
    assert not (found["shadow"] | found["bleeding"]).any()
    assert not found["untouched"][expected | ball].any()


def test_a_counterfactual_of_other_seeds_leaves_nothing_untouched() -> None:
    scene = ball_over(Matte((0.5, 0.4, 0.3)), *LAMPS, SKY, sky=np.full((8, 16, 3), 0.5))
    assert effects(scene, 16)["untouched"].mean() > 0.02
    rays, points = scene.views[0].camera.rays(), floor_points(scene.views[0].camera)
    on_floor = (rays[..., 2] < 0) & (np.abs(points).max(axis=-1) < 5.5)
    assert on_floor.mean() > 0.7
    assert not effects(scene, 16, other_seeds=[5, 6, 7, 8])["untouched"][on_floor].any()


def test_the_masks_of_the_same_seeds_are_the_same_to_the_bit() -> None:
    scene = ball_over(Matte((0.5, 0.4, 0.3)), *LAMPS, SKY, sky=np.full((8, 16, 3), 0.5))
    one, two = effects(scene, 16), effects(scene, 16)
    assert all(np.array_equal(one[name], two[name]) for name in NAMES)


def images(**parts: float) -> np.ndarray:
    """Four constant images under two lights of total 1; parts by name, those of the second light."""
    from graycard.synth.layers._separation import FIRST_PART, PARTS

    made = np.zeros((4, FIRST_PART + 2 * len(PARTS), 12, 14, 3))
    made[:, 0] = 1
    for name, value in parts.items():
        made[:, FIRST_PART + len(PARTS) + PARTS.index(name.replace("_", "."))] = value
    return made


def masks(present: np.ndarray, absent: np.ndarray, footprint: np.ndarray | None = None) -> dict[str, float]:
    """Share of each mask."""
    from graycard.synth.layers._effects import effect_layers

    footprint = np.zeros(present.shape[2:4], bool) if footprint is None else footprint
    found = effect_layers(present, absent, footprint)
    return {name: float(found[f"effect.{name}"].mean()) for name in NAMES}


@pytest.mark.parametrize(
    ("part", "expected"),
    [
        ("direct_diffuse", "shadow"),
        ("direct_specular", "mirror"),
        ("indirect_specular", "mirror"),
        ("indirect_diffuse", "bleeding"),
    ],
)
def test_a_loss_of_each_part_is_in_its_own_mask(part: str, expected: str) -> None:
    lost = masks(images(), images(**{part: 0.03}))
    assert {name for name, share in lost.items() if share} == {expected}
    assert lost[expected] == 1
    too_little = masks(images(), images(**{part: 0.019}))
    assert not any(too_little.values())


def test_only_a_loss_of_direct_light_is_a_shadow_and_bleeding_goes_both_ways() -> None:
    assert not any(masks(images(direct_diffuse=0.5), images()).values())
    assert masks(images(indirect_diffuse=0.5), images())["bleeding"] == 1
    assert masks(images(indirect_specular=0.5), images())["mirror"] == 1


def test_what_lies_in_the_footprint_has_no_other_effect_and_spoils_no_neighbour() -> None:
    footprint = np.zeros((12, 14), bool)
    footprint[4:9, 5:10] = True
    noise = np.random.default_rng(1).normal(0, 9, (4, 10, 12, 14, 3)) * footprint[..., None]
    found = masks(images(direct_diffuse=0.5) + noise, images(direct_diffuse=0.6), footprint)
    assert found["footprint"] == pytest.approx(footprint.mean())
    assert found["shadow"] == pytest.approx(1 - footprint.mean())


def test_noise_alone_is_seldom_taken_for_an_effect() -> None:
    """Gaussian differences far above tau. The spread of a pixel's own four images would give 3 % and 8 %."""
    noise = np.random.default_rng(2).normal(0, 1, (4, 10, 120, 120, 3))
    still = np.broadcast_to(images()[..., :1, :1, :], noise.shape)
    found = masks(still, still + noise)
    assert found["shadow"] < 0.002
    assert found["mirror"] < 0.006
    assert found["bleeding"] < 0.015


@pytest.mark.parametrize("name", ["metal-table", "matte-table"])
def test_views_of_tables_hold_the_masks(name: str) -> None:
    from graycard.synth.layers._views import render_view

    settings = RenderSettings(28, 24, 3, 1, 64, 4)
    scene = family_of(SceneSpec("tabletop", name, 1000, {"target_size": 1.4})).build(1000, settings)
    layers = render_view(scene, 1, 1000, settings)
    found = {mask: layers[f"effect.{mask}"] > 0 for mask in NAMES}
    on_target = layers["object_id"] == scene.target_id
    assert found["footprint"][on_target].all()
    same = (layers["radiance"] == layers["counterfactual.radiance"]).all(axis=-1)
    assert same[found["untouched"]].all()
    assert not found["untouched"][found["shadow"] | found["mirror"] | found["bleeding"]].any()
    on_table = layers["object_id"] == scene.id_of("table")
    shining = name == "metal-table"
    assert found["mirror"].any() == shining
    assert found["shadow"][inside(on_table)].any() == (not shining)


def test_a_black_target_before_black_is_seen_all_the_same() -> None:
    """Nothing differs there, but it is no pixel that the target leaves alone."""
    dark = ball_over(Matte((0.0, 0.0, 0.0)), LAMPS[0])
    black = replace(dark.things[1], material=Matte((0.0, 0.0, 0.0)))
    found = effects(replace(dark, things=(dark.things[0], black)))
    assert found["footprint"].any()
    assert (found["untouched"] == ~found["footprint"]).all()


@pytest.fixture
def without_masks(scalar: str) -> Callable[[Scene], dict[str, np.ndarray]]:
    from graycard.synth.layers._views import render_view

    return lambda scene: render_view(scene, 0, 0, RenderSettings(12, 10, 3, 1, 16, 3))


def test_without_llvm_there_are_no_masks(without_masks: Callable[[Scene], dict[str, np.ndarray]]) -> None:
    scene = all_families()["matte-table"]().build(0, RenderSettings(12, 10, 3, 1, 16, 3))
    found = without_masks(scene)
    assert "counterfactual.radiance.half_a" in found
    assert not [name for name in found if name.startswith("effect.")]

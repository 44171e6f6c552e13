# SPDX-License-Identifier: Apache-2.0
"""Layers beside the radiance: materials, positions, pure pixels, visibility of the lights."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from graycard import Camera, EnvironmentLight, PointLight, RectangleLight, View, look_at
from graycard.layers import find_fault, with_sums
from graycard.synth import (
    Ball,
    Glossy,
    LambertGGX,
    Matte,
    Quad,
    RenderSettings,
    Scene,
    Texture,
    Thing,
    all_families,
)
from graycard.synth._scene import surface_of
from graycard.synth.layers._material_layers import material_layers

MakePlane = Callable[..., Scene]
TINY = RenderSettings(20, 16, 3, 1, 16, 3)


def loaded(scene: Scene, without: str = "") -> tuple[Any, Camera]:
    from graycard.synth.renderer._mitsuba import load_scene

    camera = scene.views[0].camera
    return load_scene(scene, camera, without), camera


def surfaces(scene: Scene) -> dict[str, np.ndarray]:
    from graycard.synth.layers._views import surface_layers

    made, camera = loaded(scene)
    return surface_layers(made, scene, camera)


def pure(scene: Scene) -> np.ndarray:
    from graycard.synth.layers._purity import pure_pixels

    made, camera = loaded(scene)
    return pure_pixels(made, scene, camera)


def visibility(scene: Scene, samples: int = 64) -> dict[str, np.ndarray]:
    from graycard.synth.layers._direct_light import direct_light
    from graycard.synth.layers._separation import light_names

    made, camera = loaded(scene)
    found = direct_light(made, camera, [5, 6], samples).visibility()
    return {f"visibility.{name}": v for name, v in zip(light_names(made, scene), found, strict=True)}


def test_material_layers_of_each_material() -> None:
    """Columns: nothing, matte, glossy dielectric, papers' half metal, papers' metal."""
    quad = Quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    color = (0.5, 0.4, 0.2)
    materials = (
        Matte(color),
        Glossy(color, 0.3, 0.0, specular=1.0),
        LambertGGX(color, 0.6, 0.5),
        LambertGGX(color, 0.2, 1.0),
    )
    scene = Scene(tuple(Thing(str(k), quad, m) for k, m in enumerate(materials)), (), ())
    ids = np.arange(5, dtype=np.uint32)[None]
    base = np.where(ids[..., None] > 0, np.array(color), 0.0)
    layers = material_layers(scene, ids, base)
    np.testing.assert_allclose(layers["roughness"][0], (0, 1, 0.3, 0.6, 0.2), rtol=1e-6)
    np.testing.assert_allclose(layers["alpha"][0], (0, 1, 0.09, 0.36, 0.04), rtol=1e-6)
    np.testing.assert_allclose(layers["metallic"][0], (0, 0, 0, 0.5, 1), rtol=1e-6)
    np.testing.assert_allclose(layers["f0"][0, :, 0], (0, 0, 0.08, 0.27, 0.5), rtol=1e-6)
    np.testing.assert_allclose(layers["f0"][0, :, 2], (0, 0, 0.08, 0.12, 0.2), rtol=1e-6)
    np.testing.assert_allclose(layers["diffuse_reflectance"][0, :, 0], (0, 0.5, 0.5, 0.25, 0), rtol=1e-6)
    for name, values in layers.items():
        assert find_fault(name, values, 1, 5) is None
        assert values.dtype == np.float32


@pytest.mark.parametrize("family", all_families().values(), ids=all_families().keys())
def test_material_layers_are_what_the_renderer_shades_with(llvm: str, family: Any) -> None:
    """Against the attributes of Mitsuba's own materials at the same points."""
    import drjit as dr

    from graycard.synth.renderer._mitsuba import sensor
    from graycard.synth.renderer._wavefront import bands, centre_rays

    scene = family().build(0, TINY)
    made, camera = loaded(scene)
    layers = surfaces(scene)
    eye = sensor(camera, 1)
    si = made.ray_intersect(centre_rays(bands(eye)[0], eye.sampler()))
    bsdf: Any = si.bsdf()
    for name in ("roughness", "metallic"):
        has = bsdf.has_attribute(name, si.is_valid()) & si.is_valid()
        expected = np.array(dr.select(has, bsdf.eval_attribute_1(name, si, has), 0)).reshape(16, 20)
        known = np.array(has).reshape(16, 20)
        np.testing.assert_allclose(layers[name][known], expected[known], rtol=1e-6)
    matte = (layers["object_id"] > 0) & ~known
    assert (layers["roughness"][matte] == 1).all()
    np.testing.assert_array_equal(
        layers["diffuse_reflectance"], layers["base_color"] * (1 - layers["metallic"][..., None])
    )
    position = np.array(dr.select(si.is_valid(), si.p, 0)).T.reshape(16, 20, 3)
    np.testing.assert_allclose(layers["position"], position, atol=2e-5)


def test_position_and_distance_of_a_plane(variant: str, make_plane: MakePlane) -> None:
    scene = make_plane()
    layers, camera = surfaces(scene), scene.views[0].camera
    rays = camera.rays()
    distance = -camera.position[2] / rays[..., 2]
    np.testing.assert_allclose(layers["distance"], distance, rtol=1e-5)
    np.testing.assert_allclose(layers["position"], camera.position + distance[..., None] * rays, atol=2e-5)
    assert (layers["distance"] > layers["depth"]).all()


def test_where_nothing_is_seen(variant: str) -> None:
    camera = Camera.from_fov(8, 6, 60, look_at(np.zeros(3), np.array([1.0, 0, 0])))
    ball = Thing("ball", Ball((3, 0, 0), 0.4), LambertGGX((0.5, 0.5, 0.5), 0.4))
    layers = surfaces(Scene((ball,), (), (View("train_000", "train", camera),)))
    empty = layers["object_id"] == 0
    assert 0 < empty.sum() < empty.size
    assert np.isposinf(layers["distance"][empty]).all()
    for name in ("position", "roughness", "alpha", "metallic", "diffuse_reflectance", "f0", "base_color"):
        assert (layers[name][empty] == 0).all()
    for name, values in layers.items():
        assert find_fault(name, values, 6, 8) is None


def test_pixels_at_an_outline_are_not_pure(variant: str, make_plane: MakePlane) -> None:
    scene = make_plane(ball=Ball((0.2, 0.1, 0.6), 0.6))
    found, ids = pure(scene), surfaces(scene)["object_id"]
    assert set(np.unique(found)) == {0.0, 1.0}
    assert find_fault("pure", found, 20, 24) is None
    among_equals = ndimage.minimum_filter(ids, 3) == ndimage.maximum_filter(ids, 3)
    assert (found[1:-1, 1:-1][among_equals[1:-1, 1:-1]] == 1).all()
    differ = ids[:, 1:] != ids[:, :-1]
    # an edge that runs just between two pixels leaves both of them pure
    assert (np.minimum(found[:, 1:], found[:, :-1])[differ] == 0).mean() > 0.7
    assert differ.sum() > 10


def test_pixels_that_mix_colors_are_not_pure(variant: str) -> None:
    """A board of 2 x 1 cells that fills 5 x 5 pixels: the cells meet within the middle column."""
    for step, expected in ((0.2, 0.0), (0.02, 1.0)):
        pixels = np.full((1, 2, 3), 0.3)
        pixels[0, 1] += step
        board = Thing("board", Quad((0, 0, 0), (1, 0, 0), (0, 0, 1)), Matte(Texture(pixels, smooth=False)))
        pose = look_at(np.array([0, -4.0, 0]), np.zeros(3))
        camera = Camera.from_fov(5, 5, 2 * np.degrees(np.arctan(0.25)), pose)
        found = pure(Scene((board,), (), (View("train_000", "train", camera),)))
        assert (found[:, 2] == expected).all()
        assert (found[:, [0, 1, 3, 4]] == 1).all()


def test_visibility_of_a_point_light_is_the_shadow_of_the_ball(llvm: str, make_plane: MakePlane) -> None:
    centre, radius, light = np.array((0.2, 0.1, 0.6)), 0.6, PointLight("lamp", (1.6, 0.4, 2.0), (9, 9, 9))
    scene = make_plane((light,), ball=Ball((0.2, 0.1, 0.6), radius))
    layers = surfaces(scene)
    found = visibility(scene)["visibility.lamp"]
    assert set(np.unique(found)) == {0.0, 1.0}
    points, towards = layers["position"].astype(np.float64), np.array(light.position) - layers["position"]
    length = np.linalg.norm(towards, axis=-1, keepdims=True)
    along = ((centre - points) * towards / length).sum(-1)
    nearest = np.linalg.norm(points + along[..., None] * towards / length - centre, axis=-1)
    floor, ball = layers["object_id"] == 1, layers["object_id"] == 2
    sure = np.abs(nearest - radius) > 1e-3
    np.testing.assert_array_equal(found[floor & sure], (nearest >= radius)[floor & sure])
    facing = (layers["normal"] * towards).sum(-1)
    sure = np.abs(facing) > 1e-2
    np.testing.assert_array_equal(found[ball & sure], (facing > 0)[ball & sure])
    assert 10 < (found[floor] == 0).sum() < floor.sum() / 2


def test_visibility_times_unshadowed_light_is_the_shadowed_one(llvm: str, make_plane: MakePlane) -> None:
    """Against the path tracer: direct shading of the floor with the ball over that without it."""
    from graycard.synth.layers._separation import separated_images
    from graycard.synth.renderer._scattering import white_first
    from graycard.synth.renderer._wavefront import centre_rays

    lamp = RectangleLight("lamp", (1.2, 0.3, 2.0), (0, 0.5, 0), (0.5, 0, 0), (5, 5, 5))
    bare = make_plane((lamp,), ball=Ball((0.2, 0.1, 0.5), 0.5))
    scene = Scene((*bare.things, surface_of(lamp)), bare.lights, bare.views)
    settings = RenderSettings(24, 20, samples=1024, max_depth=2)
    lit, open_ = (
        separated_images(made, camera, [1, 2, 3, 4], settings, centre_rays, white_first).mean(axis=0)[
            0, ..., 0
        ]
        for made, camera in (loaded(scene), loaded(scene, "ball"))
    )
    floor = surfaces(scene)["object_id"] == 1
    found = visibility(scene, samples=1024)["visibility.lamp"]
    np.testing.assert_allclose((found * open_)[floor], lit[floor], atol=0.02 * open_[floor].max())
    assert 0.02 < ((found > 0) & (found < 1))[floor].mean() < 0.5


def test_a_light_behind_a_surface_is_not_seen_and_an_open_sky_is(llvm: str, make_plane: MakePlane) -> None:
    below = PointLight("below", (0.0, 0.0, -1.0), (9, 9, 9))
    sky = EnvironmentLight("sky", "environment.exr")
    found = visibility(make_plane((below, sky), sky=np.ones((8, 16, 3))))
    assert (found["visibility.below"] == 0).all()
    assert (found["visibility.sky"] == 1).all()


def render(track_family: str) -> tuple[Scene, dict[str, np.ndarray]]:
    from graycard.synth.layers._views import render_view

    scene = all_families()[track_family]().build(0, TINY)
    return scene, render_view(scene, 0, 0, TINY)


def test_views_hold_the_parts_and_the_visibility_of_each_light(llvm: str) -> None:
    scene, layers = render("studio")
    for light in scene.lights:
        for stem in ("direct.diffuse", "direct.specular", "indirect.diffuse", "indirect.specular"):
            assert f"{stem}.{light.name}" in layers
        assert 0 <= layers[f"visibility.{light.name}"].min() < layers[f"visibility.{light.name}"].max() <= 1
    for name, values in layers.items():
        assert find_fault(name, values, 16, 20) is None
    stems = ("emitted", "direct.diffuse", "direct.specular", "indirect.diffuse", "indirect.specular")
    parts = [v for k, v in layers.items() if k.startswith(stems)]
    np.testing.assert_allclose(np.sum(parts, axis=0), layers["radiance"], rtol=1e-6, atol=1e-7)


def test_halves_of_the_samples_average_to_the_whole(llvm: str) -> None:
    _, layers = render("glossy-table")
    for name in ("radiance", "counterfactual.radiance"):
        one, other = layers[f"{name}.half_a"], layers[f"{name}.half_b"]
        np.testing.assert_allclose((one + other) / 2, layers[name], rtol=1e-5, atol=1e-7)
        # Var(mean) = E[(a - b)²] / 4 for halves of equal size
        ratio = ((one - other) ** 2).sum() / 4 / layers[f"{name}.var"].sum()
        assert 0.7 < ratio < 1.4


def test_irradiance_of_all_lights_is_pi_times_shading(llvm: str) -> None:
    scene, layers = render("studio")
    total = sum(layers[f"irradiance.{light.name}"] for light in scene.lights)
    np.testing.assert_allclose(total, np.pi * layers["shading"], rtol=1e-5, atol=1e-6)
    for light in scene.lights:
        assert (
            layers[f"direct.irradiance.{light.name}"] <= layers[f"irradiance.{light.name}"] * (1 + 1e-6)
        ).all()
    hidden = layers["visibility.lamp-4"] == 0
    assert hidden.any()
    assert (layers["direct.irradiance.lamp-4"][hidden] == 0).all()
    assert (layers["direct.irradiance.lamp-4"][~hidden].min(axis=-1) > 0).all()


def test_paths_of_one_segment_light_nothing(llvm: str) -> None:
    from graycard.synth.layers._views import render_view

    settings = replace(TINY, max_depth=1)
    scene = all_families()["studio"]().build(0, settings)
    layers = render_view(scene, 0, 0, settings)
    assert not layers["shading"].any()
    np.testing.assert_array_equal(layers["radiance"], layers["emitted"])


def test_albedo_of_a_matte_surface_is_its_color_and_of_black_is_black(
    llvm: str, make_plane: MakePlane
) -> None:
    found = albedo(make_plane((PointLight("lamp", (0, 0, 2), (1, 1, 1)),)))
    seen = found.max(axis=-1) > 0
    assert seen.mean() > 0.9
    np.testing.assert_allclose(found[seen], np.broadcast_to([0.5, 0.4, 0.3], found[seen].shape), rtol=1e-5)


@pytest.mark.parametrize(("roughness", "metallic"), [(0.1, 1.0), (0.3, 0.0), (0.7, 0.5)])
def test_albedo_of_a_shiny_surface_is_the_integral_of_its_formula(
    llvm: str, make_plane: MakePlane, roughness: float, metallic: float
) -> None:
    """Against a quadrature in float64 of the Lambert and GGX formula (Walter 2007, Schlick 1994)."""
    color = np.array([0.5, 0.4, 0.3])
    floor = Thing(
        "floor", Quad((0, 0, 0), (4, 0, 0), (0, 4, 0)), LambertGGX(tuple(color), roughness, metallic)
    )
    plane = make_plane((PointLight("lamp", (0, 0, 2), (1, 1, 1)),))
    scene = replace(plane, things=(floor,))
    found = albedo(scene)
    rays = scene.views[0].camera.rays()
    for row, column in ((10, 12), (16, 4)):
        expected = (1 - metallic) * color + ggx_reflectance(
            -rays[row, column, 2], roughness**2, color, metallic
        )
        np.testing.assert_allclose(found[row, column], expected, atol=4e-3)


def ggx_reflectance(cos_o: float, alpha: float, color: np.ndarray, metallic: float) -> np.ndarray:
    """Share of light from the direction at ``cos_o`` that the GGX lobe returns, by quadrature; ``(3,)``."""
    # over half vectors, dense where D is large: tan² of their polar angle = alpha² t / (1 - t)
    t = (np.arange(2000) + 0.5) / 2000
    phi = (np.arange(256) + 0.5) / 256 * 2 * np.pi
    cos_h = 1 / np.sqrt(1 + alpha**2 * t / (1 - t))
    h = np.stack(
        np.broadcast_arrays(
            np.sqrt(1 - cos_h**2)[:, None] * np.cos(phi),
            np.sqrt(1 - cos_h**2)[:, None] * np.sin(phi),
            cos_h[:, None],
        ),
        axis=-1,
    )
    o = np.array([np.sqrt(1 - cos_o**2), 0.0, cos_o])
    o_h = h @ o
    cos_i = 2 * o_h * h[..., 2] - o[2]
    lit = (o_h > 0) & (cos_i > 0)
    g = smith(np.maximum(cos_i, 1e-9), alpha) * smith(np.array(cos_o), alpha)
    f0 = 0.04 * (1 - metallic) + metallic * color
    fresnel = f0 + (1 - f0) * (1 - np.clip(o_h, 0, 1)[..., None]) ** 5
    # density D cos_h of t and phi is uniform, so D cancels
    weight = np.where(lit, g * o_h / (cos_o * h[..., 2]), 0)
    return (fresnel * weight[..., None]).mean(axis=(0, 1))


def smith(cosine: np.ndarray, alpha: float) -> np.ndarray:
    tan2 = 1 / cosine**2 - 1
    return 2 / (1 + np.sqrt(1 + alpha**2 * tan2))


def albedo(scene: Scene) -> np.ndarray:
    from graycard.synth.layers._albedo import directional_albedo

    made, camera = loaded(scene)
    return directional_albedo(made, camera, 7)["albedo"]


def test_pixels_that_the_target_does_not_touch_are_equal_to_the_bit(llvm: str) -> None:
    scene, layers = render("glossy-table")
    same = (layers["radiance"] == layers["counterfactual.radiance"]).all(axis=-1)
    on_target = layers["object_id"] == scene.target_id
    assert same.mean() > 0.1
    assert not same[on_target].any()
    assert "counterfactual.emitted" not in layers


def test_without_the_target_specular_light_differs_in_its_mirror_image(llvm: str) -> None:
    _, layers = render("metal-table")
    present, emptied = with_sums(layers)["specular"], layers["counterfactual.specular"]
    mirror, untouched = (layers[f"effect.{name}"] > 0 for name in ("mirror", "untouched"))
    assert mirror.any()
    assert untouched.any()
    np.testing.assert_allclose(emptied[untouched], present[untouched], rtol=1e-5, atol=1e-7)
    assert (np.abs(emptied - present).max(axis=-1) > 1e-3 * layers["radiance"].max(axis=-1))[mirror].all()
    lobes = layers["counterfactual.diffuse"] + emptied
    np.testing.assert_allclose(lobes, layers["counterfactual.radiance"], rtol=1e-5, atol=1e-6)


def test_behind_the_target_is_the_table(llvm: str) -> None:
    """A floor or a table is seen without the target, and reflects as it does elsewhere."""
    scene, layers = render("metal-table")
    on_target, table = layers["object_id"] == scene.target_id, layers["object_id"] == 3
    assert on_target.sum() > 3
    for name in ("normal", "f0", "roughness"):
        emptied = layers[f"counterfactual.{name}"]
        np.testing.assert_array_equal(emptied[~on_target], layers[name][~on_target])
    behind = layers["counterfactual.roughness"][on_target]
    assert set(np.unique(behind)) <= set(np.unique(layers["roughness"][~on_target]))
    assert (behind == layers["roughness"][table][0]).any()


def test_without_llvm_views_hold_no_parts(scalar: str) -> None:
    _, layers = render("glossy-table")
    assert not [
        name
        for name in layers
        if name.startswith(
            (
                "direct.",
                "emitted",
                "visibility",
                "irradiance",
                "albedo",
                "shading",
                "counterfactual.diffuse",
                "counterfactual.specular",
            )
        )
    ]
    assert {"radiance", "radiance.var", "f0", "position", "pure", "counterfactual.radiance"} <= layers.keys()

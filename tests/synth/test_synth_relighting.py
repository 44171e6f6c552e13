# SPDX-License-Identifier: Apache-2.0
"""Views under changed lights: sums are what rendering anew gives, and lights.json says what was rendered."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2, norm

from graycard import (
    Camera,
    DatasetError,
    EnvironmentLight,
    Light,
    PointLight,
    RectangleLight,
    RenderError,
    SphereLight,
    UnknownNameError,
    View,
    look_at,
    open_truth,
    world_position,
)
from graycard.io import read_manifest, read_rgb, sha256, write_json, write_manifest
from graycard.layers import find_fault
from graycard.synth import (
    Ball,
    LambertGGX,
    Quad,
    RenderSettings,
    Scene,
    SceneSpec,
    Thing,
    all_families,
    family_of,
    find_scene,
    render_scene,
    use_renderer,
)
from graycard.synth._scene import surface_of
from graycard.synth._sky import recorded
from graycard.synth.edits._light_edits import Edit, light_edits, scaled_light

SETTINGS = RenderSettings(24, 20, samples=576, max_depth=4)
SEED = 1000
TINY = RenderSettings(20, 16, 3, 1, 16, 3)
STUDIO = SceneSpec("multilight", "studio", SEED)

PANEL = RectangleLight("panel", (-0.8, 0.3, 2.0), (0, 0.3, 0), (0.3, 0, 0), (5, 4, 3))
BULB = SphereLight("bulb", (0.9, 0.9, 0.5), 0.12, (8, 8, 9))
POINT = PointLight("point", (0.5, -0.8, 1.6), (2.0, 2.5, 3.0))
SKY = EnvironmentLight("sky", "environment.exr")


def corner() -> Scene:
    """A floor and a ball that shine a little; the bulb and the sky are in the picture."""
    material = LambertGGX((0.6, 0.5, 0.2), 0.4)
    floor = Thing("floor", Quad((0, 0, 0), (2, 0, 0), (0, 2, 0)), material)
    ball = Thing("ball", Ball((0.1, 0.1, 0.5), 0.5), material)
    pose = look_at(np.array([1.2, -2.4, 1.5]), np.array([0.2, 0.2, 0.6]))
    camera = Camera.from_fov(SETTINGS.width, SETTINGS.height, 60.0, pose)
    sky = np.linspace(0.05, 0.5, 8 * 16 * 3).reshape(8, 16, 3)
    things = floor, ball, surface_of(PANEL), surface_of(BULB)
    return Scene(things, (PANEL, POINT, BULB, SKY), (View("test_000", "test", camera),), sky)


def sums(edits: list[Edit], settings: RenderSettings = SETTINGS) -> dict[str, dict[str, np.ndarray]]:
    from graycard.synth.edits._relighting import view_with_edits

    return view_with_edits(corner(), 0, SEED, settings, edits)[1]


def rendered(scene: Scene, seeds: list[int], settings: RenderSettings = SETTINGS) -> dict[str, np.ndarray]:
    from graycard.synth.layers._separation import estimate
    from graycard.synth.layers._views import radiance_images
    from graycard.synth.renderer._mitsuba import load_scene

    camera = scene.views[0].camera
    return estimate("radiance", radiance_images(load_scene(scene, camera), camera, seeds, settings))


def linear_edits() -> list[Edit]:
    return [edit for edit in light_edits(corner(), SEED) if edit.factors is not None]


def agree(found: dict[str, np.ndarray], expected: dict[str, np.ndarray], tests: int) -> bool:
    """Return true if no mean of a channel or of a quarter of the picture is off by more than noise
    (Šidák)."""
    difference = found["radiance"].astype(np.float64) - expected["radiance"]
    variance = found["radiance.var"].astype(np.float64) + expected["radiance.var"]
    blocks = [(slice(i, i + 10), slice(j, j + 12)) for i in (0, 10) for j in (0, 12)]
    z = [
        difference[b].sum(axis=(0, 1)) / np.maximum(np.sqrt(variance[b].sum(axis=(0, 1))), 1e-12)
        for b in blocks
    ]
    # with four sub-buffers the variance of a pixel is rough; over 120 pixels it is known to 7 %
    bar = float(norm.isf((1 - (1 - 1e-4) ** (1 / (12 * tests))) / 2))
    return bool(np.abs(z).max() < 1.1 * bar)


def test_what_lights_give_adds_up_to_the_picture(llvm: str) -> None:
    from graycard.synth.layers._light_shares import emitted_images, light_shares
    from graycard.synth.layers._separation import light_names, separated_images
    from graycard.synth.renderer._mitsuba import load_scene

    scene, seeds = corner(), [3, 4]
    camera = scene.views[0].camera
    loaded = load_scene(scene, camera)
    images = separated_images(loaded, camera, seeds, replace(SETTINGS, samples=64))
    emitted = emitted_images(loaded, camera, seeds, replace(SETTINGS, samples=64))
    np.testing.assert_allclose(emitted.sum(axis=1), images[:, 1], rtol=1e-6, atol=1e-7)
    seen = dict(zip(light_names(loaded, scene), (emitted > 0).mean(axis=(0, 2, 3, 4)), strict=True))
    assert seen["point"] == 0
    assert 0 < seen["bulb"] < 0.1 < seen["sky"]
    shares = light_shares(loaded, camera, seeds, replace(SETTINGS, samples=64), images)
    np.testing.assert_allclose(shares.sum(axis=1), images[:, 0], rtol=2e-5, atol=1e-6)


def test_sums_are_what_rendering_the_changed_scene_anew_gives(llvm: str) -> None:
    edits = linear_edits()
    assert len(edits) == 5
    found = sums(edits)
    for edit in edits:
        expected = rendered(edit.scene, [5, 6, 7, 8])
        assert agree(found[edit.record.name], expected, len(edits)), edit.record.name
    dark = rendered(corner(), [5, 6, 7, 8])
    assert not any(agree(found[edit.record.name], dark, 1) for edit in edits)


def test_with_the_same_random_numbers_they_are_equal_to_rounding(llvm: str) -> None:
    """A light that is off is left in at radiance 0, so that the others are given the same samples."""
    from graycard.synth.layers._views import sub_buffer_seeds

    settings = replace(SETTINGS, samples=64)
    found, scene = sums(linear_edits(), settings), corner()
    for light in (PANEL, POINT, BULB):
        lights = tuple(scaled_light(x, (0, 0, 0)) if x is light else x for x in scene.lights)
        expected = rendered(replace(scene, lights=lights), sub_buffer_seeds(SEED, 0), settings)["radiance"]
        off = np.abs(found[f"without-{light.name}"]["radiance"] - expected) / np.maximum(expected, 1e-3)
        assert np.quantile(off, 0.95) < 1e-5
    recoloured = next(edit for edit in linear_edits() if "recoloured" in edit.record.name)
    expected = rendered(recoloured.scene, sub_buffer_seeds(SEED, 0), settings)["radiance"]
    off = np.abs(found[recoloured.record.name]["radiance"] - expected) / np.maximum(expected, 1e-3)
    assert np.quantile(off, 0.95) < 1e-5


def test_without_a_light_nothing_of_it_is_left(llvm: str) -> None:
    """All lights but one off, one after the other: the rest is what this light alone gives."""
    from graycard.synth.edits._relighting import view_with_edits

    scene, settings = corner(), replace(SETTINGS, samples=64)
    layers, relit = view_with_edits(scene, 0, SEED, settings, linear_edits())
    for light in scene.lights:
        taken = layers["radiance"] - relit[f"without-{light.name}"]["radiance"]
        parts = sum(values for name, values in layers.items() if name.endswith(f"t.diffuse.{light.name}"))
        parts += sum(values for name, values in layers.items() if name.endswith(f"t.specular.{light.name}"))
        emitted = taken - parts
        assert emitted.min() > -1e-5
        visible = (emitted > 1e-3).any(axis=-1)
        assert visible.any() == (light.name in ("bulb", "sky")), light.name


def test_halves_and_variance_are_those_of_the_sum(llvm: str) -> None:
    """On the floor and the ball, where light is estimated at all."""
    settings = replace(SETTINGS, samples=64)
    for layers in sums(linear_edits(), settings).values():
        assert layers.keys() == {"radiance", "radiance.var", "radiance.half_a", "radiance.half_b"}
        halves = (layers["radiance.half_a"] + layers["radiance.half_b"]) / 2
        np.testing.assert_allclose(halves, layers["radiance"], rtol=1e-5, atol=1e-6)
        apart = (layers["radiance.half_a"] - layers["radiance.half_b"]).astype(np.float64)[12:]
        ratio = np.median(apart**2 / 4) / np.median(layers["radiance.var"][12:])
        assert ratio == pytest.approx(chi2.median(1) / (chi2.median(3) / 3), rel=0.3)


@pytest.mark.parametrize("frame", ["world", "camera"])
def test_a_moved_light_shines_from_where_it_is_said_to_be(
    variant: str, make_plane: Callable[..., Scene], frame: str
) -> None:
    """Direct light of a point on a Lambertian plane: L = albedo / pi I cos / d², at the pixel centres."""
    from graycard.synth.edits._relighting import relit_view

    where = (0.4, 0.3, 2.2) if frame == "world" else (0.2, 0.0, 0.0)
    lamp = PointLight("lamp", where, (3.0, 2.0, 1.0), frame)  # pyright: ignore[reportArgumentType]
    plane = make_plane((lamp,))
    plane = replace(plane, views=(replace(plane.views[0], split="test"),))
    edit = next(e for e in light_edits(plane, SEED) if "moved" in e.record.name)
    settings = RenderSettings(24, 20, samples=256, max_depth=2)
    found = relit_view(edit, 0, SEED, settings)["radiance"]
    camera, light = plane.views[0].camera, edit.scene.lights[0]
    assert isinstance(light, PointLight)
    assert light.position != where
    rays, eye = camera.rays(), camera.position
    point = eye - (eye[2] / rays[..., 2])[..., None] * rays
    to_light = world_position(light, camera) - point
    square = (to_light**2).sum(-1)
    irradiance = np.array(light.intensity) * (to_light[..., 2] / square**1.5)[..., None]
    expected = np.array([0.5, 0.4, 0.3]) / np.pi * irradiance
    inside = np.abs(point[..., :2]).max(axis=-1) < 3.5  # the plane ends at 4 m
    assert inside.mean() > 0.9
    np.testing.assert_allclose(found[inside], expected[inside], rtol=4e-3)


@pytest.fixture(scope="module")
def studio(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tiny studio with parts of the radiance, not to be changed."""
    try:
        use_renderer(variant="llvm_ad_rgb")
    except RenderError as reason:
        pytest.skip(str(reason))
    return render_scene(STUDIO, TINY, tmp_path_factory.mktemp("studio"))


def test_the_truth_lists_its_edits_and_opens_them(studio: Path) -> None:
    truth = open_truth(studio / "truth")
    edits = light_edits(family_of(STUDIO).build(SEED, TINY), SEED)
    assert truth.edits == tuple(edit.record for edit in edits)
    held_out = next(view for view in truth.views if view.split == "test")
    for edit in edits:
        layers = truth.relit(edit.record.name, held_out)
        assert layers.keys() == {"radiance", "radiance.var", "radiance.half_a", "radiance.half_b"}
        for name, values in layers.items():
            assert find_fault(name, values, 16, 20) is None
        assert truth.relit_lights(edit.record.name) == edit.scene.lights
        image = studio / "truth" / "relighting" / edit.record.name / "environment.exr"
        assert image.is_file() == (edit.scene.sky is not None)
        if edit.scene.sky is not None:
            np.testing.assert_array_equal(read_rgb(image), recorded(edit.scene.sky))
    whole = truth.layers(held_out)["radiance"].astype(np.float64).mean()
    without = [truth.relit(f"without-{x.name}", held_out)["radiance"].mean() for x in truth.lights()]
    assert sum(whole - w for w in without) == pytest.approx(whole, rel=1e-5)


def test_what_is_not_there_is_named(studio: Path) -> None:
    truth = open_truth(studio / "truth", check=False)
    train, test = (next(v for v in truth.views if v.split == split) for split in ("train", "test"))
    with pytest.raises(UnknownNameError, match=r"light edit.*without-lamp"):
        truth.relit("without-lampp-3", test)
    with pytest.raises(UnknownNameError, match="light edit"):
        truth.relit_lights("moved")
    with pytest.raises(DatasetError, match="expected a held-out view, got train_000"):
        truth.relit("without-lamp-3", train)


def test_lights_of_an_edit_render_to_its_pictures(studio: Path) -> None:
    """The scene built anew from ``lights.json`` gives the picture that lies beside it."""
    from graycard.synth.layers._separation import estimate
    from graycard.synth.layers._views import radiance_images
    from graycard.synth.renderer._mitsuba import load_scene

    use_renderer(variant="llvm_ad_rgb")
    truth, scene = open_truth(studio / "truth"), family_of(STUDIO).build(SEED, TINY)
    number = next(n for n, view in enumerate(scene.views) if view.split == "test")
    view = scene.views[number]
    for edit in truth.edits:
        if edit.name.startswith("environment"):
            continue  # its image is recorded on another grid, and compared above
        lights = truth.relit_lights(edit.name)
        things = tuple(relit_surface(thing, lights) for thing in scene.things)
        sky = scene.sky if any(isinstance(x, EnvironmentLight) for x in lights) else None
        changed = replace(scene, things=things, lights=lights, sky=sky)
        settings = replace(TINY, samples=1024)
        images = radiance_images(load_scene(changed, view.camera), view.camera, [1, 2, 3, 4], settings)
        found, expected = truth.relit(edit.name, view), estimate("radiance", images)
        off = found["radiance"].astype(np.float64).mean() - expected["radiance"].mean()
        error = np.sqrt((found["radiance.var"] + expected["radiance.var"]).mean() / found["radiance"].size)
        # the three channels of a pixel share their paths
        assert abs(off) < 4 * np.sqrt(3) * error, edit.name


def relit_surface(thing: Thing, lights: tuple[Light, ...]) -> Thing:
    light = next((x for x in lights if x.name == thing.light), None)
    return surface_of(light) if isinstance(light, RectangleLight | SphereLight) else thing


def bits(folder: Path) -> dict[str, str]:
    return {str(p.relative_to(folder)): sha256(p) for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.mark.parametrize(
    "name",
    [
        "truth/relighting/without-lamp-3/views/test_002.exr",  # a sum, made with the view
        "truth/relighting/environment-1/views/test_002.exr",  # rendered by itself
        "truth/views/test_002.exr",
    ],
)
def test_a_damaged_picture_is_mended_to_the_same_bits(studio: Path, name: str) -> None:
    """And none but this one is written."""
    before = bits(studio)
    stamps = {p: p.stat().st_mtime_ns for p in studio.rglob("views/*.exr")}
    data = (studio / name).read_bytes()
    (studio / name).write_bytes(data[: len(data) // 2])
    heard: list[str] = []
    render_scene(STUDIO, TINY, studio.parent.parent, lambda done, doing: heard.append(doing))
    assert sum("_00" in h for h in heard) == 1
    assert bits(studio) == before
    changed = {p for p, stamp in stamps.items() if p.stat().st_mtime_ns != stamp}
    assert changed == {studio / name}


def test_the_capture_learns_nothing_of_it(studio: Path, tmp_path: Path) -> None:
    plain = replace(TINY, relighting=False)
    other = render_scene(STUDIO, plain, tmp_path)
    assert bits(other / "capture") == bits(studio / "capture")
    assert not (other / "truth" / "relighting").exists()
    assert open_truth(other / "truth").edits == ()
    views = {name: sha for name, sha in bits(other / "truth").items() if name.startswith("views/")}
    assert views.items() <= bits(studio / "truth").items()
    with pytest.raises(DatasetError, match="relighting"):
        find_scene(STUDIO, plain, studio.parent.parent)


def test_a_truth_of_before_has_no_edits(studio: Path, tmp_path: Path) -> None:
    data: dict[str, Any] = json.loads((studio / "truth" / "truth.json").read_text())
    del data["edits"]
    write_json(tmp_path / "truth" / "truth.json", data)
    manifest = read_manifest(studio / "truth", "graycard-truth")
    write_manifest(tmp_path / "truth", manifest)
    assert open_truth(tmp_path / "truth").edits == ()


@pytest.mark.parametrize(
    "name",
    [
        name if name in ("corridor", "metal-table", "studio") else pytest.param(name, marks=pytest.mark.slow)
        for name in all_families()
    ],
)
def test_every_family_is_relit_without_llvm(name: str, tmp_path: Path, no_llvm: str) -> None:
    """Nothing is a sum there: all edits are rendered."""
    settings = RenderSettings(8, 8, 2, 1, 4, 2)
    spec = SceneSpec(all_families()[name].track, name, SEED)
    truth = open_truth(render_scene(spec, settings, tmp_path) / "truth")
    view = next(view for view in truth.views if view.split == "test")
    assert truth.edits
    for edit in truth.edits:
        assert truth.relit(edit.name, view)["radiance"].shape == (8, 8, 3)


def test_pictures_are_the_same_to_the_bit_with_any_number_of_threads(llvm: str) -> None:
    """With enough samples for several blocks of work, and none that fill a block evenly."""
    from graycard.synth.edits._relighting import composed_view, relit_view
    from graycard.synth.layers._views import render_view

    settings = RenderSettings(64, 64, 2, 1, 100)
    scene = family_of(STUDIO).build(SEED, settings)
    edit = next(e for e in light_edits(scene, SEED) if e.record.name == "environment-1")

    def pictures(threads: int) -> list[np.ndarray]:
        use_renderer(threads=threads, variant="llvm_ad_rgb")
        made = relit_view(edit, 1, SEED, settings), composed_view(scene, 1, SEED, settings)
        return [v for layers in (*made, render_view(scene, 1, SEED, settings)) for v in layers.values()]

    one, two, again = pictures(1), pictures(2), pictures(2)
    assert all(np.array_equal(a, b) and np.array_equal(b, c) for a, b, c in zip(one, two, again, strict=True))

# SPDX-License-Identifier: Apache-2.0
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from graycard import (
    Camera,
    EnvironmentLight,
    Light,
    PointLight,
    RectangleLight,
    SphereLight,
    View,
    look_at,
    world_position,
)
from graycard.records import SceneRecord
from graycard.reports._comparison import build_gallery
from graycard.reports._evidence import MethodEvidence, SceneEvidence, describe_scene, open_scene, usable_layer
from graycard.reports.parts._render import Renderer
from graycard.reports.plan._plan import SIZE, build_plan


@pytest.fixture(scope="module")
def scene(tiny_scenes: dict[str, Path]) -> SceneEvidence:
    return open_scene(tiny_scenes["multilight"])


def at(x: float, y: float, name: str = "here") -> PointLight:
    return PointLight(name, (x, y, 0.5), (1.0, 1.0, 1.0))


def test_plan_keeps_proportions_and_looks_from_above(scene: SceneEvidence) -> None:
    world = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]
    found = build_plan(replace(scene, lights=tuple(at(*p) for p in world)), [])
    (x0, y0), (x1, y1), (x2, y2) = [(m.x, m.y) for m in found.lights]
    assert x1 > x0
    assert y1 == y0
    assert y2 < y0  # world y points up, that of an SVG down
    assert x2 == x0
    assert x1 - x0 == pytest.approx(y0 - y2, abs=0.2)
    metres = float(found.metre_text.split()[0])
    assert found.metre_bar / metres == pytest.approx(x1 - x0, rel=0.01)
    assert max(found.width, found.height) <= SIZE + 1


def test_light_on_the_camera_stands_at_every_test_camera(scene: SceneEvidence) -> None:
    lamp = PointLight("lamp", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), "camera")
    found = build_plan(replace(scene, lights=(lamp,)), [])
    tips = {
        tuple(float(v) for v in c.points.split()[0].split(",")) for c in found.cameras if c.split == "test"
    }
    assert {(m.x, m.y) for m in found.lights} == tips
    assert found.rows[0].position.endswith("from the camera")


def test_predicted_light_far_away_stays_inside_and_says_so(scene: SceneEvidence) -> None:
    lights = (at(1e6, 0.0), at(np.inf, 0.0, "nowhere"))
    found = build_plan(scene, [MethodEvidence("wild", lights=lights)])
    wild = [m for m in found.lights if m.label.startswith("wild")]
    assert [(m.outside, m.label) for m in wild] == [(True, "wild: here")]
    assert 0 < wild[0].x < found.width
    assert [r.name for r in found.rows if r.owner == "wild"] == ["here", "nowhere"]


def test_lights_of_all_kinds(scene: SceneEvidence) -> None:
    lights = (
        RectangleLight("window", (0, 0, 2), (0.5, 0, 0), (0, 0.25, 0), (1, 1, 1)),
        SphereLight("bulb", (0.5, 0, 1), 0.1, (1, 1, 1)),
        EnvironmentLight("sky", "environment.exr"),
    )
    found = build_plan(replace(scene, lights=lights), [])
    corners = np.array([[float(v) for v in p.split(",")] for p in found.outlines[0].split()])
    spans = np.ptp(corners, axis=0)
    assert spans[0] == pytest.approx(2 * spans[1], abs=0.3)
    wide = replace(lights[0], half_u=(20.0, 0.0, 0.0))
    found_wide = build_plan(replace(scene, lights=(wide,)), [])
    assert all(0 < float(p.split(",")[0]) < found_wide.width for p in found_wide.outlines[0].split())
    assert [r.kind for r in found.rows] == ["rectangle", "sphere", "environment"]
    assert found.rows[2].position == "infinitely far away"
    assert len(found.lights) == 2


def test_methods_without_lights_say_why(scene: SceneEvidence) -> None:
    silent = [
        MethodEvidence("a"),
        MethodEvidence("b", fault="boom"),
        MethodEvidence("c", lights_fault="torn"),
    ]
    assert build_plan(scene, silent).silent == (
        ("a", "not provided"), ("b", "the job failed"), ("c", "failed: torn"),
    )  # fmt: skip


def test_camera_that_looks_straight_down(scene: SceneEvidence) -> None:
    pose = look_at(np.array([0.0, 0.0, 3.0]), np.zeros(3), up=(0, 1, 0))
    down = View("down", "train", Camera.from_fov(8, 8, 50, pose))
    found = build_plan(replace(scene, truth=replace(scene.truth, views=(*scene.truth.views, down))), [])
    assert "nan" not in found.cameras[-1].points


def test_gauge_is_applied_to_base_colour_only(scene: SceneEvidence) -> None:
    view = scene.shown[0]
    layers = {view.name: {k: scene.layers[view.name][k] for k in ("base_color", "radiance")}}
    method = MethodEvidence("m", layers=layers, gauge=(2.0, 1.0, 0.5))
    mask = scene.mask("base_color", view)
    values, note = usable_layer(method, view, "base_color", mask)
    assert values is not None
    np.testing.assert_allclose(values, layers[view.name]["base_color"] * np.array([2.0, 1.0, 0.5]))
    assert note == "× 2 1 0.5"
    assert usable_layer(method, view, "radiance", mask)[1] == ""
    assert usable_layer(method, view, "normal", mask) == (None, "not provided")
    assert usable_layer(replace(method, fault="boom"), view, "radiance", mask) == (None, "failed")


def test_what_is_not_finite_outside_the_mask_is_shown_as_0(scene: SceneEvidence) -> None:
    view = scene.shown[0]
    mask, values = scene.mask("normal", view), scene.layers[view.name]["normal"].copy()
    values[~mask] = np.nan
    method = MethodEvidence("m", layers={view.name: {"normal": values}})
    shown, note = usable_layer(method, view, "normal", mask)
    assert shown is not None
    assert note == ""
    np.testing.assert_array_equal(shown[mask], values[mask])
    assert not mask.all()
    assert (shown[~mask] == 0).all()
    values[mask] = np.nan
    assert "expected finite values in normal, got nan" in usable_layer(method, view, "normal", mask)[1]


def test_scene_without_test_views_has_no_pictures_but_a_plan(scene: SceneEvidence) -> None:
    bare = replace(scene, shown=(), layers={})
    assert build_gallery(bare, []).views == ()
    assert build_plan(bare, []).dots == ()


def test_layers_that_the_truth_lacks_are_left_out(scene: SceneEvidence) -> None:
    layers = {name: {"radiance": found["radiance"]} for name, found in scene.layers.items()}
    bare = replace(scene, layers=layers)
    gallery = build_gallery(bare, [])
    assert [row.title for row in gallery.views[0].rows] == ["Radiance"]
    assert bare.mask("radiance", bare.shown[0]).all()
    assert build_plan(bare, []).dots == ()


def test_further_layers_are_shown_if_a_competing_method_hands_them_in(scene: SceneEvidence) -> None:
    shape = scene.layers[scene.shown[0].name]["depth"].shape
    more = {
        "shading": np.full((*shape, 3), 0.2), "shading.var": np.full((*shape, 3), 1e-4),
        "irradiance.lamp": np.full((*shape, 3), 0.5), "roughness": np.full(shape, 0.3),
        "albedo": np.full((*shape, 3), 0.4), "f0": np.full((*shape, 3), 0.04),
    }  # fmt: skip
    rich = replace(scene, layers={name: {**layers, **more} for name, layers in scene.layers.items()})
    given = {name: {k: v for k, v in more.items() if k != "f0"} for name in rich.layers}
    rows = build_gallery(rich, [MethodEvidence("m", layers=given)]).views[0].rows
    found = {row.title: row for row in rows}
    assert [t for t in found if t not in ("Radiance", "Base color", "Normal, world axes", "Depth")] == [
        "Albedo", "Irradiance lamp", "Roughness", "Shading",
    ]  # fmt: skip
    assert found["Shading"].unit == found["Irradiance lamp"].unit == "as displayed on a gray card"
    assert found["Shading"].noise_ratios
    assert not found["Roughness"].noise_ratios
    assert found["Roughness"].value_scale is not None
    assert (found["Roughness"].value_scale.low, found["Roughness"].error_scale.unit) == (
        "0.3", "linear difference",
    )  # fmt: skip
    reference = MethodEvidence("m", layers=given, competes=False)
    assert len(build_gallery(rich, [reference]).views[0].rows) == len(rows) - 4


def test_map_of_error_to_noise_says_how_much_is_noise_alone(scene: SceneEvidence) -> None:
    view = scene.shown[0]
    true = scene.layers[view.name]["radiance"]
    seen = scene.mask("radiance", view)
    sigma = 0.1 * true.std()
    noisy = {**scene.layers[view.name], "radiance.var": np.full(true.shape, sigma**2)}
    wrong = true + sigma * np.where(np.arange(true.shape[1])[:, None] < 10, 1.0, 3.0)
    method = MethodEvidence("m", layers={view.name: {"radiance": wrong}})
    rich = replace(scene, shown=(view,), layers={view.name: noisy})
    row = build_gallery(rich, [method, MethodEvidence("none")]).views[0].rows[0]
    share = seen[:, :10].sum() / seen.sum()
    assert [t.note for t in row.noise_ratios] == [f"{share:.0%} of the pixels within 2", ""]
    assert (row.noise_scale.low, row.noise_scale.high) == ("0", "≥ 5")


def test_only_some_views_and_photographs_are_embedded(make_scene: Callable[..., Path]) -> None:
    found = open_scene(make_scene(train=9, test=4))
    test = [v.name for v in found.test]
    assert [v.name for v in found.shown] == [test[0], test[-1]]
    thumbnails = build_gallery(found, []).thumbnails
    assert len(thumbnails) == 6
    train = [v.name for v in found.capture.train]
    assert thumbnails[0].alt.endswith(train[0])
    assert thumbnails[-1].alt.endswith(train[-1])


def test_description_names_what_is_there(tiny_scenes: dict[str, Path]) -> None:
    record = SceneRecord("tabletop", "tiny-0000", "tiny", 4, "", "", "")
    text = describe_scene(record, open_scene(tiny_scenes["tabletop"]))
    assert text == (
        "family tiny, seed 4; 3 training photographs and 2 test views of 28 × 24 pixels; "
        "1 light (1 on the camera); object to remove: target"
    )
    dark = open_scene(tiny_scenes["dark"])
    measured = replace(dark, truth=replace(dark.truth, noise_ceiling=45.27))
    assert describe_scene(record, measured).endswith("; noise ceiling 45.3 dB")
    fixed = replace(dark, lights=(at(0.0, 0.0), EnvironmentLight("sky", "environment.exr")))
    assert "; 2 lights" in describe_scene(record, fixed)
    assert "on the camera" not in describe_scene(record, fixed)


def test_predicted_lights_are_joined_to_the_true_ones_whatever_their_order(scene: SceneEvidence) -> None:
    true = (at(0.0, 0.0, "a"), at(1.0, 0.0, "b"), at(0.0, 1.0, "c"))
    swapped = MethodEvidence("few", lights=(at(1.1, 0.0, "x"), at(0.0, 0.1, "y")))
    many = MethodEvidence("many", lights=(*true, at(0.2, 0.2, "ghost"), at(np.nan, 0.0, "nowhere")))
    found = build_plan(replace(scene, lights=true), [swapped, many])
    partners = {(r.owner, r.name): r.partner for r in found.rows}
    assert partners["few", "x"] == "b, 0.1 m away"
    assert partners["few", "y"] == "a, 0.1 m away"
    assert partners["ground truth", "c"] == "missing in few"
    assert partners["ground truth", "a"] == ""
    assert partners["many", "ghost"].startswith("extra")
    assert partners["many", "nowhere"].startswith("extra")
    marks = {m.label: (m.x, m.y) for m in found.lights}
    assert (marks["few: x"], marks["ground truth: b"], 1) in [(k.start, k.end, k.shape) for k in found.links]
    assert len(found.links) == 2 + 3


def test_light_that_moves_with_the_camera_is_joined_in_every_test_view(scene: SceneEvidence) -> None:
    lamp = PointLight("lamp", (0.1, 0.0, 0.0), (1.0, 1.0, 1.0), "camera")
    fixed = MethodEvidence("fixed", lights=(at(0.0, 0.0, "still"),))
    near = MethodEvidence("near", lights=(replace(lamp, position=(0.1, 0.0, 0.25)),))
    found = build_plan(replace(scene, lights=(lamp,)), [fixed, near])
    cameras = [v.camera for v in scene.test]
    apart = [np.linalg.norm(world_position(lamp, c) - (0.0, 0.0, 0.5)) for c in cameras]
    partners = {r.owner: r.partner for r in found.rows}
    assert partners["fixed"] == f"lamp, {np.mean(apart):.3g} m away"
    assert partners["near"] == "lamp, 0.25 m away"
    still = [k for k in found.links if k.shape == 1]
    assert len(still) == len(cameras) == len({k.end for k in still})
    assert len({k.start for k in still}) == 1


def test_without_test_views_no_light_is_joined(scene: SceneEvidence) -> None:
    train = tuple(v for v in scene.truth.views if v.split == "train")
    bare = replace(scene, truth=replace(scene.truth, views=train), shown=(), layers={}, lights=(at(0, 0),))
    found = build_plan(bare, [MethodEvidence("m", lights=(at(1.0, 0.0),))])
    assert found.links == ()
    assert [r.partner for r in found.rows] == ["missing in m", "extra: no true light is left for it"]


def test_window_on_the_camera_turns_with_it(scene: SceneEvidence) -> None:
    window = RectangleLight("w", (0, 0, 0.1), (0.5, 0, 0), (0, 0.25, 0), (1, 1, 1), "camera")
    found = build_plan(replace(scene, lights=(window,)), [])
    assert len(found.outlines) == len(scene.test)
    scale = found.metre_bar / float(found.metre_text.split()[0])
    for outline, view in zip(found.outlines, scene.test, strict=True):
        first, second = (np.array([float(x) for x in p.split(",")]) for p in outline.split()[:2])
        edge = view.camera.camera_to_world[:3, :3] @ (0.0, 0.5, 0.0)
        np.testing.assert_allclose((first - second) / scale, edge[:2] * (1, -1), atol=0.01)


def test_legend_names_the_marks_of_this_plan_and_no_others(scene: SceneEvidence) -> None:
    def legend(*lights: Light, method: MethodEvidence) -> list[str]:
        html = Renderer().part("plan.html.j2", "legend", build_plan(replace(scene, lights=lights), [method]))
        return re.findall(r"</svg>(.*?)</li>", html)

    panel = RectangleLight("panel", (0, 0, 1), (0.5, 0, 0), (0, 0.2, 0), (1, 1, 1))
    always = ["test camera, blunt side forward", "training camera, blunt side forward", "height of a camera",
              "surface that a test view sees"]  # fmt: skip
    sky = MethodEvidence("sky <1>", lights=(EnvironmentLight("sky", "sky.exr"),))
    assert legend(at(0, 0), method=sky) == ["true light", *always]
    far = replace(sky, method="far <1>", lights=(at(0.2, 0.2), at(1e6, 0)))
    assert legend(at(0, 0), panel, method=far) == [
        "true light", "light of far &lt;1&gt;", "edge of a true light",
        "from a predicted light to its true one", "faint: beyond the picture", *always,
    ]  # fmt: skip


def test_heights_are_in_proportion_and_say_what_is_beyond(scene: SceneEvidence) -> None:
    lights = tuple(PointLight(str(z), (0.0, 0.0, z), (1.0, 1.0, 1.0)) for z in (0.5, 1.5, 2.5))
    far = MethodEvidence("far", lights=(replace(lights[0], position=(0.0, 0.0, 99.0)),))
    heights = build_plan(replace(scene, lights=lights), [far]).heights
    low, middle, high, beyond = heights.marks
    assert low.y - middle.y == pytest.approx(middle.y - high.y, abs=0.2)
    assert high.y < low.y  # up is up
    assert (beyond.outside, low.outside) == (True, False)
    assert 0 < beyond.y < high.y
    assert beyond.x > high.x  # each owner has a column
    metres = {text: y for y, text in heights.ticks}
    assert metres["0.5 m"] == pytest.approx(low.y, abs=0.2)
    assert 3 <= len(metres) <= 8
    assert heights.cameras

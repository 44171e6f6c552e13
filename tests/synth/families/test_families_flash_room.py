# SPDX-License-Identifier: Apache-2.0
"""The dark families: shared knobs, a lamp with room around it, closed rooms in which nothing floats."""

import dataclasses
import functools
from typing import Any

import numpy as np
import pytest

from graycard import Light, PointLight, SpotLight, world_position
from graycard.synth import Ball, Glossy, LambertGGX, Matte, RenderSettings, Scene, Thing, all_families
from graycard.synth._mesh import Mesh
from graycard.synth.families._flash_room import FlashRoom, Room
from graycard.synth.families.props import _furniture as furniture
from graycard.synth.families.props import _interior as interior
from graycard.synth.families.props import _small_goods as small_goods

SETTINGS = RenderSettings(24, 24, 6, 2, 16)
DARK = {name: family for name, family in all_families().items() if issubclass(family, FlashRoom)}
NAMES = tuple(DARK)
NEW = tuple(name for name in NAMES if name != "corridor")
SHELVES = pytest.param("shelf-room", marks=pytest.mark.slow)
"""Takes seconds to build. Where time is short, knobs that all rooms have are tried on the others."""
SEEDS = (1000, 1001, pytest.param(1002, marks=pytest.mark.slow))

pytestmark = pytest.mark.xdist_group("dark rooms")  # a worker that has built a room keeps it


@functools.lru_cache(maxsize=12)  # a room with its textures takes up to 160 MB
def built(family: FlashRoom, seed: int) -> Scene:
    return family.build(seed, SETTINGS)


def build(name: str, seed: int = 1000, **knobs: Any) -> Scene:
    return built(DARK[name](**knobs), seed)


def lamp_of(name: str, **knobs: Any) -> Light:
    """Return the lamp of a room that need not be built."""
    return DARK[name](**knobs).head_lamp()


def bounds(thing: Thing) -> tuple[np.ndarray, np.ndarray]:
    """The lowest and the highest corner of a thing."""
    match thing.geometry:
        case Mesh(vertices=points):
            return points.min(axis=0), points.max(axis=0)
        case Ball(center, radius):
            return np.array(center) - radius, np.array(center) + radius
        case quad:
            reach = np.abs(quad.half_u) + np.abs(quad.half_v)
            return np.array(quad.center) - reach, np.array(quad.center) + reach


def corner(family: type[FlashRoom], end: int) -> dict[str, Any]:
    """Every knob at the lower (0) or the upper (-1) end of its range, or at its first or its last word."""
    return {
        field.name: field.metadata.get("range", field.metadata.get("words"))[end]
        for field in dataclasses.fields(family)
    }


def test_there_are_three_dark_families() -> None:
    assert NAMES == ("corridor", "shelf-room", "cluttered-lab")
    assert {name for name, family in all_families().items() if family.track == "dark"} == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_dark_families_have_the_same_knobs(name: str) -> None:
    def knobs(family: type[FlashRoom]) -> dict[str, tuple[object, object]]:
        return {f.name: (f.default, dict(f.metadata)) for f in dataclasses.fields(family)}

    assert knobs(DARK[name]) == knobs(FlashRoom)
    assert {"light_offset", "light_cutoff", "ambient", "gloss", "material", "clutter"} < set(knobs(FlashRoom))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("end", [0, -1])
def test_every_knob_builds_at_the_ends_of_its_range(name: str, end: int) -> None:
    knobs = corner(DARK[name], end)
    scene = build(name, 1000, **knobs)
    assert len(scene.things) > 15
    assert isinstance(scene.lights[0], PointLight if end else SpotLight)
    assert scene.lights[0] == lamp_of(name, **knobs)


@pytest.mark.parametrize(
    "knobs",
    [
        {"lamp": "point", "ambient": 0.0, "gloss": 1.0, "material": "principled"},
        {"light_cutoff": 15.0, "ambient": 0.0, "light_offset": 0.8, "clutter": 0.0},
    ],
)
def test_extremes_render_light(scalar: str, knobs: dict[str, Any]) -> None:
    from graycard.synth.layers._views import radiance_images, sub_buffer_seeds
    from graycard.synth.renderer._mitsuba import load_scene

    settings = RenderSettings(16, 16, 2, 1, 16, 3)
    scene = DARK["shelf-room"](**knobs).build(1001, settings)
    camera = scene.views[0].camera
    loaded, seeds = load_scene(scene, camera), sub_buffer_seeds(1001, 0)
    mean = radiance_images(loaded, camera, seeds, settings).mean(axis=0)
    assert np.isfinite(mean).all()
    assert mean.max() > 0.01


@pytest.mark.parametrize("name", NAMES)
def test_the_lamp_is_of_the_kind_and_place_that_its_knobs_say(name: str) -> None:
    spot, point = (lamp_of(name, lamp=kind, light_offset=0.4) for kind in ("spot", "point"))
    assert isinstance(spot, SpotLight)
    assert isinstance(point, PointLight)
    assert spot.frame == point.frame == "camera"
    assert spot.position == point.position == (0.4, -0.06, 0.0)
    np.testing.assert_allclose(spot.axial_intensity, point.axial_intensity)
    narrow = lamp_of(name, light_cutoff=20.0)
    assert isinstance(narrow, SpotLight)
    assert narrow.cutoff_angle == 20.0


@pytest.mark.parametrize("name", NAMES)
def test_the_toed_in_beam_crosses_the_optical_axis_before_the_camera(name: str) -> None:
    lamp = lamp_of(name, light_offset=0.3)
    assert isinstance(lamp, SpotLight)
    reach = -lamp.position[0] / lamp.direction[0]
    assert reach * lamp.direction[2] == pytest.approx(3.0)


@pytest.mark.parametrize("name", ["corridor", SHELVES, "cluttered-lab"])
@pytest.mark.parametrize(("word", "kind"), [("lambert-ggx", LambertGGX), ("principled", Glossy)])
def test_gloss_changes_materials_and_nothing_else(name: str, word: str, kind: type) -> None:
    dull, shiny = build(name, gloss=0.0), build(name, gloss=1.0, material=word)
    assert all(isinstance(thing.material, Matte) for thing in dull.things)
    changed = [thing for thing in shiny.things if isinstance(thing.material, kind)]
    assert len(changed) > 20
    assert {type(thing.material) for thing in shiny.things} == {Matte, kind}
    assert [thing.name for thing in dull.things] == [thing.name for thing in shiny.things]
    for a, b in zip(dull.things, shiny.things, strict=True):
        np.testing.assert_array_equal(bounds(a), bounds(b))


@pytest.mark.parametrize("name", ["corridor", SHELVES, "cluttered-lab"])
def test_gloss_is_a_share(name: str) -> None:
    rooms = [build(name, gloss=gloss) for gloss in (0.5, 1.0)]
    shares = [np.mean([isinstance(thing.material, LambertGGX) for thing in room.things]) for room in rooms]
    assert 0.25 < shares[0] / shares[1] < 0.75


@pytest.mark.parametrize("name", [SHELVES, "cluttered-lab"])
def test_clutter_adds_objects_and_leaves_the_others_where_they_are(name: str) -> None:
    few, some, all_ = ({t.name: t for t in build(name, clutter=c).things} for c in (0.0, 0.5, 1.0))
    assert len(few) < len(some) < len(all_)
    assert set(few) < set(some) < set(all_)
    for key, thing in some.items():
        np.testing.assert_array_equal(bounds(thing), bounds(all_[key]))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", SEEDS)
def test_camera_and_lamp_have_room_around_them(name: str, seed: int) -> None:
    """At the smallest, the usual and the largest offset: 8 cm to the box around any object."""
    scene = build(name, seed)
    boxes = [bounds(thing) for thing in scene.things]
    for view in scene.views:
        for offset in (0.0, 0.02, 0.25, 0.8):
            lamp = dataclasses.replace(scene.lights[0], position=(offset, -0.06, 0.0))
            assert isinstance(lamp, SpotLight)
            at = world_position(lamp, view.camera)
            gaps = [np.linalg.norm(np.maximum(0, np.maximum(low - at, at - high))) for low, high in boxes]
            assert min(gaps) > 0.08


@pytest.mark.parametrize("name", NEW)
@pytest.mark.parametrize("seed", SEEDS)
def test_the_room_is_closed_and_nothing_is_near(scalar: str, name: str, seed: int) -> None:
    from graycard.synth.layers._views import surface_layers
    from graycard.synth.renderer._mitsuba import load_scene

    scene = build(name, seed)
    loaded = load_scene(scene, scene.views[0].camera)
    for view in scene.views:
        layers = surface_layers(loaded, scene, view.camera)
        assert (layers["object_id"] > 0).all()
        assert layers["depth"].min() > 0.4


@pytest.mark.parametrize("name", NEW)
@pytest.mark.parametrize("seed", SEEDS)
def test_objects_stay_in_the_room_and_out_of_one_another(name: str, seed: int) -> None:
    scene = build(name, seed, clutter=1.0)
    shell = [bounds(thing) for thing in scene.things if thing.name.endswith(" wall") or thing.name == "floor"]
    low, high = np.min([b[0] for b in shell], axis=0), np.max([b[1] for b in shell], axis=0)
    boxes = {thing.name: bounds(thing) for thing in scene.things}
    for name_, (bottom, top) in boxes.items():
        assert (bottom > low - 0.02).all(), name_
        assert (top < high + 0.02).all(), name_
    goods = [(n, *b) for n, b in boxes.items() if " on " in n or " at " in n]
    for i, (one, low_a, high_a) in enumerate(goods):
        for other, low_b, high_b in goods[:i]:
            overlap = np.minimum(high_a, high_b) - np.maximum(low_a, low_b)
            assert overlap.min() < 0.03, (one, other)


@pytest.mark.parametrize("name", [SHELVES, "cluttered-lab"])
def test_seeds_differ_in_arrangement(name: str) -> None:
    sides: set[float] = set()
    for seed in range(1000, 1008):
        sides.add(np.sign(_middle(build(name, seed, clutter=0.0))))
        if len(sides) == 2:
            break
    assert sides == {-1, 1}


def _middle(scene: Scene) -> float:
    """y of what stands at the side where the racks or the bench are."""
    thing = next(t for t in scene.things if t.name in ("wall rack", "wall bench"))
    return float(np.mean(bounds(thing), axis=0)[1])


@pytest.mark.parametrize("wall", ["left", "right", "end", "back"])
def test_walls_face_inwards_and_pictures_hang_upright(wall: str) -> None:
    room = Room(6.0, 4.0, 3.0)
    inside = np.array([3.0, 0.0, 1.5])
    for quad in (room.wall(wall), room.hung(wall, 1.0, 1.2, (0.3, 0.2))):
        normal = np.cross(quad.half_u, quad.half_v)
        assert normal @ (inside - quad.center) > 0
        assert quad.half_v[2] > 0
    assert np.linalg.norm(np.cross(room.wall(wall).half_u, room.wall(wall).half_v)) * 4 == pytest.approx(
        {"left": 18.0, "right": 18.0, "end": 12.0, "back": 12.0}[wall]
    )


@pytest.mark.parametrize("kind", sorted({*small_goods.STORED, *small_goods.APPARATUS}))
@pytest.mark.parametrize("room", [(0.34, 0.32, 0.34), (0.16, 0.2, 0.32), (0.3, 0.28, 0.4)])
def test_goods_stand_where_they_are_put_and_fit_their_place(
    kind: str, room: tuple[float, float, float]
) -> None:
    for seed in range(3):
        shape, color = small_goods.good(np.random.default_rng(seed), kind, (1.0, 2.0, 0.5), room)
        low, high = bounds(Thing(kind, shape, Matte(color)))
        assert low[2] == pytest.approx(0.5, abs=2e-3)
        assert (high - low <= np.array(room) * (1.08, 1.15, 1.3) + 0.02).all(), high - low


def test_unknown_goods_are_refused() -> None:
    with pytest.raises(ValueError, match="expected one of .*carton.*got 'anvil'"):
        small_goods.good(np.random.default_rng(0), "anvil", (0, 0, 0), (0.3, 0.3, 0.3))


@pytest.mark.parametrize(
    "shape",
    [
        furniture.cylinder(0.3, 0.1),
        furniture.table(1.2, 0.6, 0.8),
        furniture.cabinet(1.2, 0.6, 0.9, 3),
        furniture.chair(),
        furniture.monitor(0.5),
        furniture.fume_hood(1.4, 0.7, 1.2),
        furniture.gas_cylinder(1.4, 0.12),
        furniture.flask(0.2, 0.08),
        furniture.microscope(0.4),
        furniture.toolbox(0.4),
        furniture.tray(0.4, 0.3, 0.2),
    ],
)
def test_furniture_stands_on_the_floor_and_has_unit_normals(shape: Mesh) -> None:
    assert shape.vertices[:, 2].min() == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(np.linalg.norm(shape.normals, axis=1), 1, atol=1e-9)


def test_a_ladder_leans_as_far_as_it_is_told() -> None:
    points = furniture.ladder(2.0, 0.6).vertices
    top = points[points[:, 2] > points[:, 2].max() - 0.1]
    assert top[:, 1].mean() == pytest.approx(0.6, abs=0.06)
    assert np.abs(points[:, 2].min()) < 0.02


def test_a_hose_is_round_and_its_normals_point_away_from_its_curve() -> None:
    curve = furniture.sagging((0, 0, 1), (1, 0.5, 1), 0.2)
    assert curve[:, 2].min() == pytest.approx(0.8, abs=2e-3)
    hose = furniture.hose(curve, 0.02)
    offsets = hose.vertices[:, None] - curve[None]
    nearest = np.argmin(np.linalg.norm(offsets, axis=-1), axis=1)
    away = offsets[np.arange(len(nearest)), nearest]
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), 0.02, rtol=1e-6)
    assert ((away / 0.02 * hose.normals).sum(-1) > 0.95).all()


@pytest.mark.parametrize("draw", range(7))
def test_interior_surfaces_are_reflectances_with_detail(draw: int) -> None:
    rng, one, two = np.random.default_rng(draw), (0.3, 0.35, 0.4), (0.6, 0.2, 0.1)
    pixels = (
        lambda: interior.concrete(rng, one),
        lambda: interior.linoleum(rng, one, two),
        lambda: interior.sheet_metal(rng, one),
        lambda: interior.pegboard(rng, one),
        lambda: interior.poster(rng, one, two),
        lambda: interior.instrument_panel(rng, one, two),
        lambda: interior.drawer_fronts(rng, one),
    )[draw]()
    assert pixels.shape == (256, 256, 3)
    assert pixels.min() >= 0.015
    assert pixels.max() <= 0.8
    assert pixels.std() > 0.02

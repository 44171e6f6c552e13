# SPDX-License-Identifier: Apache-2.0
"""Tables: objects that stand and do not touch, knobs that do what they say, metals as measured."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.spatial import KDTree

from graycard.synth import (
    Conductor,
    Glossy,
    LambertGGX,
    Matte,
    RenderSettings,
    Scene,
    SceneSpec,
    Thing,
    all_families,
    family_of,
)
from graycard.synth._mesh import Mesh, box
from graycard.synth.families._tabletop import Tabletop
from graycard.synth.families.props._metals import METALS, conductor
from graycard.synth.families.props._table_surfaces import HEIGHT, Dome, Flat, Surface

SETTINGS = RenderSettings(32, 32, 8, 3, 16)
TABLES = tuple(name for name, family in all_families().items() if family.track == "tabletop")
POLISHED = tuple(name for name in TABLES if name != "matte-table")
SHINING = Glossy | LambertGGX

pytestmark = pytest.mark.xdist_group("tables")  # a worker that has built a table keeps it


@cache
def build(name: str, seed: int = 1000, **knobs: Any) -> Scene:
    return family_of(SceneSpec("tabletop", name, seed, knobs)).build(seed, SETTINGS)


def pieces(scene: Scene) -> list[Thing]:
    """Return pieces on the table, the target first."""
    names = [thing.name for thing in scene.things]
    return list(scene.things[names.index("table") + 1 : -1])


def points(thing: Thing) -> np.ndarray:
    assert isinstance(thing.geometry, Mesh)
    return thing.geometry.vertices


def axis(thing: Thing) -> np.ndarray:
    """Return the place of a thing: the middle of its lowest vertices' bounding box in x and y."""
    found = points(thing)[:, :2]
    return (found.min(axis=0) + found.max(axis=0)) / 2


def extent(thing: Thing) -> float:
    return float(np.ptp(points(thing)[:, 2]))


def table_of(scene: Scene) -> Thing:
    return next(thing for thing in scene.things if thing.name == "table")


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("seed", [1000, pytest.param(1001, marks=pytest.mark.slow)])
@pytest.mark.parametrize("knobs", [{}, {"objects": 5, "occlusion": 1.0, "target_size": 1.6}])
def test_objects_stand_on_the_surface_and_do_not_touch(name: str, seed: int, knobs: dict[str, Any]) -> None:
    family = family_of(SceneSpec("tabletop", name, seed, knobs))
    assert isinstance(family, Tabletop)
    surface, things = family.surface(), pieces(build(name, seed, **knobs))
    for k, thing in enumerate(things):
        above = heights_above(surface, points(thing))
        assert -0.006 < above.min() <= 1e-6  # sunk by less than its sole's sagitta, never afloat
        assert above.max() > 0.04
        for other in things[:k]:
            assert separation(points(thing), points(other)) > 0.01
    edge = points(table_of(build(name, seed, **knobs)))
    for thing in things:
        assert (np.abs(points(thing)[:, :2]).max(axis=0) < np.abs(edge[:, :2]).max(axis=0)).all()


def heights_above(surface: Surface, at: np.ndarray) -> np.ndarray:
    if isinstance(surface, Flat):
        return at[:, 2] - HEIGHT
    assert isinstance(surface, Dome)
    sphere = 1 / surface.curvature
    return np.linalg.norm(at - [0, 0, HEIGHT - sphere], axis=1) - sphere


def separation(a: np.ndarray, b: np.ndarray) -> float:
    """Smallest distance between the vertices of two objects, metres."""
    return float(KDTree(a).query(b)[0].min())


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("number", [3, 5])
def test_there_are_as_many_objects_as_asked_for(name: str, number: int) -> None:
    scene = build(name, objects=number)
    assert len(pieces(scene)) == number
    assert pieces(scene)[0].name == scene.target


def test_more_objects_leave_those_that_were_there() -> None:
    few, many = (pieces(build("glossy-table", objects=n)) for n in (3, 5))
    assert [t.name for t in few] == [t.name for t in many][:3]


def test_seeds_vary_target_and_company() -> None:
    found = [pieces(build("glossy-table", seed)) for seed in range(1000, 1008)]
    assert len({things[0].name for things in found}) == 4
    assert len({thing.name for things in found for thing in things[1:]}) == 8


@pytest.mark.parametrize("name", TABLES)
def test_the_size_of_the_target_is_its_own(name: str) -> None:
    small, large = (pieces(build(name, target_size=s)) for s in (0.8, 1.6))
    assert extent(large[0]) == pytest.approx(2 * extent(small[0]), rel=0.05)
    assert extent(large[1]) == pytest.approx(extent(small[1]), rel=0.05)


@pytest.mark.parametrize(("occlusion", "before"), [(0.0, 0), (0.5, 2), (1.0, 4)])
def test_occlusion_puts_objects_between_the_cameras_and_the_target(occlusion: float, before: int) -> None:
    for seed in range(1000, 1004):
        scene = build("glossy-table", seed, objects=5, occlusion=occlusion)
        target, *others = pieces(scene)
        towards = np.mean([view.camera.position[:2] for view in scene.views], axis=0)
        nearer = [(axis(thing) - axis(target)) @ towards > 0 for thing in others]
        assert sum(nearer) == before


def test_occlusion_crowds_the_target() -> None:
    def distance(occlusion: float) -> float:
        target, *others = pieces(build("glossy-table", 1000, occlusion=occlusion))
        return min(separation(points(target), points(thing)) for thing in others)

    assert distance(1.0) < 0.7 * distance(0.0)


@pytest.mark.parametrize("name", POLISHED)
def test_the_surface_is_as_glossy_as_its_knobs_say(name: str) -> None:
    papers = table_of(build(name, roughness=0.3)).material
    assert isinstance(papers, LambertGGX)
    assert (papers.roughness, papers.metallic) == (0.3, float(name == "metal-table"))
    disney = table_of(build(name, roughness=0.3, material="principled")).material
    assert isinstance(disney, Glossy)
    assert (disney.roughness, disney.metallic) == (0.3, float(name == "metal-table"))


def test_nothing_on_a_matte_table_shines() -> None:
    for seed in range(1000, 1004):
        assert all(isinstance(thing.material, Matte) for thing in build("matte-table", seed).things)
        scene = build("glossy-table", seed)
        shining = [thing.name for thing in pieces(scene) if isinstance(thing.material, SHINING)]
        assert len(shining) <= 2


def test_a_metal_table_may_be_a_conductor_as_measured() -> None:
    found = {table_of(build("metal-table", seed, material="roughconductor")).material for seed in range(8)}
    assert all(isinstance(m, Conductor) and m.roughness == 0.2 for m in found)
    assert len({m.eta for m in found if isinstance(m, Conductor)}) == len(METALS)


@pytest.mark.parametrize(("metal", "plugin"), [("aluminium", "Al"), ("copper", "Cu"), ("gold", "Au")])
def test_indices_of_metals_are_the_renderers_own(scalar: str, metal: str, plugin: str) -> None:
    import mitsuba as mi

    own: Any = mi.traverse(mi.load_dict({"type": "roughconductor", "material": plugin}))
    known = conductor(metal, 0.2)
    np.testing.assert_allclose(known.eta, np.ravel(own["eta.value"]), rtol=1e-5)
    np.testing.assert_allclose(known.k, np.ravel(own["k.value"]), rtol=1e-5)
    assert all(0.2 < f <= 1 for f in known.f0)


def test_reflectances_of_metals_are_plausible() -> None:
    """Aluminium is nearly gray and above 0.88; copper and gold reflect red most and blue least."""
    aluminium = conductor("aluminium", 0.1).f0
    assert min(aluminium) > 0.88
    assert max(aluminium) - min(aluminium) < 0.05
    for metal in ("copper", "gold"):
        r, g, b = conductor(metal, 0.1).f0
        assert r > g > b
    with pytest.raises(ValueError, match="expected a metal of aluminium, copper, gold, got 'tin'"):
        conductor("tin", 0.1)


def test_a_dome_has_the_normals_of_its_sphere() -> None:
    dome = Dome(0.65)
    top = dome.top()
    centre = np.array([0, 0, HEIGHT - 1 / 0.65])
    out = (top.vertices - centre) * 0.65
    on_cap = np.abs(np.linalg.norm(out, axis=1) - 1) < 1e-6
    assert on_cap.mean() > 0.8
    np.testing.assert_allclose(top.normals[on_cap], out[on_cap], atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(top.normals[np.unique(top.faces)], axis=1), 1, atol=1e-6)
    assert top.vertices[:, 2].max() == pytest.approx(HEIGHT)
    assert dome.foot().vertices[:, 2].max() == pytest.approx(top.vertices[:, 2].min())


def test_what_stands_on_a_dome_stands_upright_on_it() -> None:
    """The four lower edges of a box lie alike above the sphere, and its top faces along the normal."""
    dome, brick = Dome(0.8), box((0.1, 0.1, 0.1), 0.002).moved((0, 0, 0.05))
    stood = dome.stand(brick, 0.3, -0.2, 0.7)
    above = heights_above(dome, stood.vertices)
    corners = above[brick.vertices[:, 2] < 1e-9]
    np.testing.assert_allclose(corners, corners[0], atol=1e-9)
    assert -2e-4 < corners[0] <= 0  # its bevel counts as sole, and is a little wider
    up = stood.normals[np.argmax(brick.normals[:, 2])]
    at = np.array([0.3, -0.2, np.sqrt(1 / 0.8**2 - 0.13)]) * 0.8
    np.testing.assert_allclose(up, at, atol=1e-9)
    np.testing.assert_allclose(
        Dome(1e-3).stand(brick, 0, 0, 0.7).vertices, Flat().stand(brick, 0, 0, 0.7).vertices, atol=1e-5
    )


@pytest.mark.parametrize(("knob", "value"), [("objects", 6), ("material", "velvet"), ("target_size", 2.0)])
def test_knobs_out_of_range_are_refused(knob: str, value: Any) -> None:
    with pytest.raises(ValueError, match=f"expected {knob}"):
        all_families()["metal-table"](**{knob: value})

# SPDX-License-Identifier: Apache-2.0
"""An object of another scene: where it is put, that it is that object, and what is on disk of it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from graycard import Camera, DatasetError, EnvironmentLight, PointLight, View, look_at, open_truth
from graycard.io import dumps
from graycard.layers import find_fault
from graycard.synth import (
    Ball,
    Quad,
    RenderSettings,
    Scene,
    SceneSpec,
    Thing,
    family_of,
    render_scene,
    use_renderer,
)
from graycard.synth._mesh import Mesh, box, turn_about_z
from graycard.synth._scene import BLACK, Matte
from graycard.synth.edits._composition import Composed, composition, donor_of, moved
from graycard.synth.edits._free_space import Obstacles, bounds
from without_llvm import hide_llvm

SETTINGS = RenderSettings(24, 24, 6, 3, 16)
TINY = RenderSettings(20, 16, 3, 1, 4, 3, relighting=False)
SEEDS = (1000, 1001, 1002)


@pytest.fixture(scope="module")
def composed() -> dict[int, tuple[Scene, Composed]]:
    hosts = {seed: host(seed) for seed in SEEDS}
    found = {seed: composition(scene, seed, SETTINGS) for seed, scene in hosts.items()}
    return {seed: (hosts[seed], made) for seed, made in found.items() if made is not None}


def host(seed: int) -> Scene:
    return family_of(SceneSpec("multilight", "studio", seed)).build(seed, SETTINGS)


Made = dict[int, tuple[Scene, Composed]]


@pytest.mark.parametrize("seed", SEEDS)
def test_the_guest_is_the_donors_object_moved_rigidly(composed: Made, seed: int) -> None:
    scene, made = composed[seed]
    donor = made.record.donor
    spec = SceneSpec(donor.track, donor.family, donor.seed, donor.knobs)
    assert replace(spec, knobs={}) == donor_of(seed)
    thing = family_of(spec).build(donor.seed, SETTINGS).things[donor.object_id - 1]
    assert thing.name == donor.object
    guest = made.scene.things[-1]
    assert made.record.object_id == len(made.scene.things) == len(scene.things) + 1
    assert made.scene.things[:-1] == scene.things
    assert (made.scene.lights, made.scene.views) == (scene.lights, scene.views)
    to_host = made.record.donor_to_host
    np.testing.assert_allclose(to_host[:3, :3] @ to_host[:3, :3].T, np.eye(3), atol=1e-12)
    np.testing.assert_array_equal(to_host[:, 2], (0, 0, 1, 0))
    if isinstance(thing.geometry, Mesh):
        assert isinstance(guest.geometry, Mesh)
        corners = np.append(thing.geometry.vertices, np.ones((len(thing.geometry.vertices), 1)), axis=1)
        np.testing.assert_allclose(guest.geometry.vertices, (corners @ to_host.T)[:, :3], atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_it_stands_on_the_floor_and_touches_nothing_else(composed: Made, seed: int) -> None:
    scene, made = composed[seed]
    low, high = bounds(made.scene.things[-1].geometry)
    assert low[2] == pytest.approx(0, abs=1e-9)
    assert low[:2].min() > -1.8
    assert high[:2].max() < 1.8
    for thing in scene.things:
        if not isinstance(thing.geometry, Quad):
            other = bounds(thing.geometry)
            assert not ((low < other[1]) & (high > other[0])).all(), thing.name


def test_it_is_repeatable_and_differs_with_the_seed(composed: Made) -> None:
    again = composition(host(1000), 1000, SETTINGS)
    assert again is not None
    assert dumps(again.record) == dumps(composed[1000][1].record)
    assert len({dumps(made.record.donor_to_host) for _, made in composed.values()}) == len(SEEDS)


@pytest.mark.parametrize(("track", "family"), [("dark", "corridor"), ("tabletop", "glossy-table")])
def test_other_tracks_have_none(track: str, family: str) -> None:
    scene = family_of(SceneSpec(track, family, 1000)).build(1000, SETTINGS)
    assert composition(scene, 1000, SETTINGS) is None


def test_a_scene_without_room_or_without_a_floor_has_none() -> None:
    scene = host(1000)
    block = Thing("block", box((3.6, 3.6, 0.9)).moved((0, 0, 0.45)), BLACK)
    assert composition(replace(scene, things=(*scene.things, block)), 1000, SETTINGS) is None
    no_floor = tuple(thing for thing in scene.things if thing.name != "floor")
    assert composition(replace(scene, things=no_floor), 1000, SETTINGS) is None
    sky_only = tuple(light for light in scene.lights if isinstance(light, EnvironmentLight))
    assert composition(replace(scene, lights=sky_only), 1000, SETTINGS) is None


def test_shapes_move_as_points_do() -> None:
    to_host = np.eye(4)
    to_host[:3, :3] = turn_about_z(0.7)
    to_host[:3, 3] = 1, 2, 3
    cube = box((0.2, 0.4, 0.6)).moved((1, 0, 0))
    after = moved(cube, to_host)
    assert isinstance(after, Mesh)
    np.testing.assert_allclose(after.vertices, cube.moved((1, 2, 3), 0.7).vertices, atol=1e-12)
    np.testing.assert_allclose(after.normals, cube.moved((1, 2, 3), 0.7).normals, atol=1e-12)
    ball = moved(Ball((1, 0, 0), 0.3), to_host)
    assert isinstance(ball, Ball)
    np.testing.assert_allclose(ball.center, (1 + np.cos(0.7), 2 + np.sin(0.7), 3))
    with pytest.raises(ValueError, match="expected a mesh or a ball"):
        moved(Quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), to_host)


def test_what_hides_and_what_touches() -> None:
    solids = Obstacles((), np.array([[[-1, -1, 0], [1, 1, 1.0]]]))
    eye = np.array([0, -5, 0.5])
    points = np.array([[0, 5, 0.5], [0, -2, 0.5], [0, 5, 4], [0, 0, 0.5], [4, 5, 0.5]])
    assert solids.hide(eye, points).tolist() == [True, False, False, True, False]
    assert not Obstacles((), np.zeros((0, 2, 3))).hide(eye, points).any()
    for x, near in ((1.05, True), (1.2, False)):
        assert solids.touch(np.array([[x, 0, 0], [x + 1, 1, 1]]), 0.1) == near


@pytest.fixture(scope="module")
def studio(tmp_path_factory: pytest.TempPathFactory) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        hide_llvm(patch)
        return render_scene(SceneSpec("multilight", "studio", 1000), TINY, tmp_path_factory.mktemp("c"))


def test_the_truth_opens_it(studio: Path, tiny_scenes: dict[str, Path]) -> None:
    truth = open_truth(studio / "truth")
    scene = family_of(SceneSpec("multilight", "studio", 1000)).build(1000, TINY)
    made = composition(scene, 1000, TINY)
    found = truth.composition()
    assert made is not None
    assert found is not None
    assert found.donor == made.record.donor
    np.testing.assert_array_equal(found.donor_to_host, made.record.donor_to_host)
    train, test = (next(v for v in truth.views if v.split == split) for split in ("train", "test"))
    layers = truth.composed(test)
    estimates = {"radiance", "radiance.var", "radiance.half_a", "radiance.half_b"}
    assert layers.keys() == {*estimates, "object_id"}
    for name, values in layers.items():
        assert find_fault(name, values, 16, 20) is None
    guest, before = layers["object_id"] == found.object_id, truth.layers(test)
    assert 0.002 < guest.mean() < 0.3
    np.testing.assert_array_equal(layers["object_id"][~guest], before["object_id"][~guest])
    with pytest.raises(DatasetError, match="expected a held-out view, got train_000"):
        truth.composed(train)
    assert open_truth(tiny_scenes["multilight"] / "truth").composition() is None


def test_a_broken_record_is_named(studio: Path) -> None:
    path = studio / "truth" / "composition" / "composition.json"
    whole = path.read_text()
    path.write_text(json.dumps(json.loads(whole) | {"donnor": 1}))
    try:
        with pytest.raises(DatasetError, match=r"composition.json.*did you mean 'donor'"):
            open_truth(studio / "truth", check=False).composition()
    finally:
        path.write_text(whole)


@pytest.mark.parametrize("name", ["composition.json", "views/test_002.exr"])
def test_it_is_mended_to_the_same_bits(studio: Path, name: str, no_llvm: str) -> None:
    path = studio / "truth" / "composition" / name
    before = {p: p.read_bytes() for p in studio.rglob("*") if p.is_file()}
    path.write_bytes(path.read_bytes()[:50])
    heard: list[str] = []
    spec = SceneSpec("multilight", "studio", 1000)
    render_scene(spec, TINY, studio.parent.parent, lambda done, doing: heard.append(doing))
    assert sum("_00" in h for h in heard) == int("views" in name)
    assert {p: p.read_bytes() for p in studio.rglob("*") if p.is_file()} == before


def test_it_can_be_left_out(tmp_path: Path, no_llvm: str, studio: Path) -> None:
    plain = replace(TINY, composition=False)
    other = render_scene(SceneSpec("multilight", "studio", 1000), plain, tmp_path)
    assert not (other / "truth" / "composition").exists()
    captures = [sorted((p / "capture").rglob("*.exr")) for p in (other, studio)]
    for a, b in zip(*captures, strict=True):
        assert a.read_bytes() == b.read_bytes()


def test_the_composite_is_the_host_where_the_guest_plays_no_part() -> None:
    """A small ball in one corner of a large floor: far from it the pictures agree within the noise."""
    from graycard.synth.edits._relighting import composed_view

    use_renderer(variant="scalar_rgb")
    floor = Thing("floor", Quad((0, 0, 0), (4, 0, 0), (0, 4, 0)), Matte((0.5, 0.5, 0.5)))
    pose = look_at(np.array([0.0, -3.0, 3.0]), np.array([0.0, 0.0, 0.0]))
    views = (View("test_000", "test", Camera.from_fov(24, 20, 50.0, pose)),)
    lamp = PointLight("lamp", (-1.0, 0.0, 2.0), (3.0, 3.0, 3.0))
    ball = Thing("ball", Ball((-1.2, 0.0, 0.2), 0.2), Matte((0.5, 0.4, 0.3)))
    settings = RenderSettings(24, 20, samples=256, max_depth=2)
    plain, with_ball = (
        composed_view(Scene(things, (lamp,), views), 0, 7, settings) for things in ((floor,), (floor, ball))
    )
    np.testing.assert_allclose(plain["radiance"][:, 16:], with_ball["radiance"][:, 16:], rtol=1e-5)
    guest = with_ball["object_id"] == 2
    assert 0.005 < guest.mean() < 0.1
    shadow = with_ball["radiance"] < 0.5 * plain["radiance"]
    assert shadow[~guest].any()

# SPDX-License-Identifier: Apache-2.0
"""Every family: repeatable, plausible, lit from out of sight, and held-out views that training covers."""

from functools import lru_cache

import numpy as np
import pytest

from graycard import Camera, EnvironmentLight, RectangleLight, SphereLight, SpotLight
from graycard.records import KNOB_UNITS
from graycard.synth import (
    Conductor,
    Glossy,
    LambertGGX,
    RenderSettings,
    Scene,
    SceneSpec,
    Texture,
    all_families,
    family_of,
    knobs,
)
from graycard.synth._mesh import Mesh
from graycard.synth._stream import stream
from graycard.synth.families._family import interleaved

SETTINGS = RenderSettings(32, 32, 8, 3, 16)
NAMES = tuple(all_families())


def build(name: str, seed: int = 0, **knobs: float) -> Scene:
    return family_of(SceneSpec(all_families()[name].track, name, seed, knobs)).build(seed, SETTINGS)


@lru_cache(maxsize=3)
def kept(name: str, seed: int) -> Scene:
    """Return the scene of a seed, built once for all tests of a family."""
    return build(name, seed)


@pytest.fixture(scope="module", params=NAMES)
def name(request: pytest.FixtureRequest) -> str:
    """Each family, with all tests of one before those of the next."""
    return request.param


def fingerprint(scene: Scene) -> list[object]:
    parts: list[object] = [scene.lights, scene.views, scene.objects(), scene.target_id]
    for thing in scene.things:
        shape, material = thing.geometry, thing.material
        color = material.f0 if isinstance(material, Conductor) else material.color
        parts.append(shape.vertices.tobytes() if isinstance(shape, Mesh) else shape)
        parts.append(color.pixels.tobytes() if isinstance(color, Texture) else color)
    return [*parts, None if scene.sky is None else scene.sky.tobytes()]


def test_a_knob_has_the_unit_that_its_meaning_says(name: str) -> None:
    words = {"metres": "m", "degrees": "°", "W/m²/sr": "W/m²/sr"}
    for knob in knobs(all_families()[name]):
        said = [unit for word, unit in words.items() if f", {word}" in knob.meaning]
        assert [KNOB_UNITS.get(knob.name, "")] == (said or [""])
        assert not said or knob.allowed.endswith(f" {said[0]}")


def test_a_seed_gives_one_scene_and_another_seed_another(name: str) -> None:
    first, other = kept(name, 0), kept(name, 1)
    assert fingerprint(first) == fingerprint(build(name, 0))
    assert fingerprint(first) != fingerprint(other)
    assert first.lights != other.lights or first.views != other.views


@pytest.mark.parametrize("seed", [0, 1, pytest.param(2, marks=pytest.mark.slow)])
def test_objects_have_names_of_their_own_and_materials_keep_energy(name: str, seed: int) -> None:
    scene = kept(name, seed)
    names = [thing.name for thing in scene.things]
    assert len(set(names)) == len(names)
    assert [o.id for o in scene.objects()] == list(range(1, len(names) + 1))
    for thing in scene.things:
        if isinstance(thing.material, Conductor):
            continue
        color = thing.material.color
        values = color.pixels if isinstance(color, Texture) else np.array(color)
        assert values.min() >= 0
        assert values.max() <= (0.8 if isinstance(thing.material, Glossy) else 0.95)


def test_lights_are_named_once_and_area_lights_have_surfaces(name: str) -> None:
    scene = kept(name, 0)
    names = [light.name for light in scene.lights]
    assert len(set(names)) == len(names)
    area = {x.name for x in scene.lights if isinstance(x, RectangleLight | SphereLight)}
    assert {thing.light for thing in scene.things if thing.light} == area
    assert any(isinstance(x, EnvironmentLight) for x in scene.lights) == (scene.sky is not None)


def test_views_are_interleaved_and_held_out_ones_lie_between(name: str) -> None:
    views = kept(name, 0).views
    assert [v.name for v in views] == [f"{v.split}_{i:03d}" for i, v in enumerate(views)]
    assert sum(v.split == "test" for v in views) == 3
    assert views[0].split == views[-1].split == "train"
    assert len({v.camera.digest for v in views}) == 11


@pytest.mark.parametrize(("count", "test"), [(3, 1), (4, 2), (7, 5), (11, 3), (40, 10)])
def test_interleaving_holds_out_the_right_number(count: int, test: int) -> None:
    cameras = [Camera.from_fov(4, 4, 50, np.eye(4)) for _ in range(count)]
    splits = [v.split for v in interleaved(cameras, test)]
    assert splits.count("test") == test
    assert splits[0] == splits[-1] == "train"


def test_interleaving_needs_two_training_views() -> None:
    cameras = [Camera.from_fov(4, 4, 50, np.eye(4)) for _ in range(3)]
    with pytest.raises(ValueError, match="expected 2 or more training views, got 1"):
        interleaved(cameras, 2)


def test_streams_are_independent_of_one_another() -> None:
    assert stream(0, "a").random() == stream(0, "a").random()
    assert len({stream(s, n).random() for s in (0, 1) for n in ("a", "b")}) == 4


@pytest.mark.parametrize("seed", [0, 1])
def test_what_is_held_out_was_seen_and_lamps_are_not_in_the_way(scalar: str, name: str, seed: int) -> None:
    """Training views see most of what test views see; lamps fill next to nothing of any view."""
    from graycard.synth.layers._views import surface_layers
    from graycard.synth.renderer._mitsuba import load_scene

    scene = kept(name, seed)
    loaded = load_scene(scene, scene.views[0].camera)
    layers = [surface_layers(loaded, scene, v.camera) for v in scene.views]
    lamps = [o.id for o in scene.objects() if o.emits]
    for layer in layers:
        assert np.isin(layer["object_id"], lamps).mean() < 0.06
        assert (layer["object_id"] > 0).mean() > 0.6
        assert layer["depth"].min() > 0.25
    train = [i for i, v in enumerate(scene.views) if v.split == "train"]
    for i, view in enumerate(scene.views):
        if view.split == "test":
            points = seen_points(view.camera, layers[i]["depth"])
            covered = np.any([sees(scene.views[k].camera, layers[k]["depth"], points) for k in train], axis=0)
            assert covered.mean() > 0.8


def seen_points(camera: Camera, depth: np.ndarray) -> np.ndarray:
    seen, rays = np.isfinite(depth), camera.rays()
    return camera.position + (depth[seen] / (rays[seen] @ camera.forward))[:, None] * rays[seen]


def sees(camera: Camera, depth: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return true for points that project into the image and lie near the surface that is seen there."""
    pixel, z = camera.project(points)
    inside = (z > 0) & (pixel >= 0).all(-1) & (pixel < (camera.width, camera.height)).all(-1)
    column, row = np.where(inside[:, None], pixel, 0).astype(int).T
    return inside & (np.abs(depth[row, column] - z) < 0.12 * z)


def test_the_lamp_of_the_corridor_moves_with_the_camera() -> None:
    lamp = build("corridor", light_offset=0.4).lights[0]
    assert isinstance(lamp, SpotLight)
    assert lamp.frame == "camera"
    assert lamp.position[0] == 0.4


@pytest.mark.parametrize("gloss", [0.0, 1.0])
def test_gloss_turns_the_corridors_objects_glossy(gloss: float) -> None:
    scene = build("corridor", gloss=gloss)
    shown = [t for t in scene.things if t.name in ("drum", "stool", "crate 1")]
    glossy = [isinstance(t.material, LambertGGX) for t in shown]
    assert glossy == [gloss == 1.0] * 3


def test_clutter_fills_the_shelves() -> None:
    empty, full = (build("corridor", clutter=share) for share in (0.0, 1.0))
    assert len(full.things) - len(empty.things) == 2 * 3 * 4


def test_an_unlit_corridor_keeps_its_ceiling() -> None:
    ceiling = build("corridor", ambient=0.0).lights[1]
    assert isinstance(ceiling, RectangleLight)
    assert ceiling.radiance == (0, 0, 0)


def test_a_target_is_one_of_the_things() -> None:
    scene = build("glossy-table")
    assert scene.target_id == scene.id_of(scene.target)
    assert build("studio").target_id is None
    with pytest.raises(ValueError, match="expected a thing of the scene, got 'cup'"):
        scene.id_of("cup")

# SPDX-License-Identifier: Apache-2.0
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from graycard import (
    TRACKS,
    Camera,
    DatasetError,
    EnvironmentLight,
    GaussianLight,
    Light,
    PointLight,
    RectangleLight,
    SphereLight,
    SphericalGaussian,
    SpotLight,
    Truth,
    UnknownNameError,
    capture_folders,
    look_at,
    open_capture,
    open_truth,
    world_position,
)
from graycard.io import dumps, write_json, write_layers, write_rgb
from graycard.lights import light_from_json, light_to_json, read_lights

LIGHTS: tuple[Light, ...] = (
    PointLight("p", (0, 1, 2), (3, 4, 5), "camera"),
    SpotLight("s", (0, 1, 2), (0, 0, 1), (3, 4, 5), 10.0, 30.0),
    RectangleLight("r", (0, 0, 2), (0.5, 0, 0), (0, 0.25, 0), (2, 4, 6)),
    SphereLight("b", (0, 0, 2), 0.1, (2, 4, 6)),
    EnvironmentLight("e", "environment.exr"),
    GaussianLight("g", (0, 1, 2), (SphericalGaussian((0, 0.6, 0.8), 5.0, (3, 4, 5)),), "camera"),
)


def edit(path: Path, change: Callable[[dict[str, object]], object]) -> None:
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))


def test_a_capture_gives_photographs_of_training_views_only(tiny_scenes: dict[str, Path]):
    capture = open_capture(tiny_scenes["dark"] / "capture")
    assert [v.split for v in capture.views].count("train") == len(capture.train) == 3
    assert capture.photograph(capture.train[0]).shape == (24, 28, 3)
    with pytest.raises(
        DatasetError, match="expected a training view, got test_001: its photograph is held out"
    ):
        capture.photograph(capture.test[0])
    assert not list((tiny_scenes["dark"] / "capture" / "photographs").glob("test*"))
    brightest = np.percentile([capture.photograph(v) for v in capture.train], 99)
    assert brightest * capture.exposure == pytest.approx(1)


def test_target_masks_are_granted_on_training_views(tiny_scenes: dict[str, Path]):
    capture = open_capture(tiny_scenes["tabletop"] / "capture")
    truth = open_truth(tiny_scenes["tabletop"] / "truth")
    for view in capture.train:
        assert np.array_equal(capture.target_mask(view), truth.layers(view)["object_id"] == capture.target)
    with pytest.raises(DatasetError, match="scene with a target"):
        open_capture(tiny_scenes["dark"] / "capture").target_mask(capture.train[0])


def test_masks_of_another_object_are_refused(make_scene: Callable[..., Path]):
    folder = make_scene(track="tabletop")
    capture = open_capture(folder / "capture", check=False)
    view = capture.train[0]
    path = folder / "capture" / "masks" / "target" / f"{view.name}.exr"
    ids = np.zeros((view.camera.height, view.camera.width), np.uint32)
    ids[:4] = 2
    write_layers(path, {"object_id": ids})
    with pytest.raises(DatasetError, match=r"expected object 3, the target of the capture, or 0 .* got 2"):
        capture.target_mask(view)
    write_layers(path, {"depth": ids.astype(np.float32)})
    with pytest.raises(DatasetError, match="expected object_id in .* got depth"):
        capture.target_mask(view)


def test_views_and_scenes_are_found_by_name(tiny_scenes: dict[str, Path]):
    truth = open_truth(tiny_scenes["dark"] / "truth")
    assert truth.view("test_001").split == "test"
    assert truth.emitter_ids() == frozenset()
    with pytest.raises(UnknownNameError, match="did you mean 'test_001'"):
        truth.view("test_01")
    dataset = tiny_scenes["dark"].parents[1]
    assert capture_folders(dataset) == [tiny_scenes[t] for t in TRACKS]


def test_a_changed_file_is_named(make_scene: Callable[..., Path]):
    scene = make_scene()
    (scene / "truth" / "views" / "test_001.exr").write_bytes(b"not what was written")
    with pytest.raises(
        DatasetError, match=r"views/test_001.exr: expected SHA-256 .* Run `graycard render` again"
    ):
        open_truth(scene / "truth")
    (scene / "capture" / "photographs" / "train_000.exr").unlink()
    with pytest.raises(DatasetError, match=r"photographs/train_000.exr: missing"):
        open_capture(scene / "capture")


def test_a_newer_format_is_refused(make_scene: Callable[..., Path]):
    scene = make_scene()
    edit(scene / "truth" / "manifest.json", lambda m: m.update(format_version=99, from_the_future=1))
    with pytest.raises(DatasetError, match=r"version 1 or older .* got version 99. Install a newer graycard"):
        open_truth(scene / "truth")


def test_a_half_written_scene_is_not_read(make_scene: Callable[..., Path], tmp_path: Path):
    scene = make_scene()
    (scene / "truth" / "manifest.json").unlink()
    with pytest.raises(DatasetError, match=r"rendering was cut off.*graycard render"):
        open_truth(scene / "truth")
    assert capture_folders(scene.parents[1]) == []
    with pytest.raises(DatasetError, match="got nothing"):
        open_capture(tmp_path / "nowhere")


def test_a_capture_is_no_truth(tiny_scenes: dict[str, Path]):
    with pytest.raises(DatasetError, match="expected a graycard-truth folder at .*, got a graycard-capture"):
        open_truth(tiny_scenes["dark"] / "capture")


def test_a_misspelt_key_is_an_error(make_scene: Callable[..., Path]):
    scene = make_scene()
    edit(scene / "capture" / "capture.json", lambda c: c.update(exposur=c.pop("exposure")))
    with pytest.raises(DatasetError, match=r"expected a Capture with .*exposur.*did you mean 'exposure'"):
        open_capture(scene / "capture", check=False)


def test_files_need_a_folder():
    with pytest.raises(DatasetError, match="opened from a folder, got one in memory"):
        Truth("dark", "x", (), 1.0, 1.0, ()).lights()


@pytest.mark.parametrize("light", LIGHTS, ids=lambda light: light.name)
def test_lights_round_trip(light: Light):
    assert light_from_json(json.loads(dumps(light_to_json(light)))) == light


def test_intensities_of_lights_with_an_area():
    """Rectangle 1 m x 0.5 m: I = L A. Sphere: I = L pi r²."""
    _, _, rectangle, sphere, *_ = LIGHTS
    assert isinstance(rectangle, RectangleLight)
    assert isinstance(sphere, SphereLight)
    assert rectangle.axial_intensity == pytest.approx([1, 2, 3])
    assert sphere.axial_intensity == pytest.approx(np.array([2, 4, 6]) * np.pi * 0.01)


def test_a_light_on_the_camera_moves_with_it():
    """30 cm to the right of a camera that looks along +y stands at +x in the world."""
    light = PointLight("flash", (0.3, 0, 0), (1, 1, 1), "camera")
    camera = Camera.from_fov(8, 8, 60, look_at(np.array([1, -3, 1]), np.array([1, 0, 1])))
    assert world_position(light, camera) == pytest.approx([1.3, -3, 1])


def test_the_intensity_of_a_gaussian_light():
    """One lobe has its amplitude on the axis and exp(-2 s) of it behind; of several the brightest counts."""
    lobe = SphericalGaussian((0, 0, 1), 1.5, (3, 4, 5))
    one = GaussianLight("g", (0, 0, 0), (lobe,))
    towards = one.intensity_towards(np.array([[0, 0, 1], [1, 0, 0], [0, 0, -1]]))
    assert towards == pytest.approx(np.exp([[0.0], [-1.5], [-3.0]]) * np.array([3, 4, 5]))
    assert one.axial_intensity == pytest.approx([3, 4, 5])
    two = GaussianLight("g", (0, 0, 0), (lobe, SphericalGaussian((1, 0, 0), 1.5, (9, 1, 9))))
    assert two.axial_intensity == pytest.approx(np.array([9, 1, 9]) + np.exp(-1.5) * np.array([3, 4, 5]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"axis": (0, 0, 2)}, "axis of unit length, got .* of length 2"),
        ({"axis": (0, 0, 0)}, "axis of unit length"),
        ({"axis": (0, 0, float("nan"))}, "axis of unit length"),
        ({"sharpness": -1.0}, "finite sharpness of 0 or more, got -1"),
        ({"sharpness": float("inf")}, "finite sharpness"),
        ({"amplitude": (1, -1, 1)}, "finite amplitudes of 0 or more"),
        ({"amplitude": (1, float("nan"), 1)}, "finite amplitudes"),
    ],
)
def test_bad_lobes(change: dict[str, object], message: str):
    fields = {"axis": (0, 0, 1), "sharpness": 1.0, "amplitude": (1, 1, 1)} | change
    with pytest.raises(ValueError, match=message):
        SphericalGaussian(**fields)  # pyright: ignore[reportArgumentType]
    data = {"type": "spherical-gaussians", "name": "g", "position": [0, 0, 0], "lobes": [fields]}
    with pytest.raises(DatasetError, match=message):
        light_from_json(json.loads(dumps(data)))


def test_a_gaussian_light_has_a_lobe():
    with pytest.raises(ValueError, match="expected one lobe or more in the light 'g', got none"):
        GaussianLight("g", (0, 0, 0), ())


@pytest.mark.parametrize(
    ("data", "error", "message"),
    [
        ({"type": "poin", "name": "a"}, UnknownNameError, "did you mean 'point'"),
        ({"name": "a"}, DatasetError, "a light as an object with a 'type'"),
        ({"type": "point", "name": "a", "position": [0, 0, 0]}, DatasetError, "expected a PointLight"),
        (
            {"type": "point", "name": "a", "position": [0, 0, 0], "intensity": [1, 1, 1], "color": 3},
            DatasetError,
            "color",
        ),
    ],
)
def test_bad_lights(data: object, error: type[Exception], message: str):
    with pytest.raises(error, match=message):
        light_from_json(data)


@pytest.mark.parametrize("track", ["dark", "tabletop"])
def test_pictures_are_as_large_as_their_cameras(make_scene: Callable[..., Path], track: str):
    scene = make_scene(track=track)
    capture, truth = open_capture(scene / "capture"), open_truth(scene / "truth")
    view, ids = capture.train[0], np.full((3, 4), 3, np.uint32)
    write_rgb(scene / "capture" / "photographs" / f"{view.name}.exr", np.ones((3, 4, 3)))
    write_layers(scene / "truth" / "views" / f"{view.name}.exr", {"object_id": ids})
    reads = [lambda: capture.photograph(view), lambda: truth.layers(view)]
    if track == "tabletop":
        write_layers(scene / "capture" / "masks" / "target" / f"{view.name}.exr", {"object_id": ids})
        reads.append(lambda: capture.target_mask(view))
    for read in reads:
        with pytest.raises(DatasetError, match="to be 28x24 pixels, as its camera is, got 4x3"):
            read()


def test_a_layer_that_the_truth_lacks_is_named_with_its_file(make_scene: Callable[..., Path]):
    scene = make_scene()
    truth = open_truth(scene / "truth")
    path = scene / "truth" / "views" / f"{truth.views[0].name}.exr"
    write_layers(path, {"depth": np.ones((24, 28))})
    layers = truth.layers(truth.views[0])
    assert layers.get("object_id") is None
    with pytest.raises(DatasetError, match=f"expected object_id in {path}, got depth"):
        layers["object_id"]


def test_lights_are_a_list(tmp_path: Path):
    write_json(tmp_path / "lights.json", {"a": 1})
    with pytest.raises(DatasetError, match="expected a JSON list of lights"):
        read_lights(tmp_path / "lights.json")

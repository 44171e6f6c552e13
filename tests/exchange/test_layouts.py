# SPDX-License-Identifier: Apache-2.0
"""Layouts of the field: nerfstudio with any distortion, NeRF-synthetic, and TensoIR with its truth.

Loaders here are a few lines each, written after the rules of the programs, not after ours.
"""

import json
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image

from graycard import DatasetError, look_at, open_capture, open_truth, srgb_decode, srgb_encode
from graycard.cli import main
from graycard.exchange import ImportOptions, export_capture, import_capture, left_out_of, plan_import
from graycard.exchange._export import write_tensoir

TURNED = np.diag([1.0, -1.0, -1.0, 1.0])
W, H = 32, 24
PLAIN = {"w": W, "h": H, "fl_x": 40.0, "fl_y": 41.0, "cx": 16.5, "cy": 11.5}


def frames(count: int, name: str) -> list[dict[str, Any]]:
    poses = [look_at(np.array([3.0, i / 3, 1.0]), np.zeros(3)) @ TURNED for i in range(count)]
    return [{"file_path": name.format(i), "transform_matrix": p.tolist()} for i, p in enumerate(poses)]


def photographs(folder: Path, count: int, name: str, alpha: bool = False) -> None:
    for i in range(count):
        path = folder / name.format(i)
        path.parent.mkdir(parents=True, exist_ok=True)
        pixels = np.random.default_rng(i).integers(1, 256, (H, W, 4), dtype=np.uint8)
        pixels[..., 3] = 255
        if alpha:
            pixels[:5, :, 3] = 0
            pixels[5:8, :, 3] = 128
        Image.fromarray(pixels if alpha else pixels[..., :3]).save(path)


@pytest.fixture
def nerfstudio(tmp_path: Path) -> Callable[..., Path]:
    def write(per_frame: dict[str, Any] | None = None, **top: Any) -> Path:
        folder = tmp_path / "nerfstudio"
        photographs(folder, 4, "images/{:03d}.png")
        listed = [{**frame, **(per_frame or {})} for frame in frames(4, "images/{:03d}.png")]
        (folder / "transforms.json").write_text(json.dumps({**top, "frames": listed}))
        return folder

    return write


BROWN = {"k1": -0.1, "k2": 0.02, "p1": 0.001, "p2": -0.002}
WAYS: dict[str, tuple[dict[str, Any], str, list[float]]] = {
    "keys": ({"camera_model": "OPENCV", **BROWN}, "brown", [-0.1, 0.02, 0.001, -0.002, 0]),
    "no model": (BROWN, "brown", [-0.1, 0.02, 0.001, -0.002, 0]),
    "k3": ({**BROWN, "k3": 0.01}, "brown", [-0.1, 0.02, 0.001, -0.002, 0.01]),
    "a list": (
        {"distortion_params": [-0.1, 0.02, 0.01, 0.0, 0.001, -0.002]},
        "brown",
        [-0.1, 0.02, 0.001, -0.002, 0.01],
    ),
    "a short list": ({"distortion_params": [-0.1, 0.02]}, "brown", [-0.1, 0.02, 0, 0, 0]),
    "rational": (
        {"camera_model": "FULL_OPENCV", **BROWN, "k3": 0.01, "k4": 0.02, "k5": 0.01, "k6": 0.005},
        "brown",
        [-0.1, 0.02, 0.001, -0.002, 0.01, 0.02, 0.01, 0.005],
    ),
    "fisheye": ({"camera_model": "OPENCV_FISHEYE", "k1": 0.02, "k4": 0.001}, "fisheye", [0.02, 0, 0, 0.001]),
    "fisheye without any": ({"camera_model": "OPENCV_FISHEYE"}, "fisheye", [0, 0, 0, 0]),
    "instant-ngp": ({"is_fisheye": True, "k1": 0.02, "k2": -0.01}, "fisheye", [0.02, -0.01, 0, 0]),
}  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("each", [False, True])
def test_distortion_is_undone_however_it_is_written(
    way: str, each: bool, nerfstudio: Callable[..., Path], tmp_path: Path
):
    """Against OpenCV's own undistortion of the picture to the camera that came of it."""
    entry, kind, numbers = WAYS[way]
    folder = nerfstudio(entry, **PLAIN) if each else nerfstudio(**PLAIN, **entry)
    made = import_capture(folder, tmp_path / "data", "dark", "x", ImportOptions(hold_out="0"))
    capture = open_capture(made / "capture")
    camera = capture.train[0].camera
    K, aim = np.array([[40, 0, 16.5], [0, 41, 11.5], [0, 0, 1.0]]), camera.K.copy()
    K[:2, 2] -= 0.5  # OpenCV counts from the first pixel's centre
    aim[:2, 2] -= 0.5
    init = cv2.initUndistortRectifyMap if kind == "brown" else cv2.fisheye.initUndistortRectifyMap
    maps = init(K, np.array(numbers, float), np.eye(3), aim, (camera.width, camera.height), cv2.CV_32FC1)
    source = srgb_decode(np.asarray(Image.open(folder / "images/000.png")) / 255).astype(np.float32)
    expected = cv2.remap(source, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    np.testing.assert_allclose(capture.photograph(capture.train[0]), expected, atol=1e-6)
    lenses = [row for row in plan_import(folder, "dark").rows if row.what == "distortion"]
    assert [row.count for row in lenses] == [4]
    assert "lens undone: 32x24 becomes" in lenses[0].said


@pytest.mark.parametrize(
    "keys", [{"k5": 0.01}, {"k6": 0.01}, {"k4": 0.1}, {"camera_model": "OPENCV", "k5": 0.01}]
)
def test_distortion_of_no_known_model_is_refused_by_name(
    keys: dict[str, Any], nerfstudio: Callable[..., Path]
):
    name = next(key for key in keys if key[0] == "k")
    with pytest.raises(DatasetError, match=f"with {name} 0.*Name the right camera_model"):
        plan_import(nerfstudio(**PLAIN, **keys), "dark")


def test_an_angle_and_the_photograph_are_enough(nerfstudio: Callable[..., Path]):
    plan = plan_import(nerfstudio(camera_angle_x=0.8), "dark")
    focal = 0.5 * W / np.tan(0.4)
    np.testing.assert_allclose(plan.shots[0].camera.K, [[focal, 0, 16], [0, focal, 12], [0, 0, 1]])
    with pytest.raises(DatasetError, match="expected camera_angle_x between 0 and pi"):
        plan_import(nerfstudio(camera_angle_x=4.0), "dark")


@pytest.fixture
def synthetic(tmp_path: Path) -> Path:
    """NeRF-synthetic's layout: names without suffix, transparent pictures, none of test views."""
    folder = tmp_path / "lego"
    for split, count in (("train", 5), ("val", 2), ("test", 3)):
        index = {"camera_angle_x": 0.76, "frames": frames(count, f"./{split}/r_{{}}")}
        if split != "test":
            photographs(folder, count, f"{split}/r_{{}}.png", alpha=True)
        (folder / f"transforms_{split}.json").write_text(json.dumps(index))
    return folder


def test_nerf_synthetic_is_read(synthetic: Path, tmp_path: Path):
    plan = plan_import(synthetic, "multilight")
    assert [(s.name, s.held_out) for s in plan.shots] == [
        *[(f"test_r_{i}", True) for i in range(3)],
        *[(f"train_r_{i}", False) for i in range(5)],
        *[(f"val_r_{i}", True) for i in range(2)],
    ]
    capture = open_capture(import_capture(synthetic, tmp_path / "data", "multilight", "lego") / "capture")
    view = capture.view("train_r_3")
    focal = 0.5 * W / np.tan(0.5 * 0.76)
    np.testing.assert_allclose(view.camera.K, [[focal, 0, 16], [0, focal, 12], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(view.camera.camera_to_world @ TURNED, frames(5, "")[3]["transform_matrix"])
    levels = np.random.default_rng(3).integers(1, 256, (H, W, 4), dtype=np.uint8)
    light = srgb_decode(levels[..., :3] / 255)
    found = capture.photograph(view)
    assert (found[:5] == 0).all()
    np.testing.assert_allclose(found[5:8], light[5:8] * 128 / 255, atol=1e-6)
    np.testing.assert_allclose(found[8:], light[8:], atol=1e-6)


def test_what_is_odd_about_nerf_synthetic_is_said(synthetic: Path):
    index = json.loads((synthetic / "transforms_val.json").read_text())
    index["frames"] = json.loads((synthetic / "transforms_train.json").read_text())["frames"][:2]
    (synthetic / "transforms_val.json").write_text(json.dumps(index))
    said = {(row.what, row.count, row.said) for row in plan_import(synthetic, "dark").rows}
    assert ("views", 2, "of transforms_val.json taken once: other lists have them too") in said
    assert ("cameras", 3, "without a photograph, held out: test_r_0, test_r_1, test_r_2") in said
    train = json.loads((synthetic / "transforms_train.json").read_text())
    lit = {str(i): {**frame, "light_idx": i % 3} for i, frame in enumerate(train["frames"])}
    (synthetic / "transforms_train.json").write_text(json.dumps({**train, "frames": lit}))
    rows = [row for row in plan_import(synthetic, "dark").rows if "3 different lights" in row.said]
    assert [(row.count, row.warns) for row in rows] == [(5, True)]


def nerf_pytorch(folder: Path) -> tuple[np.ndarray, np.ndarray, list[np.ndarray], float]:
    """Pictures, poses, indices by split and focal length, as ``load_blender_data``: it opens all lists."""
    pictures, poses, counts = [], [], [0]
    for split in ("train", "val", "test"):
        meta = json.loads((folder / f"transforms_{split}.json").read_text())
        for frame in meta["frames"]:
            pictures.append(np.asarray(Image.open(folder / (frame["file_path"] + ".png"))) / 255.0)
            poses.append(np.array(frame["transform_matrix"]))
        counts.append(len(pictures))
    whole = np.array(pictures)
    white = whole[..., :3] * whole[..., -1:] + (1.0 - whole[..., -1:])  # its --white_bkgd
    splits = [np.arange(a, b) for a, b in pairwise(counts)]
    return white, np.array(poses), splits, 0.5 * whole.shape[2] / np.tan(0.5 * meta["camera_angle_x"])


def inria(folder: Path, split: str) -> list[np.ndarray]:
    """Pictures as ``readCamerasFromTransforms`` of 3D Gaussian Splatting lays them on white."""
    frames = json.loads((folder / f"transforms_{split}.json").read_text())["frames"]
    found = []
    for frame in frames:
        rgba = np.array(Image.open(folder / (frame["file_path"] + ".png")).convert("RGBA")) / 255.0
        found.append(rgba[:, :, :3] * rgba[:, :, 3:4] + (1 - rgba[:, :, 3:4]))
    return found


@pytest.mark.parametrize("track", ["multilight", "tabletop"])
def test_the_usual_loaders_read_our_nerf_synthetic(track: str, tiny_scenes: dict[str, Path], tmp_path: Path):
    capture = export_capture(tiny_scenes[track], "blender", tmp_path / "out")
    pictures, poses, splits, focal = nerf_pytorch(tmp_path / "out")
    assert [len(split) for split in splits] == [3, 3, 3]
    for view, number in zip(capture.train, splits[0], strict=True):
        picture, pose = pictures[number], poses[number]
        shown = srgb_encode(capture.photograph(view) * capture.exposure)
        assert np.abs(picture - shown).max() <= 0.5 / 255 + 1e-9
        assert abs(focal - view.camera.K[0, 0]) < 1e-9
        x, y = 20, 5  # a ray as get_rays makes it, without the half pixel that it leaves out
        local = [(x - 0.5 * view.camera.width) / focal, -(y - 0.5 * view.camera.height) / focal, -1]
        ray = pose[:3, :3] @ local
        expected = view.camera.project(pose[:3, 3] + 2 * ray)[0]
        np.testing.assert_allclose(expected, [x, y], atol=1e-9)
    for split in ("train", "test"):
        assert np.array_equal(inria(tmp_path / "out", split), pictures[splits[0]])


def test_held_out_cameras_of_nerf_synthetic_stand_where_no_loader_looks(
    tiny_scenes: dict[str, Path], tmp_path: Path
):
    capture = export_capture(tiny_scenes["multilight"], "blender", tmp_path / "out")
    lists = sorted(path.name for path in (tmp_path / "out").glob("*.json"))
    assert lists == [f"transforms_{split}.json" for split in ("test", "train", "val")]
    held = json.loads((tmp_path / "out" / "held_out" / "transforms.json").read_text())["frames"]
    assert len(held) == len(capture.test) == 2
    assert not list((tmp_path / "out").rglob("test/*"))


def test_names_stay_in_nerf_synthetic(tiny_scenes: dict[str, Path], tmp_path: Path):
    """Names would grow by the folder's with each export and import."""
    scene, names = tiny_scenes["multilight"], []
    for turn in range(2):
        export_capture(scene, "blender", tmp_path / f"out{turn}")
        scene = import_capture(tmp_path / f"out{turn}", tmp_path / f"data{turn}", "multilight", "x")
        names.append([(v.name, v.split) for v in open_capture(scene / "capture").views])
    before = open_capture(tiny_scenes["multilight"] / "capture").views
    assert names == [sorted((v.name, v.split) for v in before)] * 2


def test_what_a_layout_has_no_place_for_is_said(
    tiny_scenes: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    args = ["export", str(tiny_scenes["tabletop"]), "--format"]
    for kind in ("blender", "tensoir"):
        assert main([*args, kind, "--out", str(tmp_path / kind)]) == 0
        told = capsys.readouterr().err
        assert told == f"warning: {kind} has no place for 3 masks of the target: left out\n"
    assert main([*args, "colmap", "--out", str(tmp_path / "colmap")]) == 0
    shown = capsys.readouterr()
    assert "3 photographs, 2 held-out cameras without a photograph" in shown.out
    assert shown.err == ""


def test_points_that_a_layout_has_no_place_for_are_said(nerfstudio: Callable[..., Path], tmp_path: Path):
    folder = nerfstudio(**PLAIN, ply_file_path="p.ply")
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    (folder / "p.ply").write_text(
        f"ply\nformat ascii 1.0\nelement vertex 2\n{axes}end_header\n0 0 0\n1 1 1\n"
    )
    capture = open_capture(import_capture(folder, tmp_path / "data", "dark", "x") / "capture")
    assert left_out_of(capture, "blender") == left_out_of(capture, "tensoir") == ["2 sparse points"]
    assert left_out_of(capture, "nerfstudio") == []


def test_cameras_that_a_layout_cannot_say_are_refused(nerfstudio: Callable[..., Path], tmp_path: Path):
    made = import_capture(nerfstudio(**PLAIN), tmp_path / "data", "dark", "x")
    with pytest.raises(DatasetError, match="square pixels and the principal point in the middle"):
        export_capture(made, "blender", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def tensoir(place: Path) -> dict[str, Any]:
    """One view as TensoIR's loader for relighting reads it, on white."""
    meta = json.loads((place / "metadata.json").read_text())
    pose = np.array([float(x) for x in meta["cam_transform_mat"].split(",")]).reshape(4, 4)
    pictures = {n: np.asarray(Image.open(place / f"{n}.png")) / 255 for n in ("rgba", "albedo", "normal")}
    normal = (pictures["normal"][..., :3] - 0.5) * 2
    return {
        "pose": pose @ np.array([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]),
        "focal": 0.5 * int(meta["imw"]) / np.tan(0.5 * meta["cam_angle_x"]),
        "rgb": pictures["rgba"][..., :3],
        "mask": pictures["rgba"][..., 3] != 0,
        "albedo": pictures["albedo"][..., :3],
        "normal": normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9),
    }


def test_tensoir_reads_our_truth(tiny_scenes: dict[str, Path], tmp_path: Path):
    scene = tiny_scenes["multilight"]
    capture = export_capture(scene, "tensoir", tmp_path / "out")
    truth = open_truth(scene / "truth")
    for views in (capture.train, capture.test):
        for number, view in enumerate(views):
            found, layers = tensoir(tmp_path / "out" / f"{view.split}_{number:03d}"), truth.layers(view)
            seen = layers["object_id"] > 0
            assert (found["mask"] == seen).all()
            np.testing.assert_allclose(found["pose"], view.camera.camera_to_world, atol=1e-12)
            assert found["focal"] == pytest.approx(view.camera.K[0, 0], abs=1e-9)
            assert np.abs(found["albedo"] - layers["base_color"])[seen].max() <= 0.5 / 255 + 1e-6
            assert ((found["normal"] * layers["normal"]).sum(-1)[seen] > np.cos(np.radians(0.6))).all()
            shown = srgb_encode(layers["radiance"] * capture.exposure)
            assert np.abs(found["rgb"] - shown)[seen].max() <= 0.5 / 255 + 1e-6


@pytest.mark.parametrize("width", [None, 14])
def test_tensoirs_layers_become_truth(width: int | None, tiny_scenes: dict[str, Path], tmp_path: Path):
    scene = tiny_scenes["multilight"]
    before = export_capture(scene, "tensoir", tmp_path / "out")
    (tmp_path / "out" / "train_000" / "rgba_city.png").write_bytes(b"another light")
    (tmp_path / "out" / "train_000" / "acc.png").write_bytes(b"who knows")
    plan = plan_import(tmp_path / "out", "multilight", ImportOptions(width=width))
    said = {row.what: (row.count, row.said) for row in plan.rows}
    assert said["lights"] == (2, "in the folder; taken is rgba: --model chooses")
    assert said["layers"][0] == 2
    assert "acc.png, rgba_city.png" in said["layers"][1]
    made = import_capture(
        tmp_path / "out", tmp_path / "data", "multilight", "mine", ImportOptions(width=width)
    )
    after, truth = open_capture(made / "capture"), open_truth(made / "truth")
    assert [v.name for v in after.train] == ["train_000", "train_001", "train_002"]
    assert [v.name for v in after.test] == ["test_000", "test_001"]
    original = open_truth(scene / "truth")
    for ours, theirs in zip((*after.train, *after.test), (*before.train, *before.test), strict=True):
        assert np.abs(ours.camera.camera_to_world - theirs.camera.camera_to_world).max() < 1e-6
        layers, exact = truth.layers(ours), original.layers(theirs)
        assert set(layers) == {"radiance", "object_id", "base_color", "normal"}
        if width is None:
            seen = exact["object_id"] > 0
            assert ((layers["object_id"] > 0) == seen).all()
            assert np.abs(layers["base_color"] - exact["base_color"])[seen].max() <= 0.5 / 255 + 1e-6
        else:
            assert layers["normal"].shape == (12, 14, 3)
            seen = layers["object_id"] > 0
            blocks = {name: exact[name].reshape(12, 2, 14, 2, -1) for name in layers}
            parts = (blocks["object_id"] > 0).astype(float)
            share = parts.mean(axis=(1, 3))[..., 0]
            assert np.array_equal(seen, share > 0.5)
            base = (blocks["base_color"] * parts).mean(axis=(1, 3)) / np.maximum(share, 1e-6)[..., None]
            assert np.abs(layers["base_color"] - base)[seen].max() <= 0.5 / 255 + 1e-5
            mean = (blocks["normal"] * parts).mean(axis=(1, 3))
            mean /= np.maximum(np.linalg.norm(mean, axis=-1, keepdims=True), 1e-9)
            assert ((layers["normal"] * mean).sum(axis=-1)[seen] > np.cos(np.radians(1))).all()
            np.testing.assert_allclose(np.linalg.norm(layers["normal"], axis=-1)[seen], 1, atol=1e-5)
            assert all((layers[name][~seen] == 0).all() for name in ("base_color", "normal"))
            shown = srgb_decode(np.rint(255 * srgb_encode(exact["radiance"] * before.exposure)) / 255)
            shown = np.where(exact["object_id"][..., None] > 0, shown, 0)
            expected = shown.reshape(12, 2, 14, 2, 3).mean(axis=(1, 3))
            np.testing.assert_allclose(layers["radiance"], expected, atol=1e-5)


def test_a_tensoir_folder_with_faults(tiny_scenes: dict[str, Path], tmp_path: Path):
    export_capture(tiny_scenes["multilight"], "tensoir", tmp_path / "out")
    path = tmp_path / "out" / "train_001" / "metadata.json"
    whole = json.loads(path.read_text())
    for change, message in (
        ({"cam_transform_mat": "1,2,3"}, "expected cam_transform_mat as 16 numbers"),
        ({"cam_angle_x": "wide"}, "expected cam_angle_x as a number"),
        ({"cam_angle_x": 0}, "expected a size, fx, fy > 0"),
        ({"imw": 29}, "to be 29x24 pixels, as its camera is, got 28x24"),
    ):
        path.write_text(json.dumps({**whole, **change}))
        with pytest.raises(DatasetError, match=message):
            plan_import(tmp_path / "out", "multilight")
    path.write_text(json.dumps(whole))
    with pytest.raises(DatasetError, match="expected photographs night.png"):
        plan_import(tmp_path / "out", "multilight", ImportOptions(model="night"))


def test_a_capture_alone_is_written_as_tensoir_without_truth(tiny_scenes: dict[str, Path], tmp_path: Path):
    capture = open_capture(tiny_scenes["dark"] / "capture")
    write_tensoir(capture, None, tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["train_000", "train_001", "train_002"]
    assert sorted(p.name for p in (tmp_path / "train_000").iterdir()) == ["metadata.json", "rgba.png"]

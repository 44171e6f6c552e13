# SPDX-License-Identifier: Apache-2.0
"""Captures to nerfstudio and COLMAP and back, and folders of other programs with faults planted in them."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from graycard import (
    TRACKS,
    Capture,
    DatasetError,
    GraycardError,
    OutputError,
    UnknownNameError,
    View,
    capture_folders,
    look_at,
    open_capture,
    open_truth,
    srgb_decode,
    srgb_encode,
)
from graycard.dataset import manifest_of
from graycard.exchange import ExchangeFormat, ImportOptions, export_capture, import_capture
from graycard.io import sha256_of_files, write_rgb

FORMATS: tuple[ExchangeFormat, ...] = ("nerfstudio", "colmap", "colmap-binary", "blender")
KEPT, TURNED = np.array([0.1, -0.2, 1.5]), np.diag([1.0, -1.0, -1.0, 1.0])


@pytest.fixture(params=FORMATS)
def exported(request: pytest.FixtureRequest, tiny_scenes: dict[str, Path], tmp_path: Path) -> Path:
    export_capture(tiny_scenes["dark"], request.param, tmp_path / "out")
    return tmp_path / "out"


def take_in(folder: Path, dataset: Path, track: str = "dark", **options: Any) -> Capture:
    chosen = ImportOptions(**options)
    return open_capture(import_capture(folder, dataset, track, "mine", chosen) / "capture")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Ten photographs and a transforms.json with global intrinsics, as another program writes it."""
    frames = []
    for i in range(10):
        pose = look_at(np.array([2.0, i / 4, 1.0]), np.zeros(3)) @ TURNED
        frames.append({"file_path": f"./images/{i:02d}.png", "transform_matrix": pose.tolist()})
        path = tmp_path / "source" / "images" / f"{i:02d}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(np.full((6, 8, 3), 20 * i + 10, np.uint8)).save(path)
    index = {"w": 8, "h": 6, "fl_x": 7.0, "fl_y": 7.5, "cx": 4.25, "cy": 3, "k1": 0.0, "frames": frames}
    (tmp_path / "source" / "transforms.json").write_text(json.dumps(index))
    return tmp_path / "source"


def change(folder: Path, edit: Callable[[dict[str, Any]], Any]) -> None:
    path = folder / "transforms.json"
    index = json.loads(path.read_text())
    edit(index)
    path.write_text(json.dumps(index))


@pytest.mark.parametrize("track", TRACKS)
@pytest.mark.parametrize("kind", FORMATS)
def test_a_capture_comes_back(kind: ExchangeFormat, track: str, tiny_scenes: dict[str, Path], tmp_path: Path):
    before = export_capture(tiny_scenes[track], kind, tmp_path / "out")
    after = take_in(tmp_path / "out", tmp_path / "data", track)
    name = names_after(kind)
    assert {(v.name, v.split) for v in after.views} == {(name(v), v.split) for v in before.views}
    for view in before.views:
        camera = after.view(name(view)).camera
        assert np.abs(camera.camera_to_world - view.camera.camera_to_world).max() < 1e-6
        assert np.abs(camera.K - view.camera.K).max() < 1e-6
        assert (camera.width, camera.height) == (view.camera.width, view.camera.height)
    assert after.light_on_camera == before.light_on_camera
    has_masks = kind != "blender"  # that layout has none
    assert (after.target is None) == (before.target is None or not has_masks)
    for view in before.train:
        shown = srgb_encode(before.photograph(view) * before.exposure)
        again = srgb_encode(after.photograph(after.view(name(view))))
        assert np.abs(again - shown).max() <= 0.5 / 255 + 1e-6
        if before.target is not None and has_masks:
            same = after.target_mask(after.view(view.name)) == before.target_mask(view)
            assert same.all()
            assert before.target_mask(view).any()


def names_after(kind: str) -> Callable[[View], str]:
    """NeRF-synthetic keeps views of each split in a folder, which begins their names, once."""
    if kind != "blender":
        return lambda view: view.name
    return lambda view: f"{view.split}_{view.name.removeprefix(f'{view.split}_')}"


def test_held_out_photographs_are_not_exported(exported: Path):
    names = {p.stem for folder in ("images", "train", "test") for p in (exported / folder).glob("*")}
    assert {name.removeprefix("train_") for name in names} == {"000", "002", "004"}
    assert len(list(exported.rglob("*.png"))) == 3


def test_nerfstudio_axes_and_lists(tiny_scenes: dict[str, Path], tmp_path: Path):
    capture = export_capture(tiny_scenes["tabletop"], "nerfstudio", tmp_path / "out")
    index = json.loads((tmp_path / "out" / "transforms.json").read_text())
    assert "applied_transform" not in index
    view, frame = capture.train[0], index["frames"][0]
    matrix = np.array(frame["transform_matrix"])
    np.testing.assert_allclose(matrix[:3, 2], -view.camera.forward, atol=1e-15)  # OpenGL looks along -z
    assert matrix[2, 1] > 0  # its y is up, as the world's z is
    assert index["train_filenames"] == [f"images/{v.name}.png" for v in capture.train]
    assert index["test_filenames"] == [f"images/{v.name}.png" for v in capture.test]
    assert (tmp_path / "out" / frame["file_path"]).is_file()  # nerfstudio opens the first to learn its size
    mask = np.asarray(Image.open(tmp_path / "out" / frame["mask_path"]))
    assert ((mask == 0) == capture.target_mask(view)).all()  # what is black is ignored
    assert all("mask_path" in f for f in index["frames"])  # nerfstudio wants one for all frames or none


def test_colmap_projects_like_the_camera(tiny_scenes: dict[str, Path], tmp_path: Path):
    """By COLMAP's own formula for a unit quaternion, not by the library that wrote it."""
    capture = export_capture(tiny_scenes["dark"], "colmap", tmp_path / "out")
    lines = (tmp_path / "out" / "sparse" / "0" / "images.txt").read_text().splitlines()
    assert lines[2] == ""  # the keypoints
    fields = lines[1].split()
    w, x, y, z, *t = map(float, fields[1:8])
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    camera = (tmp_path / "out" / "sparse" / "0" / "cameras.txt").read_text().splitlines()[1].split()
    fx, fy, cx, cy = map(float, camera[4:])
    local = rotation @ KEPT + t
    expected, depth = capture.train[0].camera.project(KEPT)
    np.testing.assert_allclose([fx * local[0] / local[2] + cx, fy * local[1] / local[2] + cy], expected)
    assert local[2] == pytest.approx(float(depth))
    assert fields[9] == "train_000.png"
    assert camera[1] == "PINHOLE"


def test_every_nth_photograph_is_held_out_and_that_is_recorded(folder: Path, tmp_path: Path):
    capture = take_in(folder, tmp_path / "data")
    assert [v.name for v in capture.test] == ["00", "08"]  # as LLFF, mip-NeRF 360 and 3DGS count
    assert manifest_of(capture).settings == {"format": "nerfstudio", "hold_out_every": 8}
    assert [v.name for v in take_in(folder, tmp_path / "b", hold_out="3").test] == ["00", "03", "06", "09"]
    assert take_in(folder, tmp_path / "c", hold_out="0").test == ()


def test_held_out_views_may_be_named(folder: Path, tmp_path: Path):
    capture = take_in(folder, tmp_path / "data", hold_out="03, 05.png")
    assert [v.name for v in capture.test] == ["03", "05"]
    assert manifest_of(capture).settings["split"] == "as chosen"
    (tmp_path / "list.txt").write_text("\ufeff# mine\n04\n\n07.png\n", encoding="utf-8")
    assert [v.name for v in take_in(folder, tmp_path / "b", hold_out=str(tmp_path / "list.txt")).test] == [
        "04",
        "07",
    ]
    paths = f"images/02.png, images/04, {folder / 'images' / '06.png'}"
    assert [v.name for v in take_in(folder, tmp_path / "c", hold_out=paths).test] == ["02", "04", "06"]
    for bad in ("11", "other/03.png", "ges/03.png", "03.jpg"):
        with pytest.raises(UnknownNameError, match=f"expected a photograph that exists, got '{bad}'"):
            take_in(folder, tmp_path / "d", hold_out=f"03,{bad}")


def test_photographs_become_linear(folder: Path, tmp_path: Path):
    """IEC 61966-2-1 by hand: 128/255 is 0.21586, 10/255 is on the straight piece."""
    Image.fromarray(np.full((6, 8, 3), 128, np.uint8)).save(folder / "images" / "03.png")
    light = np.full((6, 8, 3), 5.5, np.float32)
    write_rgb(folder / "images" / "04.exr", light)
    change(folder, lambda index: index["frames"][4].update(file_path="images/04.exr"))
    Image.fromarray(np.full((6, 8), 128, np.uint8)).save(folder / "images" / "05.jpg", quality=100)
    change(folder, lambda index: index["frames"][5].update(file_path="images/05.jpg"))
    capture = take_in(folder, tmp_path / "data")
    assert capture.photograph(capture.view("03")) == pytest.approx(0.21586, abs=1e-5)
    first = Image.fromarray(np.full((6, 8, 3), 10, np.uint8))
    first.save(folder / "images" / "01.png")
    dark = take_in(folder, tmp_path / "again")
    assert dark.photograph(dark.view("01")) == pytest.approx(10 / 255 / 12.92, rel=1e-6)
    assert capture.photograph(capture.view("05")) == pytest.approx(0.21586, abs=2e-3)
    assert (capture.photograph(capture.view("04")) == light).all()
    pixels = np.concatenate([capture.photograph(v).ravel() for v in capture.train])
    assert capture.exposure == pytest.approx(1 / np.percentile(pixels, 99))


def test_a_rounded_pose_is_made_a_rotation(folder: Path, tmp_path: Path):
    change(
        folder,
        lambda index: index["frames"][0].update(
            transform_matrix=np.round(index["frames"][0]["transform_matrix"], 4).tolist()[:3]
        ),
    )
    camera = take_in(folder, tmp_path / "data").view("00").camera
    expected = look_at(np.array([2.0, 0, 1.0]), np.zeros(3))
    assert np.abs(camera.camera_to_world - expected).max() < 1e-4


def test_masks_elsewhere_than_on_tabletop_are_left_out(tiny_scenes: dict[str, Path], tmp_path: Path):
    export_capture(tiny_scenes["tabletop"], "colmap", tmp_path / "out")
    assert take_in(tmp_path / "out", tmp_path / "data", "multilight").target is None


def give_masks(folder: Path, black: Callable[[int], np.ndarray | bool]) -> None:
    """A mask for each of the ten photographs, black where ``black(number)``."""
    (folder / "masks").mkdir()
    for i in range(10):
        pixels = np.where(np.broadcast_to(black(i), (6, 8)), 0, 255).astype(np.uint8)
        Image.fromarray(pixels).save(folder / "masks" / f"{i:02d}.png")
    change(
        folder,
        lambda index: [f.update(mask_path=f"masks/{i:02d}.png") for i, f in enumerate(index["frames"])],
    )


def some(number: int) -> np.ndarray:
    """An object in one view of two."""
    return np.arange(48).reshape(6, 8) < (number % 2) * 5


def test_an_object_may_be_out_of_sight_in_some_views(folder: Path, tmp_path: Path):
    give_masks(folder, some)
    capture = take_in(folder, tmp_path / "data", "tabletop")
    assert [capture.target_mask(view).sum() for view in capture.train[:2]] == [5, 0]


@pytest.mark.parametrize(
    ("black", "message"),
    [
        (lambda i: False, r"expected an object in some mask of 8, as .*01\.png, got masks without any black"),
        (lambda i: True, r"expected a mask with an object in .*01\.png, got one that is all black"),
        (lambda i: some(i) | (i == 3), r"in .*03\.png, got one that is all black. Masks are black where the"),
    ],
)
def test_masks_that_show_no_object_or_nothing_else_are_refused(
    black: Callable[[int], np.ndarray | bool], message: str, folder: Path, tmp_path: Path
):
    give_masks(folder, black)
    with pytest.raises(DatasetError, match=message):
        take_in(folder, tmp_path / "data", "tabletop")
    assert not (tmp_path / "data").exists()
    assert take_in(folder, tmp_path / "data", "multilight").target is None


def test_what_is_wrong_with_a_mask_is_said_of_the_mask(folder: Path, tmp_path: Path):
    give_masks(folder, some)
    Image.fromarray(np.zeros((3, 4), np.uint8)).save(folder / "masks" / "02.png")
    with pytest.raises(DatasetError, match=r"02\.png to be 8x6 pixels, .* got 4x3\. Scale the mask$"):
        take_in(folder, tmp_path / "data", "tabletop")
    (folder / "masks" / "02.png").unlink()
    with pytest.raises(DatasetError, match=r"expected a mask at .*02\.png, got none"):
        take_in(folder, tmp_path / "data", "tabletop")
    change(folder, lambda index: index["frames"][1].update(mask_path="masks/01.exr"))
    with pytest.raises(DatasetError, match=r"expected a mask at .*01\.exr, got none"):
        take_in(folder, tmp_path / "data", "tabletop")


def edit_frame(**new: Any) -> Callable[[dict[str, Any]], Any]:
    return lambda index: index["frames"][2].update(new)


NAN_POSE = [[1, 0, 0, float("nan")], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
FAULTS: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "no frames": (lambda i: i.update(frames=[]), "expected one or more photographs"),
    "frames no list": (lambda i: i.update(frames="none"), "expected a list 'frames'"),
    "missing image": (
        edit_frame(file_path="images/nope.png"),
        r"expected a photograph at .*nope\.png, got none",
    ),
    "no image kind": (edit_frame(file_path="transforms.json"), "expected a photograph as .png, .jpg"),
    "no file path": (edit_frame(file_path=None), "expected file_path"),
    "wrong size": (lambda i: i.update(w=9), "expected .* to be 9x6 pixels, as its camera is, got 8x6"),
    "half a pixel": (lambda i: i.update(w=8.5), "expected w as a whole number"),
    "no width": (lambda i: i.pop("w"), "expected w as a whole number .* got None"),
    "negative focal": (lambda i: i.update(fl_x=-7), "fx, fy > 0"),
    "panorama": (lambda i: i.update(camera_model="EQUIRECTANGULAR"), "got EQUIRECTANGULAR"),
    "k5 of no model": (lambda i: i.update(k5=0.02), "got PINHOLE with k5 0.02"),
    "k4 of no model": (lambda i: i.update(k4=0.02), "got PINHOLE with k4 0.02"),
    "thin prism": (lambda i: i.update(camera_model="OPENCV", sx1=0.1), "got OPENCV with sx1 0.1"),
    "text for k1": (lambda i: i.update(k1="0.02"), "expected k1 as a number"),
    "seven parameters": (lambda i: i.update(distortion_params=[0.0] * 7), "distortion_params as up to 6"),
    "text for parameters": (lambda i: i.update(distortion_params="none"), "distortion_params as up to 6"),
    "distortion twice": (lambda i: i.update(k1=0.1, distortion_params=[0.2]), "expected distortion once"),
    "NaN pose": (edit_frame(transform_matrix=NAN_POSE), "NaN is no number of JSON"),
    "scaled pose": (edit_frame(transform_matrix=(2 * np.eye(4)).tolist()), "expected camera_to_world"),
    "mirrored pose": (edit_frame(transform_matrix=np.diag([1, 1, -1, 1]).tolist()), "right-handed"),
    "short pose": (edit_frame(transform_matrix=[[1, 0], [0, 1]]), "expected transform_matrix as 4x4"),
    "ragged pose": (edit_frame(transform_matrix=[[1], [0, 1]]), "expected transform_matrix as 4x4"),
    "double name": (edit_frame(file_path="./images/03.png"), "photographs of different names.* 2 named '03'"),
    "unknown test": (lambda i: i.update(test_filenames=["x.png"]), "to name frames, got 'x.png'"),
    "list no list": (lambda i: i.update(test_filenames="x"), "expected test_filenames as a list"),
    "mask for one": (edit_frame(mask_path="images/02.png"), "expected a mask for each"),
    "all held out": (
        lambda i: i.update(test_filenames=[f["file_path"] for f in i["frames"]]),
        "expected a photograph that is not held out",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_broken_nerfstudio_folder_is_named(fault: str, folder: Path, tmp_path: Path):
    edit, message = FAULTS[fault]
    change(folder, edit)
    with pytest.raises(DatasetError, match=message):
        take_in(folder, tmp_path / "data", "tabletop")
    assert not (tmp_path / "data").exists()


def test_a_list_may_name_frames_with_or_without_files(folder: Path, tmp_path: Path):
    names = [f"./images/{i:02d}.png" for i in range(4)]
    lists = {"test_filenames": names[1:2], "val_filenames": names[2:4], "train_filenames": names[3:]}
    change(folder, lambda index: index.update(lists))
    (folder / "images" / "02.png").unlink()
    capture = take_in(folder, tmp_path / "data")
    assert [v.name for v in capture.test] == ["01", "02"]
    assert manifest_of(capture).settings["split"] == "as listed"


COLMAP_FAULTS: dict[str, tuple[str, str, str, str]] = {
    "panorama": ("cameras.txt", "1 PINHOLE", "1 EQUIRECTANGULAR", "expected a camera of model .* got EQUIR"),
    "folded": (
        "cameras.txt",
        "1 PINHOLE 28 24",
        "1 RADIAL 28 24 30 14 12 -9000 9\n2 PINHOLE 28 24",
        "a lens that shows",
    ),
    "no size": ("cameras.txt", "1 PINHOLE 28", "1 PINHOLE 0", "expected a size, fx, fy > 0"),
    "parameters": ("cameras.txt", " 14.0 12.0", " 14.0", "expected 4 parameters of PINHOLE"),
    "size": ("cameras.txt", "PINHOLE 28", "PINHOLE 27", "to be 27x24 pixels, as its camera is, got 28x24"),
    "no number": ("cameras.txt", " 14.0", " fourteen", "expected numbers in .*cameras.txt, line 2"),
    "short camera": (
        "cameras.txt",
        "1 PINHOLE 28 24",
        "1 PINHOLE\n2 PINHOLE 28 24",
        "expected CAMERA_ID MODEL",
    ),
    "camera twice": ("cameras.txt", "1 PINHOLE", "1 PINHOLE 28 24 9 9 9 9\n1 PINHOLE", "got 1 again"),
    "no camera": ("cameras.txt", "1 PINHOLE", "7 PINHOLE", "expected a camera of cameras.txt .* Known: 7"),
    "missing image": (
        "images.txt",
        "train_002.png",
        "nope.png",
        "expected a photograph at .*nope.png, got none",
    ),
    "double name": ("images.txt", "train_002.png", "train_000.png", "2 named 'train_000'"),
    "short line": ("images.txt", " 1 train_002.png", "", "expected IMAGE_ID QW"),
    "one line each": ("images.txt", "000.png\n\n", "000.png\n", "expected keypoints"),
    "NaN pose": ("images.txt", "1 0.", "1 nan0.", "expected numbers"),
}


@pytest.mark.parametrize("fault", COLMAP_FAULTS)
def test_a_broken_colmap_folder_is_named(fault: str, tiny_scenes: dict[str, Path], tmp_path: Path):
    export_capture(tiny_scenes["dark"], "colmap", tmp_path / "out")
    name, old, new, message = COLMAP_FAULTS[fault]
    path = tmp_path / "out" / "sparse" / "0" / name
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(DatasetError, match=message):
        take_in(tmp_path / "out", tmp_path / "data")
    assert not (tmp_path / "data").exists()


@pytest.mark.parametrize("numbers", ["nan 0 0 0 0 0 0", "0 0 0 0 0 0 0", "1 0 0 0 0 inf 0"])
def test_a_colmap_pose_that_is_none(numbers: str, tiny_scenes: dict[str, Path], tmp_path: Path):
    export_capture(tiny_scenes["dark"], "colmap", tmp_path / "out")
    path = tmp_path / "out" / "sparse" / "0" / "images.txt"
    path.write_text(f"1 {numbers} 1 train_000.png\n\n")
    with pytest.raises(DatasetError, match="expected a unit quaternion and a finite translation"):
        take_in(tmp_path / "out", tmp_path / "data")


def test_simple_pinholes_and_keypoints_are_read(tiny_scenes: dict[str, Path], tmp_path: Path):
    export_capture(tiny_scenes["dark"], "colmap", tmp_path / "out")
    model = tmp_path / "out" / "sparse" / "0"
    (model / "cameras.txt").write_text("\n9 SIMPLE_PINHOLE 28 24 30.5 14 12\n")
    (model / "images.txt").write_text("# a\n4 1 0 0 0 0.5 0 2 9 train_000.png\n1.5 2.5 -1 3 4 17\n")
    capture = take_in(tmp_path / "out", tmp_path / "data")
    camera = capture.train[0].camera
    np.testing.assert_array_equal(camera.K, [[30.5, 0, 14], [0, 30.5, 12], [0, 0, 1]])
    np.testing.assert_array_equal(camera.position, [-0.5, 0, -2])


def test_a_binary_model_that_breaks_off(tmp_path: Path):
    (tmp_path / "sparse").mkdir()
    (tmp_path / "sparse" / "cameras.bin").write_bytes(b"x")
    with pytest.raises(DatasetError, match=r"expected 8 bytes more in .*cameras\.bin at byte 0, got 1"):
        take_in(tmp_path, tmp_path / "data")


def test_a_model_without_its_images(tmp_path: Path):
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 8 6 7 7 4 3\n")
    with pytest.raises(DatasetError, match=r"expected a COLMAP text file at .*images\.txt"):
        take_in(tmp_path, tmp_path / "data")


def break_pixels(path: Path) -> None:
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (6, 8, 3), np.uint8)).save(path)
    path.write_bytes(path.read_bytes()[:-60])


def make_transparent(path: Path) -> None:
    Image.fromarray(np.full((6, 8, 4), 100, np.uint8)).save(path)


def add_endless_text(path: Path) -> None:
    text = PngInfo()
    text.add_text("a", "x" * 10**7, zip=True)
    Image.fromarray(np.full((6, 8, 3), 100, np.uint8)).save(path, pnginfo=text)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (break_pixels, "expected a whole image at"),
        (add_endless_text, "expected a whole image at"),
        (make_transparent, "expected an opaque photograph"),
        (lambda path: path.write_text("no image"), "expected a whole image at"),
    ],
)
def test_a_broken_photograph_leaves_nothing(
    spoil: Callable[[Path], None], message: str, folder: Path, tmp_path: Path
):
    spoil(folder / "images" / "06.png")
    with pytest.raises(DatasetError, match=message):
        take_in(folder, tmp_path / "data")
    assert not (tmp_path / "data").exists()


def test_light_that_is_not_finite(folder: Path, tmp_path: Path):
    write_rgb(folder / "images" / "04.exr", np.full((6, 8, 3), np.nan))
    change(folder, lambda index: index["frames"][4].update(file_path="images/04.exr"))
    with pytest.raises(DatasetError, match="expected finite light"):
        take_in(folder, tmp_path / "data")


def test_black_photographs(folder: Path, tmp_path: Path):
    for path in (folder / "images").iterdir():
        Image.fromarray(np.zeros((6, 8, 3), np.uint8)).save(path)
    with pytest.raises(DatasetError, match="expected photographs with some light"):
        take_in(folder, tmp_path / "data")


@pytest.mark.parametrize(
    ("track", "scene", "options", "message"),
    [
        ("drak", "x", {}, "did you mean 'dark'"),
        ("dark", "../x", {}, "Give the scene another --scene"),
        ("dark", ".x", {}, "Give the scene another --scene"),
        ("dark", "x", {"hold_out": "1"}, "expected to hold out every 2nd photograph or fewer"),
        ("dark", "x", {"hold_out": "-3"}, "expected to hold out"),
        ("dark", "x", {"width": 0}, "expected a width of 1 or more pixels"),
    ],
)
def test_wrong_options(
    track: str, scene: str, options: dict[str, Any], message: str, folder: Path, tmp_path: Path
):
    with pytest.raises(GraycardError, match=message):
        import_capture(folder, tmp_path / "data", track, scene, ImportOptions(**options))
    assert not (tmp_path / "data").exists()


def test_what_is_there_is_never_replaced(folder: Path, tiny_scenes: dict[str, Path], tmp_path: Path):
    take_in(folder, tmp_path / "data")
    before = sha256_of_files(tmp_path / "data")
    with pytest.raises(OutputError, match="expected a new or an empty folder"):
        take_in(folder, tmp_path / "data")
    with pytest.raises(OutputError, match="expected a new or an empty folder"):
        export_capture(tiny_scenes["dark"], "colmap", folder)
    assert sha256_of_files(tmp_path / "data") == before
    with pytest.raises(OutputError, match="expected an output folder that can be written to"):
        export_capture(tiny_scenes["dark"], "colmap", Path("/proc/graycard"))


def test_an_unknown_format(tiny_scenes: dict[str, Path], tmp_path: Path):
    with pytest.raises(UnknownNameError, match="did you mean 'colmap'"):
        export_capture(tiny_scenes["dark"], "colmp", tmp_path)  # pyright: ignore[reportArgumentType]


def test_an_imported_capture_has_no_truth_and_says_so(folder: Path, tmp_path: Path):
    take_in(folder, tmp_path / "data")
    with pytest.raises(DatasetError, match="got an imported capture, which has no truth"):
        open_truth(tmp_path / "data" / "dark" / "mine" / "truth")
    assert [p.name for p in capture_folders(tmp_path / "data")] == ["mine"]


def test_a_half_written_truth_hides_its_scene(make_scene: Callable[..., Path]):
    scene = make_scene()
    assert capture_folders(scene.parents[1]) == [scene]
    (scene / "truth" / "manifest.json").unlink()
    assert capture_folders(scene.parents[1]) == []


def test_srgb_decode_undoes_encode():
    linear = np.linspace(0, 1, 1001)
    np.testing.assert_allclose(srgb_decode(srgb_encode(linear)), linear, atol=1e-12)
    assert srgb_decode(np.array([-1.0, 2.0])).tolist() == [0, 1]

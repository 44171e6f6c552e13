# SPDX-License-Identifier: Apache-2.0
"""Models that COLMAP's own code writes, read by ours, and the reverse; and models with faults in them."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from graycard import DatasetError, UnknownNameError, open_capture
from graycard.dataset import manifest_of
from graycard.exchange import ExchangeFormat, ImportOptions, ImportPlan, export_capture, plan_import
from graycard.exchange.colmap._binary import MODELS
from graycard.io import write_manifest
from posed_photographs import LENSES, reconstruct, rewrite, write_folder
from sparse_points import with_points

pycolmap = pytest.importorskip("pycolmap")
TEN = list(LENSES.items())


@pytest.fixture(scope="module")
def ten() -> Any:
    return reconstruct(TEN)


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A folder with a binary model of three images."""
    return write_folder(tmp_path / "small", reconstruct(TEN[:3]))


def said(plan: ImportPlan, what: str) -> list[str]:
    return [f"{row.count} {row.said}" for row in plan.rows if row.what == what]


def test_the_models_are_those_of_colmap():
    for number, (name, count) in enumerate(MODELS):
        model = pycolmap.CameraModelId.__members__[name]
        assert int(model) == number
        assert len(pycolmap.Camera.create_from_model_id(1, model, 50, 100, 80).params) == count
    assert len(MODELS) == len(pycolmap.CameraModelId.__members__) - 1  # INVALID


@pytest.mark.parametrize("binary", [True, False])
def test_what_colmap_writes_is_read(binary: bool, ten: Any, tmp_path: Path):
    folder = write_folder(tmp_path / "ten", ten, binary=binary)
    plan = plan_import(folder, "multilight", ImportOptions(hold_out="0"))
    assert len(plan.shots) == len(TEN) > 10
    for number, shot in enumerate(plan.shots, 1):
        image = ten.images[number]
        assert shot.name == f"walk one_IMG {number:02d}"
        assert np.abs(shot.camera.world_to_camera[:3] - image.cam_from_world().matrix()).max() < 1e-6
        camera = image.camera
        focal = camera.focal_length_x, camera.focal_length_y
        assert np.abs(shot.camera.K[[0, 1], [0, 1]] - focal).max() < 1e-6
        assert (shot.lens is None) == (camera.model_name in ("PINHOLE", "SIMPLE_PINHOLE"))
    points = plan.points
    assert points is not None
    theirs = [ten.points3D[i] for i in sorted(ten.point3D_ids())]
    assert np.abs(points.positions - [p.xyz for p in theirs]).max() < 1e-6
    assert (points.colors == [p.color for p in theirs]).all()
    assert points.views.tolist() == [p.track.length() for p in theirs]
    for number, shot in enumerate(plan.shots):  # keypoints are where the undistorted pinhole sees the points
        here = points.view == number
        expected = shot.camera.project(points.positions[points.point[here]])[0]
        assert np.abs(points.pixel[here] - expected).max() < 1e-3
    assert said(plan, "points") == ["12 kept, with 156 observations"]


@pytest.mark.parametrize("kind", ["colmap", "colmap-binary"])
def test_colmap_reads_what_we_write(
    kind: ExchangeFormat, tiny_scenes: dict[str, Path], tmp_path: Path, make_scene: Any
):
    scene = make_scene()
    manifest = manifest_of(open_capture(scene / "capture"))
    with_points(scene)
    write_manifest(scene / "capture", manifest)
    capture = export_capture(scene, kind, tmp_path / "out")
    found = pycolmap.Reconstruction(tmp_path / "out" / "sparse" / "0")
    assert {image.name for image in found.images.values()} == {f"{v.name}.png" for v in capture.train}
    for image in found.images.values():
        camera = capture.view(Path(image.name).stem).camera
        assert np.abs(image.cam_from_world().matrix() - camera.world_to_camera[:3]).max() < 1e-6
        assert np.abs(image.camera.calibration_matrix() - camera.K).max() < 1e-6
        assert (image.camera.width, image.camera.height) == (camera.width, camera.height)
    points = capture.points()
    assert len(points) > 0
    order = sorted(found.point3D_ids())
    np.testing.assert_allclose([found.points3D[i].xyz for i in order], points.positions, atol=1e-6)
    assert [found.points3D[i].track.length() for i in order] == points.views.tolist()
    element = found.points3D[order[0]].track.elements[0]
    xy = found.images[element.image_id].points2D[element.point2D_idx].xy
    assert np.abs(points.pixel[points.point == 0] - xy).max(axis=-1).min() < 1e-4
    assert pycolmap.Reconstruction(tmp_path / "out" / "held_out").num_images() == len(capture.test)


@pytest.mark.parametrize("name", ["cameras.bin", "images.bin", "points3D.bin"])
def test_a_binary_file_that_breaks_off_or_goes_on_is_refused(name: str, small: Path):
    """COLMAP's own reader takes most of these without a word, or asks for all memory."""
    path = small / "sparse" / "0" / name
    whole = path.read_bytes()
    for end in [*range(0, 40), *range(40, len(whole), 37), len(whole) - 1]:
        path.write_bytes(whole[:end])
        with pytest.raises(DatasetError, match=f"bytes more in .*{name}|no end of it"):
            plan_import(small, "dark")
    path.write_bytes(whole + b"x")
    with pytest.raises(
        DatasetError, match=f"expected .*{name} to end at byte {len(whole)}, got 1 bytes more"
    ):
        plan_import(small, "dark")
    path.write_bytes(struct.pack("<Q", 2**62) + whole[8:])
    with pytest.raises(DatasetError, match="cut off or damaged"):
        plan_import(small, "dark")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (b"../../../../etc/01", "expected a path below"),
        (b"/etc/passwd/02.JPG", "expected a path below"),
        (b"C:\\windows\\ab.JPG", "expected a path below"),
        (b"walk\none/IMG 1.JPG", "expected the name of an image"),
        (b"walk\x1bone/IMG 1.JPG", "expected the name of an image"),
        (b"walk\xffone/IMG 1.JPG", "expected the name of an image"),
        (b"walk one/IM\xe2\x80\xaeG.JPG", "expected the name of an image"),
    ],
)
def test_names_of_a_binary_model_pass_the_gate(name: bytes, message: str, small: Path):
    old = b"walk one/IMG 01.JPG"
    rewrite(small / "sparse" / "0" / "images.bin", lambda data: data.replace(old, name.ljust(len(old), b"x")))
    with pytest.raises(DatasetError, match=message):
        plan_import(small, "dark")


@pytest.mark.parametrize(
    ("file", "start", "value", "message"),
    [
        ("cameras.bin", 12, struct.pack("<i", 99), "expected a camera model from 0 to 17"),
        ("cameras.bin", 12, struct.pack("<i", 17), "got EQUIRECTANGULAR"),
        ("cameras.bin", 16, struct.pack("<Q", 2**40), "and a size in"),
        ("images.bin", 12, struct.pack("<d", float("nan")), "expected a unit quaternion"),
        ("images.bin", 12, struct.pack("<d", 1e300), "expected a unit quaternion"),
        ("images.bin", 44, struct.pack("<d", 1e300), "and a finite translation"),
        ("images.bin", 68, struct.pack("<I", 77), "expected a camera of cameras.txt .* got 77"),
        ("points3D.bin", 16, struct.pack("<d", float("inf")), "expected finite positions"),
        ("points3D.bin", 63, struct.pack("<I", 4000), "got keypoint 4000 of image 1, which has 12"),
    ],
)
def test_numbers_that_are_none(file: str, start: int, value: bytes, message: str, small: Path):
    rewrite(small / "sparse" / "0" / file, lambda data: data[:start] + value + data[start + len(value) :])
    with pytest.raises(DatasetError, match=message):
        plan_import(small, "dark")


def test_tracks_of_images_that_are_gone_are_counted(small: Path):
    rewrite(
        small / "sparse" / "0" / "points3D.bin",
        lambda data: data[:59] + struct.pack("<I", 1234) + data[63:],
    )
    plan = plan_import(small, "dark", ImportOptions(hold_out="0"))
    assert said(plan, "observations") == ["1 of images that the model does not have, left out of the tracks"]
    assert plan.points is not None
    assert plan.points.views.tolist() == [2, *[3] * 11]


def test_points_that_only_held_out_views_see_are_counted(small: Path):
    found = reconstruct(TEN[:3])
    for number in (2, 3):
        found.delete_observation(number, 0)
    rng = write_folder(small.parent / "b", found)
    plan = plan_import(rng, "dark")  # the first image is held out
    assert said(plan, "held out") == ["1 each 8th by name, from the first: walk one_IMG 01"]
    assert sum(int(text.split()[0]) for text in said(plan, "points")) >= 11


def test_the_largest_of_several_models_is_taken_and_another_may_be(tmp_path: Path):
    folder = write_folder(tmp_path / "split", reconstruct(TEN[:2]), model="sparse/0")
    write_folder(folder, reconstruct(TEN[:5]), model="sparse/1")
    write_folder(folder, reconstruct(TEN[:3]), model="sparse/2", binary=False)
    plan = plan_import(folder, "dark")
    assert len(plan.shots) == 5
    assert said(plan, "models") == [
        "3 found; taken is sparse/1, of most photographs (5), left sparse/0 (2), sparse/2 (3): "
        "--model chooses"
    ]
    assert [row.warns for row in plan.rows if row.what == "models"] == [True]
    assert len(plan_import(folder, "dark", ImportOptions(model="2")).shots) == 3
    assert len(plan_import(folder, "dark", ImportOptions(model="sparse/0")).shots) == 2
    with pytest.raises(UnknownNameError, match="sparse/1"):
        plan_import(folder, "dark", ImportOptions(model="7"))


def test_photographs_lie_where_the_names_of_the_model_are_found(tmp_path: Path):
    folder = write_folder(tmp_path / "a", reconstruct(TEN[:2]), photographs="my pictures")
    plan = plan_import(folder, "dark")
    assert said(plan, "photographs") == ["2 found in my pictures/, by the names of the model's images"]
    flat = write_folder(tmp_path / "b", reconstruct(TEN[:2]), model="sparse")
    assert len(plan_import(flat, "dark").shots) == 2


def test_a_model_of_few_of_the_photographs_looks_wrong(tmp_path: Path):
    folder = write_folder(tmp_path / "a", reconstruct(TEN[:3]))
    for number in range(3, 10):
        (folder / "images" / "walk one" / f"IMG {number + 1:02d}.JPG").write_bytes(b"never read")
    row = next(row for row in plan_import(folder, "dark").rows if row.what == "photographs")
    assert (row.count, row.warns) == (7, True)
    assert "images/walk one/IMG 04.JPG" in row.said
    assert "cameras hold 3 of 10: is this a part of a split model?" in row.said

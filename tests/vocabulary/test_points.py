# SPDX-License-Identifier: Apache-2.0
"""Sparse points on disk, and in the folders of other programs."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from graycard import DatasetError, Points, open_capture
from graycard.dataset import manifest_of
from graycard.exchange import ExchangeFormat, export_capture, import_capture
from graycard.io import write_manifest
from graycard.points import read_points, write_points


def cloud(count: int = 5, views: tuple[int, ...] = (0, 2)) -> Points:
    rng = np.random.default_rng(3)
    point, view = np.repeat(np.arange(count), len(views)), np.tile(views, count)
    colors = rng.integers(0, 256, (count, 3)).astype(np.uint8)
    return Points(rng.normal(size=(count, 3)), colors, point, view, rng.uniform(0, 24, (len(point), 2)))


def assert_same(found: Points, expected: Points, tracks: bool = True) -> None:
    np.testing.assert_allclose(found.positions, expected.positions, atol=1e-6)
    assert (found.colors == expected.colors).all()
    assert found.views.sum() == (expected.views.sum() if tracks else 0)
    if tracks:
        order, wanted = (np.lexsort((p.view, p.point)) for p in (found, expected))
        for name in ("point", "view", "pixel"):
            np.testing.assert_allclose(
                getattr(found, name)[order], getattr(expected, name)[wanted], atol=1e-5
            )


@pytest.mark.parametrize("count", [0, 5])
@pytest.mark.parametrize("tracks", [True, False])
def test_points_survive_the_disk(count: int, tracks: bool, tmp_path: Path) -> None:
    write_points(tmp_path / "p.ply", cloud(count), tracks=tracks)
    assert_same(read_points(tmp_path / "p.ply"), cloud(count), tracks)


def test_a_capture_without_points_has_none(tiny_scenes: dict[str, Path]) -> None:
    assert len(open_capture(tiny_scenes["dark"] / "capture").points()) == 0


@pytest.mark.parametrize("kind", ["colmap", "colmap-binary", "nerfstudio"])
def test_points_go_out_and_come_back(
    kind: ExchangeFormat, make_scene: Callable[..., Path], tmp_path: Path
) -> None:
    scene = make_scene()
    manifest = manifest_of(open_capture(scene / "capture"))
    write_points(scene / "capture" / "points.ply", cloud())
    write_manifest(scene / "capture", manifest)
    before = export_capture(scene, kind, tmp_path / "out")
    after = open_capture(import_capture(tmp_path / "out", tmp_path / "data", "dark", "mine") / "capture")
    found, given = after.points(), before.points()
    assert_same(found, given, tracks=False) if kind == "nerfstudio" else None
    if kind != "nerfstudio":
        names = [v.name for v in after.views]
        number = np.array([names.index(v.name) for v in before.views])
        assert_same(
            found, Points(given.positions, given.colors, given.point, number[given.view], given.pixel)
        )


@pytest.fixture
def model(make_scene: Callable[..., Path], tmp_path: Path) -> Path:
    export_capture(make_scene(), "colmap", tmp_path / "out")
    path = tmp_path / "out" / "sparse" / "0" / "images.txt"
    lines = path.read_text().splitlines()
    lines[2] = "1.5 2.5 1 3.5 4.5 -1"
    path.write_text("\n".join(lines) + "\n")
    return tmp_path / "out"


def take_in(folder: Path, points: str, tmp_path: Path) -> Points:
    (folder / "sparse" / "0" / "points3D.txt").write_text(points)
    scene = import_capture(folder, tmp_path / "data", "dark", "mine")
    return open_capture(scene / "capture").points()


def test_a_point_of_another_program_is_read(model: Path, tmp_path: Path) -> None:
    found = take_in(model, "# a\n1 0.1 0.2 0.3 9 8 7 0.5 1 0\n4 1 1 1 1 1 1 0\n", tmp_path)
    np.testing.assert_allclose(found.positions, [[0.1, 0.2, 0.3], [1, 1, 1]], atol=1e-7)
    assert found.colors[0].tolist() == [9, 8, 7]
    assert found.pixel.tolist() == [[1.5, 2.5]]


@pytest.mark.parametrize(
    "line",
    ["1 0 0", "1 0 0 0 9 8 7 0.5 1", "1 0 0 0 9 8 7 0.5 1 2", "1 0 0 0 9 8 7 0.5 1 -1", "1 nan 0 0 1 1 1 0"],
)
def test_a_broken_point_is_named(line: str, model: Path, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"expected POINT3D_ID X Y Z .* in .*points3D\.txt, line 1"):
        take_in(model, line + "\n", tmp_path)
    assert not (tmp_path / "data").exists()


HEAD = b"ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty float y\nproperty float z\n"


def test_a_text_ply_with_faces_and_without_colours(tmp_path: Path) -> None:
    faces = b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / "p.ply").write_bytes(HEAD + faces + b"1 2 3\n4 5 6\n3 0 1 1\n")
    found = read_points(tmp_path / "p.ply")
    assert found.positions.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert (found.colors == 128).all()


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "without its header"),
        (b"ply\nformat binary_middle_endian 1.0\nend_header\n", "got another kind"),
        (HEAD + b"end_header\n1 2 3\n", "cut off or damaged: 1 of 2 rows"),
        (HEAD + b"end_header\n1 2 3\n1 nan 3\n", "expected finite positions"),
        (b"ply\nformat ascii 1.0\nelement face 0\nend_header\n", "expected a PLY with x, y, z"),
        (HEAD.replace(b"double", b"quad") + b"end_header\n", "cut off or damaged"),
    ],
)
def test_a_broken_ply_is_named(data: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "p.ply").write_bytes(data)
    with pytest.raises(DatasetError, match=message):
        read_points(tmp_path / "p.ply")


def test_a_missing_or_cut_off_ply_is_named(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="expected points at"):
        read_points(tmp_path / "none.ply")
    write_points(tmp_path / "p.ply", cloud())
    (tmp_path / "p.ply").write_bytes((tmp_path / "p.ply").read_bytes()[:-3])
    with pytest.raises(DatasetError, match="cut off or damaged"):
        read_points(tmp_path / "p.ply")


def test_shapes_and_indices_are_checked() -> None:
    good = cloud()
    with pytest.raises(ValueError, match="expected points"):
        Points(good.positions, good.colors[:1], good.point, good.view, good.pixel)
    with pytest.raises(ValueError, match="expected observations of points 0 to 4, got 5"):
        Points(good.positions, good.colors, good.point + 1, good.view, good.pixel)

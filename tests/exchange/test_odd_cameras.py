# SPDX-License-Identifier: Apache-2.0
"""Cameras, lists and models that are well-formed and look wrong: each is told with a warning, or refused."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from graycard import DatasetError
from graycard.exchange import ImportOptions, plan_import
from made_pictures import write_transforms

W, H = 32, 24
NAMES = [f"{i}.png" for i in range(10)]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in NAMES:
        Image.fromarray(np.full((H, W, 3), 128, np.uint8)).save(tmp_path / name)
    return write_transforms(tmp_path, NAMES, (W, H))


def change(folder: Path, edit: Callable[[dict[str, Any]], Any]) -> None:
    path = folder / "transforms.json"
    index = json.loads(path.read_text())
    edit(index)
    path.write_text(json.dumps(index))


def warnings(folder: Path, **options: Any) -> list[tuple[str, int, str]]:
    rows = plan_import(folder, "dark", ImportOptions(**options)).rows
    return [(row.what, row.count, row.said) for row in rows if row.warns]


def at(index: dict[str, Any], frame: int, place: list[float]) -> None:
    for row, value in enumerate(place):
        index["frames"][frame]["transform_matrix"][row][3] = value


ODD: dict[str, tuple[Callable[[dict[str, Any]], Any], list[tuple[int, str]]]] = {
    "nothing": (lambda i: None, []),
    "outside": (lambda i: i.update(cx=500), [(10, "are cx and cy pixels?")]),
    "negative": (lambda i: i.update(cy=-3), [(10, "are cx and cy pixels?")]),
    "shares": (lambda i: i.update(cx=0.5, cy=0.5), [(10, "are cx and cy pixels?")]),
    "of one": (lambda i: i["frames"][3].update(cx=0.5), [(1, "are cx and cy pixels? 3")]),
    "all shares": (
        lambda i: i.update(cx=0.5, cy=0.5, fl_x=0.9, fl_y=1.2),
        [(10, "are cx and cy pixels?"), (10, "see more than 150° across: are focal lengths pixels?")],
    ),
    "off centre": (lambda i: i.update(cx=W / 5, cy=H / 4), []),
    "far": (lambda i: at(i, 4, [1e30, 0, 0]), [(1, "far from all others: 4")]),
    "in millimetres": (lambda i: at(i, 4, [2000.0, 9000, 1000]), [(1, "far from all others: 4")]),
    "one place": (
        lambda i: [at(i, n, [1, 2, 3]) for n in range(10)],
        [(10, "all at one place: no depth can be found from there")],
    ),
    "two places": (lambda i: [at(i, n, [1, 2, 3]) for n in range(9)], []),
}


@pytest.mark.parametrize("odd", ODD)
def test_numbers_that_look_wrong_are_told(odd: str, folder: Path):
    edit, expected = ODD[odd]
    change(folder, edit)
    found = [row for row in warnings(folder) if row[0] == "cameras"]
    assert [count for _, count, _ in found] == [count for count, _ in expected]
    assert all(part in said for (_, _, said), (_, part) in zip(found, expected, strict=True))


def test_a_fisheye_may_see_more(folder: Path):
    change(folder, lambda i: i.update(fl_x=4.0, fl_y=4.0))
    assert [count for what, count, _ in warnings(folder) if what == "cameras"] == [10]
    change(folder, lambda i: i.update(camera_model="OPENCV_FISHEYE"))
    assert [count for what, count, _ in warnings(folder) if what == "cameras"] == []


@pytest.mark.parametrize(("last", "count"), [("1e30 0 0", 1), ("9000 0 0", 1), ("3 2 1", 0)])
def test_points_far_away_are_told(last: str, count: int, folder: Path):
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    places = ["0 0 0", "1 0 0", "0 1 0", "0 0 1", last]
    text = f"ply\nformat ascii 1.0\nelement vertex 5\n{axes}end_header\n"
    (folder / "p.ply").write_text(text + "\n".join(places) + "\n")
    change(folder, lambda i: i.update(ply_file_path="p.ply"))
    assert warnings(folder) == [("points", 1, "far from all others")] * count


def test_frames_of_no_list_are_left_out_where_training_frames_are_listed(folder: Path):
    """Follow nerfstudio: a list of test frames alone leaves the others to train on."""
    change(folder, lambda i: i.update(train_filenames=NAMES[:6], test_filenames=NAMES[6:8]))
    plan = plan_import(folder, "dark")
    assert [(s.name, s.held_out) for s in plan.shots] == [(str(i), i > 5) for i in range(8)]
    said = "left out, as no list of transforms.json names them: 8, 9"
    assert ("cameras", 2, said) in warnings(folder)
    change(folder, lambda i: i.pop("train_filenames"))
    assert len(plan_import(folder, "dark").train) == 8
    assert warnings(folder) == []


def test_two_kinds_of_cameras_in_a_folder_are_told(folder: Path):
    (folder / "transforms_train.json").write_text(json.dumps({"camera_angle_x": 0.7, "frames": []}))
    told = [said for what, _, said in warnings(folder) if what == "cameras"]
    assert told == [
        "read from transforms.json alone: cameras of transforms_train.json are passed over. Move "
        "transforms.json away to import them"
    ]
    change(folder, lambda i: i.update(frames=i["frames"][:1]))
    with pytest.raises(DatasetError, match=r"got 1, and transforms_train\.json beside it.*Move transforms"):
        plan_import(folder, "dark")


def test_a_model_in_both_forms_is_told(tmp_path: Path):
    pycolmap = pytest.importorskip("pycolmap")
    from posed_photographs import LENSES, reconstruct, write_folder

    found = reconstruct([("PINHOLE", LENSES["PINHOLE"])] * 3)
    write_folder(tmp_path, found)
    assert warnings(tmp_path) == []
    pycolmap.Reconstruction(tmp_path / "sparse/0").write_text(tmp_path / "sparse/0")
    said = "in both forms; binary files are read, as COLMAP does, and text files are passed over"
    assert warnings(tmp_path) == [("models", 1, said)]


def test_depths_that_are_not_read_are_told(folder: Path):
    change(folder, lambda i: [frame.update(depth_file_path="d.exr") for frame in i["frames"][:4]])
    rows = plan_import(folder, "dark").rows
    told = [(row.count, row.said) for row in rows if row.what == "depths"]
    assert told == [(4, "of depth_file_path are not read")]

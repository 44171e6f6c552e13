# SPDX-License-Identifier: Apache-2.0
"""Photographs and masks are found once: in other case, undistorted ones beside a dense model, strays."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from graycard import DatasetError, look_at
from graycard.exchange import ImportOptions, ImportPlan, plan_import
from made_pictures import write_transforms

W, H = 16, 12
CAMERA_TO_WORLD = [look_at(np.array([2.0, i / 4, 1.0]), np.zeros(3)) for i in range(9)]
TURNED = np.diag([1.0, -1.0, -1.0, 1.0])


def picture(path: Path, level: int = 99) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.full((H, W, 3), level, np.uint8)).save(path, format="PNG")


def mask(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    white = np.full((H, W), 255, np.uint8)
    white[4:8, 5:9] = 0
    Image.fromarray(white).save(path, format="PNG")


def write_model(folder: Path, names: list[str]) -> None:
    folder.mkdir(parents=True)
    (folder / "cameras.txt").write_text(f"1 PINHOLE {W} {H} 9 9 {W / 2} {H / 2}\n")
    (folder / "images.txt").write_text(
        "".join(f"{i} 0.5 0.5 0.5 0.5 {i / 9} 0 3 1 {name}\n\n" for i, name in enumerate(names, 1))
    )
    (folder / "points3D.txt").write_text("")


def said(plan: ImportPlan, what: str) -> list[tuple[int, str]]:
    return [(row.count, row.said) for row in plan.rows if row.what == what]


def nerfstudio(folder: Path) -> None:
    names = [f"images/{i}.png" for i in range(9)]
    write_transforms(folder, names, (W, H), [f"masks/{i}.png" for i in range(9)])
    for i in range(9):
        picture(folder / f"images/{i}.PNG")
        mask(folder / f"Masks/{i}.Png")


def colmap(folder: Path) -> None:
    write_model(folder / "sparse/0", [f"walk/img_{i}.png" for i in range(9)])
    for i in range(9):
        picture(folder / f"photos/Walk/IMG_{i}.PNG")
        mask(folder / f"masks/walk/IMG_{i}.PNG.png")


def blender(folder: Path) -> None:
    for split, numbers in (("train", range(2, 9)), ("test", range(2))):
        frames = [
            {"file_path": f"./{split}/r_{i}", "transform_matrix": (CAMERA_TO_WORLD[i] @ TURNED).tolist()}
            for i in numbers
        ]
        text = json.dumps({"camera_angle_x": 0.7, "frames": frames})
        (folder / f"transforms_{split}.json").write_text(text)
        for i in numbers:
            picture(folder / f"{split}/R_{i}.PNG")


LAYOUTS: dict[str, Callable[[Path], None]] = {"nerfstudio": nerfstudio, "colmap": colmap, "blender": blender}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_files_in_other_case_are_all_found(layout: str, tmp_path: Path):
    """No held-out photograph is lost, none is taken for one without a camera, and the masks come along."""
    LAYOUTS[layout](tmp_path)
    plan = plan_import(tmp_path, "tabletop")
    assert (len(plan.train), len(plan.pictures.held)) == (7, 2)
    assert len(plan.pictures.masks) == (0 if layout == "blender" else 7)
    assert [count for count, _ in said(plan, "cameras")] == [9]
    assert all("without a camera" not in text for _, text in said(plan, "photographs"))
    if layout != "blender":  # its names have no suffix, so they differ on any disk
        assert said(plan, "names") == [(9, "found under a name in other case")]


def test_two_files_that_differ_in_case_alone_are_named(tmp_path: Path):
    write_transforms(tmp_path, ["a.png", "b.png"], (W, H))
    for name in ("a.png", "b.png", "A.png", "B.PNG", "B.png"):
        picture(tmp_path / name)
    assert len(plan_import(tmp_path, "dark").shots) == 2
    (tmp_path / "b.png").unlink()
    with pytest.raises(DatasetError, match=r"expected one file for .*b\.png, got B\.PNG, B\.png\. Rename"):
        plan_import(tmp_path, "dark")


def test_undistorted_photographs_lie_beside_their_model(tmp_path: Path):
    """The originals have the same names and, for all that sizes tell, could be the undistorted ones."""
    names = [f"{i}.png" for i in range(3)]
    write_model(tmp_path / "dense/sparse", names)
    for name in names:
        picture(tmp_path / "images" / name)
        mask(tmp_path / "masks" / f"{name}.png")
    assert [s.image.parent for s in plan_import(tmp_path, "dark").shots] == [tmp_path / "images"] * 3
    for name in names[:2]:
        picture(tmp_path / "dense/images" / name)
    with pytest.raises(DatasetError, match=r"expected a photograph at .*dense/images/2\.png, got none"):
        plan_import(tmp_path, "dark", ImportOptions(hold_out="0"))
    picture(tmp_path / "dense/images" / names[2])
    plan = plan_import(tmp_path, "tabletop")
    assert [s.image.parent for s in plan.shots] == [tmp_path / "dense/images"] * 3
    assert said(plan, "photographs") == [(3, "found in dense/images/, by the names of the model's images")]
    assert not plan.pictures.masks
    text = "of masks/ left out: they are of other photographs than those in dense/images/"
    assert said(plan, "masks") == [(3, text)]
    for name in names:
        mask(tmp_path / "dense/masks" / f"{name}.png")
    assert len(plan_import(tmp_path, "tabletop").pictures.masks) == 2


def test_a_photograph_without_a_camera_is_counted_once(tmp_path: Path):
    write_transforms(tmp_path, ["images/a.png", "images/sub/b.png"], (W, H))
    for name in ("a.png", "sub/b.png", "sub/stray.png"):
        picture(tmp_path / "images" / name)
    text = "without a camera, left out: images/sub/stray.png"
    assert said(plan_import(tmp_path, "dark"), "photographs") == [(1, text)]


def test_masks_that_a_track_does_not_take_are_said(tmp_path: Path):
    """They lie among the photographs, and are none without a camera."""
    names = [f"images/{i}.png" for i in range(3)]
    write_transforms(tmp_path, names, (W, H), [f"images/{i}_mask.png" for i in range(3)])
    for i, name in enumerate(names):
        picture(tmp_path / name)
        mask(tmp_path / f"images/{i}_mask.png")
    plan = plan_import(tmp_path, "dark")
    assert said(plan, "masks") == [(3, "left out: tabletop alone has an object to be removed")]
    assert said(plan, "photographs") == []
    assert said(plan_import(tmp_path, "tabletop"), "masks") == []


@pytest.mark.parametrize("layout", ["nerfstudio", "blender"])
def test_a_model_is_refused_where_there_are_no_several(layout: str, tmp_path: Path):
    LAYOUTS[layout](tmp_path)
    with pytest.raises(
        DatasetError, match=r"expected --model for a folder of COLMAP or TensoIR.*got 'sunset'"
    ):
        plan_import(tmp_path, "dark", ImportOptions(model="sunset"))

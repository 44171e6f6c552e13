# SPDX-License-Identifier: Apache-2.0
"""Contact sheets: a fault planted in a scene is to be seen in its sheet."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from graycard import (
    TRACKS,
    Camera,
    Composition,
    DatasetError,
    Donor,
    LightEdit,
    PointLight,
    RectangleLight,
    open_capture,
    open_truth,
    srgb_encode,
)
from graycard.dataset import write_index
from graycard.edits import composed_file
from graycard.exchange import export_capture, import_capture
from graycard.io import write_json, write_layers, write_rgb
from graycard.reports import write_contact_sheets
from graycard.reports.pictures._colour_maps import colour_map
from graycard.reports.pictures._contact_sheet import CELL, COLUMNS, GAP, TEXT, _layer_groups, contact_sheet
from graycard.reports.pictures._layer_pictures import NO_NUMBER, NOTHING, layer_picture, outline
from graycard.reports.plan._picture import FINE, LAMP, TEST, TRAIN, plan_picture
from graycard.reports.plan._plan import lay_out

WIDTH, HEIGHT = 28, 24
"""Size of the tiny scenes."""
RNG = np.random.default_rng(3)


def share_of(pixels: np.ndarray, colour: tuple[int, int, int]) -> float:
    return float((pixels == np.array(colour)).all(axis=-1).mean())


@pytest.mark.parametrize("track", TRACKS)
def test_a_sheet_shows_photographs_layers_and_plan(track: str, tiny_scenes: dict[str, Path]):
    sheet = contact_sheet(tiny_scenes[track])
    capture = open_capture(tiny_scenes[track] / "capture")
    first = srgb_encode(capture.photograph(capture.train[0]) * capture.exposure)
    scale = CELL // first.shape[1]
    top, left = 2 * GAP + 22 + 12 + GAP + TEXT + 8, 2 * GAP
    shown = sheet[top : top + first.shape[0] * scale : scale, left : left + first.shape[1] * scale : scale]
    expected = np.rint(255 * first).astype(np.uint8)
    outlined = (shown == np.array(NO_NUMBER)).all(axis=-1)
    assert outlined.any() == (capture.target is not None)
    np.testing.assert_array_equal(shown[~outlined], expected[~outlined])
    assert sheet.shape[1] == COLUMNS * (CELL + GAP) + 3 * GAP
    assert share_of(sheet, TRAIN) > 0
    assert share_of(sheet, TEST) > 0
    assert share_of(sheet, LAMP) > 0


def test_a_capture_without_truth_has_a_sheet_too(make_scene: Callable[..., Path], tmp_path: Path):
    scene = make_scene()
    export_capture(scene, "colmap", tmp_path / "away")
    import_capture(tmp_path / "away", tmp_path / "dataset", "dark", "mine")
    (scene / "truth" / "manifest.json").unlink()  # half-written
    (scene.parent / ".hidden").mkdir()
    sheets = write_contact_sheets(tmp_path / "dataset", tmp_path / "look")
    assert sheets == [tmp_path / "look" / "dark-mine.png"]
    pixels = np.asarray(Image.open(sheets[0]))
    assert share_of(pixels, TRAIN) > 0
    assert share_of(pixels, LAMP) == 0


def test_a_wrong_scene_is_seen(make_scene: Callable[..., Path]):
    """NaN albedo turns magenta; nothing of a whole scene is."""
    scene = make_scene()
    assert share_of(contact_sheet(scene), NO_NUMBER) == 0
    truth = open_truth(scene / "truth")
    view = next(v for v in truth.views if v.split == "test")
    layers = truth.layers(view)
    layers["base_color"][4:9, 3:8] = np.nan
    write_layers(scene / "truth" / "views" / f"{view.name}.exr", layers)
    spoilt = contact_sheet(scene)
    scale = CELL // view.camera.width
    assert round(share_of(spoilt, NO_NUMBER) * spoilt[..., 0].size) == 25 * scale**2


def test_changed_lights_and_a_composition_are_shown(make_scene: Callable[..., Path]):
    """A spoilt patch in either picture is magenta."""
    scene = make_scene()
    plain = contact_sheet(scene)
    truth = open_truth(scene / "truth")
    edit = LightEdit("without-lamp", "The lamp is off.")
    write_index(scene / "truth", replace(truth, edits=(edit,)))
    origin = Donor("multilight", "studio", 3, {}, "vase", 6)
    record = Composition(origin, np.eye(4), 4)
    write_json(scene / "truth" / "composition" / "composition.json", record)
    for view in (v for v in truth.views if v.split == "test"):
        picture = truth.layers(view)["radiance"]
        for number, name in enumerate((edit.view_file(view.name), composed_file(view.name)), start=1):
            picture[4 : 4 + number, 3:8] = np.nan
            write_layers(scene / "truth" / name, {"radiance": picture})
    sheet = contact_sheet(scene)
    assert sheet.shape[0] > plain.shape[0] + HEIGHT * (CELL // WIDTH)
    spoilt = share_of(sheet, NO_NUMBER) * sheet[..., 0].size
    assert round(spoilt) == (5 + 10) * (CELL // WIDTH) ** 2


def test_a_layer_of_another_size_is_named(make_scene: Callable[..., Path]):
    scene = make_scene()
    truth = open_truth(scene / "truth")
    write_layers(scene / "truth" / "views" / "test_003.exr", {"depth": np.ones((3, 4))})
    assert truth.view("test_003").split == "test"
    with pytest.raises(
        DatasetError, match="expected .*test_003.exr to be 28x24 pixels, as its camera is, got 4x3"
    ):
        contact_sheet(scene)


def test_every_layer_is_drawn_once_in_a_group(tiny_scenes: dict[str, Path]):
    truth = open_truth(tiny_scenes["tabletop"] / "truth")
    layers = truth.layers(truth.views[0])
    more = {name: layers["radiance"] for name in ("irradiance.a", "direct.irradiance.a", "direct.diffuse.a")}
    groups = dict(_layer_groups(layers | more, 1.0, brief=False))
    drawn = [cell.caption.split()[0] for cells in groups.values() for cell in cells]
    assert sorted(drawn) == sorted(layers | more)
    assert [c.caption.split()[0] for c in groups["light that arrives"]] == [
        "direct.irradiance.a",
        "irradiance.a",
    ]
    assert list(dict(_layer_groups(layers, 1.0, brief=True))) == ["truth in brief"]


def test_no_scene_is_an_error(tmp_path: Path):
    with pytest.raises(DatasetError, match="got no whole scene there"):
        write_contact_sheets(tmp_path, tmp_path / "look")
    assert not (tmp_path / "look").exists()


def test_light_and_reflectance_are_encoded_once():
    """18 % is 118 on a display; only light takes the exposure, and arriving light is shown on a gray card."""
    gray = np.full((2, 3, 3), 0.09)
    assert (layer_picture("radiance", gray, 2.0)[0] == 118).all()
    for arriving, value in (("shading", 0.5), ("irradiance.lamp", np.pi / 2)):
        assert (layer_picture(arriving, np.full((2, 3, 3), value), 2.0)[0] == 118).all()
    pixels, caption = layer_picture("albedo", 2 * gray, 2.0)
    assert (pixels == 118).all()
    assert caption == "albedo  0.18 to 0.18"


def test_normals_and_positions_are_colours():
    normal = np.zeros((1, 3, 3))
    normal[0, 0], normal[0, 1] = (0, 0, 1), (-1, 0, 0)
    pixels = layer_picture("normal", normal, 1.0)[0]
    assert pixels[0].tolist() == [[128, 128, 255], [0, 128, 128], list(NOTHING)]
    position = np.array([[[0.0, 1, 5], [4, 3, 5]]])
    assert layer_picture("position", position, 1.0)[0][0].tolist() == [[0, 0, 0], [255, 255, 0]]


def test_depth_has_a_range_and_nothing_is_gray():
    pixels, caption = layer_picture("depth", np.array([[1.0, 3.0, np.inf]]), 1.0)
    assert caption == "depth  1 to 3"
    assert pixels[0, 2].tolist() == list(NOTHING)
    assert pixels[0, 0].tolist() == colour_map("depth")[0].tolist()
    assert pixels[0, 1].tolist() == colour_map("depth")[-1].tolist()
    assert layer_picture("depth", np.array([[np.nan]]), 1.0)[0][0, 0].tolist() == list(NO_NUMBER)
    assert layer_picture("roughness", np.array([[np.inf]]), 1.0)[0][0, 0].tolist() == list(NO_NUMBER)


def test_variance_is_shown_as_deviation():
    variance = np.full((4, 4, 3), 0.01**2)
    assert layer_picture("radiance.var", variance, 5.0)[1] == "radiance.var  sd to 5.0% of white"
    assert layer_picture("albedo.var", variance, 5.0)[1] == "albedo.var  sd to 0.01"
    assert layer_picture("roughness.var", variance[..., 0], 5.0)[1] == "roughness.var  sd to 0.01"


def test_ids_keep_their_colours_between_views():
    one = layer_picture("object_id", np.array([[0, 3, 7]], np.uint32), 1.0)[0][0]
    other, caption = layer_picture("object_id", np.array([[7, 0, 12]], np.uint32), 1.0)
    assert (one[2] == other[0, 0]).all()
    assert (one[0] == NOTHING).all()
    assert len({tuple(c) for c in (*one, *other[0])}) == 4
    assert caption == "object_id  3 ids up to 12"


def test_the_outline_is_inside_the_mask():
    mask = np.zeros((7, 7), bool)
    mask[2:5, 2:5] = True
    changed = np.asarray(outline(np.zeros((7, 7, 3), np.uint8), mask)[..., 0] > 0)
    assert changed.sum() == 8
    assert not changed[3, 3]
    assert not (changed & ~mask).any()


def test_the_plan_is_drawn_where_it_says(tiny_scenes: dict[str, Path]):
    views = open_capture(tiny_scenes["dark"] / "capture").views
    lights = (
        PointLight("bulb", (1.0, 0.5, 2.0), (1.0, 1.0, 1.0)),
        RectangleLight("window", (-1, 0, 2), (0.5, 0, 0), (0, 0.5, 0), (1, 1, 1)),
    )
    plan = lay_out(views, [RNG.normal(size=(50, 3))], [("", 0, lights)])
    pixels = np.asarray(plan_picture(plan))
    bulb = next(m for m in plan.lights if m.label.endswith("bulb"))
    assert pixels.shape[:2] == (round(plan.height), round(plan.width))
    assert pixels[round(bulb.y), round(bulb.x)].tolist() == list(LAMP)
    for camera in plan.cameras:
        corners = [tuple(map(float, p.split(","))) for p in camera.points.split()]
        x, y = np.mean(corners, axis=0)
        assert pixels[round(y), round(x)].tolist() == list(TRAIN if camera.split == "train" else TEST)
    assert FINE > 1


def test_large_photographs_are_averaged_down(make_scene: Callable[..., Path]):
    scene = make_scene()
    capture = open_capture(scene / "capture")
    views = tuple(
        replace(v, camera=Camera.from_fov(450, 300, 50, v.camera.camera_to_world)) for v in capture.views
    )
    for view in capture.train:
        write_rgb(scene / "capture" / "photographs" / f"{view.name}.exr", np.full((300, 450, 3), 0.05))
    write_index(scene / "capture", replace(capture, views=views, exposure=1.0))
    shutil.rmtree(scene / "truth")
    level = round(255 * float(srgb_encode(np.array(0.05))))
    sheet = contact_sheet(scene)
    assert share_of(sheet, (level, level, level)) * sheet[..., 0].size >= 3 * CELL * round(300 * CELL / 450)

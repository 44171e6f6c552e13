# SPDX-License-Identifier: Apache-2.0
"""The page of an imported capture: marked as photographs without truth, and complete in itself."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from graycard import EnvironmentLight, PointLight, Predictions, RecordError, View
from graycard.cli import main
from graycard.dataset import open_held_out
from graycard.eval import score_photographs
from graycard.io import write_rgb
from graycard.predictions import finish_predictions, write_view
from graycard.reports import CaptureRow, write_capture_report
from graycard.reports._evidence import MethodEvidence, handed_in
from graycard.reports.captures._lights import MOST_LIGHTS, found_lights
from graycard.reports.captures._page import MAX_SIDE, MODEL_UNIT, capture_page
from graycard.reports.captures._scores import score_table
from graycard.reports.pictures._layer_rows import bare_row
from graycard.reports.pictures._pictures import seen_picture
from real_captures import import_bracketed, import_tiny, predict_photographs


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory, write_tiny: Callable[..., Path]) -> list[CaptureRow]:
    folder = tmp_path_factory.mktemp("cellar")
    scene = import_tiny(folder, write_tiny)

    def darker(view: View, light: np.ndarray) -> np.ndarray:
        return light * np.float32(0.7)

    made = {
        "right": predict_photographs(folder / "a", scene),
        "<b>": predict_photographs(folder / "b", scene, darker),
    }
    return [CaptureRow(name, path, score_photographs(path, scene)) for name, path in made.items()]


def scene_of(rows: list[CaptureRow]) -> Path:
    return rows[0].predictions.parent / "mine" / "dark" / "cellar"


def test_the_page_is_marked_and_complete(rows: list[CaptureRow], tmp_path: Path) -> None:
    page = write_capture_report(scene_of(rows), rows, out=tmp_path / "page.html").read_text()
    assert page.count("photographs, no truth") >= 3
    assert "default-src &#39;none&#39;" in page
    assert not re.findall(r"(?:src|href)=.(?!data:|#)", page)
    assert "<b>" not in page
    assert "&lt;b&gt;" in page


def test_pictures_stand_beside_their_photograph(rows: list[CaptureRow], tmp_path: Path) -> None:
    """Three views of three pictures, two errors, and two layers of two methods; six training photographs."""
    page = write_capture_report(scene_of(rows), rows, out=tmp_path / "page.html").read_text()
    gallery = capture_page(scene_of(rows), rows).gallery
    assert len(gallery.thumbnails) == 6
    assert gallery.views[0].name in page
    for view in gallery.views:
        light, *layers = view.rows
        assert light.truth.picture
        assert all(tile.picture for tile in (*light.predictions, *light.errors))
        assert [row.title for row in layers] == ["Base color", "Depth"]
        assert all(row.truth.missing == "no truth" and not row.errors for row in layers)
        assert all(tile.picture for row in layers for tile in row.predictions)
    assert "ground truth" not in page.partition("<script")[0]
    values = [score.value for score in rows[1].sheet.scores if score.metric == "photographs.psnr"]
    assert values[0] is not None
    assert f"{values[0]:.2f}" in page


def test_pictures_are_shown_at_the_exposure_of_each_photograph(
    tmp_path: Path, write_tiny: Callable[..., Path]
) -> None:
    """Light beyond the white of a photograph is shown as white, as the photograph is, and is no error."""
    scene = import_bracketed(tmp_path, write_tiny, (0.5, 2.0, 4.0))
    held = open_held_out(scene)

    def brighter(view: View, light: np.ndarray) -> np.ndarray:
        if view.split == "train":
            return light
        white = 1 / (held.capture.exposure * held.exposure(view))
        return np.where(light > 0.999 * white, 3 * light, light).astype(np.float32)

    mine = predict_photographs(tmp_path / "mine", scene, brighter)
    page = capture_page(scene, [CaptureRow("mine", mine, score_photographs(mine, scene))])
    pictures = [
        (row.truth.picture, row.predictions[0].picture, row.errors[0].picture)
        for row in (view.picture for view in page.views)
    ]
    for true, predicted, error in pictures:
        assert true is not None
        assert predicted is not None
        assert error is not None
        assert seen_picture(true).webp == seen_picture(predicted).webp
        assert error.webp == next(e for _, _, e in pictures if e is not None).webp
    assert len({true.webp for true, _, _ in pictures if true is not None}) == 3
    assert (held.photograph(held.views[2]).max() * held.capture.exposure) < 0.5, "full far below white"


def test_parts_of_light_are_shown_at_the_exposure_of_the_photograph_beside_them(
    tmp_path: Path, write_tiny: Callable[..., Path]
) -> None:
    scene = import_bracketed(tmp_path, write_tiny, (0.5, 2.0, 4.0))
    held = open_held_out(scene)
    mine = predict_photographs(tmp_path / "mine", scene)
    for view in held.views:
        light = held.photograph(view)
        write_view(mine, view.name, {"radiance": light, "diffuse": light, "base_color": light})
    finish_predictions(mine, Predictions("mine", held.capture.track, held.capture.scene))
    page = capture_page(scene, [CaptureRow("mine", mine, score_photographs(mine, scene))])
    for view in page.views:
        diffuse = next(row for row in view.layers if row.layer == "diffuse")
        beside, shown = view.picture.predictions[0].picture, diffuse.predictions[0].picture
        assert beside is not None
        assert shown is not None
        assert shown.webp == beside.webp


def test_the_same_predictions_give_the_same_bytes(rows: list[CaptureRow], tmp_path: Path) -> None:
    one, two = (write_capture_report(scene_of(rows), rows, out=tmp_path / name) for name in "ab")
    assert one.read_bytes() == two.read_bytes()


def test_rows_have_names_of_their_own(rows: list[CaptureRow], tmp_path: Path) -> None:
    for bad in ([], [rows[0], rows[0]]):
        with pytest.raises(RecordError, match="expected rows of different names"):
            write_capture_report(scene_of(rows), bad, out=tmp_path / "page.html")


def test_the_verb_writes_the_page(rows: list[CaptureRow], capsys: pytest.CaptureFixture[str]) -> None:
    scene = scene_of(rows)
    assert main(["report", str(scene), "--predictions", f"mine={rows[0].predictions}"]) == 0
    assert str(scene / "report" / "index.html") in capsys.readouterr().out
    assert (scene / "report" / "index.html").is_file()


def test_a_method_is_a_row_and_the_best_of_several_is_marked(rows: list[CaptureRow]) -> None:
    """The first method predicts the very photographs."""
    table = score_table([(row.name, row.sheet) for row in rows])
    assert [head.title for head in table.heads[:2]] == ["PSNR", "SSIM"]
    assert [row.method for row in table.rows] == ["right", "<b>"]
    psnr = [row.cells[0] for row in table.rows]
    assert (psnr[0].text, psnr[0].best) == ("∞", True)
    assert not psnr[1].best
    views = rows[0].sheet.scores[0].per_view
    assert [(row.method, row.view) for row in table.by_view] == [
        (n, v) for n in ("right", "<b>") for v in views
    ]
    assert len(views) == 3
    alone = score_table([(rows[0].name, rows[0].sheet)])
    assert not any(cell.best for cell in alone.rows[0].cells), "one method has no rival"


def test_what_was_taken_is_told_where_it_is_another_number(rows: list[CaptureRow]) -> None:
    sheet = rows[1].sheet
    same, other = (replace(score, breakdown={"as_taken": 12.5}, value=12.5) for score in sheet.scores[:2])
    found = replace(sheet, scores=(same, replace(other, value=0.25)), metrics=sheet.metrics[:2])
    (row,) = score_table([("mine", found)]).rows
    assert [(cell.text, cell.note) for cell in row.cells] == [("12.50", ""), ("0.250", "as taken 12.500")]


def test_depth_of_an_imported_model_is_not_in_metres(rows: list[CaptureRow]) -> None:
    page = capture_page(scene_of(rows), rows)
    found = {row.title: row for view in page.views for row in view.layers}
    assert found["Depth"].unit == MODEL_UNIT
    assert found["Depth"].value_scale
    assert found["Depth"].value_scale.unit == MODEL_UNIT
    assert found["Base color"].unit == "reflectance, 1 is white"


def test_pictures_of_a_capture_may_be_larger(rows: list[CaptureRow]) -> None:
    small = open_held_out(scene_of(rows)).views[0]
    view = replace(small, camera=replace(small.camera, width=300, height=150))
    layers = {view.name: {"base_color": np.full((150, 300, 3), 0.5, np.float32)}}
    for side, width in ((128, 100), (MAX_SIDE, 150), (300, 300)):
        (tile,) = bare_row("base_color", view, 1.0, [MethodEvidence("mine", layers=layers)], side).predictions
        assert tile.picture
        assert (tile.picture.width, tile.picture.height) == (width, width // 2)


def test_exposures_that_differ_are_told(tmp_path: Path, write_tiny: Callable[..., Path]) -> None:
    scene = import_bracketed(tmp_path, write_tiny, (0.5, 2.0, 4.0))
    mine = predict_photographs(tmp_path / "mine", scene)
    page = capture_page(scene, [CaptureRow("mine", mine, score_photographs(mine, scene))])
    assert page.described.endswith("pixels; exposures up to 8 times apart")


def test_lights_are_listed_the_brightest_first(tmp_path: Path) -> None:
    lamps = [
        PointLight(f"lamp-{n}", (float(n), 0.0, 2.0), (n + 1.0, n + 1.0, n + 1.0), "camera")
        for n in range(25)
    ]
    write_rgb(tmp_path / "sky.exr", np.ones((4, 8, 3), np.float32))
    sky = EnvironmentLight("sky", "sky.exr")
    finish_predictions(tmp_path, Predictions("mine", "dark", "cellar"), (sky, *lamps))
    found = found_lights([handed_in("mine", tmp_path, [])])
    assert len(found) == MOST_LIGHTS + 1
    assert (found[0].name, found[0].kind, found[0].place) == ("lamp-24", "point", "24, 0, 2 on the camera")
    assert found[0].intensity == "25, 25, 25"
    assert found[-1].name == "6 more"


def test_lights_that_cannot_be_read_are_told_and_none_are_no_list(
    rows: list[CaptureRow], tmp_path: Path
) -> None:
    assert found_lights([handed_in("right", rows[0].predictions, [])]) == ()
    finish_predictions(tmp_path, Predictions("mine", "dark", "cellar"), ())
    assert [light.name for light in found_lights([handed_in("mine", tmp_path, [])])] == ["no light"]
    (tmp_path / "lights.json").write_text("[")
    (told,) = found_lights([handed_in("mine", tmp_path, [])])
    assert told.name.startswith("cannot be read: ")

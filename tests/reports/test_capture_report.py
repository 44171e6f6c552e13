# SPDX-License-Identifier: Apache-2.0
"""The page of an imported capture: marked as photographs without truth, and complete in itself."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from graycard import RecordError, View
from graycard.cli import main
from graycard.dataset import open_held_out
from graycard.eval import score_photographs
from graycard.reports import CaptureRow, write_capture_report
from graycard.reports.captures._page import capture_page
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

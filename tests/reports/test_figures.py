# SPDX-License-Identifier: Apache-2.0
"""Figures as SVG and PDF: read back, they hold each pixel of each picture, and their words as text."""

import base64
import io
import re
import xml.etree.ElementTree as Xml
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from pypdf import PdfReader

from graycard import (
    GraycardError,
    RecordError,
    UnknownNameError,
    open_capture,
    open_predictions,
    open_truth,
    srgb_encode,
)
from graycard.cli import main
from graycard.reports import FigureSpec, write_figure
from graycard.reports.figures._content import FigureContent, figure_content
from graycard.reports.history._keep import OWN
from graycard.reports.pictures._colour_maps import STEPS

HOSTILE = "<script>window.broken = 1</script>"
SVG, XLINK = "{http://www.w3.org/2000/svg}", "{http://www.w3.org/1999/xlink}"
LAYERS = ("radiance", "base_color", "normal", "depth")
SPEC = FigureSpec("tabletop/tiny-0000", ("gray", "retinex", HOSTILE), LAYERS)


def pictures_of(content: FigureContent) -> list[np.ndarray]:
    """Return all pictures of a figure, strip by strip, without colour bars."""
    cells = (cell for strip in content.strips for cell in strip.cells if cell)
    return [cell.pixels for cell in cells if cell.pixels is not None]


def is_bar(picture: np.ndarray) -> bool:
    return picture.shape[:2] == (STEPS, 1)


def in_svg(path: Path) -> tuple[list[np.ndarray], list[str]]:
    """Return the pictures and the words of an SVG."""
    root = Xml.parse(path).getroot()
    found = []
    for image in root.iter(f"{SVG}image"):
        head, data = str(image.get(f"{XLINK}href")).split(",")
        assert head == "data:image/png;base64"
        opened = Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB")
        pixels = np.asarray(opened)
        flipped = re.search(r"scale\(1 -1\)", image.get("transform", ""))
        found.append(pixels[::-1] if flipped else pixels)
    return found, ["".join(text.itertext()) for text in root.iter(f"{SVG}text")]


def in_pdf(path: Path) -> tuple[list[np.ndarray], str]:
    """Return the pictures and the words of a PDF of one page, which turns pictures over as it draws them."""
    (page,) = PdfReader(path).pages
    found = [np.asarray(image.image.convert("RGB"))[::-1] for image in page.images if image.image]
    return found, page.extract_text()


def check_same(found: list[np.ndarray], wanted: list[np.ndarray]) -> None:
    """Hold pictures against those that were to be drawn, bit by bit, in any order."""
    as_bytes = sorted((p.shape, p.tobytes()) for p in found if not is_bar(p))
    assert as_bytes == sorted((p.shape, p.tobytes()) for p in wanted)


def test_svg_and_pdf_hold_each_pixel_and_each_word(tiny_run: Path, tmp_path: Path):
    content = write_figure(tiny_run, SPEC, tmp_path / "fig.svg")
    assert write_figure(tiny_run, SPEC, tmp_path / "fig.pdf").notes == content.notes
    wanted = pictures_of(content)
    assert len(wanted) == 4 + 3 + 4 + 3 + 3 + 2 + 4 + 3  # gray has no normals
    drawn, words = in_svg(tmp_path / "fig.svg")
    check_same(drawn, wanted)
    assert sum(map(is_bar, drawn)) == 5
    for word in (
        "truth",
        "gray",
        "retinex",
        HOSTILE,
        "Radiance",
        "Error",
        "not provided",
        "18.42 dB",
        "degrees",
    ):
        assert word in words
    drawn, text = in_pdf(tmp_path / "fig.pdf")
    check_same(drawn, wanted)
    for word in ("truth", "gray", HOSTILE, "not provided", "18.42 dB"):
        assert word in text
    assert "Type3" not in (tmp_path / "fig.pdf").read_bytes().decode("latin-1")


def test_pictures_are_those_of_the_run_at_one_exposure(tiny_run: Path):
    content = figure_content(tiny_run, SPEC)
    truth = open_truth(tiny_run / "dataset/tabletop/tiny-0000/truth", check=False)
    view = next(v for v in truth.views if v.name == content.view)
    assert view.split == "test"
    mine = open_predictions(tiny_run / "jobs/tabletop/tiny-0000/gray-0/predictions").layers(view.name)
    true = truth.layers(view)
    first = content.strips[0].cells
    for cell, light in ((first[0], true["radiance"]), (first[1], mine["radiance"])):
        assert cell
        assert cell.pixels is not None
        expected = np.rint(255 * srgb_encode(np.maximum(light, 0) * truth.exposure))
        assert np.array_equal(cell.pixels, expected.astype(np.uint8))


def test_a_training_view_has_its_photograph(tiny_run: Path):
    content = figure_content(
        tiny_run, FigureSpec("dark/tiny-0000", ("gray",), ("base_color", "radiance"), "train_000")
    )
    assert content.columns == ("photograph", "truth", "gray")
    color, light = content.strips  # that run has predictions of held-out views alone, and no errors
    assert color.cells[0] is None
    assert light.cells[0]
    capture = open_capture(tiny_run / "dataset/dark/tiny-0000/capture", check=False)
    view = next(v for v in capture.train if v.name == "train_000")
    expected = np.rint(255 * srgb_encode(capture.photograph(view) * capture.exposure)).astype(np.uint8)
    assert np.array_equal(np.asarray(light.cells[0].pixels), expected)
    assert light.cells[0].text == "as taken"


def test_errors_of_a_layer_share_a_scale_and_can_be_left_out(tiny_run: Path):
    content = figure_content(tiny_run, SPEC)
    assert [strip.label for strip in content.strips[::2]] == [
        "Radiance",
        "Base color",
        "Normal, world axes",
        "Depth",
    ]
    for strip in content.strips[1::2]:
        assert strip.label == "Error"
        assert strip.bar
        assert strip.cells[0] is None
    bare = figure_content(tiny_run, FigureSpec(SPEC.scene, SPEC.rows, LAYERS, errors=False))
    assert [strip.label for strip in bare.strips] == [strip.label for strip in content.strips[::2]]


def test_equal_runs_give_equal_figures(tiny_run: Path, tmp_path: Path):
    for form in ("svg", "pdf"):
        paths = [tmp_path / f"{name}.{form}" for name in ("one", "two")]
        for path in paths:
            write_figure(tiny_run, FigureSpec("tabletop/tiny-0000", ("gray",), ("radiance",)), path)
        assert paths[0].read_bytes() == paths[1].read_bytes()


def test_a_failed_job_leaves_its_place_empty_and_says_so(tiny_run: Path):
    content = figure_content(tiny_run, FigureSpec("dark/tiny-0000", (HOSTILE, "gray"), ("radiance",)))
    failed = content.strips[0].cells[1]
    assert failed
    assert (failed.pixels, failed.text) == (None, "failed")
    assert content.strips[1].cells[1] is None
    alone = figure_content(tiny_run, FigureSpec("dark/tiny-0000", (HOSTILE,), ("radiance",)))
    assert [strip.label for strip in alone.strips] == ["Radiance"], (
        "no error is known, and no place is left for it"
    )


def test_the_figure_is_as_wide_as_asked_for(tiny_run: Path, tmp_path: Path):
    write_figure(tiny_run, SPEC, tmp_path / "fig.pdf", 86)
    assert float(PdfReader(tmp_path / "fig.pdf").pages[0].mediabox.width) == pytest.approx(
        86 / 25.4 * 72, abs=0.1
    )


@pytest.mark.parametrize(
    ("changed", "error", "told"),
    [
        ({"scene": "tiny-0000"}, UnknownNameError, "scene of this run .* Known: dark/tiny-0000, multilight"),
        ({"scene": "dark/none"}, UnknownNameError, "scene of this run"),
        ({"rows": ("grey",)}, UnknownNameError, "row of tiny-0000 .*did you mean 'gray'"),
        ({"rows": ()}, RecordError, "rows of different names, got none"),
        ({"rows": ("gray", "gray")}, RecordError, "rows of different names, got gray, gray"),
        ({"layers": ()}, RecordError, "layers of different names"),
        ({"layers": ("radiance", "object_id")}, UnknownNameError, "layer of test_"),
        ({"view": "test_999"}, UnknownNameError, "view of this scene"),
    ],
)
def test_what_the_run_has_not_is_refused(
    tiny_run: Path, tmp_path: Path, changed: dict[str, Any], error: type[GraycardError], told: str
):
    asked = {"scene": "dark/tiny-0000", "rows": ("gray",), "layers": ("radiance",)} | changed
    with pytest.raises(error, match=told):
        write_figure(tiny_run, FigureSpec(**asked), tmp_path / "fig.svg")
    assert not (tmp_path / "fig.svg").exists()


@pytest.mark.parametrize(
    ("name", "width", "told"),
    [("fig.png", 180.0, "ends in .svg or .pdf, got .*fig.png"), ("fig.svg", 1.0, "30 to 1000 mm, got 1")],
)
def test_other_files_and_widths_are_refused(
    tiny_run: Path, tmp_path: Path, name: str, width: float, told: str
):
    with pytest.raises(GraycardError, match=told):
        write_figure(tiny_run, SPEC, tmp_path / name, width)


def test_a_published_folder_has_no_pictures(tmp_path: Path):
    spec = FigureSpec("matte-table-0018", ("goris",), ("radiance",))
    with pytest.raises(RecordError, match="got a published folder, .*matte, which has records alone"):
        write_figure(OWN / "matte", spec, tmp_path / "fig.svg")


def test_the_verb(make_run: Callable[..., Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    run, _ = make_run()
    options = ["--scene", "tabletop/tiny-0000", "--rows", "gray", "--layers", "base_color", "--no-errors"]
    assert main(["figure", str(run), *options, "--out", str(tmp_path / "fig.pdf")]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "base_color of gray is shown × 2 1 0.5, as it is scored"
    assert said[1].startswith("below base_color: albedo.psnr.channel of view test_")
    assert said[2].startswith(f"figure: {tmp_path / 'fig.pdf'}, view test_")
    assert len(in_pdf(tmp_path / "fig.pdf")[0]) == 2

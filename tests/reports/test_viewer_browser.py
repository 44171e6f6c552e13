# SPDX-License-Identifier: Apache-2.0
"""The viewer of pictures in a report in a browser: what it shows, and what it reads out."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Locator

from graycard import open_predictions, open_truth, srgb_encode
from report_pages import CHROMIUM, SCENE, open_report, settle

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium or google-chrome on this machine")

MOVE = "(e, value) => { e.value = value; e.dispatchEvent(new Event('input', { bubbles: true })); }"
COLOUR = """(canvas, [u, v]) => {
  const { width, height } = canvas;
  const copy = document.createElement('canvas');
  copy.width = copy.height = 1;
  const context = copy.getContext('2d', { willReadFrequently: true });
  context.drawImage(canvas, Math.floor(u * width), Math.floor(v * height), 1, 1, 0, 0, 1, 1);
  return [...context.getImageData(0, 0, 1, 1).data];
}"""
WITHOUT_DEPTH = """async (id) => {
  const { pictures } = JSON.parse(await inflate(await island('kept', id)));
  const tiles = pictures.gallery.views.flatMap((view) => view.rows).filter((row) => row.layer === 'depth')
    .flatMap((row) => row.predictions);
  for (const tile of tiles) Object.assign(tile, { picture: null, missing: 'not provided' });
  const root = document.createElement('div');
  root.id = 'other';
  document.querySelector('main').append(root);
  new Viewer(root, pictures.gallery, pictures.methods, await blobsOf(id), 'truth');
}"""


@pytest.fixture
def viewer(browser: Browser, report_path: Path, heard: list[str]) -> Iterator[Locator]:
    """The pictures of the first scene, of base colour; nothing else is opened."""
    page = open_report(browser, report_path, heard, f"{SCENE}?layer=base_color&right=gray&mode=flip")
    found = page.locator(f"#{SCENE} .viewer")
    found.locator(".readout tr[data-index]").first.wait_for()
    yield found
    page.close()
    assert heard == []


def pixel(viewer: Locator, number: int, x: int, y: int) -> list[int]:
    """The colour of a pixel of the tiny scene in one of the large pictures."""
    settle(viewer.page)
    canvas = viewer.locator(".panes canvas").nth(number)
    return canvas.evaluate(COLOUR, [(x + 0.5) / 28, (y + 0.5) / 24])[:3]


def place_of(canvas: Locator) -> Any:
    """Return the box of a picture in the window, once it is there."""
    canvas.scroll_into_view_if_needed()
    settle(canvas.page)
    return canvas.bounding_box()


def test_exposure_is_that_of_the_true_light(
    browser: Browser, report_path: Path, tiny_run: Path, heard: list[str]
) -> None:
    truth = open_truth(tiny_run / "dataset/dark/tiny-0000/truth")
    view = next(v for v in truth.views if v.split == "test")
    light = truth.layers(view)["radiance"] * truth.exposure
    page = open_report(browser, report_path, heard, f"{SCENE}?layer=radiance&right=ground truth&mode=flip")
    viewer = page.locator(f"#{SCENE} .viewer")
    slider = viewer.locator(".exposure")
    for stops, text in ((0, "0.00 stops"), (2.5, "+2.50 stops"), (-3, "−3.00 stops")):
        slider.evaluate(MOVE, stops)
        settle(page)
        assert slider.locator("xpath=../output").text_content() == text
        for x, y in ((5, 12), (14, 20), (20, 8)):
            expected = 255 * srgb_encode(np.maximum(light[y, x], 0) * 2.0**stops)
            assert np.abs(np.array(pixel(viewer, 0, x, y)) - expected).max() <= 2
    viewer.locator(".reset").click()
    settle(page)
    assert slider.input_value() == "0"
    page.close()
    assert heard == []


def test_keys_flip_between_rows_and_the_truth(viewer: Locator) -> None:
    caption = viewer.locator(".panes figcaption").first
    stage = viewer.locator(".stage")
    stage.focus()
    row = pixel(viewer, 0, 14, 18)
    assert caption.text_content() == "gray"
    viewer.page.keyboard.press("0")
    assert caption.text_content() == "ground truth"
    assert pixel(viewer, 0, 14, 18) != row
    viewer.page.keyboard.press("Space")
    viewer.page.keyboard.press("Space")
    viewer.page.keyboard.press("2")
    assert caption.text_content() == "gray" or caption.text_content() == "truth"
    viewer.page.keyboard.press("e")
    assert viewer.locator(".panes figcaption").all_text_contents() == ["error of gray", "gray"]
    viewer.page.keyboard.press("m")
    assert viewer.locator("[data-mode=side]").get_attribute("aria-pressed") == "true"
    viewer.page.keyboard.press("l")
    assert viewer.locator("[role=tab][aria-selected=true]").text_content() != "Base color"
    viewer.page.keyboard.press("v")
    assert viewer.locator(".film button").nth(1).get_attribute("aria-pressed") == "true"
    viewer.page.keyboard.press("r")


def test_divider_shows_one_row_left_and_another_right(viewer: Locator) -> None:
    viewer.locator("select.left").select_option(label="ground truth")
    viewer.locator("[data-mode=split]").click()
    right = pixel(viewer, 0, 20, 18)
    viewer.locator(".divider").evaluate(MOVE, 100)
    left = pixel(viewer, 0, 20, 18)
    assert left != right
    box = place_of(viewer.locator(".panes canvas").first)
    mouse = viewer.page.mouse
    mouse.move(box["x"] + 0.9 * box["width"], box["y"] + 20)
    mouse.down()
    mouse.move(box["x"] + 0.25 * box["width"], box["y"] + 20, steps=3)
    mouse.up()
    settle(viewer.page)
    assert viewer.locator(".divider").input_value() == "25"
    dragged = pixel(viewer, 0, 10, 18)
    viewer.locator(".reset").click()
    assert pixel(viewer, 0, 10, 18) != dragged
    assert viewer.locator(".divider").input_value() == "50"


def test_value_under_the_pointer_is_that_of_the_files(viewer: Locator, tiny_run: Path) -> None:
    truth = open_truth(tiny_run / "dataset/dark/tiny-0000/truth")
    view = next(v for v in truth.views if v.split == "test")
    expected = truth.layers(view)["base_color"][18, 14]
    box = place_of(viewer.locator(".panes canvas").first)
    viewer.page.mouse.move(box["x"] + 14.5 / 28 * box["width"], box["y"] + 18.5 / 24 * box["height"])
    settle(viewer.page)
    assert viewer.locator(".readout .where").text_content() == "Base color, row 18, column 14"
    cells = viewer.locator(".readout tr[data-index='-1'] td").all_text_contents()
    read = [float(text) for text in cells[0].split(", ")]
    assert np.abs(np.array(read) - expected).max() <= 0.005
    assert all(viewer.locator(".readout tr[data-index='1'] td").all_text_contents())
    viewer.locator(".stage").focus()
    viewer.page.keyboard.press("ArrowRight")
    viewer.page.keyboard.press("Shift+ArrowUp")
    settle(viewer.page)
    assert viewer.locator(".readout .where").text_content() == "Base color, row 10, column 15"
    assert "row 10, column 15: ground truth" in (viewer.locator(".said").text_content() or "")


def test_zoom_and_pan_move_all_pictures_together(viewer: Locator) -> None:
    viewer.locator("[data-mode=side]").click()
    viewer.locator(".zoom").evaluate(MOVE, 2)
    settle(viewer.page)
    box = place_of(viewer.locator(".panes canvas").first)
    mouse = viewer.page.mouse
    mouse.move(box["x"] + 100, box["y"] + 100)
    mouse.down()
    mouse.move(box["x"] + 20, box["y"] + 60, steps=3)
    mouse.up()
    link = viewer.locator("a.permalink").get_attribute("href") or ""
    assert "zoom=2" in link
    assert "centre=0.5" not in link.split("-")[0]
    colours = [pixel(viewer, n, 14, 12) for n in range(2)]
    viewer.page.mouse.move(0, 0)
    viewer.page.goto(f"{viewer.page.url.split('#')[0]}{link}")
    viewer.page.wait_for_selector(f"#{SCENE} .panes canvas")
    assert [pixel(viewer, n, 14, 12) for n in range(2)] == colours


def test_removal_shows_before_after_truth_and_what_is_left(
    browser: Browser, report_path: Path, heard: list[str]
) -> None:
    page = open_report(
        browser,
        report_path,
        heard,
        "track-2-scene-1?layer=counterfactual.radiance&right=retinex&mode=removal",
    )
    found = page.locator("#track-2-scene-1 .panes figcaption")
    found.nth(3).wait_for()
    assert found.all_text_contents() == ["before", "after: retinex", "truth", "what is left"]
    page.locator("#track-2-scene-1 [role=tab]").filter(has_text="Depth").click()
    assert not page.locator("#track-2-scene-1 [data-mode=removal]").is_visible()
    page.close()
    assert heard == []


def test_colours_of_numbers_have_a_scale(viewer: Locator) -> None:
    assert not viewer.locator(".of-values").is_visible()
    viewer.get_by_role("tab", name="Depth").click()
    assert viewer.locator(".of-values").is_visible()
    assert (viewer.locator(".of-values .high").text_content() or "").endswith(" m")


def test_gauge_of_a_row_stands_below_its_picture(viewer: Locator) -> None:
    assert "× 2 1 0.5" in (viewer.locator(".tiles figure[data-row=gray]").text_content() or "")


def test_layers_are_tabs_for_the_keyboard(viewer: Locator) -> None:
    chosen = viewer.locator("[role=tab][aria-selected=true]")
    before = chosen.text_content()
    chosen.focus()
    viewer.page.keyboard.press("ArrowRight")
    assert chosen.count() == 1
    assert chosen.text_content() != before
    assert viewer.page.evaluate("document.activeElement.getAttribute('aria-selected')") == "true"


def test_layers_that_nobody_provides_are_hidden_until_they_are_asked_for(viewer: Locator) -> None:
    viewer.page.evaluate(WITHOUT_DEPTH, SCENE)
    other = viewer.page.locator("#other")
    more, tab = other.locator(".more-layers"), other.locator("[role=tab]").filter(has_text="Depth")
    assert more.text_content() == "Show 1 layer that no row provides"
    assert not tab.is_visible()
    more.click()
    assert tab.is_visible()
    assert more.text_content() == "Hide 1 layer that no row provides"
    assert not viewer.locator(".more-layers").is_visible()


def test_a_map_has_one_scale_for_all_rows_and_is_read_by_the_pointer(viewer: Locator, tiny_run: Path) -> None:
    truth = open_truth(tiny_run / "dataset/dark/tiny-0000/truth")
    view = next(v for v in truth.views if v.split == "test")
    jobs = tiny_run / "jobs/dark/tiny-0000"
    layer = open_predictions(jobs / "gray-0" / "predictions").layers(view.name)["base_color"]
    p, t = layer[18, 14] * np.array([2, 1, 0.5]), truth.layers(view)["base_color"][18, 14]
    viewer.locator("select.measure").select_option("relative")
    end = viewer.locator(".of-errors .high").filter(has_text="% of the truth")
    end.wait_for()
    assert re.fullmatch(r"≥ [\d.]+ % of the truth", end.text_content() or "")
    notes = viewer.locator(".tiles figure[data-row] .note").all_text_contents()
    assert len([note for note in notes if "mean " in note]) == 3
    assert all(note.endswith(f", scale 0 to {end.text_content()}") for note in notes if "mean " in note)
    box = place_of(viewer.locator(".panes canvas").first)
    viewer.page.mouse.move(box["x"] + 14.5 / 28 * box["width"], box["y"] + 18.5 / 24 * box["height"])
    settle(viewer.page)
    read = viewer.locator(".readout tr[data-index='1'] td").nth(1).text_content() or ""
    assert float(read) == pytest.approx(float((100 * np.abs(p - t) / t).mean()), rel=0.15, abs=1)
    assert "measure=relative" in (viewer.locator("a.permalink").get_attribute("href") or "")
    viewer.get_by_role("tab", name="Normal, world axes").click()
    assert viewer.locator("select.measure option").all_text_contents() == ["Angle"]
    kept = viewer.locator(".tiles figure[data-row=retinex] .note").text_content() or ""
    assert re.search(r"scale 0 to ≥ [\d.]+ degrees$", kept)


def test_the_farthest_true_distance_is_read_as_it_is(
    browser: Browser, report_path: Path, tiny_run: Path, heard: list[str]
) -> None:
    """The scale ends there, and what is predicted beyond it reads as at least that."""
    truth = open_truth(tiny_run / "dataset/dark/tiny-0000/truth")
    depths = {v.name: truth.layers(v)["depth"] for v in truth.views if v.split == "test"}
    depths = {name: np.where(np.isfinite(depth), depth, 0) for name, depth in depths.items()}
    name = max(depths, key=lambda view: depths[view].max())
    row, column = np.unravel_index(depths[name].argmax(), depths[name].shape)
    query = f"view={name}&layer=depth&right=gray&mode=flip&at={column}-{row}"
    page = open_report(browser, report_path, heard, f"{SCENE}?{query}")
    value = page.locator(f"#{SCENE} .readout tr[data-index='-1'] td").first.filter(has_text=".")
    value.wait_for()
    assert float(value.text_content() or "") == pytest.approx(depths[name].max(), abs=0.001)
    page.close()
    assert heard == []

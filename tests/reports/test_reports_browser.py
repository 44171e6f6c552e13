# SPDX-License-Identifier: Apache-2.0
"""The report in a browser, opened as a file: what its script does, and that it asks nobody for anything."""

import csv
import re
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, Locator, Page

from graycard import open_predictions, open_truth, srgb_encode
from graycard.io import write_json
from graycard.records import Cost, JobResult
from graycard.reports import write_report
from graycard.reports._priors import PriorBadge
from graycard.reports._templates import environment
from graycard.reports.tables._cells import Cell
from graycard.reports.tables._tables import MethodHead
from report_pages import CHROMIUM, open_all, open_report
from runs_of_size import write_made_up

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium or google-chrome on this machine")

CELLS = """(scroll) => {
  const { left, top } = scroll.getBoundingClientRect();
  const bodies = [...scroll.querySelector('table').tBodies];
  const rows = bodies.flatMap((body) => [...body.rows]).filter((row) => row.cells.length > 1);
  return rows.map((row) => [...row.cells].map((cell) => cell.getBoundingClientRect()).map(
    (box) => [Math.round(box.left - left + 3), Math.round(box.bottom - top - 1)]));
}"""
"""A place in the left padding of each cell of a row, just above its lower edge, pixels of what scrolls."""
ALIGN = """(scroll) => {
  scroll.style.marginTop = '0px';
  const top = scroll.getBoundingClientRect().top + window.scrollY;
  scroll.style.marginTop = `${Math.ceil(top) - top}px`;
}"""
"""Parts of pixels above a table would blur the lines of cells that stick otherwise than those of others."""
MOVE = "(e, value) => { e.value = value; e.dispatchEvent(new Event('input', { bubbles: true })); }"
BACKGROUND = "getComputedStyle(document.body).backgroundColor"
FRAMES = """new Promise((done) => {
  requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done)));
})"""
COLOUR = """(canvas, [u, v]) => {
  const { width, height } = canvas;
  const copy = document.createElement('canvas');
  copy.width = copy.height = 1;
  const context = copy.getContext('2d', { willReadFrequently: true });
  context.drawImage(canvas, Math.floor(u * width), Math.floor(v * height), 1, 1, 0, 0, 1, 1);
  return [...context.getImageData(0, 0, 1, 1).data];
}"""
SCENE = "track-1-scene-1"
COPIED = """(row) => {
  const table = document.createElement('table');
  table.innerHTML = `<tr>${row}</tr>`;
  return [...table.rows[0].cells].map(copied);
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


@pytest.fixture(scope="module")
def path(tiny_run: Path) -> Path:
    return write_report(tiny_run)


@pytest.fixture
def heard() -> list[str]:
    return []


@pytest.fixture
def viewer(browser: Browser, path: Path, heard: list[str]) -> Iterator[Locator]:
    """The pictures of the first scene, of base colour; nothing else is opened."""
    page = open_report(browser, path, heard, f"{SCENE}?layer=base_color&right=gray&mode=flip")
    found = page.locator(f"#{SCENE} .viewer")
    found.locator(".readout tr[data-index]").first.wait_for()
    yield found
    page.close()
    assert heard == []


def settle(page: Page) -> None:
    page.evaluate(FRAMES)


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


def test_pictures_come_first_and_nothing_is_drawn_before_it_is_opened(
    browser: Browser, path: Path, heard: list[str]
) -> None:
    page = open_report(browser, path, heard, viewport={"width": 1400, "height": 900})
    box = page.locator("main img").first.bounding_box()
    assert box is not None
    assert box["y"] + box["height"] < 900
    assert page.evaluate("document.querySelectorAll('*').length") < 5000
    assert page.evaluate("document.documentElement.scrollHeight") < 8000
    assert page.locator("canvas").count() == page.locator("table.scores").count() == 0
    assert page.evaluate("window.broken") is None
    page.close()
    assert heard == []


def test_everything_opens_without_a_word_of_the_console(
    browser: Browser, path: Path, heard: list[str]
) -> None:
    page = open_report(browser, path, heard)
    open_all(page)
    settle(page)
    assert page.locator(".viewer .tiles canvas").count() > 20
    for name in ("retinex", "<script>window.broken = 1</script>"):
        assert page.get_by_text(name, exact=True).first.is_visible()
    assert page.evaluate("window.broken") is None
    assert page.evaluate("document.documentElement.scrollWidth") <= 1280
    page.close()
    assert heard == []


def test_exposure_is_that_of_the_true_light(
    browser: Browser, path: Path, tiny_run: Path, heard: list[str]
) -> None:
    truth = open_truth(tiny_run / "dataset/dark/tiny-0000/truth")
    view = next(v for v in truth.views if v.split == "test")
    light = truth.layers(view)["radiance"] * truth.exposure
    page = open_report(browser, path, heard, f"{SCENE}?layer=radiance&right=ground truth&mode=flip")
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
    browser: Browser, path: Path, heard: list[str]
) -> None:
    page = open_report(
        browser, path, heard, "track-2-scene-1?layer=counterfactual.radiance&right=retinex&mode=removal"
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


def test_rows_are_filtered_and_variants_unfold_everywhere(
    browser: Browser, path: Path, heard: list[str]
) -> None:
    page = open_report(browser, path, heard, f"{SCENE}-scores")
    page.locator(".row-filter").fill("retin")
    rows = page.locator("table.dots").first.locator("tbody tr")
    assert [row.get_attribute("data-row") for row in rows.all() if row.is_visible()] == ["retinex"]
    heads = page.locator(f"#{SCENE}-scores thead th")
    assert len([head for head in heads.all() if head.is_visible()]) == 2
    page.locator(".row-filter").fill("")
    assert len([head for head in heads.all() if head.is_visible()]) > 2
    page.close()
    assert heard == []


def test_table_is_sorted_searched_copied_and_linked(browser: Browser, path: Path, heard: list[str]) -> None:
    page = open_report(browser, path, heard, "track-1-by-scene")
    open_one = page.locator("#track-1-board")
    page.evaluate("location.hash = '#track-1-board'")
    page.wait_for_selector("body[data-opened='track-1-board']")
    table = open_one.locator("table.leaderboard")
    places = "(body) => [...body.rows].map((row) => [row.dataset.row, row.cells[0].textContent])"
    before = dict(table.locator("tbody").first.evaluate(places))
    assert sorted(before.values()) == ["1", "2", "3"]
    head = table.locator("thead th").nth(2)
    head.locator(".sort").click()
    assert head.get_attribute("aria-sort") == "descending"
    first = [row.get_attribute("data-row") for row in table.locator("tbody").first.locator("tr").all()]
    head.locator(".sort").click()
    assert [
        row.get_attribute("data-row") for row in table.locator("tbody").first.locator("tr").all()
    ] != first
    assert dict(table.locator("tbody").first.evaluate(places)) == before, "a place is of the whole table"
    first_head = table.locator("thead th").first
    first_head.locator(".sort").click()
    assert first_head.get_attribute("aria-sort") == "ascending", "the best place comes first"
    said = page.locator(".row-tools [role=status]")
    for words, expected in (("nobody", "no row has this name"), ("", "")):
        page.locator(".row-filter").fill(words)
        assert said.text_content() == expected
    open_one.locator(".find").fill("steps, light")
    assert [r.get_attribute("data-row") for r in table.locator("tbody tr").all() if r.is_visible()] == [
        "retinex"
    ]
    copies = {}
    for kind in ("markdown", "csv", "latex"):
        page.evaluate("delete document.body.dataset.copied")
        open_one.locator(f"[data-copy={kind}]").click()
        page.wait_for_selector("body[data-copied]")
        copies[kind] = page.evaluate("document.body.dataset.copied")
    assert copies["markdown"].splitlines()[0].startswith("| # | Method | Novel view PSNR")
    assert copies["csv"].splitlines()[1].split(",")[1] == "retinex"
    assert copies["latex"].count("\\\\") == len(copies["csv"].splitlines())
    assert copies["latex"].startswith("\\begin{tabular}{rlr")
    assert (
        copies["latex"].count("\\textbf{")
        == copies["markdown"].count("| **")
        == table.locator("tr[data-row=retinex] td.best").count()
        > 0
    )
    assert "<sup>a</sup> |" in copies["markdown"].splitlines()[2]
    assert "\n<sup>a</sup> significance not computed, 1 scene\n" in copies["markdown"]
    assert "\\par{\\footnotesize \\#: place among all methods with their own settings}" in copies["latex"]
    assert "<sup>" not in copies["csv"]
    link = open_one.locator("a.permalink").get_attribute("href")
    page.close()
    again = open_report(browser, path, heard, (link or "")[1:])
    assert again.locator(link or "").is_visible()
    again.close()
    assert heard == []


def test_what_is_not_found_leaves_no_heading_behind(browser: Browser, path: Path, heard: list[str]) -> None:
    page = open_report(browser, path, heard, "track-1-all")
    part = page.locator("#track-1-all")
    groups, said = part.locator("tr.group"), part.locator(".copied").first
    seen = len([row for row in groups.all() if row.is_visible()])
    part.locator(".find").first.fill("normal error")
    assert 0 < len([row for row in groups.all() if row.is_visible()]) < seen
    assert said.text_content() == ""
    part.locator(".find").first.fill("no such metric")
    assert not any(row.is_visible() for row in part.locator("tbody tr").all())
    assert said.text_content() == "no row has this"
    part.locator(".find").first.fill("")
    assert len([row for row in groups.all() if row.is_visible()]) == seen
    page.close()
    assert heard == []


def test_help_of_a_metric_stands_beside_its_name(browser: Browser, path: Path, heard: list[str]) -> None:
    page = open_report(browser, path, heard, "track-1-board")
    page.mouse.move(0, 0)  # focus scrolls the page, and a name might come to lie under the mouse
    page.locator(".leaderboard .metric button").nth(1).focus()
    tip = page.locator(".leaderboard .tip").nth(1)
    page.keyboard.press("Tab")
    page.keyboard.press("Shift+Tab")
    tip.wait_for(state="visible")
    page.keyboard.press("Escape")
    tip.wait_for(state="hidden")  # a busy browser takes a moment to hear the key
    page.close()
    assert heard == []


def test_dark_scheme_and_narrow_window(browser: Browser, path: Path, heard: list[str]) -> None:
    backgrounds = []
    for scheme in ("light", "dark"):
        size = {"width": 420, "height": 900}
        page = open_report(browser, path, heard, SCENE, color_scheme=scheme, viewport=size)
        assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
        backgrounds.append(page.evaluate(BACKGROUND))
        page.close()
    assert backgrounds == ["rgb(246, 246, 244)", "rgb(21, 22, 21)"]
    assert heard == []


@pytest.mark.parametrize("width", [420, 1400])
@pytest.mark.parametrize("scrolled", [0, 60])
def test_lines_of_tables_are_the_same_below_each_cell(
    browser: Browser, path: Path, width: int, scrolled: int
) -> None:
    """Heads of rows stick while a narrow table is scrolled, and their lines with them."""
    page = open_report(browser, path, [], viewport={"width": width, "height": 900})
    for part in ("track-1-board", f"{SCENE}-scores", "facts-jobs"):
        page.evaluate(f"location.hash = '#{part}'")
        page.wait_for_selector(f"body[data-opened='{part}']")
    page.evaluate(f"document.querySelectorAll('.scroll').forEach((e) => {{ e.scrollLeft = {scrolled}; }})")
    tables = [t for t in page.locator(".scroll:has(table.scores)").all() if t.is_visible()]
    assert len(tables) >= 3
    for table in tables:
        table.evaluate(ALIGN)
        settle(page)
        picture = np.asarray(Image.open(BytesIO(table.screenshot())).convert("RGB"))
        for row in table.evaluate(CELLS):
            strips = [picture[y - 4 : y + 1, x] for x, y in row if 0 <= x < picture.shape[1]]
            assert all((strip == strips[0]).all() for strip in strips)
            assert len(strips) > 1
    page.close()


def test_without_script_the_strips_are_there(browser: Browser, path: Path) -> None:
    page = browser.new_page(java_script_enabled=False)
    page.goto(path.as_uri())
    assert page.locator(".strip-of-pictures img").count() >= 3
    assert page.locator(".strip-of-pictures img").first.evaluate("(image) => image.naturalWidth") > 0
    assert page.locator("noscript p", has_text="scripts are off").is_visible()
    page.close()


def test_bar_wraps_and_what_sticks_stands_below_it(browser: Browser, make_run: Any, heard: list[str]) -> None:
    run, record = make_run()
    long = replace(record.scenes[0], scene="a-scene-whose-name-needs-all-of-the-width-that-a-window-has-" * 2)
    write_json(run / "run.json", replace(record, scenes=(*record.scenes, long)))
    page = open_report(browser, write_report(run), heard, viewport={"width": 500, "height": 900})
    assert page.evaluate("document.documentElement.scrollWidth") <= 500
    edges = [link.bounding_box() for link in page.locator("nav a").all()]
    assert all(box and box["x"] >= 0 and box["x"] + box["width"] <= 500 for box in edges)
    height = page.evaluate("document.querySelector('nav').offsetHeight")
    assert (
        page.evaluate("getComputedStyle(document.documentElement).getPropertyValue('--bar')") == f"{height}px"
    )
    page.close()
    assert heard == []


def test_times_are_sorted_as_times_and_one_head_is_marked(
    browser: Browser, tmp_path: Path, heard: list[str]
) -> None:
    record = write_made_up(tmp_path, 2, 1, metrics=2)
    costs = zip(record.results, (Cost(4.2, 10.0), Cost(75.0, 9.0)), strict=True)
    write_json(tmp_path / "run.json", replace(record, results=tuple(replace(r, cost=c) for r, c in costs)))
    page = open_report(browser, write_report(tmp_path), heard, "facts-jobs")
    heads = page.locator("#facts-jobs thead th")
    heads.nth(4).locator(".sort").click()
    times = page.locator("#facts-jobs tbody td:nth-child(5)").all_text_contents()
    assert times == ["1 min 15 s", "4.2 s"]
    heads.nth(5).locator(".sort").click()
    assert "".join(heads.locator(".sort").all_text_contents()) == "↕↕↕↕↕↓↕↕"
    page.close()
    assert heard == []


def test_copies_are_safe_for_what_reads_them(browser: Browser, path: Path, heard: list[str]) -> None:
    page = open_report(browser, path, heard)
    rows = [["=1+2", "−0.5, −3"], ["@a", "-1+cmd|' /C calc'!A0"], ["a|b<i>`", "≥ 2 ± 1"]]
    cells = [[{"text": text} for text in row] for row in rows]
    written = {
        kind: page.evaluate(f"(rows) => WRITERS.{kind}(rows, 'x')", cells)
        for kind in ("csv", "markdown", "latex")
    }
    assert [*csv.reader(StringIO(written["csv"]))] == [
        ["'=1+2", "-0.5, -3"], ["'@a", "'-1+cmd|' /C calc'!A0"], ["a|b<i>`", "≥ 2 ± 1"],
    ]  # fmt: skip
    assert written["markdown"].splitlines()[-1] == "| a\\|b\\<i\\>\\` | ≥ 2 ± 1 |"
    assert "a\\textbar{}b\\textless{}i\\textgreater{}` & $\\geq$ 2 $\\pm$ 1 \\\\" in written["latex"]
    page.close()
    assert heard == []


def test_copies_have_intervals_ties_and_priors(browser: Browser, path: Path, heard: list[str]) -> None:
    page = open_report(browser, path, heard)
    tied = {"text": "2.50 (1 of 2 scored)", "lacks": "1 of 2 scored", "notes": ["tied with one", "ö & <p>"]}
    rows = [
        [{"text": "Method"}, {"text": "PSNR ↑ dB"}],
        [
            {"text": "one", "badges": ["reference", "priors: oracle 2"], "words": ["priors: oracle 2: told"]},
            {"text": "3.50", "best": True, "low": "−1.25", "high": "4.00", "notes": ["tied with two"]},
        ],
        [{"text": "two"}, tied],
        [{"text": "three"}, {"text": "2.40", "notes": ["tied with one"]}],
    ]
    written = {
        kind: page.evaluate(f"(rows) => WRITERS.{kind}(rows, 'x')", rows)
        for kind in ("csv", "markdown", "latex")
    }
    assert [*csv.reader(StringIO(written["csv"]))] == [
        ["Method", "PSNR ↑ dB: value", "PSNR ↑ dB: low", "PSNR ↑ dB: high", "PSNR ↑ dB: note"],
        ["one", "3.50", "-1.25", "4.00", ""],
        ["two", "2.50", "", "", "1 of 2 scored"],
        ["three", "2.40", "", "", ""],
    ]
    assert written["markdown"].splitlines()[2:] == [
        "| one (reference; priors: oracle 2) | **3.50** \\[−1.25, 4.00\\]<sup>a</sup> |",
        "| two | 2.50 (1 of 2 scored)<sup>b, c</sup> |",
        "| three | 2.40<sup>b</sup> |",
        "", "<sup>a</sup> tied with two",
        "", "<sup>b</sup> tied with one",
        "", "<sup>c</sup> ö & \\<p\\>",
        "", "priors: oracle 2: told",
        "", "\\[low, high\\]: 95 % interval",
    ]  # fmt: skip
    body = written["latex"].split("\\midrule\n")[1].splitlines()
    assert body[:2] == [
        "one (reference; priors: oracle 2) & \\textbf{3.50} [$-$1.25, 4.00]\\textsuperscript{a} \\\\",
        "two & 2.50 (1 of 2 scored)\\textsuperscript{b, c} \\\\",
    ]
    assert body[4:] == [
        "\\end{tabular}",
        "\\par{\\footnotesize \\textsuperscript{a} tied with two}",
        "\\par{\\footnotesize \\textsuperscript{b} tied with one}",
        "\\par{\\footnotesize \\textsuperscript{c} ö \\& \\textless{}p\\textgreater{}}",
        "\\par{\\footnotesize priors: oracle 2: told}",
        "\\par{\\footnotesize [low, high]: 95 \\% interval}",
    ]
    page.close()
    assert heard == []


def test_cells_are_copied_with_what_the_page_says_of_them(
    browser: Browser, path: Path, heard: list[str]
) -> None:
    macros: Any = environment().get_template("macros.html.j2").module
    head = MethodHead("goris", "A summary.", (), True, PriorBadge("oracle 2", "answers are made wrong"))
    notes = ("tied with one", "1.00 by 1 missing light", "ceiling 9.00")
    cell = Cell("scored", "3.50", 3.5, notes, interval=("3.00", "4.00"), standing=notes[0], unpaired=notes[1])
    page = open_report(browser, path, heard)
    copied = page.evaluate(COPIED, f"<th>{macros.method_name(head)}</th>{macros.cell(cell)}")
    help_of = "priors: oracle 2: Told more than the photographs by priors: answers are made wrong"
    assert (copied[0]["text"], copied[0]["badges"]) == ("goris", ["submitted", "priors: oracle 2"])
    assert copied[0]["words"] == [help_of]
    assert (copied[1]["text"], copied[1]["low"], copied[1]["high"]) == ("3.50", "3.00", "4.00")
    assert copied[1]["notes"] == ["tied with one", "1.00 by 1 missing light"]
    page.close()
    assert heard == []


def test_what_nobody_provides_is_hidden_until_it_is_asked_for(
    browser: Browser, tmp_path: Path, heard: list[str]
) -> None:
    record = write_made_up(tmp_path, 2, 1, metrics=2)
    silent = record.metrics[1].id
    write_json(
        tmp_path / "run.json", replace(record, results=tuple(without(r, silent) for r in record.results))
    )
    page = open_report(browser, write_report(tmp_path), heard, "track-1-all")
    rows, button = page.locator("#track-1-all tbody.nobody tr"), page.locator("#track-1-all [data-shows]")
    assert "1 metric" in (page.locator("#track-1-all .hidden-rest").text_content() or "")
    assert [row.is_visible() for row in rows.all()] == [False, False]
    button.click()
    assert [row.is_visible() for row in rows.all()] == [True, True]
    button.click()
    assert [row.is_visible() for row in rows.all()] == [False, False]
    page.close()
    assert heard == []


def without(result: JobResult, metric: str) -> JobResult:
    """Return a result that does not provide a metric."""
    assert result.sheet is not None
    scores = tuple(
        replace(score, status="not provided", value=None, per_view={}) if score.metric == metric else score
        for score in result.sheet.scores
    )
    return replace(result, sheet=replace(result.sheet, scores=scores))


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


def test_a_part_that_is_damaged_says_so(
    browser: Browser, path: Path, tmp_path: Path, heard: list[str]
) -> None:
    damaged = re.sub(r'(?<=data-part="facts-machine">)[^<]*', "AAAA", path.read_text(encoding="utf-8"))
    (tmp_path / "damaged.html").write_text(damaged, encoding="utf-8")
    page = open_report(browser, tmp_path / "damaged.html", heard, "facts-machine")
    assert "This cannot be drawn" in (page.locator("#facts-machine .trouble").text_content() or "")
    page.close()
    assert heard == []


def test_the_farthest_true_distance_is_read_as_it_is(
    browser: Browser, path: Path, tiny_run: Path, heard: list[str]
) -> None:
    """The scale ends there, and what is predicted beyond it reads as at least that."""
    truth = open_truth(tiny_run / "dataset/dark/tiny-0000/truth")
    depths = {v.name: truth.layers(v)["depth"] for v in truth.views if v.split == "test"}
    depths = {name: np.where(np.isfinite(depth), depth, 0) for name, depth in depths.items()}
    name = max(depths, key=lambda view: depths[view].max())
    row, column = np.unravel_index(depths[name].argmax(), depths[name].shape)
    query = f"view={name}&layer=depth&right=gray&mode=flip&at={column}-{row}"
    page = open_report(browser, path, heard, f"{SCENE}?{query}")
    value = page.locator(f"#{SCENE} .readout tr[data-index='-1'] td").first.filter(has_text=".")
    value.wait_for()
    assert float(value.text_content() or "") == pytest.approx(depths[name].max(), abs=0.001)
    page.close()
    assert heard == []

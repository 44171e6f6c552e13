# SPDX-License-Identifier: Apache-2.0
"""The report in a browser, opened as a file: what its script does, and that it asks nobody for anything."""

import shutil
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

from graycard import open_truth, srgb_encode
from graycard.io import write_json
from graycard.reports import write_report

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium or google-chrome on this machine")

READ_CANVAS = """(label) => {
  const canvas = [...document.querySelectorAll('canvas')].find((c) => c.getAttribute('aria-label') === label);
  return [...canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data];
}"""
CELLS = """(scroll) => {
  const { left, top } = scroll.getBoundingClientRect();
  const bodies = [...scroll.querySelector('table').tBodies];
  const rows = bodies.flatMap((body) => [...body.rows]).filter((row) => row.cells.length > 1);
  return rows.map((row) => [...row.cells].map((cell) => cell.getBoundingClientRect()).map(
    (box) => [Math.round(box.left - left + 3), Math.round(box.bottom - top - 1)]));
}"""
"""A place in the left padding of each cell of a row, just above its lower edge, pixels of what scrolls."""
MOVE = "(e, value) => { e.value = value; e.dispatchEvent(new Event('input', { bubbles: true })); }"
BACKGROUND = "getComputedStyle(document.body).backgroundColor"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


def open_report(browser: Browser, path: Path, heard: list[str], **options: Any) -> Page:
    page = browser.new_page(**options)
    page.on("console", lambda message: heard.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: heard.append(str(error)))
    page.on("request", lambda request: heard.append(request.url) if is_foreign(request.url) else None)
    page.goto(path.as_uri())
    page.wait_for_selector("body[data-ready=true]")
    return page


def is_foreign(url: str) -> bool:
    return not url.startswith(("file:", "data:"))


def test_report_in_a_browser(browser: Browser, tiny_run: Path) -> None:
    heard: list[str] = []
    page = open_report(browser, write_report(tiny_run), heard)
    truth = open_truth(tiny_run / "dataset/dark/tiny-0000/truth")
    view = next(v for v in truth.views if v.split == "test")
    light = truth.layers(view)["radiance"] * truth.exposure

    for name in ("Dark", "Tabletop", "Multilight", "retinex", "<script>window.broken = 1</script>"):
        assert page.get_by_text(name, exact=True).first.is_visible()
    assert page.evaluate("window.broken") is None

    slider = page.locator(".exposure").first
    for stops, text in ((0, "0.00 stops"), (2.5, "+2.50 stops"), (-3, "−3.00 stops")):
        slider.evaluate(MOVE, stops)
        assert page.locator("output").first.text_content() == text
        data = np.array(page.evaluate(READ_CANVAS, f"Radiance, {view.name}: truth"))
        shown = data.reshape(view.camera.height, view.camera.width, 4)
        assert (shown[..., 3] == 255).all()
        expected = 255 * srgb_encode(np.maximum(light, 0) * 2.0**stops)
        assert np.abs(shown[..., :3] - expected).max() <= 1
    page.locator(".reset").first.click()
    assert page.locator("output").first.text_content() == "0.00 stops"

    scene = page.locator(".scene").first
    first, second = scene.locator(".view").all()
    assert (first.is_visible(), second.is_visible()) == (True, False)
    scene.locator(".views input").nth(1).check()
    assert (first.is_visible(), second.is_visible()) == (False, True)

    page.mouse.move(0, 0)  # focus scrolls the page, and a name might come to lie under the mouse
    page.locator(".leaderboard .metric button").first.focus()
    page.keyboard.press("Tab")
    tip = page.locator(".leaderboard .tip").nth(1)
    tip.wait_for(state="visible")
    page.keyboard.press("Escape")
    tip.wait_for(state="hidden")  # a busy browser takes a moment to hear the key
    page.close()
    assert heard == []


def test_dark_scheme_and_narrow_window(browser: Browser, tiny_run: Path) -> None:
    heard: list[str] = []
    path = write_report(tiny_run)
    backgrounds = []
    for scheme in ("light", "dark"):
        size = {"width": 420, "height": 900}
        page = open_report(browser, path, heard, color_scheme=scheme, viewport=size)
        assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
        backgrounds.append(page.evaluate(BACKGROUND))
        page.close()
    assert backgrounds == ["rgb(246, 246, 244)", "rgb(21, 22, 21)"]
    assert heard == []


@pytest.mark.parametrize("width", [420, 1400])
@pytest.mark.parametrize("scrolled", [0, 60])
def test_lines_of_tables_are_the_same_below_each_cell(
    browser: Browser, tiny_run: Path, width: int, scrolled: int
) -> None:
    """Heads of rows stick while a narrow table is scrolled, and their lines with them."""
    page = open_report(browser, write_report(tiny_run), [], viewport={"width": width, "height": 900})
    page.evaluate(f"document.querySelectorAll('.scroll').forEach((e) => {{ e.scrollLeft = {scrolled}; }})")
    tables = [t for t in page.locator(".scroll:has(table.scores)").all() if t.is_visible()]
    assert tables
    for table in tables:
        picture = np.asarray(Image.open(BytesIO(table.screenshot())).convert("RGB"))
        for row in table.evaluate(CELLS):
            strips = [picture[y - 4 : y + 1, x] for x, y in row if 0 <= x < picture.shape[1]]
            assert all((strip == strips[0]).all() for strip in strips)
            assert len(strips) > 1
    page.close()


def test_without_script_pictures_and_both_views_are_there(browser: Browser, tiny_run: Path) -> None:
    page = browser.new_page(java_script_enabled=False)
    page.goto(write_report(tiny_run).as_uri())
    assert all(view.is_visible() for view in page.locator(".view").all())
    assert page.locator("img[data-linear]").first.is_visible()
    assert not page.locator(".controls").first.is_visible()
    page.close()


def test_bar_wraps_and_pictures_keep_whole_pixels(browser: Browser, make_run: Any) -> None:
    """A name of the bar is never beyond the edge; what sticks stands below it; a pixel is two wide."""
    run, record = make_run()
    long = replace(record.scenes[0], scene="a-scene-whose-name-needs-all-of-the-width-that-a-window-has-" * 2)
    write_json(run / "run.json", replace(record, scenes=(*record.scenes, long)))
    heard: list[str] = []
    page = open_report(browser, write_report(run), heard, viewport={"width": 1300, "height": 900})
    assert page.evaluate("document.documentElement.scrollWidth") <= 1300
    edges = [link.bounding_box() for link in page.locator("nav a").all()]
    assert all(box and box["x"] >= 0 and box["x"] + box["width"] <= 1300 for box in edges)
    height = page.evaluate("document.querySelector('nav').offsetHeight")
    assert height > 60
    top = page.evaluate("getComputedStyle(document.querySelector('.controls')).top")
    assert top == f"{height}px"
    sizes = "[...document.querySelectorAll('.view:not([hidden]) .gallery .pixels')].map((e) => e.offsetWidth)"
    assert set(page.evaluate(sizes)) == {2 * 28}
    page.close()
    assert heard == []

# SPDX-License-Identifier: Apache-2.0
"""The report in a browser, opened as a file: what its script does, and that it asks nobody for anything."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser

from graycard.io import write_json
from graycard.reports import write_report
from report_pages import CHROMIUM, SCENE, open_all, open_report, settle

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium or google-chrome on this machine")

BACKGROUND = "getComputedStyle(document.body).backgroundColor"


def test_pictures_come_first_and_nothing_is_drawn_before_it_is_opened(
    browser: Browser, report_path: Path, heard: list[str]
) -> None:
    page = open_report(browser, report_path, heard, viewport={"width": 1400, "height": 900})
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
    browser: Browser, report_path: Path, heard: list[str]
) -> None:
    page = open_report(browser, report_path, heard)
    open_all(page)
    settle(page)
    assert page.locator(".viewer .tiles canvas").count() > 20
    for name in ("retinex", "<script>window.broken = 1</script>"):
        assert page.get_by_text(name, exact=True).first.is_visible()
    assert page.evaluate("window.broken") is None
    assert page.evaluate("document.documentElement.scrollWidth") <= 1280
    page.close()
    assert heard == []


def test_dark_scheme_and_narrow_window(browser: Browser, report_path: Path, heard: list[str]) -> None:
    backgrounds = []
    for scheme in ("light", "dark"):
        size = {"width": 420, "height": 900}
        page = open_report(browser, report_path, heard, SCENE, color_scheme=scheme, viewport=size)
        assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
        backgrounds.append(page.evaluate(BACKGROUND))
        page.close()
    assert backgrounds == ["rgb(246, 246, 244)", "rgb(21, 22, 21)"]
    assert heard == []


def test_without_script_the_strips_are_there(browser: Browser, report_path: Path) -> None:
    page = browser.new_page(java_script_enabled=False)
    page.goto(report_path.as_uri())
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


def test_a_part_that_is_damaged_says_so(
    browser: Browser, report_path: Path, tmp_path: Path, heard: list[str]
) -> None:
    damaged = re.sub(r'(?<=data-part="facts-machine">)[^<]*', "AAAA", report_path.read_text(encoding="utf-8"))
    (tmp_path / "damaged.html").write_text(damaged, encoding="utf-8")
    page = open_report(browser, tmp_path / "damaged.html", heard, "facts-machine")
    assert "This cannot be drawn" in (page.locator("#facts-machine .trouble").text_content() or "")
    page.close()
    assert heard == []

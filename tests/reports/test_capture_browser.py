# SPDX-License-Identifier: Apache-2.0
"""The page of an imported capture in a browser: first light, then layers beside the photograph."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser

from graycard.eval import score_photographs
from graycard.reports import CaptureRow, write_capture_report
from real_captures import import_tiny, predict_photographs
from report_pages import CHROMIUM

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium or google-chrome on this machine")
HALVES = """() => {
  const canvas = document.querySelector('.panes canvas');
  const [x, y] = [canvas.width / 28, canvas.height / 24];
  const read = (column) => [...canvas.getContext('2d').getImageData((column + 0.5) * x, 12.5 * y, 1, 1).data];
  return [read(7), read(20)];
}"""
"""Colours of a pixel left and right of the divider, of pictures of 28 x 24 pixels."""


def test_a_capture_begins_with_light_and_shows_layers_beside_it(
    browser: Browser, tmp_path: Path, write_tiny: Callable[..., Path]
) -> None:
    scene = import_tiny(tmp_path, write_tiny)
    black = predict_photographs(tmp_path / "mine", scene, lambda view, light: np.zeros_like(light))
    path = write_capture_report(scene, [CaptureRow("mine", black, score_photographs(black, scene))])
    heard: list[str] = []
    page = browser.new_page(viewport={"width": 420, "height": 900})
    page.on("console", lambda message: heard.append(message.text) if message.type == "error" else None)
    page.on("request", lambda asked: heard.append(asked.url) if asked.url != path.as_uri() else None)
    page.goto(path.as_uri())
    page.locator("[role=tab]").first.wait_for()
    chosen = page.locator("[role=tab][aria-selected=true]")
    assert chosen.text_content() == "Radiance"
    assert page.evaluate("document.documentElement.scrollWidth") <= 420
    drawn = f"() => {{ const [a, b] = ({HALVES})(); return a[3] && b[3]; }}"
    page.wait_for_function(drawn)
    photograph, light = page.evaluate(HALVES)
    assert photograph[:3] != [0, 0, 0] == light[:3]
    page.get_by_role("tab", name="Base color").click()
    assert page.locator(".panes figcaption").first.text_content() == "photograph | mine"
    page.wait_for_function(drawn)
    left, right = page.evaluate(HALVES)
    assert left == photograph
    assert right[:3] != [0, 0, 0]
    again = browser.new_page()
    again.goto(path.as_uri() + (page.locator(".viewer a.permalink").get_attribute("href") or ""))
    again.locator("[role=tab][aria-selected=true]", has_text="Base color").wait_for()
    again.close()
    page.set_viewport_size({"width": 1400, "height": 900})
    found = [v for v in Axe().run(page).response["violations"] if v["impact"] in ("serious", "critical")]
    assert [(rule["id"], rule["nodes"][0]["html"]) for rule in found] == []
    page.close()
    assert [text for text in heard if not text.startswith(("data:", "blob:"))] == []

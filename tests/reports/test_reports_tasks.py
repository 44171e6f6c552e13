# SPDX-License-Identifier: Apache-2.0
"""The questions of docs/how-to/read-a-report.md, answered in a browser in three actions at most."""

import csv
from collections.abc import Iterator
from io import StringIO
from typing import Any

import pytest
from playwright.sync_api import Browser, Locator, Page

from graycard.reports.history._keep import OWN
from report_pages import CHROMIUM, open_report

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium or google-chrome on this machine")

SIZES = ({"width": 1400, "height": 900}, {"width": 420, "height": 900})


class Reader:
    """Somebody who reads a page, and counts what has to be done."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.actions = 0

    def click(self, place: Locator) -> None:
        self.actions += 1
        place.click()

    def open(self, part: str) -> Locator:
        self.click(self.page.locator(f"#{part} > summary"))
        content = self.page.locator(f"#{part} > .inside")
        content.wait_for()
        return content

    def scene(self, number: int = 1) -> Locator:
        self.open(f"track-1-scene-{number}")
        viewer = self.page.locator(f"#track-1-scene-{number} .viewer")
        viewer.locator(".panes canvas").first.wait_for()
        return viewer


@pytest.fixture(params=SIZES, ids=lambda size: str(size["width"]))
def size(request: pytest.FixtureRequest) -> Any:
    return request.param


@pytest.fixture
def reader(browser: Browser, size: Any, heard: list[str]) -> Iterator[Reader]:
    page = open_report(browser, OWN / "tabletop" / "index.html", heard, viewport=size)
    found = Reader(page)
    yield found
    assert found.actions <= 3
    assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
    page.close()
    assert heard == []


def test_best_albedo_on_dark_and_is_it_sure(browser: Browser, size: Any, heard: list[str]) -> None:
    page = open_report(browser, OWN / "dark" / "index.html", heard, viewport=size)
    answer = page.locator(".answer").first
    assert answer.is_visible()
    assert "darkgs priors: oracle 0 has the best albedo" in " ".join((answer.text_content() or "").split())
    assert "tied with sunfaded" in (answer.text_content() or "")
    page.close()
    assert heard == []


def test_worst_scene_of_a_row_and_the_layer_that_explains_it(reader: Reader) -> None:
    table = reader.open("track-1-by-scene").locator("table").nth(1)
    reader.click(table.locator("tr[data-row=goris] a.worst-cell"))
    cause = reader.page.locator(".worst section[data-row=goris] .cause").first
    cause.wait_for()
    assert "rank correlation" in (cause.text_content() or "")


def test_flip_two_rows_on_the_mirror(reader: Reader) -> None:
    viewer = reader.scene()
    reader.actions += 1
    viewer.locator("select.left").select_option(label="removal")
    caption = viewer.locator(".panes figcaption").first
    assert caption.text_content() == "removal | goris"
    reader.actions += 1
    viewer.locator(".stage").press("Space")
    assert caption.text_content() == "goris | removal"


def test_value_of_f0_at_a_pixel(reader: Reader) -> None:
    viewer = reader.scene()
    reader.click(viewer.get_by_role("tab", name="F0"))
    reader.actions += 1
    viewer.locator(".panes canvas").first.hover(position={"x": 40, "y": 100})
    value = viewer.locator(".readout tbody tr").nth(1).locator("td").first
    value.filter(has_text=",").wait_for()
    assert len((value.text_content() or "").split(",")) == 3


def test_verdict_and_its_evidence(reader: Reader) -> None:
    reader.click(reader.page.locator("a.mark[href='#claim-R1']"))
    claim = reader.page.locator("#claim-panel article")
    claim.wait_for()
    assert claim.locator(".effect-row").count() == 4


def test_what_is_left_after_the_removal(reader: Reader) -> None:
    viewer = reader.scene()
    reader.click(viewer.get_by_role("tab", name="Radiance without the target object"))
    reader.click(viewer.get_by_role("button", name="Removal", exact=True))
    assert viewer.locator(".panes figcaption").last.text_content() == "what is left"
    assert viewer.locator(".panes canvas").count() == 4


def test_how_far_lights_are_from_the_true_ones(reader: Reader) -> None:
    reader.scene()
    plan = reader.open("track-1-scene-1-lights")
    assert plan.locator("svg.plan").is_visible()
    assert plan.locator(".lights-table tbody tr").count() >= 2


def test_a_metric_that_is_not_at_the_top(reader: Reader) -> None:
    content = reader.open("track-1-all")
    reader.actions += 1
    content.locator(".find").fill("overlap")
    rows = [row for row in content.locator("tbody tr:not(.group)").all() if row.is_visible()]
    assert rows
    assert all("overlap" in (row.text_content() or "").lower() for row in rows)


def test_variants_of_a_method(reader: Reader) -> None:
    reader.click(reader.page.locator(".show-variants"))
    reader.actions += 1
    reader.page.locator(".row-filter").fill("goris")
    rows = [
        r.get_attribute("data-row")
        for r in reader.page.locator("table.dots tbody tr").all()
        if r.is_visible()
    ]
    assert len(rows) == 12
    assert all(str(name).startswith("goris") for name in rows)


def test_a_table_for_a_paper(reader: Reader) -> None:
    content = reader.open("track-1-board")
    reader.click(content.locator("[data-copy=latex]"))
    reader.page.wait_for_selector("body[data-copied]")
    assert "\\toprule" in reader.page.evaluate("document.body.dataset.copied")
    reader.page.evaluate("delete document.body.dataset.copied")
    reader.click(content.locator("[data-copy=csv]"))
    reader.page.wait_for_selector("body[data-copied]")
    head, *rows = csv.reader(StringIO(reader.page.evaluate("document.body.dataset.copied")))
    first = next(i for i, name in enumerate(head) if name.endswith(": value"))
    assert [name.rpartition(": ")[2] for name in head[first : first + 3]] == ["value", "low", "high"]
    ends = [[float(cell) for cell in row[first : first + 3]] for row in rows if row[first + 1]]
    assert len(ends) > 3
    assert all(low <= value <= high for value, low, high in ends)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_serious_for_axe(browser: Browser, heard: list[str], scheme: Any) -> None:
    axe = pytest.importorskip(
        "axe_playwright_python.sync_playwright", reason="axe-playwright-python is not installed"
    )
    page = open_report(browser, OWN / "tabletop" / "index.html", heard, color_scheme=scheme)
    for part in (
        "track-1-scene-1",
        "track-1-scene-1-worst",
        "track-1-scene-1-lights",
        "track-1-board",
        "claim-R1",
    ):
        page.evaluate(f"location.hash = '#{part}'")
        page.wait_for_selector(f"body[data-opened='{part}']")
    found = axe.Axe().run(page).response["violations"]
    assert not [(v["id"], v["nodes"][0]["html"]) for v in found if v["impact"] in ("serious", "critical")]
    page.close()
    assert heard == []

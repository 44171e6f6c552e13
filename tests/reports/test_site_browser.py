# SPDX-License-Identifier: Apache-2.0
"""The site of a ledger in a browser: silent, narrow, dark, by keyboard, and by the rules of axe-core."""

from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page

from graycard.cli import main
from graycard.reports.history._keep import OWN
from report_pages import CHROMIUM

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium or google-chrome on this machine")
PAGES = ("index", "claims", "leaderboards", "scenes", "methods", "submit", "history")
SERIOUS = ("serious", "critical")
BACKGROUND = "getComputedStyle(document.body).backgroundColor"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site of one run of graycard's own, with the history of all of them."""
    out = tmp_path_factory.mktemp("browsed") / "site"
    assert main(["site", str(OWN / "matte"), "--out", str(out)]) == 0
    return out


def opened(browser: Browser, path: Path, heard: list[str], scheme: str = "light", width: int = 420) -> Page:
    """Open a page and hear what it says and asks for."""
    page = browser.new_page(
        color_scheme="dark" if scheme == "dark" else "light", viewport={"width": width, "height": 900}
    )
    page.on("console", lambda message: heard.append(message.text))
    page.on("pageerror", lambda error: heard.append(str(error)))
    page.on("request", lambda asked: heard.append(asked.url) if asked.url != path.as_uri() else None)
    page.goto(path.as_uri())
    return page


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_silent_and_fits_a_narrow_window_in_both_schemes(browser: Browser, site: Path, name: str):
    heard: list[str] = []
    colours = []
    for scheme in ("light", "dark"):
        page = opened(browser, site / f"{name}.html", heard, scheme)
        assert page.evaluate("document.documentElement.scrollWidth") <= 420
        colours.append(page.evaluate(BACKGROUND))
        page.close()
    assert colours == ["rgb(246, 246, 244)", "rgb(21, 22, 21)"]
    assert heard == []


@pytest.mark.parametrize(
    ("name", "scheme", "width"),
    [
        ("index", "light", 420),
        ("leaderboards", "dark", 420),
        ("methods", "dark", 1400),
        ("submit", "light", 420),
    ],
)
def test_axe_finds_nothing_serious(browser: Browser, site: Path, name: str, scheme: str, width: int):
    page = opened(browser, site / f"{name}.html", [], scheme, width)
    found = Axe().run(page).response["violations"]
    page.close()
    told = {
        rule["id"]: [node["html"] for node in rule["nodes"]] for rule in found if rule["impact"] in SERIOUS
    }
    assert told == {}


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("name", ["claims", "history"])
def test_axe_finds_nothing_serious_in_long_pages(browser: Browser, site: Path, name: str, scheme: str):
    test_axe_finds_nothing_serious(browser, site, name, scheme, 1400)


def test_axe_finds_what_is_wrong(browser: Browser, site: Path, tmp_path: Path):
    text = (site / "submit.html").read_text(encoding="utf-8")
    planted = text.replace("<main id=", '<img src="data:,"><main id=')
    (tmp_path / "planted.html").write_text(planted, encoding="utf-8")
    page = opened(browser, tmp_path / "planted.html", [])
    found = {rule["id"] for rule in Axe().run(page).response["violations"] if rule["impact"] in SERIOUS}
    page.close()
    assert "image-alt" in found


def test_a_permalink_and_the_keyboard_lead_to_a_claim(browser: Browser, site: Path):
    page = opened(browser, site / "index.html", [], width=1400)
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"
    link = page.get_by_role("link", name="R3", exact=True)
    link.focus()
    page.keyboard.press("Enter")
    page.wait_for_url("**/claims.html#R3")
    top = page.evaluate("document.querySelector('#R3').getBoundingClientRect().top")
    assert 0 < top < 900
    reached = page.evaluate("document.querySelector('nav').getBoundingClientRect().bottom")
    assert top >= reached, "what sticks does not cover it"
    page.close()

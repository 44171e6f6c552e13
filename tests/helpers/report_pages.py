# SPDX-License-Identifier: Apache-2.0
"""Pages of reports in a browser, and what they do that they must not."""

import shutil
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
SCENE = "track-1-scene-1"
"""The part of the first scene of a report."""


def open_report(browser: Browser, path: Path, heard: list[str], anchor: str = "", **options: Any) -> Page:
    """Open a page as a file; ``heard`` takes every message of its console and every request to elsewhere."""
    page = browser.new_page(**options)
    page.on("console", lambda message: heard.append(message.text))
    page.on("pageerror", lambda error: heard.append(str(error)))
    page.on("request", lambda request: heard.append(request.url) if is_foreign(request.url) else None)
    page.goto(path.as_uri() + (f"#{anchor}" if anchor else ""))
    page.wait_for_selector("body[data-ready=true]")
    if anchor:
        page.wait_for_selector(f'body[data-opened="{anchor.split("?")[0]}"]')
    return page


def is_foreign(url: str) -> bool:
    return not url.startswith(("file:", "data:", "blob:"))


def open_all(page: Page) -> None:
    """Open every part, the parts inside too, and all claims."""
    while page.locator("details.part:not([open])").count():
        page.evaluate("document.querySelectorAll('details.part').forEach((part) => { part.open = true; })")
        empty = page.locator("details.part[data-part][open]:not(:has(> .inside))")
        while empty.count():
            page.wait_for_timeout(20)
    if page.locator("a.mark").count():
        page.evaluate("location.hash = '#claims-all'")
        page.wait_for_selector("body[data-opened=claims-all]")


def settle(page: Page) -> None:
    """Wait for three frames: what was asked for is drawn then."""
    frame = "await new Promise(requestAnimationFrame);"
    page.evaluate(f"async () => {{ {3 * frame} }}")

# SPDX-License-Identifier: Apache-2.0
"""The site builds strictly, has a page for every part of the reference, and loads nothing from elsewhere."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from docs_of_reference import API, offers
from prose import ROOT, pages

pytest.importorskip("mkdocs", reason="needs mkdocs (`pip install -e '.[docs]'`)")
pytest.importorskip("material", reason="needs mkdocs-material (`pip install -e '.[docs]'`)")
pytest.importorskip("mkdocstrings", reason="needs mkdocstrings (`pip install -e '.[docs]'`)")

LOADS = re.compile(
    r"<(?:script|img|iframe|source)\b[^>]*\bsrc=[\"']?(https?:)?//|<link\b[^>]*\bhref=[\"']?https?://"
)


def loads(html: str) -> list[str]:
    """Return what a page would load from elsewhere; the address that a page says it has is no load."""
    canonical = re.sub(r"<link[^>]*rel=[\"']?canonical[^>]*>", "", html)
    return [found[0] for found in LOADS.finditer(canonical)]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the site as `make site` does."""
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(out)]
    # without --quiet: mkdocs counts no warning that it does not print
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return out


def test_every_page_is_in_the_site(site: Path):
    docs = [path for path in pages() if ROOT / "docs" in path.parents]
    built = [site / path.relative_to(ROOT / "docs").with_suffix(".html") for path in docs]
    assert [str(path) for path in built if not path.is_file()] == []


def test_the_reference_of_code_is_in_the_site(site: Path):
    assert "--until-decided" in (site / "reference/commands.html").read_text(encoding="utf-8")
    assert "--clearing" in (site / "reference/settings.html").read_text(encoding="utf-8")
    for module in API:
        page = (site / f"reference/python/{module}.html").read_text(encoding="utf-8")
        assert [path for path in offers(module) if f'id="{path}"' not in page] == [], module
    assert 'id="graycard.lights.PointLight"' in (site / "reference/python/graycard.lights.html").read_text()


def test_the_site_opens_offline(site: Path):
    html = {path: path.read_text(encoding="utf-8") for path in site.rglob("*.html")}
    assert not {str(path): found for path, text in html.items() if (found := loads(text))}
    assert "fonts.googleapis" not in "".join(html.values())


@pytest.mark.parametrize(
    "html",
    [
        '<script src="https://x/y.js">',
        '<link rel="stylesheet" href="https://x/y.css">',
        "<img src=//x/y.png>",
    ],
)
def test_a_page_that_loads_from_elsewhere_is_seen(html: str):
    assert loads(html)
    assert not loads('<link rel="canonical" href="https://x/"><a href="https://x">x</a><img src="y.png">')

# SPDX-License-Identifier: Apache-2.0
"""Hooks of mkdocs: add the pages that exist in the site alone (see mkdocs.yml)."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]


ROLE = re.compile(r":(?:attr|class|data|exc|func|meth|mod):(?=<code)")
"""Role before a name, as in ``:func:`x```."""
SECTIONS = {
    "tutorials": "Tutorials",
    "how-to": "How-to",
    "methods": "Methods",
    "reference": "Reference",
    "explanation": "Explanation",
    "results": "Results",
    "lab-notes": "Lab notes",
}
"""Section of the navigation for each folder of docs."""


def on_config(config: Any) -> Any:
    """Put a page for each public module into the navigation, and pages that it does not list to the end."""
    sys.path[:0] = [str(ROOT / "src"), str(ROOT / "tests/helpers")]  # mkdocs forgets what a hook's head adds
    from docs_of_reference import API

    listed = set(_pages(config.nav))
    for path in sorted(Path(config.docs_dir).rglob("*.md")):
        name = path.relative_to(config.docs_dir).as_posix()
        if name not in listed:
            _section(config.nav, SECTIONS[name.partition("/")[0]]).append(name)
    pages = [{title: f"reference/python/{module}.md"} for module, title in API.items()]
    _section(_section(config.nav, "Reference"), "Python", pages)
    return config


def on_page_content(html: str, **_: Any) -> str:
    """Drop the roles of names in docstrings: the site shows code in the place of a reference."""
    return ROLE.sub("", html)


def _pages(nav: Any) -> Iterator[str]:
    """Yield the pages of a navigation, at any depth."""
    if isinstance(nav, str):
        yield nav
    else:
        for entry in nav.values() if isinstance(nav, dict) else nav:
            yield from _pages(entry)


def on_files(files: Any, config: Any) -> Any:
    """Add the pages that are made of the code."""
    from mkdocs.structure.files import File

    from docs_of_reference import site_pages

    for path, text in site_pages():
        files.append(File.generated(config, path, content=text))
    return files


def _section(nav: list[Any], title: str, pages: list[Any] | None = None) -> list[Any]:
    """Return a section of the navigation, or replace what is in it."""
    item = next(entry for entry in nav if isinstance(entry, dict) and title in entry)
    if pages is not None:
        item[title] = pages
    return item[title]

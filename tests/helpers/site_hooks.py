# SPDX-License-Identifier: Apache-2.0
"""Hooks of mkdocs: add the pages that exist in the site alone (see mkdocs.yml)."""

import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]


def on_config(config: Any) -> Any:
    """Put a page for each public module into the navigation."""
    sys.path[:0] = [str(ROOT / "src"), str(ROOT / "tests/helpers")]  # mkdocs forgets what a hook's head adds
    from docs_of_reference import API

    pages = [{title: f"reference/python/{module}.md"} for module, title in API.items()]
    _section(_section(config.nav, "Reference"), "Python", pages)
    return config


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

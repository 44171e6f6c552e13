# SPDX-License-Identifier: Apache-2.0
"""Links between pages lead somewhere, and code names pages that exist."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from prose import CODE, ROOT, pages

LINK = re.compile(r"\[(?:[^\[\]]|\[[^\]]*\])*\]\(([^)\s]+)\)")
NAMED = re.compile(r"docs/[\w./-]+\.(?:md|svg|jpg)")
LIMIT = 12 * 2**20
"""Bytes of the folder docs."""


def anchors(text: str) -> set[str]:
    """Return the anchors of the headings of a page, as GitHub and the site make them."""
    heads = re.findall(r"^#{1,6} (.*)$", re.sub(r"^```.*?^```", "", text, flags=re.M | re.S), re.MULTILINE)
    plain = [re.sub(r"[^\w\s-]", "", head.replace("`", "")).strip().lower() for head in heads]
    return {re.sub(r"\s", "-", head) for head in plain} | {re.sub(r"[\s-]+", "-", head) for head in plain}


def dead_links(path: Path, text: str) -> Iterator[str]:
    """Yield links of a page that lead nowhere."""
    for target in LINK.findall(re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)):
        if re.match(r"https?:|mailto:", target):
            continue
        name, _, anchor = target.partition("#")
        file = (path.parent / name).resolve() if name else path
        if not file.exists():
            yield f"{target}: no such file"
        elif anchor and file.suffix == ".md":
            known = anchors(text if file == path else file.read_text(encoding="utf-8"))
            if anchor not in known:
                yield f"{target}: no such heading"


@pytest.mark.parametrize("path", pages(), ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(path: Path):
    assert list(dead_links(path, path.read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize("link", ["[a](none.md)", "[a](docs/index.md#none)", "[a](#none)"])
def test_a_dead_link_is_seen(link: str):
    assert len(list(dead_links(ROOT / "README.md", f"# Title\n\n{link}\n"))) == 1


def test_a_link_to_a_heading_is_no_dead_one():
    text = "# Title\n\n## How `x` is, and why\n\n[a](#how-x-is-and-why) [b](docs/index.md#begin)\n"
    assert list(dead_links(ROOT / "README.md", text)) == []


def missing_pages(texts: dict[str, str]) -> list[str]:
    """Return the pages that code or a test names and that do not exist."""
    named = {(name, found) for name, text in texts.items() for found in NAMED.findall(text)}
    return sorted(f"{name} names {found}" for name, found in named if not (ROOT / found).exists())


def test_code_names_pages_that_exist():
    files = [path for folder in (*CODE, "tests") for path in (ROOT / folder).rglob("*.py")]
    texts = {
        str(p): p.read_text(encoding="utf-8") for p in files if not any(q.is_symlink() for q in p.parents)
    }
    texts.pop(str(Path(__file__)))
    assert missing_pages(texts | {"Makefile": (ROOT / "Makefile").read_text(encoding="utf-8")}) == []
    assert missing_pages({"x.py": "see docs/none.md"}) == ["x.py names docs/none.md"]


def test_the_docs_are_small():
    sizes = [path.stat().st_size for path in (ROOT / "docs").rglob("*") if path.is_file()]
    assert sum(sizes) < LIMIT


def test_the_readme_is_short():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(readme.splitlines()) < 80
    assert len(re.findall(r"^!\[", readme, re.MULTILINE)) == 1

# SPDX-License-Identifier: Apache-2.0
"""Parts of a page of the docs that ``make docs`` writes, between two comments with their name."""

import os
from pathlib import Path


def told_and_wanted(page: Path, name: str, wanted: str) -> tuple[str, str]:
    """Return a part of a page and what it has to say; written first where docs are written."""
    before, told, after = parts_of(page, name)
    if os.environ.get("GRAYCARD_WRITE_DOCS"):
        page.write_text(before + wanted + after, encoding="utf-8")
        told = wanted
    return told, wanted


def parts_of(page: Path, name: str) -> tuple[str, str, str]:
    """Return what stands before a part that is written, the part, and what follows."""
    begin, end = f"<!-- {name}: written by `make docs` -->\n", f"<!-- end of {name} -->\n"
    before, found, rest = page.read_text(encoding="utf-8").partition(begin)
    part, ended, after = rest.partition(end)
    assert found, f"expected {begin.strip()} in {page}"
    assert ended, f"expected {end.strip()} in {page}"
    return before + begin, part, end + after

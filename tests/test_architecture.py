# SPDX-License-Identifier: Apache-2.0
"""The page on the architecture shows the house as its imports are.

``make docs`` writes the picture and the table anew.
"""

import os
from pathlib import Path

import pytest

import docs_of_house
import house
from written_blocks import told_and_wanted

FOLDER = Path(__file__).parents[1] / "docs" / "explanation"
WRITE = "GRAYCARD_WRITE_DOCS" in os.environ


def test_the_picture_is_drawn_from_the_imports():
    path = FOLDER / "architecture.svg"
    if WRITE:
        path.write_text(docs_of_house.picture(), encoding="utf-8")
    assert path.read_text(encoding="utf-8") == docs_of_house.picture(), "run `make docs`"


def test_the_table_names_every_package():
    told, wanted = told_and_wanted(FOLDER / "architecture.md", "packages", docs_of_house.table())
    assert told == wanted, "run `make docs`"


def test_a_planted_import_changes_the_picture(monkeypatch: pytest.MonkeyPatch):
    drawn = docs_of_house.picture()
    planted = (*house.imports_of("graycard.reports._write"), house.Import("graycard.synth", 1))
    monkeypatch.setattr(
        docs_of_house,
        "imports_of",
        lambda name: planted if name == "graycard.reports._write" else house.imports_of(name),
    )
    assert ("reports", "synth") in docs_of_house.arrows()
    assert docs_of_house.picture() != drawn

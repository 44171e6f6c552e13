# SPDX-License-Identifier: Apache-2.0
"""Reference pages are what the code says.

``make docs`` writes them: with ``GRAYCARD_WRITE_DOCS`` in the environment these tests do so.
"""

import os
import re

import pytest

from docs_of_reference import API, DOCS, KEPT, cell, commands_page, settings_page, table
from docs_pictures import file_of_layer
from graycard.cli._table import VERBS
from graycard.layers import all_layers
from graycard.methods import BUILT_IN
from graycard.synth import all_families


@pytest.mark.parametrize("name", KEPT)
def test_a_page_is_what_the_code_makes_of_it(name: str):
    expected = KEPT[name]()
    if os.environ.get("GRAYCARD_WRITE_DOCS"):
        (DOCS / name).write_text(expected, encoding="utf-8")
    assert (DOCS / name).read_text(encoding="utf-8") == expected, "run `make docs`"


def test_the_commands_of_the_site_are_all_verbs_with_their_options():
    page = commands_page()
    assert re.findall(r"^## `graycard ([\w-]+)`$", page, re.MULTILINE) == [verb.name for verb in VERBS]
    assert "--until-decided" in page
    assert "\x1b" not in page


def test_the_settings_of_the_site_are_those_of_all_methods():
    page = settings_page()
    assert re.findall(r"^## `([\w-]+)`$", page, re.MULTILINE) == list(BUILT_IN)
    assert "--iterations" in page


def test_the_python_of_the_site_is_public():
    assert not [module for module in API if any(part.startswith("_") for part in module.split("."))]


def test_a_cell_is_one_line_of_marked_code():
    assert cell("a ``b``\n | c") == "a `b` \\| c"
    assert table(("x",), [("1",)]) == "| x |\n| --- |\n| 1 |\n"


def test_every_family_and_layer_has_a_small_picture():
    names = [f"family-{name}.jpg" for name in all_families()] + [file_of_layer(x.name) for x in all_layers()]
    sizes = {name: (DOCS / "pictures" / name).stat().st_size for name in (*names, "tracks.jpg")}
    assert not {name: size for name, size in sizes.items() if not 500 < size < 120_000}

# SPDX-License-Identifier: Apache-2.0
import math
import re
from types import SimpleNamespace

import pytest

from graycard.reports._facts import flatten
from graycard.reports._format import (
    count,
    format_date,
    format_name,
    format_number,
    format_seconds,
    format_value,
)
from graycard.reports.parts._render import Renderer
from graycard.reports.site._runs import knobs_in_words


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (31.456, "dB", "31.46"),
        (0.98765, "1", "0.988"),
        (-0.5, "1", "−0.500"),
        (2.0, "count", "2"),
        (2.5, "count", "2.5"),
        (7.123, "% of the scene's diameter", "7.12"),
        (math.inf, "dB", "∞"),
        (-math.inf, "dB", "−∞"),
        (math.nan, "dB", "nan"),
    ],
)
def test_value_has_the_digits_of_its_unit(value: float, unit: str, text: str) -> None:
    assert format_value(value, unit) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.034, "0.03 s"),
        (4.21, "4.2 s"),
        (60, "1 min 0 s"),
        (75, "1 min 15 s"),
        (3700, "1 h 1 min"),
        (math.inf, "inf s"),
    ],
)
def test_duration_in_the_unit_that_fits(seconds: float, text: str) -> None:
    assert format_seconds(seconds) == text


def test_date_of_utc_of_no_zone_and_of_nonsense() -> None:
    assert format_date("2026-11-01T09:07:14+00:00") == "1 November 2026, 09:07 UTC"
    assert format_date("2026-11-01T09:07:14") == "1 November 2026, 09:07"
    assert format_date("last <week>") == "last <week>"


def test_words() -> None:
    assert format_name("novel_view") == "Novel view"
    assert format_name("") == ""
    assert (count(1, "scene"), count(0, "scene")) == ("1 scene", "0 scenes")
    assert (format_number(-0.012345), format_number(math.inf)) == ("−0.0123", "∞")


def test_flatten_keeps_every_leaf_once() -> None:
    nested = {"a_b": {"c": [1, 2]}, "d": [{"e": None}, {"e": []}], "f": [{"g": True}]}
    assert dict(flatten(nested)) == {
        "a b c": "1, 2", "d 1 e": "none", "d 2 e": "none", "f g": "True",
    }  # fmt: skip
    assert flatten(3) == (("value", "3"),)


def test_knobs_of_scenes_are_shown_with_their_units() -> None:
    knobs = {"light_offset": 0.25, "light_cutoff": 38.0, "ambient": 0.02, "gloss": 0.5, "lamp": "spot"}
    assert knobs_in_words(knobs) == (
        "light offset 0.25 m, light cutoff 38 °, ambient 0.02 W/m²/sr, gloss 0.5, lamp spot"
    )
    settings = flatten({"family": "corridor", "knobs": knobs, "render": {"ambient": 3}})
    section = SimpleNamespace(pictures=SimpleNamespace(settings=settings))
    html = Renderer().part("scene.html.j2", "settings", section)
    shown = re.findall("<dt>(.*?)</dt><dd>(.*?)</dd>", html)
    assert shown == [
        ("family", "corridor"), ("knobs light offset", "0.25 m"), ("knobs light cutoff", "38.0 °"),
        ("knobs ambient", "0.02 W/m²/sr"), ("knobs gloss", "0.5"), ("knobs lamp", "spot"),
        ("render ambient", "3"),
    ]  # fmt: skip

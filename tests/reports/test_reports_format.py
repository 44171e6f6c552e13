# SPDX-License-Identifier: Apache-2.0
import math

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

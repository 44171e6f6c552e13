# SPDX-License-Identifier: Apache-2.0
"""docs/reference/metrics.md and its figure show what the code says.

``make docs`` writes them: with ``GRAYCARD_WRITE_DOCS`` in the environment these tests do so.
"""

import os
import re
from pathlib import Path

import pytest

import graycard.eval as ge
from docs_of_scores import (
    METRICS,
    SPREAD,
    ceiling_table,
    generated,
    metric_table,
    reference_table,
    scores_page,
)
from graycard.records import MetricRecord


@pytest.mark.parametrize("path", [METRICS, SPREAD], ids=lambda p: p.name)
def test_a_page_is_what_the_code_makes_of_it(path: Path) -> None:
    expected = generated()[path]
    if os.environ.get("GRAYCARD_WRITE_DOCS"):
        path.write_text(expected, encoding="utf-8")
    assert path.read_text(encoding="utf-8") == expected, "write it by `make docs`"


@pytest.mark.parametrize("metric", ge.all_metrics(), ids=lambda m: m.id)
def test_each_metric_stands_once_in_the_tables(metric: MetricRecord) -> None:
    assert len(re.findall(rf"^\| `{re.escape(metric.id)}` \|", metric_table(), re.MULTILINE)) == 1
    assert ceiling_table().count(f"`{metric.id}`") == 1


def test_each_reference_stands_in_its_table() -> None:
    rows = reference_table().splitlines()[2:]
    assert [row.split(" | ")[0].removeprefix("| ") for row in rows] == [r.name for r in ge.references()]


def test_a_page_that_has_lost_a_mark_is_not_written() -> None:
    page = METRICS.read_text(encoding="utf-8")
    with pytest.raises(ValueError, match="expected one generated part named ceilings, got 0. Mark it"):
        scores_page(page.replace("<!-- ceilings:", "<!-- roof:"))

# SPDX-License-Identifier: Apache-2.0
"""docs/scores.md shows what the code says.

With ``GRAYCARD_WRITE_DOCS=1`` in the environment these tests write it.
"""

import os
import re
from pathlib import Path

from docs_of_scores import ceiling_table, reference_table, spread_figure
from graycard.eval.protocols import Experiment, protocol_spread

DOCS = Path(__file__).parents[2] / "docs"
SHARES = (0.10, 0.25, 0.60)
BETWEEN = r"(<!-- references: [^>]*-->\n)(.*?)(<!-- end -->)"


def held(path: Path, expected: str) -> None:
    """Compare a page with what it has to be, or write it where that was asked for."""
    if os.environ.get("GRAYCARD_WRITE_DOCS"):
        path.write_text(expected, encoding="utf-8")
    assert path.read_text(encoding="utf-8") == expected


def test_the_table_of_references_is_the_one_that_tests_use() -> None:
    page = (DOCS / "scores.md").read_text(encoding="utf-8")
    table = reference_table()
    held(DOCS / "scores.md", re.sub(BETWEEN, lambda m: m[1] + table + m[3], page, flags=re.DOTALL))
    assert len(re.findall(BETWEEN, page, flags=re.DOTALL)) == 1


def test_the_table_of_ceilings_is_the_one_of_the_code() -> None:
    page = (DOCS / "scores.md").read_text(encoding="utf-8")
    between = r"(<!-- ceilings: [^>]*-->\n)(.*?)(<!-- end of ceilings -->)"
    table = ceiling_table()
    held(DOCS / "scores.md", re.sub(between, lambda m: m[1] + table + m[3], page, flags=re.DOTALL))
    assert len(re.findall(between, page, flags=re.DOTALL)) == 1


def test_the_figure_of_the_spread_is_that_of_the_experiment() -> None:
    scores = []
    for share in SHARES:
        found = protocol_spread(Experiment(share))
        scores.append({n: s.value for n, s in found.items() if s.value is not None and s.unit == "dB"})
    held(DOCS / "protocol-spread.svg", spread_figure(SHARES, scores))

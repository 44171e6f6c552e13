# SPDX-License-Identifier: Apache-2.0
"""Priors of a row are named beside it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from graycard.io import to_builtins, write_json
from graycard.methods.priors import Override, PriorSpec
from graycard.records import RunRecord
from graycard.reports import write_report
from graycard.reports._priors import prior_badge, prior_badges
from opened import opened

TOLD = "Told more than the photographs by priors: answers are "


@pytest.mark.parametrize(
    ("spec", "text", "answers"),
    [
        (PriorSpec("oracle", 2), "oracle 2", "the truth made wrong by severity 2 of 1 to 5"),
        (PriorSpec("oracle"), "oracle 0", "the truth itself (severity 0)"),
        (PriorSpec("classical"), "classical", "from algorithms that need no weights"),
        (
            PriorSpec("pretrained", path="/home/me/weights/v2"),
            "pretrained v2",
            "from pretrained networks (v2)",
        ),
        (
            PriorSpec("oracle", 2, overrides={"normal": Override(severity=5)}),
            "oracle 2, normal 5",
            "the truth made wrong by severity 2 of 1 to 5; those about normal are the truth made wrong by "
            "severity 5 of 1 to 5",
        ),
        (
            PriorSpec(overrides={"inpainting": Override("classical", algorithm="telea")}),
            "inpainting classical telea",
            "not given; those about inpainting are from algorithms that need no weights (telea)",
        ),
    ],
)
def test_badge_says_where_answers_come_from(spec: PriorSpec, text: str, answers: str) -> None:
    badge = prior_badge(to_builtins(spec))
    assert badge is not None
    assert (badge.text, badge.help) == (text, TOLD + answers)


def test_many_kinds_that_differ_are_named_in_the_help_alone() -> None:
    kinds = {kind: Override(severity=4) for kind in ("depth", "normal")}
    spec = PriorSpec("oracle", 3, overrides={**kinds, "base_color": Override(source="classical")})
    badge = prior_badge(to_builtins(spec))
    assert badge is not None
    assert badge.text.startswith("oracle 3, ")
    assert badge.text.endswith(", …")
    for kind in ("depth", "normal", "base color"):
        assert f"those about {kind} are" in badge.help
    errors = PriorSpec("oracle", 3, overrides={"depth": Override(errors={"kappa": 0.3})})
    found = prior_badge(to_builtins(errors))
    assert found is not None
    assert found.text == "oracle 3, depth kappa 0.3"


@pytest.mark.parametrize("priors", [{}, to_builtins(PriorSpec())])
def test_row_without_priors_has_no_badge(priors: dict[str, Any]) -> None:
    assert prior_badge(priors) is None


def test_report_marks_rows_that_were_told(make_run: Callable[..., tuple[Path, RunRecord]]) -> None:
    run, record = make_run()
    told = to_builtins(PriorSpec("oracle", 2))
    results = tuple(
        replace(r, job=replace(r.job, priors=told)) if r.job.method == "retinex" else r
        for r in record.results
    )
    assert "badge told" not in opened(write_report(run).read_text(encoding="utf-8"))
    changed = replace(record, results=results)
    assert set(prior_badges(changed)) == {"retinex"}
    write_json(run / "run.json", changed)
    html = opened(write_report(run).read_text(encoding="utf-8"))
    title = f"{TOLD}the truth made wrong by severity 2 of 1 to 5"
    badge = f'<span class="badge told" title="{title}">priors: oracle 2</span>'
    first, tracks = html.split('<section class="track"', 1)
    assert badge in first[first.index('<section class="summary"') :]
    for place in (
        '<table class="scores leaderboard">',
        "Values of single test views",
    ):
        rows = tracks[tracks.index(place) :]
        assert badge in rows[: rows.index("</table>")], place
    assert html.count("badge told") == html.count(badge) + 1  # and where it is explained

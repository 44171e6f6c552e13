# SPDX-License-Identifier: Apache-2.0
"""One prediction by many protocols, and one score by its neighbouring rules."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from graycard.io import write_json
from graycard.records import Job, JobResult, RunRecord, Score, ScoreSheet
from graycard.reports import write_report
from graycard.reports._spread import protocol_spreads
from graycard.reports.tables._cells import Reading, breakdown_text
from opened import opened


def by(protocol: str, value: float | None, unit: str = "dB", up: bool = True) -> Score:
    status: Any = "failed" if value is None else "scored"
    return Score(f"albedo.{protocol}", protocol, status, value, unit, up, math.inf if up else 0.0)


def result(method: str, *protocols: Score, seed: int = 0) -> JobResult:
    sheet = ScoreSheet("dark", "s", method, "", "", (), protocols)
    return JobResult(Job("dark", "s", method, seed, {}), "h", "f", "done", sheet=sheet)


def test_strip_has_a_dot_for_each_protocol_on_one_axis() -> None:
    results = [
        result("a", by("raw-1", 16.0), by("wide-1", 30.0), by("broken-1", None)),
        result("b", by("raw-1", 20.0), by("wide-1", 24.0)),
    ]  # fmt: skip
    (spread,) = protocol_spreads(results, ["a", "b", "c"])
    assert (spread.unit, spread.direction, spread.ends) == ("dB", "higher is better", ("16.00", "30.00"))
    first, second = spread.strips
    assert (first.method, first.spread, second.spread) == ("a", "14.00", "4.00")
    assert [d.label for d in first.dots] == ["raw-1: 16.00", "wide-1: 30.00"]
    share = (second.dots[0].place - first.dots[0].place) / (first.dots[1].place - first.dots[0].place)
    assert share == pytest.approx(4 / 14, abs=1e-3)
    assert spread.rows == (
        ("raw-1", ("16.00", "20.00")), ("wide-1", ("30.00", "24.00")), ("broken-1", ("–", "–")),
    )  # fmt: skip


def test_units_have_axes_of_their_own_and_seeds_are_averaged() -> None:
    scores = by("raw-1", 16.0), by("lmse-1", 0.02, "1", False)
    results = [result("a", *scores), result("a", by("raw-1", 18.0), scores[1], seed=1)]
    decibels, share = protocol_spreads(results, ["a"])
    assert decibels.rows == (("raw-1", ("17.00",)),)
    assert (share.unit, share.direction, share.rows) == ("", "lower is better", (("lmse-1", ("0.020",)),))
    assert share.strips[0].spread == "0.000"


def test_no_protocols_no_strip() -> None:
    assert protocol_spreads([result("a"), result("b", by("raw-1", None))], ["a", "b"]) == ()


def test_perfect_prediction_has_no_finite_number() -> None:
    assert protocol_spreads([result("a", by("raw-1", math.inf))], ["a"]) == ()


def test_breakdown_is_the_mean_over_scenes_of_what_all_have() -> None:
    readings = [
        Reading("one", "scored", 20.0, breakdown={"interior": 22.0, "boundary": 10.0}),
        Reading("two", "scored", 30.0, breakdown={"interior": 32.0}),
        Reading("three", "failed"),
    ]
    assert breakdown_text(readings, "dB") == "interior 27.00"
    assert breakdown_text(readings[2:], "dB") == ""


def test_report_shows_strips_and_breakdowns(make_run: Callable[..., tuple[Path, RunRecord]]) -> None:
    run, record = make_run()

    def enrich(r: JobResult) -> JobResult:
        if r.sheet is None:
            return r
        scores = tuple(replace(s, breakdown={"interior": 1.25}) if s.value else s for s in r.sheet.scores)
        protocols = (by("raw-1", 16.0), by("<wide>-1", 30.0))
        return replace(r, sheet=replace(r.sheet, scores=scores, protocols=protocols))

    methods = tuple(replace(m, entry="gray") if m.name == "retinex" else m for m in record.methods)
    results = tuple(enrich(r) for r in record.results)
    write_json(run / "run.json", replace(record, methods=methods, results=results))
    html = opened(write_report(run).read_text(encoding="utf-8"))
    assert "<title>&lt;wide&gt;-1: 30.00</title>" in html
    assert "spread 14.00 dB" in html
    for row, kind in (("gray", ""), ("retinex", " variant")):  # folded and filtered as in all tables
        assert f'<div class="strip-row{kind}" data-row="{row}">' in html
    assert "<b>gray</b> interior 1.25" in html
    assert "interior: pixels of one surface and colour" in html

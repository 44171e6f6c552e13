# SPDX-License-Identifier: Apache-2.0
"""Work on records of runs: what it costs grows with the scores of a run, and with nothing else."""

import json
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from graycard.benchmarks.speed import made_up_run
from graycard.benchmarks.validity import _record
from graycard.cli import main
from graycard.eval.statistics import compare_run
from graycard.io import dumps, from_builtins, read_json, write_json
from graycard.io._names import check_label
from graycard.records import RunRecord, read_run
from graycard.reports._page import build_page
from graycard.reports.tables import _cells, _tables


def counted(patch: pytest.MonkeyPatch, module: Any, name: str, calls: Counter[str]) -> None:
    """Count the calls of a function of a module."""
    plain: Callable[..., Any] = getattr(module, name)

    def call(*arguments: Any, **more: Any) -> Any:
        calls[name] += 1
        return plain(*arguments, **more)

    patch.setattr(module, name, call)


def test_a_made_up_run_is_the_same_each_time_and_can_be_read(tmp_path: Path):
    made = made_up_run(5, 7)
    assert dumps(made) == dumps(made_up_run(5, 7))
    write_json(tmp_path / "run.json", made)
    assert read_run(tmp_path) == made
    assert (len(made.methods), len(made.scenes), len(made.results)) == (5, 7, 35)
    assert {len(result.sheet.scores) for result in made.results if result.sheet} == {44}


@pytest.mark.parametrize("rows", [4, 12])
def test_a_report_reads_each_score_as_often_in_a_large_run_as_in_a_small_one(
    rows: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    run = made_up_run(rows, 4)
    calls: Counter[str] = Counter()
    counted(monkeypatch, _tables, "find_score", calls)
    counted(monkeypatch, _tables, "read_metric", calls)
    counted(monkeypatch, _cells, "find_score", calls)
    build_page(run, tmp_path)
    scores = sum(len(result.sheet.scores) for result in run.results if result.sheet)
    assert calls["read_metric"] <= 6 * scores
    assert calls["find_score"] <= 12 * scores


def test_each_job_looks_a_score_up_by_its_metric():
    sheet = made_up_run(1, 1).results[0].sheet
    assert sheet
    assert sheet.by_metric == {score.metric: score for score in sheet.scores}
    double = type(sheet)("dark", "s", "m", "", "", (sheet.scores[1], *sheet.scores))
    assert double.by_metric[sheet.scores[1].metric] is double.scores[0]
    assert "by_metric" not in json.loads(dumps(sheet))


def test_scores_above_their_ceiling_are_found_without_comparing(monkeypatch: pytest.MonkeyPatch):
    calls: Counter[str] = Counter()
    counted(monkeypatch, _record, "compare_first_look", calls)
    assert _record.ceiling_breaches(made_up_run(3, 3)) == []
    assert not calls


def test_a_name_that_stands_in_a_record_often_is_checked_once(monkeypatch: pytest.MonkeyPatch):
    from graycard.io import _names

    calls: Counter[str] = Counter()
    counted(monkeypatch, _names, "check_label", calls)
    data = json.loads(dumps(made_up_run(6, 6)))
    from_builtins(RunRecord, data)
    distinct = calls["check_label"]
    from_builtins(RunRecord, data)
    assert calls["check_label"] == distinct
    assert distinct < sum(len(result["sheet"]["scores"]) for result in data["results"])
    assert check_label("a") == "a"


def test_a_pair_has_the_same_numbers_among_others_as_alone():
    run = made_up_run(12, 9)
    whole = compare_run(run)
    few = [method.name for method in run.methods if not method.sees][:2]
    kept = tuple(result for result in run.results if result.job.method in few)
    alone = compare_run(replace(run, results=kept))
    for table, other in zip(whole.metrics, alone.metrics, strict=True):
        (mine,) = other.pairs
        (same,) = [pair for pair in table.pairs if [pair.first, pair.second] == few]
        names = ("scenes", "difference", "p_rank", "p_mean", "error")
        assert [getattr(mine, name) for name in names] == [getattr(same, name) for name in names]
        assert mine.interval == pytest.approx(same.interval, rel=1e-12)


@pytest.mark.slow
def test_the_command_measures_each_verb(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["speed", "records", "--quick", "--json", str(tmp_path / "costs.json")]) == 0
    costs = {cost["verb"]: cost for cost in read_json(tmp_path / "costs.json")["result"]}
    assert [*costs] == ["compare", "report", "claims", "check-result"]
    assert [cost["exit_code"] for cost in costs.values()] == [0, 0, 0, 1]
    assert all(cost["seconds"] > 0 and cost["peak_mib"] > 10 for cost in costs.values())
    assert "a run of 2 rows and 6 scenes" in capsys.readouterr().out

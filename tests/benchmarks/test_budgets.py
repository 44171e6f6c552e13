# SPDX-License-Identifier: Apache-2.0
"""Runs of a suite at half and at twice the iterations, beside which a verdict has to stand."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from graycard import RecordError
from graycard.benchmarks import Terms, _runner, load_suite, run_bench
from graycard.benchmarks._introduction import Introduction
from graycard.benchmarks._run_record import RunError
from graycard.benchmarks.claims import check_budgets
from graycard.cli import main
from graycard.io import read_json, sha256, silent, write_json
from graycard.processes import USUAL
from graycard.records import read_run
from runs_by_hand import run_of
from tiny_benches import made_without_renderer, write_reserve_suite
from valid_runs import breaches, change

RUN = run_of({"mine": {"psnr": [1.0, 2.0]}, "theirs": {"psnr": [0.0, 0.0]}})


def test_iterations_of_each_row_are_multiplied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows without any stay as they are; the record names what it fitted, and suite.json the suite."""
    known = [
        Introduction("splats", (), {"iterations": 1001, "lamps": 8}, (), ""),
        Introduction("gray", (), {"reflectance": 0.18}, (), ""),
    ]
    monkeypatch.setattr(_runner, "introduce", lambda *_: known)
    suite = load_suite(str(write_reserve_suite(tmp_path)))
    suite = replace(suite, methods=suite.methods[:2])
    bench = _runner.Bench(suite, tmp_path, tmp_path, 1, silent, USUAL, None, Terms(0.5))
    scaled, found = _runner._begun(bench)
    assert [k.settings for k in found] == [{"iterations": 500, "lamps": 8}, {"reflectance": 0.18}]
    assert [dict(m.settings) for m in scaled.suite.methods] == [{"iterations": 500}, {}]
    assert scaled.whole == suite


@pytest.mark.parametrize("budget", [0.0, -1.0, float("inf"), float("nan")])
def test_a_budget_is_above_nothing(budget: float) -> None:
    with pytest.raises(RunError, match="expected a budget above 0, as 0.5 or 2"):
        Terms(budget)


def test_a_run_says_its_budget_and_keeps_others_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write_tiny: Callable[..., Path]
) -> None:
    made_without_renderer(monkeypatch, write_tiny)
    suite, run = load_suite(str(write_reserve_suite(tmp_path))), tmp_path / "run"
    run_bench(suite, run, 1, silent, terms=Terms(2.0))
    assert read_run(run).budget == 2
    assert "suite" not in breaches(run)
    with pytest.raises(RunError, match="got one of 'tiny-reserve' version 1 at 2 times its iterations"):
        run_bench(suite, run, 1, silent)


def test_a_row_of_other_iterations_than_its_budget_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write_tiny: Callable[..., Path]
) -> None:
    made_without_renderer(monkeypatch, write_tiny)
    path, run = write_reserve_suite(tmp_path), tmp_path / "run"
    suite = load_suite(str(path))
    run_bench(suite, run, 1, silent)

    def fit_with(iterations: int) -> None:
        def edit(data: Any) -> None:
            for result in data["results"]:
                if result["job"]["method"] == "gray":
                    result["job"]["settings"]["iterations"] = iterations

        change(run, edit)

    kept = read_json(run / "suite.json")
    kept["methods"][1]["settings"] = {"iterations": 100}
    write_json(run / "suite.json", kept)
    change(run, lambda data: data.update(budget=0.5, suite_sha256=sha256(run / "suite.json")))
    fit_with(50)
    assert "suite" not in breaches(run)
    fit_with(100)
    assert "got another settings.iterations" in breaches(run)["suite"][0]


def test_runs_that_differ_in_their_budget_alone_go_together() -> None:
    check_budgets(RUN, {0.5: replace(RUN, budget=0.5), 2.0: replace(RUN, budget=2.0)})
    check_budgets(RUN, {2.0: replace(RUN, budget=2.0, methods=RUN.methods[:1])})


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        ({"budget": 1.0}, "expected a run with budget 0.5 for 0.5 times the budget, got 1.0"),
        ({"suite_version": 2}, "expected a run with suite hand version 1"),
        ({"scenes": RUN.scenes[:1]}, "expected a run with scenes"),
        ({"results": RUN.results[:0]}, r"expected a run with seeds \[0\] .* got \[\]"),
    ],
)
def test_runs_that_differ_in_more_do_not(edit: Mapping[str, Any], words: str) -> None:
    with pytest.raises(RecordError, match=words):
        check_budgets(RUN, {0.5: replace(RUN, **({"budget": 0.5} | dict(edit)))})


def test_the_command_line_takes_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, budget in (("run", 1.0), ("half", 0.5), ("twice", 4.0)):
        write_json(tmp_path / name / "run.json", replace(RUN, budget=budget))
    command = ["claims", str(tmp_path / "run"), "--any-suite", "--claims", "goris-matte"]
    assert main([*command, "--half", str(tmp_path / "half")]) == 0
    assert main([*command, "--twice", str(tmp_path / "twice")]) == 2
    assert "expected a run with budget 2.0 for 2 times the budget, got 4.0" in capsys.readouterr().err
    assert main(["claims", "--half", str(tmp_path / "half")]) == 2
    assert "expected a run with --half, got none" in capsys.readouterr().err

# SPDX-License-Identifier: Apache-2.0
"""The end of a bench says who is best on each track."""

import io
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from graycard.cli._terminal import Terminal
from graycard.cli.benches._standings import show_standings
from graycard.io import write_json
from graycard.records import (
    COMPARISON,
    Comparison,
    MethodStanding,
    MetricComparison,
    MetricRecord,
    RunRecord,
    SceneRecord,
)

VIEWS = MetricRecord("novel_view.psnr", "Novel view PSNR", "view", "dB", True, 99.0, "", True, 0.3, ())
ANGLE = MetricRecord("normal.mean_angle", "Normal error, mean", "normal", "°", False, 0.0, "", True, 0.3, ())
TOLD = replace(VIEWS, id="told", headline=False)


def terminal() -> tuple[Terminal, io.StringIO]:
    out = io.StringIO()
    return Terminal(out=Console(file=out, width=100), err=Console(file=io.StringIO())), out


def a_run(scenes: int) -> RunRecord:
    places = tuple(
        SceneRecord("dark", f"s{n}", "corridor", n, f"dataset/dark/s{n}", "ab", "a corridor")
        for n in range(scenes)
    )
    return RunRecord("demo", 1, places, (), (VIEWS, ANGLE, TOLD), (), {}, "2026-01-01T00:00:00+00:00", 1.0)


def shown(folder: Path, tables: list[MetricComparison], scenes: int = 1) -> list[str]:
    """Return the lines that are printed for a run with these tables."""
    write_json(folder / COMPARISON, Comparison("demo", 1, 0.95, 6, {"dB": 1.0}, "who wins", tuple(tables)))
    into, out = terminal()
    show_standings(folder, a_run(scenes), into)
    return out.getvalue().splitlines()


def table(metric: MetricRecord, **means: float | None) -> MetricComparison:
    rows = [
        MethodStanding(name.replace("_", "-"), name != "truth", 1, 1, 1, mean)
        for name, mean in {"truth": 99.0, **means}.items()
    ]
    return MetricComparison("dark", metric.id, tuple(rows), ())


def test_the_best_comes_first_and_each_column_marks_its_best(tmp_path: Path):
    tables = [table(VIEWS, gray=15.0, sunfaded=25.0), table(ANGLE, gray=47.0, sunfaded=39.5)]
    head, first, second, end = shown(tmp_path, tables)
    assert head.split() == ["dark", "Novel", "view", "PSNR,", "dB", "Normal", "error,", "°"]
    assert first.split() == ["sunfaded", "25", "*", "39.5", "*"]
    assert second.split() == ["gray", "15", "47"]
    assert "dark: fewer than 6 scenes decide nothing" in end


def test_a_method_without_a_score_has_an_empty_cell_and_a_lone_one_no_mark(tmp_path: Path):
    lines = shown(tmp_path, [table(VIEWS, gray=15.0, a=20.0), table(ANGLE, gray=47.0, a=None)])
    assert [line.split() for line in lines[1:3]] == [["a", "20", "*"], ["gray", "15", "47"]]


def test_enough_scenes_need_no_warning(tmp_path: Path):
    assert len(shown(tmp_path, [table(VIEWS, gray=15.0, a=20.0)], scenes=6)) == 3


def test_only_headlines_and_methods_that_compete_are_shown(tmp_path: Path):
    assert shown(tmp_path, [table(TOLD, gray=1.0)])[:-1] == []
    assert shown(tmp_path, [table(VIEWS)])[:-1] == []


def test_a_long_table_is_cut_and_says_so(tmp_path: Path):
    lines = shown(tmp_path, [table(VIEWS, **{f"m_{n}": float(n) for n in range(12)})])
    assert lines[1].split()[0] == "m-11"
    assert lines[9].strip() == "and 4 more"


@pytest.mark.parametrize("content", [None, "{"])
def test_a_run_without_a_comparison_has_no_table(tmp_path: Path, content: str | None):
    if content is not None:
        (tmp_path / COMPARISON).write_text(content)
    into, out = terminal()
    show_standings(tmp_path, a_run(1), into)
    assert out.getvalue() == ""

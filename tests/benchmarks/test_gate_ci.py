# SPDX-License-Identifier: Apache-2.0
"""The gate in continuous integration: what it writes for people, for machines, and over commits."""

from collections.abc import Callable
from pathlib import Path

import pytest

from graycard import RecordError, UnknownNameError
from graycard.benchmarks import annotations, entry_of, find_baseline, judge, make_baseline, read_baseline
from graycard.benchmarks.gates._annotations import SHOWN
from graycard.benchmarks.gates._history import RECORDS, GateHistory, page, read_history, sparkline
from graycard.cli import main
from graycard.io import write_json
from runs_by_hand import Table, run_of

BEFORE: Table = {"mine": {"psnr": [20.0, 22.0], "error": [0.5, 0.4]}, "gray": {"psnr": [15.0, 16.0]}}
WORSE: Table = {"mine": {"psnr": [19.0, 18.0], "error": [0.5, 0.3]}, "gray": {"psnr": [15.0, 16.0]}}
Capture = pytest.CaptureFixture[str]


@pytest.fixture
def gate(tmp_path: Path) -> Callable[..., int]:
    """The verb on a run with scores, against a baseline of BEFORE."""

    def run(table: Table, *options: str) -> int:
        folder, baseline = tmp_path / "run", tmp_path / "base.json"
        write_json(folder / "run.json", run_of(BEFORE))
        assert main(["gate", str(folder), "--baseline", str(baseline), "--write"]) == 0
        write_json(folder / "run.json", run_of(table))
        return main(["gate", str(folder), "--baseline", str(baseline), *options])

    return run


def test_the_largest_loss_comes_first_with_the_difference(gate: Callable[..., int], capsys: Capture):
    assert gate(WORSE) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[1:] == [
        "worse: dark/s1 mine psnr: expected 22 dB (tolerance 0.3), got 18, -4 dB",
        "worse: dark/s0 mine psnr: expected 20 dB (tolerance 0.3), got 19, -1 dB",
        "better: dark/s1 mine error: expected 0.4 (tolerance 0.01), got 0.3, -0.1",
        "gate: failed: accuracy dropped (6 compared, 2 worse, 0 missing, 1 better)",
    ]


def test_losses_and_missing_scores_are_both_in_the_last_line(gate: Callable[..., int], capsys: Capture):
    assert gate({"mine": {"psnr": [10.0], "error": [0.5]}}) == 2
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == (
        "gate: failed: accuracy dropped and scores are missing (2 compared, 1 worse, 4 missing, 0 better)"
    )


def test_rows_and_tolerances_are_chosen(gate: Callable[..., int], capsys: Capture):
    assert gate(WORSE, "--rows", "gray") == 0
    assert gate(WORSE, "--tolerance", "20") == 0
    assert gate(BEFORE, "--tolerance", "0") == 0
    assert gate(WORSE, "--rows", "grey") == 2
    assert "expected a row that exists, got 'grey' (did you mean 'gray'?)" in capsys.readouterr().err
    assert gate(WORSE, "--tolerance", "-1") == 2
    assert "Mend --tolerance" in capsys.readouterr().err


def test_a_baseline_may_watch_some_rows(tmp_path: Path):
    made = make_baseline(run_of(BEFORE), ["mine"])
    assert {expected.method for expected in made.scores} == {"mine"}
    with pytest.raises(UnknownNameError, match="expected a row that exists, got 'min' .*'mine'"):
        make_baseline(run_of(BEFORE), ["min"])


def test_a_baseline_that_comes_along_is_known_by_name():
    assert read_baseline(find_baseline("smoke")).suite == "smoke"
    with pytest.raises(UnknownNameError, match="expected a baseline that exists, got 'smok' .*'smoke'"):
        find_baseline("smok")
    assert find_baseline("none.json") == Path("none.json"), "reading it says that it is missing"


def test_many_annotations_end_with_their_number():
    many = {f"m{n}": {"psnr": [20.0]} for n in range(SHOWN + 7)}
    verdict = judge(run_of({name: {"psnr": [10.0]} for name in many}), make_baseline(run_of(many)))
    lines = [*annotations(verdict)]
    assert len(lines) == SHOWN + 1
    assert lines[-1] == "::error title=graycard gate::7 more; the summary lists them"


def test_names_cannot_break_out_of_the_page():
    run = run_of({"a|b <img> [x](y)": {"psnr": [20.0]}})
    verdict = judge(run, make_baseline(run))
    entry = entry_of(run, ["a|b <img> [x](y)"], verdict, "c")
    assert "| a\\|b \\<img\\> \\[x\\](y) | psnr |" in page(GateHistory((entry,)))


def test_a_summary_takes_the_factor_on_tolerances(gate: Callable[..., int], tmp_path: Path, capsys: Capture):
    gate(WORSE)
    told = ["report", str(tmp_path / "run"), "--summary", "md", "--baseline", str(tmp_path / "base.json")]
    capsys.readouterr()
    assert main(told) == 0
    strict = capsys.readouterr().out
    assert main([*told, "--tolerance", "20"]) == 0
    assert "2 worse" in strict
    assert "2 worse" not in capsys.readouterr().out


def test_annotations_are_one_line_each(gate: Callable[..., int], capsys: Capture):
    assert gate(WORSE, "--annotate") == 1
    found = [line for line in capsys.readouterr().out.splitlines() if line.startswith("::error")]
    assert found[0] == (
        "::error title=graycard gate::dark/s1 mine psnr: expected 22 dB (tolerance 0.3), got 18, -4 dB"
    )
    assert len(found) == 2
    assert gate(BEFORE, "--annotate") == 0
    assert "::error" not in capsys.readouterr().out


def test_percent_signs_are_escaped_in_annotations():
    verdict = judge(run_of({"50%": {"psnr": [10.0]}}), make_baseline(run_of({"50%": {"psnr": [20.0]}})))
    assert "dark/s0 50%25 psnr" in next(annotations(verdict))


def test_commits_make_a_history(gate: Callable[..., int], tmp_path: Path, capsys: Capture):
    folder = tmp_path / "history"
    for commit, table in (("aaa", BEFORE), ("bbb", WORSE), ("bbb", WORSE)):
        gate(table, "--history", str(folder), "--commit", commit, "--rows", "mine")
    entries = read_history(folder).entries
    assert [(e.commit, e.exit_code) for e in entries] == [("aaa", 0), ("bbb", 1)], "a commit run twice is one"
    assert capsys.readouterr().out.count("\nhistory: ") == 3, "gate.sh looks for it"
    text = (folder / "README.md").read_text()
    assert "❌ bbb, " in text
    assert "| mine | psnr | █▁ | 18.5 dB | 21 | 21 | higher |" in text
    assert "| mine | error | █▁ | 0.4 | 0.45 | 0.4 | lower |" in text
    assert "gray" not in text
    assert page(read_history(folder)) == text


def test_the_commit_is_that_of_the_repository(
    gate: Callable[..., int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    assert gate(BEFORE, "--history", str(tmp_path / "h")) == 0
    assert read_history(tmp_path / "h").entries[0].commit == "unknown", "no repository is around here"


def test_a_damaged_history_is_left_alone(gate: Callable[..., int], tmp_path: Path, capsys: Capture):
    (tmp_path / RECORDS).write_text("{")
    assert gate(BEFORE, "--history", str(tmp_path), "--commit", "a") == 2
    assert RECORDS in capsys.readouterr().err
    assert (tmp_path / RECORDS).read_text() == "{"
    (tmp_path / RECORDS).write_text('{"entries": [], "format": "graycard-gate-history", "format_version": 9}')
    with pytest.raises(RecordError, match="9"):
        read_history(tmp_path)


def test_a_sparkline_shows_gaps_and_constant_lines():
    assert sparkline([1.0, None, 2.0]) == "▁·█"
    assert sparkline([3.0, 3.0]) == "▅▅"
    assert sparkline([]) == ""
    assert sparkline([1.0, float("inf"), float("nan"), 2.0]) == "▁··█"
    assert sparkline([-1.7e308, 1.7e308]) == "▅▅", "their difference is no number"


@pytest.mark.parametrize(
    "options",
    [
        ["--write", "--annotate"],
        ["--write", "--tolerance", "2"],
        ["--write", "--history", "h"],
        ["--commit", "a"],
    ],
)
def test_options_that_would_do_nothing_are_refused(
    options: list[str], gate: Callable[..., int], tmp_path: Path, capsys: Capture
):
    assert gate(BEFORE, *options) == 2
    assert f"expected {options[0]} " in capsys.readouterr().err
    assert not Path("h").exists()


@pytest.mark.parametrize("option", [["--rows", "mine"], ["--tolerance", "2"]])
def test_a_summary_without_a_baseline_watches_no_rows(option: list[str], tmp_path: Path, capsys: Capture):
    write_json(tmp_path / "run.json", run_of(BEFORE))
    assert main(["report", str(tmp_path), "--summary", "md", *option]) == 2
    assert "expected --baseline with --rows or --tolerance" in capsys.readouterr().err

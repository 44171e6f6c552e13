# SPDX-License-Identifier: Apache-2.0
"""Benches that add scenes until claims are decided, on scenes that no renderer makes."""

import shutil
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import pytest

from graycard.benchmarks import Plan, check_result, load_suite, run_until_decided
from graycard.benchmarks import _until_decided as module
from graycard.benchmarks._run_record import RunError
from graycard.benchmarks.claims import judge_run
from graycard.cli import main
from graycard.eval.statistics import level_up_to
from graycard.io import sha256, silent
from graycard.records import ClaimResult, RunRecord, find_claim, read_comparison, read_ledger, read_run
from tiny_benches import CLAIMS, TIE, made_without_renderer, pursued, write_claims, write_reserve_suite
from valid_runs import breaches, change


@pytest.fixture(autouse=True)
def asked(monkeypatch: pytest.MonkeyPatch, write_tiny: Callable[..., Path]) -> list[str]:
    return made_without_renderer(monkeypatch, write_tiny)


@pytest.fixture
def pursue(tmp_path: Path) -> Callable[..., RunRecord]:
    """``pursue(most, *claims)`` goes on in ``tmp_path / "run"``."""
    return partial(pursued, tmp_path)


@pytest.fixture(scope="module")
def ended(tmp_path_factory: pytest.TempPathFactory, write_tiny: Callable[..., Path]) -> Callable[[int], Path]:
    """``ended(most)``: folder of a run that nothing disturbed, made on first use; not to be changed."""

    @cache
    def of(most: int) -> Path:
        folder = tmp_path_factory.mktemp("ended")
        with pytest.MonkeyPatch.context() as patch:
            made_without_renderer(patch, write_tiny)
            pursued(folder, most)
        return folder

    return of


@pytest.fixture
def copied(ended: Callable[[int], Path], tmp_path: Path) -> Callable[[int], Path]:
    """``copied(most)``: the run folder of a copy of it in ``tmp_path``."""
    return lambda most: Path(shutil.copytree(ended(most), tmp_path, dirs_exist_ok=True)) / "run"


def claim_of(run: Path, claim: str) -> ClaimResult:
    ledger = read_ledger(run)
    assert ledger is not None
    return find_claim(ledger, claim)


def test_it_stops_when_the_claims_are_decided(ended: Callable[[int], Path]) -> None:
    """Eight scenes of one sign have p = 2 / 2^8; those of six, 2 / 2^6, is above the level."""
    run = ended(10) / "run"
    record = read_run(run)
    assert record.looks is not None
    assert record.looks.level == level_up_to(10)
    assert [len(look.scenes) for look in record.looks.made] == [2, 2, 2, 2]
    assert record.looks.stopped == "every claim that can be tested is decided"
    assert [look.undecided for look in record.looks.made] == [("tiny-claims T1",)] * 3 + [()]
    assert claim_of(run, "T1").verdict == "reproduced"
    ledger = read_ledger(run)
    assert ledger is not None
    assert ledger.level == level_up_to(10)


def test_scenes_that_are_added_have_the_rows_of_open_claims_alone(ended: Callable[[int], Path]) -> None:
    run = ended(10) / "run"
    record = read_run(run)
    rows = [tuple(r.job.method for r in record.results if r.job.scene == s.scene) for s in record.scenes]
    assert rows[:2] == [("truth", "gray", "gray-dark", "input", "retinex")] * 2
    assert rows[2:] == [("truth", "gray", "input")] * 6
    told = claim_of(run, "T1").checks[1]
    assert len(told.scenes) <= 2, "a row that was given up is judged by the scenes that it has"
    comparison = read_comparison(run)
    assert comparison is not None
    assert {s.scenes for s in comparison.find("dark", "albedo.psnr.channel").methods} == {2}


def test_it_ends_at_the_planned_number_and_adds_what_open_claims_are_about(
    pursue: Callable[..., RunRecord], asked: list[str], tmp_path: Path
) -> None:
    record = pursue(6, CLAIMS.partition("[[claims]]")[0], TIE)
    assert record.looks is not None
    assert record.looks.stopped == "the planned 6 scenes are reached"
    assert record.looks.made[-1].undecided == ("tiny-claims T2",)
    assert asked[2:] == ["corridor-0501", "corridor-0503-02e911", "corridor-0505", "corridor-0507-02e911"]
    assert claim_of(tmp_path / "run", "T2").verdict == "undecided"


def test_it_ends_with_the_reserve(pursue: Callable[..., RunRecord]) -> None:
    record = pursue(6, CLAIMS.partition("[[claims]]")[0], TIE, last=505)
    assert record.looks is not None
    assert record.looks.stopped == "the reserve has no further scene that an open claim is about"
    assert len(record.scenes) == 5


@pytest.mark.slow
def test_a_claim_keeps_the_verdict_of_the_look_that_decided_it(
    pursue: Callable[..., RunRecord], tmp_path: Path
) -> None:
    """Its rows are given up then: the last look could not judge it."""
    record = pursue(10, CLAIMS, TIE)
    assert record.looks is not None
    assert record.looks.made[-1].rows == ("truth", "gray", "gray-dark")
    run = tmp_path / "run"
    assert claim_of(run, "T1").verdict == "reproduced"
    assert len(claim_of(run, "T1").checks[0].scenes) == 8
    assert claim_of(run, "T2").verdict == "undecided"
    assert judge_run(read_run(run), run, [str(tmp_path / "tiny-claims.toml")]) == read_ledger(run)


@pytest.mark.slow
def test_the_result_is_valid_and_what_is_wrong_is_found(
    pursue: Callable[..., RunRecord], tmp_path: Path
) -> None:
    pursue(10)
    run = tmp_path / "run"
    assert {breach.rule for breach in check_result(run).breaches} <= {"origin"}
    change(run, lambda data: data["results"].pop())
    assert "expected 1 fit in run.json, got 0" in breaches(run)["counts"][0]
    change(run, lambda data: data["looks"]["made"].pop())
    assert any("expected scenes of tiny-reserve" in line for line in breaches(run)["suite"])


def test_a_second_call_finds_all_done(
    pursue: Callable[..., RunRecord], copied: Callable[[int], Path]
) -> None:
    before = read_run(run := copied(10))
    assert pursue(10) == before
    assert read_run(run) == before


def test_what_was_cut_off_goes_on_and_ends_the_same(
    pursue: Callable[..., RunRecord], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    measure, calls = module.measure, []

    def stopping(bench: Any) -> Any:
        calls.append(bench)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return measure(bench)

    monkeypatch.setattr(module, "measure", stopping)
    with pytest.raises(KeyboardInterrupt):
        pursue(10)
    half = read_run(tmp_path / "run")
    assert half.looks is not None
    assert (len(half.looks.made), half.looks.stopped) == (2, "")
    whole = pursue(10)
    assert whole.looks is not None
    assert len(whole.looks.made) == 4
    before = read_run(tmp_path / "run")
    pursue(10)
    assert read_run(tmp_path / "run") == before


def test_a_plan_is_kept(
    pursue: Callable[..., RunRecord], copied: Callable[[int], Path], tmp_path: Path
) -> None:
    copied(6)
    with pytest.raises(
        RunError, match="expected --max-scenes 6 with claims tiny-claims, as the run in .* got 8"
    ):
        pursue(8)
    suite = str(tmp_path / "tiny-reserve.toml")
    assert main(["bench", suite, "--out", str(tmp_path / "run")]) == 2
    assert len(read_run(tmp_path / "run").scenes) == 6


def test_claims_that_were_edited_are_refused(
    pursue: Callable[..., RunRecord], copied: Callable[[int], Path], tmp_path: Path
) -> None:
    copied(6)
    before = (tmp_path / "run" / "run.json").read_bytes()
    with pytest.raises(
        RunError, match=r"got other content in .*tiny-claims\.toml\. Rules .* undo the change"
    ):
        pursue(6, CLAIMS.replace('rows = ["gray", "input"]', 'rows = ["gray", "gray-dark"]'))
    assert (tmp_path / "run" / "run.json").read_bytes() == before
    record = pursue(6)
    assert record.looks is not None
    assert record.looks.claims == {"tiny-claims": sha256(tmp_path / "tiny-claims.toml")}


def test_a_suite_that_was_edited_is_refused(
    pursue: Callable[..., RunRecord], copied: Callable[[int], Path]
) -> None:
    """Its reserve counts as well: it says which scenes are added."""
    copied(6)
    with pytest.raises(RunError, match=r"got other content in the file of suite 'tiny-reserve'\. Rules"):
        pursue(6, last=509)


def test_a_plan_that_cannot_be_read_is_not_planned_anew(
    pursue: Callable[..., RunRecord], copied: Callable[[int], Path]
) -> None:
    (copied(6) / "run.json").write_text("{}")
    with pytest.raises(RunError, match="expected the plan of the run in its run.json"):
        pursue(8)


@pytest.mark.parametrize("most", [5, 13])
def test_a_plan_that_cannot_be_kept(pursue: Callable[..., RunRecord], most: int) -> None:
    with pytest.raises(RunError, match="expected 6 to 12 scenes for suite 'tiny-reserve' and its reserve"):
        pursue(most)


def test_without_claims_there_is_nothing_to_decide(tmp_path: Path) -> None:
    suite = load_suite(str(write_reserve_suite(tmp_path)))
    with pytest.raises(RunError, match="expected claims to decide for suite 'tiny-reserve', got none"):
        run_until_decided(suite, tmp_path / "run", 1, silent, Plan(6))


def test_claims_of_other_suites_and_of_one_name_are_refused_before_any_work(
    pursue: Callable[..., RunRecord], tmp_path: Path
) -> None:
    with pytest.raises(RunError, match="claims for runs of suite 'tiny-reserve', got .* for runs of 'other'"):
        pursue(6, CLAIMS.replace('suite = "tiny-reserve"', 'suite = "other"'))
    suite, claims = load_suite(str(write_reserve_suite(tmp_path))), write_claims(tmp_path)
    with pytest.raises(RunError, match="expected claims of papers with names of their own"):
        run_until_decided(suite, tmp_path / "run", 1, silent, Plan(6, (claims, claims)))
    assert not (tmp_path / "run").exists()


def test_a_suite_without_enough_to_add(pursue: Callable[..., RunRecord], tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"4 or more scenes in \[reserve\] of suite 'tiny-reserve', got 2"):
        pursue(6, last=502)
    plan = Plan(5, (write_claims(tmp_path, CLAIMS.replace('suite = "tiny-reserve"\n', "")),))
    with pytest.raises(RunError, match=r"'demo' to have scenes to add, got none: it has no \[reserve\]"):
        run_until_decided(load_suite("demo"), tmp_path / "run", 1, silent, plan)


def test_on_the_command_line(
    copied: Callable[[int], Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    suite, claims = str(write_reserve_suite(tmp_path)), write_claims(tmp_path)
    command = ["bench", suite, "--out", str(tmp_path / "run"), "--jobs", "1"]
    assert main([*command, "--until-decided"]) == 2
    assert main([*command, "--max-scenes", "9"]) == 2
    assert main([*command, "--until-decided", "--max-scenes", "9", "--budget", "2", "--sealed"]) == 2
    said = capsys.readouterr().err
    assert "expected --max-scenes N with --until-decided, got none" in said
    assert "expected --until-decided with --max-scenes, got none" in said
    assert "expected --until-decided without --sealed, --budget, got both" in said
    shutil.rmtree(
        copied(10) / "jobs" / "dark" / "corridor-0501"
    )  # its fits are made again, all else is there
    assert main([*command, "--until-decided", "--max-scenes", "10", "--claims", claims]) == 0
    shown = capsys.readouterr().out.strip().splitlines()
    last, looks = shown[-1], next(line for line in shown if line.startswith("looks:"))
    assert looks.startswith(f"looks: 4 at {100 * level_up_to(10):.2f} % each, 8 of at most 10 scenes; every")
    assert last.startswith("bench: 28 jobs, 0 failures")

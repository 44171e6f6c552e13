# SPDX-License-Identifier: Apache-2.0
"""Verdicts of runs that add scenes: they last, and fits that fail are told of."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from graycard.benchmarks import _runner
from graycard.benchmarks._jobs import FitJob, run_fit
from graycard.benchmarks.claims import judge_run
from graycard.cli import main
from graycard.processes import Outcome
from graycard.records import ClaimResult, RunRecord, find_claim, read_ledger, read_run
from tiny_benches import CLAIMS, TIE, made_without_renderer, pursued, write_claims, write_reserve_suite

Pursue = Callable[..., RunRecord]


@pytest.fixture(autouse=True)
def asked(monkeypatch: pytest.MonkeyPatch, write_tiny: Callable[..., Path]) -> list[str]:
    return made_without_renderer(monkeypatch, write_tiny)


@pytest.fixture
def pursue(tmp_path: Path) -> Pursue:
    """``pursue(most, *claims)`` goes on in ``tmp_path / "run"``."""
    return partial(pursued, tmp_path)


@pytest.fixture
def failing(monkeypatch: pytest.MonkeyPatch) -> set[tuple[str, str, int]]:
    """Fits that fail: row, scene, seed."""
    return let_fail(monkeypatch)


def let_fail(patch: pytest.MonkeyPatch, *fits: tuple[str, str, int]) -> set[tuple[str, str, int]]:
    """Let some fits fail; more may be added to what it returns."""
    found = set(fits)

    def fit(job: FitJob) -> Outcome:
        asks = job.job.method, job.job.scene, job.job.seed
        return Outcome(reason="out of memory") if asks in found else run_fit(job)

    patch.setattr(_runner, "run_fit", fit)
    return found


LOST = ("input", "corridor-0501", 0)


@pytest.fixture(scope="module")
def lost(tmp_path_factory: pytest.TempPathFactory, write_tiny: Callable[..., Path]) -> Path:
    """Folder of a run in which a fit has failed; not to be changed."""
    folder = tmp_path_factory.mktemp("lost")
    with pytest.MonkeyPatch.context() as patch:
        made_without_renderer(patch, write_tiny)
        let_fail(patch, LOST)
        pursued(folder, 10)
    return folder


@pytest.fixture(scope="module")
def tied(tmp_path_factory: pytest.TempPathFactory, write_tiny: Callable[..., Path]) -> Path:
    """Folder of a run that has decided one claim of two; not to be changed."""
    folder = tmp_path_factory.mktemp("tied")
    with pytest.MonkeyPatch.context() as patch:
        made_without_renderer(patch, write_tiny)
        pursued(folder, 10, CLAIMS, TIE)
    return folder


def claim_of(run: Path, claim: str) -> ClaimResult:
    ledger = read_ledger(run)
    assert ledger is not None
    return find_claim(ledger, claim)


def judged_again(folder: Path) -> bool:
    """Tell if judging the run later gives the ledger that the run wrote."""
    run = folder / "run"
    return judge_run(read_run(run), run, [str(folder / "tiny-claims.toml")]) == read_ledger(run)


@pytest.mark.slow
def test_a_verdict_lasts_through_more_than_ten_looks(pursue: Pursue, tmp_path: Path) -> None:
    """T1 is decided after some looks; T3 is about one corridor in two, and the suite has none of them."""
    glossy = TIE.replace("T2", "T3").replace('["corridor"]', '["corridor"], knobs = { gloss = [0.2, 0.3] }')
    record = pursue(20, CLAIMS, TIE, glossy, last=560)
    assert record.looks is not None
    assert len(record.looks.made) > 10
    open_at = [i for i, look in enumerate(record.looks.made) if "tiny-claims T1" in look.undecided]
    decided = claim_of(tmp_path / "run", "T1")
    assert decided.verdict == "reproduced"
    scenes = record.at_look(open_at[-1] + 1).scenes
    assert list(decided.checks[0].scenes) == [scene.scene for scene in scenes]
    assert record.looks.untestable == {}
    assert claim_of(tmp_path / "run", "T3").verdict == claim_of(tmp_path / "run", "T2").verdict
    shining = [s.scene for s in record.scenes if s.family == "corridor" and s.knobs.get("gloss") == 0.25]
    assert len(shining) > 5
    assert list(claim_of(tmp_path / "run", "T3").checks[0].scenes) == shining
    assert judged_again(tmp_path)


@pytest.mark.slow
def test_later_scenes_with_its_rows_do_not_turn_a_verdict(pursue: Pursue, tmp_path: Path) -> None:
    """T1 is decided at the fourth look; T3 is about one corridor in two, and the suite has none of them.

    Both stand on the same rows: later looks could judge T1 by more scenes, and must not.
    """
    t3 = TIE.replace("T2", "T3").replace('["corridor"]', '["corridor"], knobs = { gloss = [0.2, 0.3] }')
    record = pursue(20, CLAIMS, t3.replace('"gray-dark"', '"input"'), last=560)
    assert record.looks is not None
    assert len(record.looks.made) > 10
    open_at = [i for i, look in enumerate(record.looks.made) if "tiny-claims T1" in look.undecided]
    assert open_at == [0, 1, 2]
    decided, last = (claim_of(tmp_path / "run", claim) for claim in ("T1", "T3"))
    assert (decided.verdict, last.verdict) == ("reproduced", "reproduced")
    assert list(decided.checks[0].scenes) == [scene.scene for scene in record.at_look(3).scenes]
    assert record.looks.untestable == {}
    assert len(last.checks[0].scenes) == 8
    assert judged_again(tmp_path)


def test_a_fit_that_fails_takes_its_claim_out_and_says_so(lost: Path) -> None:
    record = read_run(lost / "run")
    assert record.looks is not None
    why = record.looks.untestable["tiny-claims T1"]
    assert why == "input failed on corridor-0501: out of memory"
    assert record.looks.lost == record.looks.untestable
    assert record.looks.stopped == "nothing is left to decide, but tiny-claims T1 cannot be tested"
    assert claim_of(lost / "run", "T1").verdict == "not testable here"
    assert judged_again(lost)


def test_what_failed_is_tried_again_by_the_next_call(pursue: Pursue, tmp_path: Path, lost: Path) -> None:
    shutil.copytree(lost, tmp_path, dirs_exist_ok=True)
    record = pursue(10)
    assert record.looks is not None
    assert record.looks.untestable == {}
    assert record.looks.stopped == "every claim that can be tested is decided"
    assert claim_of(tmp_path / "run", "T1").verdict == "reproduced"


def test_a_fit_that_fails_later_leaves_earlier_verdicts(
    pursue: Pursue, tmp_path: Path, failing: set[tuple[str, str, int]], tied: Path
) -> None:
    """Gray is a row of both claims; T1 was decided by then."""
    shutil.copytree(tied, tmp_path, dirs_exist_ok=True)
    before = read_run(tmp_path / "run")
    assert before.looks is not None
    decided = claim_of(tmp_path / "run", "T1")
    late = before.looks.made[5].scenes[0].rpartition("/")[2]
    failing.add(("gray", late, 0))
    for done in (tmp_path / "run" / "jobs" / "dark" / late).glob("gray-0-*/job.json"):
        done.unlink()
    record = pursue(10, CLAIMS, TIE)
    assert record.looks is not None
    assert record.looks.untestable == {"tiny-claims T2": f"gray failed on {late}: out of memory"}
    assert claim_of(tmp_path / "run", "T1") == decided
    assert judged_again(tmp_path)


def test_a_claim_that_was_given_up_is_judged_by_the_scenes_that_it_has(tied: Path) -> None:
    """Stricter rules leave T1 open at the look that decided it: later scenes lack its rows all the same."""
    record = read_run(tied / "run")
    assert record.looks is not None
    stricter = replace(record, looks=replace(record.looks, level=0.9999))
    ledger = judge_run(stricter, tied / "run", [str(tied / "tiny-claims.toml")])
    found = find_claim(ledger, "T1")
    assert (found.verdict, len(found.checks[0].scenes)) == ("undecided", 8)


@pytest.mark.slow
def test_claims_with_several_seeds_have_the_mean_of_each_scene(
    pursue: Pursue, tmp_path: Path, failing: set[tuple[str, str, int]]
) -> None:
    record = pursue(10, seeds="[0, 1]")
    assert {len([r for r in record.results if r.job.scene == s.scene]) for s in record.scenes} == {6, 10}
    decided = claim_of(tmp_path / "run", "T1")
    assert (decided.verdict, len(decided.checks[0].scenes)) == ("reproduced", 8)
    assert decided.checks[0].seed_sd == 0, "fits of one scene differ by nothing"
    assert judged_again(tmp_path)
    failing.add(("gray", "corridor-0501", 1))
    for done in (tmp_path / "run" / "jobs" / "dark" / "corridor-0501").glob("gray-1-*/job.json"):
        done.unlink()
    again = pursue(10, seeds="[0, 1]")
    assert again.looks is not None
    assert list(again.looks.lost) == ["tiny-claims T1"], "one seed that fails is enough"


def test_a_row_that_the_suite_has_not_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    claims = write_claims(tmp_path, CLAIMS.replace('["gray", "input"]', '["grey", "input"]'))
    command = ["bench", str(write_reserve_suite(tmp_path)), "--out", str(tmp_path / "run"), "--jobs", "1"]
    assert main([*command, "--until-decided", "--max-scenes", "10", "--claims", claims]) == 0
    said = capsys.readouterr()
    assert "cannot be tested: tiny-claims T1: " in said.err
    assert "grey" in said.err
    assert "nothing is left to decide, but tiny-claims T1 cannot be tested; undecided: none" in said.out


def test_a_lost_claim_on_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], failing: set[tuple[str, str, int]], lost: Path
) -> None:
    """The fit is tried again, and fails again."""
    failing.add(LOST)
    shutil.copytree(lost, tmp_path, dirs_exist_ok=True)
    suite, claims = str(write_reserve_suite(tmp_path)), write_claims(tmp_path)
    command = ["bench", suite, "--out", str(tmp_path / "run"), "--jobs", "1", "--until-decided"]
    assert main([*command, "--max-scenes", "10", "--claims", claims]) == 1
    said = capsys.readouterr()
    told = "can no longer be tested: tiny-claims T1: input failed on corridor-0501: out of memory"
    assert told in said.err
    assert "advice: run the same command again: what failed is tried again" in said.err
    assert "nothing is left to decide, but tiny-claims T1 cannot be tested; undecided: none" in said.out


def test_each_option_that_is_missing_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["bench", str(write_reserve_suite(tmp_path)), "--out", str(tmp_path / "run")]
    for options, says in (
        (["--until-decided"], "expected --max-scenes N with --until-decided, got none"),
        (["--until-decided", "--claims", "x"], "expected --max-scenes N with --until-decided, got none"),
        (["--max-scenes", "9"], "expected --until-decided with --max-scenes, got none"),
        (["--claims", "x"], "expected --until-decided with --claims, got none"),
        (["--max-scenes", "9", "--claims", "x"], "with --max-scenes and --claims, got none"),
    ):
        assert main([*command, *options]) == 2
        assert says in capsys.readouterr().err

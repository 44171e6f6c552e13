# SPDX-License-Identifier: Apache-2.0
"""``graycard claims`` on a run made by hand."""

from dataclasses import replace
from pathlib import Path

import pytest

from graycard import RecordError
from graycard.cli import main
from graycard.io import from_builtins, read_json, sha256, write_json
from graycard.records import CLAIMS, Ledger, find_claim, read_ledger, read_run
from runs_by_hand import run_of

ROOT = Path(__file__).parents[2]

OWN_CLAIMS = """
name = "mine"
version = 3
title = "A paper of mine"
track = "dark"
bound = "bound"
trivial = "gray"
[[claims]]
id = "M1"
sentence = "Mine is better."
source = "Table 1"
figures = { mine = "35 dB" }
[[claims.checks]]
id = "psnr"
says = "PSNR is higher"
rule = "better"
rows = ["mine", "theirs"]
quantity = { metric = "psnr" }
expects = "higher"
paper = 5.0
[[claims.checks]]
id = "told"
says = "The other way round"
rule = "better"
rows = ["theirs", "mine"]
quantity = { metric = "psnr" }
expects = "higher"
decides = false
[[claims]]
id = "M2"
sentence = "Mine is better than nobody."
source = "Table 1"
[[claims.checks]]
id = "psnr"
says = "PSNR is higher"
rule = "better"
rows = ["mine", "nobody"]
quantity = { metric = "psnr" }
expects = "higher"
"""


@pytest.fixture
def claims(tmp_path: Path) -> str:
    path = tmp_path / "mine.toml"
    path.write_text(OWN_CLAIMS)
    return str(path)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """``mine`` leads by 4.5 to 5.5 dB on six scenes, of which the interval holds all."""
    lead = (4.5, 4.75, 4.875, 5.125, 5.25, 5.5)
    rows = {"mine": [30 + e for e in lead], "theirs": [30.0] * 6, "gray": [10.0] * 6, "bound": [50.0] * 6}
    write_json(tmp_path / "run" / "run.json", run_of({row: {"psnr": v} for row, v in rows.items()}))
    return tmp_path / "run"


def test_verdicts_are_said_and_kept(run: Path, claims: str, capsys: pytest.CaptureFixture[str]) -> None:
    copy = run / "copy.json"
    assert main(["claims", str(run), "--claims", claims, "--checks", "--json", str(copy)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "A paper of mine, claims version 3" in lines
    first = next(line for line in lines if line.startswith("M1"))
    assert "reproduced" in first
    assert "PSNR, mine − theirs = 5 dB (4.5 to 5.5, 6 scenes); the paper: 5 dB" in first
    told = next(line for line in lines if line.startswith("told"))
    assert "does not hold (decides nothing)" in told
    assert "-5.5 to -4.5" in told
    assert "bound: 50" in told
    assert lines[-1].startswith("claims: 1 reproduced, 1 not testable here; report: ")
    ledger = read_ledger(run)
    assert ledger is not None
    assert ledger == from_builtins(Ledger, read_json(copy))
    assert ledger.run_sha256 == sha256(run / "run.json")
    assert ledger.papers[0].claims_sha256 == sha256(Path(claims))
    assert ledger.methods["mine"] == "what mine is"
    assert find_claim(ledger, "M2").verdict == "not testable here"
    assert ledger.level == 0.95
    assert ledger.format_version == 2
    with pytest.raises(RecordError, match="expected a claim of this ledger, got 'M3'"):
        find_claim(ledger, "M3")


def test_the_same_run_gives_the_same_ledger(run: Path, claims: str) -> None:
    main(["claims", str(run), "--claims", claims])
    once = (run / CLAIMS).read_bytes()
    main(["claims", str(run), "--claims", claims])
    assert (run / CLAIMS).read_bytes() == once


def test_claims_of_another_suite_are_refused_and_nothing_is_replaced(
    run: Path, claims: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The rows of two suites may have the same names, and other scenes."""
    assert main(["claims", str(run), "--claims", claims]) == 0
    before = (run / CLAIMS).read_bytes()
    Path(claims).write_text(OWN_CLAIMS.replace('track = "dark"', 'track = "dark"\nsuite = "theirs"', 1))
    capsys.readouterr()
    assert main(["claims", str(run), "--claims", claims]) == 2
    said = capsys.readouterr()
    assert f"expected a run of suite 'theirs' for claims '{claims}', got a run of suite 'hand'" in said.err
    assert "--any-suite" in said.err
    assert said.out == ""
    assert main(["claims", str(run), "--claims", "sunfaded", "gsid"]) == 2
    assert (
        "expected a run of suite 'claims-dark' for claims 'sunfaded', a run of suite 'claims-multilight' for"
        in capsys.readouterr().err
    )
    assert (run / CLAIMS).read_bytes() == before
    assert main(["claims", str(run), "--claims", claims, "--any-suite"]) == 0
    said = capsys.readouterr()
    assert f"not of these scenes: {claims} is made for runs of theirs, not of hand" in said.err
    assert "1 reproduced" in said.out


def test_claims_that_name_the_runs_suite_are_judged(
    run: Path, claims: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path(claims).write_text(OWN_CLAIMS.replace('track = "dark"', 'track = "dark"\nsuite = "hand"', 1))
    assert main(["claims", str(run), "--claims", claims]) == 0
    assert capsys.readouterr().err == ""


def test_a_run_that_no_claims_are_made_for_is_held_against_all_if_asked(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["claims", str(run)]) == 2
    said = capsys.readouterr().err
    assert "expected a run of suite 'claims-dark' for claims 'sunfaded', got a run of suite 'hand'" in said
    assert "--any-suite" in said
    assert "--sizes" in said
    assert read_ledger(run) is None
    assert main(["claims", str(run), "--any-suite"]) == 0
    ledger = read_ledger(run)
    assert ledger is not None
    assert [paper.name for paper in ledger.papers] == [
        "goris",
        "goris-matte",
        "goris-robust",
        "gsid",
        "sunfaded",
    ]
    assert find_claim(ledger, "GA1").verdict == "inconsistent"
    assert all(claim.verdict == "not testable here" for claim in ledger.papers[4].claims)
    assert "the run has no row sunfaded, appearance" in capsys.readouterr().out


def test_claims_made_for_the_suite_come_first(run: Path) -> None:
    write_json(run / "run.json", replace(read_run(run), suite="claims-dark"))
    assert main(["claims", str(run)]) == 0
    ledger = read_ledger(run)
    assert ledger is not None
    assert [paper.name for paper in ledger.papers] == ["sunfaded"]


def test_tables_of_papers_need_no_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And what is published of them is what the command writes."""
    copy = tmp_path / "tables.json"
    assert main(["claims", "--json", str(copy)]) == 0
    assert capsys.readouterr().out.endswith("\nclaims: 1 consistent, 5 inconsistent\n")
    ledger = from_builtins(Ledger, read_json(copy))
    assert [c.id for paper in ledger.papers for c in paper.claims] == [
        "RA1",
        "GA1",
        "GA2",
        "GA3",
        "GA4",
        "GA5",
    ]
    assert ledger.run_sha256 == ""
    assert copy.read_bytes() == (ROOT / "reports" / "published" / "tables.json").read_bytes()
    assert main(["claims", "--claims", "goris"]) == 0
    assert capsys.readouterr().out.endswith("\nclaims: 1 inconsistent\n")


def test_what_is_wrong_is_said(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["claims", str(run), "--claims", "sunfadde"]) == 2
    assert "expected a file of claims that exists, got 'sunfadde'" in capsys.readouterr().err
    assert main(["claims", str(tmp_path)]) == 2
    assert "expected a run folder with run.json" in capsys.readouterr().err
    assert read_ledger(tmp_path) is None


def test_a_ledger_of_the_first_format_is_refused_with_advice(run: Path, claims: str) -> None:
    """Its verdicts have other meanings, whatever else it holds."""
    assert main(["claims", str(run), "--claims", claims]) == 0
    ledger = read_ledger(run)
    write_json(run / CLAIMS, read_json(run / CLAIMS) | {"format_version": 1})
    with pytest.raises(
        RecordError, match=r"(?s)version 2 in .*claims\.json.*got version 1.*graycard claims RUN"
    ):
        read_ledger(run)
    write_json(run / CLAIMS, {"format": "graycard-claims", "format_version": 1, "papers": "anything"})
    with pytest.raises(RecordError, match="Judge the run again: graycard claims RUN"):
        read_ledger(run)
    assert main(["claims", str(run), "--claims", claims]) == 0, "the advice helps"
    assert read_ledger(run) == ledger
    write_json(run / CLAIMS, read_json(run / CLAIMS) | {"format_version": 3})
    with pytest.raises(RecordError) as newer:
        read_ledger(run)
    assert "Judge the run again" not in str(newer.value)


def test_questions_of_graycards_own_stand_apart(
    run: Path, claims: str, capsys: pytest.CaptureFixture[str]
) -> None:
    own = OWN_CLAIMS.replace('source = "Table 1"', 'source = "Table 1"\nasked_by = "graycard"', 1)
    Path(claims).write_text(own)
    assert main(["claims", str(run), "--claims", claims]) == 0
    said = capsys.readouterr().out
    papers, asked = said.split("graycard's own questions, which no paper claims")
    assert "M2" in papers
    assert "M1" not in papers
    assert any(line.startswith("M1") and "holds" in line for line in asked.splitlines())
    assert "\nclaims: 1 not testable here, 1 holds; report: " in said

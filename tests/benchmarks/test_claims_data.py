# SPDX-License-Identifier: Apache-2.0
"""Files of claims as they are read, and those that come along; tables of papers against themselves."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

import graycard.eval as ge
from graycard import RecordError, UnknownNameError
from graycard.benchmarks import load_suite
from graycard.benchmarks.claims import (
    Arithmetic,
    Paper,
    claims_names,
    claims_of_suite,
    judge_paper,
    load_claims,
)
from graycard.methods import load_method, settings_of
from graycard.records import ClaimResult
from runs_by_hand import run_of

CLAIMS = """
name = "mine"
version = 1
title = "Mine"
track = "dark"
bound = "truth"
trivial = "gray"
[[claims]]
id = "M1"
sentence = "It is better."
source = "Table 1"
{claim}
[[claims.checks]]
id = "a"
says = "mine is better"
rule = "better"
rows = ["mine", "theirs"]
quantity = {{ metric = "novel_view.psnr" }}
expects = "higher"
{check}
"""


def written(folder: Path, claim: str = "", check: str = "", text: str = CLAIMS) -> str:
    path = folder / "mine.toml"
    path.write_text(text.format(claim=claim, check=check))
    return str(path)


def test_a_file_is_read_as_it_is_written(tmp_path: Path) -> None:
    more = (
        'paper = 5\naccepted = [2, inf]\nscenes = { families = ["corridor"], knobs = { gloss = [0, 0.5] } }'
    )
    claim = load_claims(written(tmp_path, 'notes = ["smaller"]', more)).claims[0]
    check = claim.checks[0]
    assert (claim.id, claim.notes, check.rows) == ("M1", ("smaller",), ("mine", "theirs"))
    assert (check.paper, check.accepted) == (5.0, (2.0, float("inf")))
    assert check.scenes.knobs == {"gloss": (0.0, 0.5)}


@pytest.mark.parametrize(
    ("claim", "check", "words"),
    [
        ("sentense = 'x'", "", "sentense"),
        ("", "papper = 5.0", "papper"),
        ("", "scale = 'percent'", "scale"),
        ("verdict_by = 'most'", "", "verdict_by"),
        ("", "paper = -5.0", "the paper's effect above 0, as it is in the claimed sense, got -5.0"),
        ("", "paper = 0.5\nscale = 'ratio'", "the paper's effect above 1"),
        ("", "accepted = [2, 1]", "accepted from low to high"),
        ("", "negligible = -1", "negligible of 0 or more, and none for within, got -1"),
        ("", "negligible = nan", "negligible of 0 or more"),
        ("", "paper = 5.0\nnegligible = 10.0", "negligible below the claimed size [2.5, 10.0], got 10.0"),
        ("", "accepted = [1, 2, 3]", "accepted"),
        ("", "levels = [1, 2]", "one or two rows, without levels"),
        ("", "along = { knob = 'gloss', low = 1, high = 0 }", "low below high along gloss"),
        ("", "decides = false", "a check that decides, or unavailable, in claim 'M1'"),
    ],
)
def test_a_broken_file_is_refused(tmp_path: Path, claim: str, check: str, words: str) -> None:
    with pytest.raises(RecordError, match="mine.toml") as refusal:
        load_claims(written(tmp_path, claim, check))
    assert words in str(refusal.value)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('rule = "better"', 'rule = "within"', "what the interval has to lie in (accepted)"),
        ('rule = "better"', 'rule = "monotone"', "three or more rows and no knob"),
        ('rule = "better"', 'rule = "best"', "rule"),
        ('["mine", "theirs"]', '["mine", "mine"]', "rows that differ"),
        ('["mine", "theirs"]', '["a", "b", "c"]', "one or two rows"),
        ('["mine", "theirs"]', "[]", "one or two rows"),
        ('["mine", "theirs"]', '["mine"]\nscale = "ratio"', "a number above 0 that the row is a multiple of"),
        ('bound = "truth"\n', "", "the rows of the upper bound and of what is trivial for 'M1'"),
        ("[[claims]]", '[[arithmetic]]\nid = "M1"\nsentence = ""\nsource = ""\n'
         "entries = {{ a = [1.0], b = [2.0] }}\n[[claims]]", "claims of 'mine' with ids of their own"),
    ],
)  # fmt: skip
def test_a_broken_check_is_refused(tmp_path: Path, old: str, new: str, words: str) -> None:
    with pytest.raises(RecordError, match="mine.toml") as refusal:
        load_claims(written(tmp_path, text=CLAIMS.replace(old, new)))
    assert words in str(refusal.value)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('minus = ["x"]', "as many rows in minus as in rows, got 1 for 3"),
        ("levels = [1, 2]", "a level for each row, rising"),
        ("levels = [1, 3, 2]", "a level for each row, rising"),
    ],
)
def test_levels_that_do_not_fit_are_refused(tmp_path: Path, more: str, words: str) -> None:
    text = CLAIMS.replace('rule = "better"', 'rule = "monotone"').replace(
        '["mine", "theirs"]', '["a", "b", "c"]'
    )
    assert load_claims(written(tmp_path, text=text)).claims[0].checks[0].places == (0, 1, 2)
    with pytest.raises(RecordError) as refusal:
        load_claims(written(tmp_path, check=more, text=text))
    assert words in str(refusal.value)


def test_what_is_no_file_of_claims(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'sunfaded'"):
        load_claims("sunfadde")
    with pytest.raises(UnknownNameError, match="a path that ends in .toml"):
        load_claims(str(tmp_path / "none.toml"))
    with pytest.raises(UnknownNameError, match="did you mean 'dark'"):
        load_claims(written(tmp_path, text=CLAIMS.replace('"dark"', '"drak"')))
    broken = tmp_path / "broken.toml"
    broken.write_text("name = ")
    with pytest.raises(RecordError, match="expected TOML in"):
        load_claims(str(broken))


def test_the_files_of_the_docs_can_be_read(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "reference" / "claim-files.md").read_text(encoding="utf-8")
    claims, table = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    path = tmp_path / "mine.toml"
    path.write_text(claims + table)
    paper = load_claims(str(path))
    assert [c.id for c in (*paper.claims, *paper.arithmetic)] == ["M1", "GA1"]
    commented = re.sub(r"(?m)^# (accepted|scenes|decides)", r"\1", claims)
    path.write_text(commented.replace("decides = false", "decides = true"))
    assert load_claims(str(path)).claims[0].checks[0].range == (2.0, float("inf"))


def test_claims_of_a_suite() -> None:
    assert claims_of_suite("claims-dark") == ["sunfaded"]
    assert claims_of_suite("claims-multilight") == ["gsid"]
    assert claims_of_suite("claims-tabletop") == ["goris"]
    assert claims_of_suite("claims-matte") == ["goris-matte"]
    assert claims_of_suite("claims-robust") == ["goris-robust"]
    assert claims_of_suite("smoke") == []


@pytest.mark.parametrize("name", claims_names())
def test_files_that_come_along_name_what_there_is(name: str) -> None:
    paper = load_claims(name)
    known = {metric.id for metric in ge.all_metrics()}
    rows = {m.row for m in load_suite(paper.suite).methods} if paper.suite else set()
    assert {row for pair in paper.nested for row in (pair.inner, pair.outer)} <= rows
    for claim in paper.claims:
        assert {claim.bound or paper.bound, claim.trivial or paper.trivial} <= rows
        for check in claim.checks:
            assert {*check.rows, *check.minus} <= rows, f"{claim.id} {check.id}"
            named = {check.quantity.metric, check.quantity.less} - {""}
            assert {n for n in named if not n.startswith(("cost.", "count."))} <= known


@pytest.mark.parametrize(
    ("paper", "letter", "count"),
    [("sunfaded", "S", range(1, 15)), ("gsid", "G", range(1, 15)), ("goris", "R", (*range(1, 18), 20))],
)
def test_every_claim_of_a_paper_is_there(paper: str, letter: str, count: Sequence[int]) -> None:
    assert [claim.id for claim in load_claims(paper).claims] == [f"{letter}{n}" for n in count]


def test_what_needs_real_rooms_or_another_suite_is_said_to() -> None:
    lacking = [claim for claim in load_claims("goris").claims if claim.unavailable]
    assert [claim.id for claim in lacking] == ["R2", "R3", "R10", "R11", "R12", "R16"]
    assert [claim.id for claim in lacking if claim.checks] == ["R16"], "told, and decides nothing"
    for claim in lacking[1:-1]:
        name = "goris-matte" if claim.id == "R3" else "goris-robust"
        assert name in claim.unavailable
        assert claim.id in [judged.id for judged in load_claims(name).claims]


@pytest.mark.parametrize(
    "suite", ["claims-dark", "claims-multilight", "claims-tabletop", "claims-matte", "claims-robust"]
)
def test_the_rows_of_the_suites_take_their_settings(suite: str) -> None:
    for row in load_suite(suite).methods:
        settings_of(load_method(row.name), row.settings)


def arithmetic(**more: Any) -> ClaimResult:
    options: dict[str, Any] = {"entries": {"a": (24.51, 23.60)}, "stated": {"a": 22.71}} | more
    paper = Paper("p", 1, "P", arithmetic=(Arithmetic("A", "Means are means.", "Table 4", **options),))
    return judge_paper(paper, run_of({}))[0]


def test_a_mean_that_is_none() -> None:
    found = arithmetic()
    assert found.verdict == "inconsistent"
    assert found.text == "does not follow from its own entries: the mean of 24.51, 23.60 is 24.055, not 22.71"
    assert found.checks[0].estimate == pytest.approx(24.055)
    assert found.checks[0].paper == 22.71
    assert found.checks[0].accepted == pytest.approx((22.70, 22.72)), "both are rounded to a hundredth"
    assert (found.stability, found.suspended, found.needs) == (None, "", "")


@pytest.mark.parametrize(
    ("stated", "expected"),
    [(24.05, "consistent"), (24.06, "consistent"), (24.065, "consistent"), (24.07, "inconsistent")],
)
def test_both_are_rounded(stated: float, expected: str) -> None:
    assert arithmetic(stated={"a": stated}).verdict == expected


def test_one_mean_that_is_wrong_among_right_ones() -> None:
    entries = {"a": (1.0, 2.0), "b": (1.0, 3.0)}
    found = arithmetic(entries=entries, stated={"a": 1.5, "b": 2.5})
    assert [check.verdict for check in found.checks] == ["consistent", "inconsistent"]
    assert "the mean of 1.00, 3.00 is 2.000, not 2.50" in found.text
    assert arithmetic(entries=entries, stated={"a": 1.5, "b": 2.0}).text == "follows from its own entries"


def test_rows_that_are_the_same() -> None:
    same = arithmetic(entries={"a": (1.5, 2.0), "b": (1.5, 2.0)}, stated={})
    assert same.text == "does not follow from its own entries: a and b are both 1.50, 2.00"
    assert arithmetic(entries={"a": (1.5, 2.0), "b": (1.5, 2.1)}, stated={}).verdict == "consistent"


@pytest.mark.parametrize(
    "options",
    [
        {"stated": {"b": 1.0}},
        {"entries": {"a": ()}},
        {"stated": {}},
        {"entries": {}, "stated": {}},
    ],
)
def test_tables_that_say_nothing_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="expected"):
        arithmetic(**options)

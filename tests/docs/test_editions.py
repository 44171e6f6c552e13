# SPDX-License-Identifier: Apache-2.0
"""``docs/results/second.md``: what the ledger's second edition says beside the first."""

import zlib
from dataclasses import replace
from pathlib import Path

import pytest

from docs_of_editions import (
    claims_in,
    decided_words,
    edition_block,
    is_decided,
    newest_claims,
    size_block,
    whole_block,
)
from docs_of_reference import DOCS
from graycard.io import sha256
from graycard.records import UNSEEN, read_ledger, read_run
from graycard.reports.history._explain import NOT_TESTED
from graycard.reports.history._keep import OWN
from published import LARGE, PAPER, SECOND, SIZES, folders_of_large, folders_of_second
from written_blocks import told_and_wanted

PAGE = DOCS / "results" / "second.md"
FOLDERS = folders_of_second()
SEALED = [*FOLDERS, *folders_of_large()]
HELD_AGAINST = {"dark-hd": SECOND / "dark-sealed-2", "tabletop-hd": SECOND / "tabletop-sealed"}
"""The run of small pictures beside each run of large ones, by its name."""


def test_the_page_begins_with_how_many_claims_are_decided():
    told, wanted = told_and_wanted(PAGE, "whole", whole_block(FOLDERS))
    assert told == wanted, "run `make docs`"
    verdicts = [line.split(" | ")[2] for line in told.splitlines() if line.startswith("| ")][2:]
    decided = sum(map(is_decided, newest_claims(FOLDERS).values()))
    assert told.startswith(f"{decided} of {len(verdicts)} claims and questions ")


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_each_verdict_of_both_editions_stands_on_the_page(folder: Path):
    told, wanted = told_and_wanted(PAGE, folder.name, edition_block(folder))
    assert told == wanted, "run `make docs`"


def test_each_run_of_larger_pictures_has_one_of_small_ones_beside_it():
    assert {folder.name for folder in folders_of_large()} == set(HELD_AGAINST)


@pytest.mark.parametrize("name", HELD_AGAINST)
def test_the_verdicts_on_larger_pictures_stand_beside_those_of_the_edition(name: str):
    told, wanted = told_and_wanted(PAGE, name, size_block(LARGE / name, HELD_AGAINST[name]))
    assert told == wanted, "run `make docs`"


def test_the_page_says_rightly_which_verdicts_stand_on_larger_pictures():
    large, small = claims_in(LARGE / "dark-hd"), claims_in(HELD_AGAINST["dark-hd"])
    tested = {name: claim.verdict for name, claim in large.items() if claim.verdict != NOT_TESTED}
    assert [name for name, verdict in tested.items() if verdict == small[name].verdict] == ["S1", "S14"]
    assert (small["S2"].verdict, tested["S2"]) == ("undecided", "contradicted")
    assert (tested["S13"], large["S13"].before, small["S13"].verdict) == ("open", "holds", "holds")
    assert "S1 and S14 have the verdicts that they have at 112 pixels." in PAGE.read_text(encoding="utf-8")


def test_the_page_says_rightly_what_larger_pictures_say_of_tables():
    large, small = claims_in(LARGE / "tabletop-hd"), claims_in(HELD_AGAINST["tabletop-hd"])
    tested = {name: claim.verdict for name, claim in large.items() if is_decided(claim)}
    assert tested == {"R1": "reproduced", "R14": "holds"} == {name: small[name].verdict for name in tested}
    assert large["R15"].verdict == small["R15"].verdict == "open"
    run = read_run(LARGE / "tabletop-hd")
    unseen = run.environment[UNSEEN]
    assert list(unseen) == [f"tabletop/{scene.scene}" for scene in run.scenes[:5]]
    assert {one["git_commit"] for one in run.environments} == {"9cf7e72f2ba2"}
    assert [one["cpu"] for one in run.environments] == ["AMD EPYC", "Intel(R) Xeon(R) Processor"]
    assert "R1 and R14 have the verdicts that they have at 112 pixels." in PAGE.read_text(encoding="utf-8")


def test_runs_of_one_size_are_not_held_against_each_other():
    folder = HELD_AGAINST["dark-hd"]
    with pytest.raises(ValueError, match="expected runs of two sizes of pictures, got 112 x 112"):
        size_block(folder, folder)


@pytest.mark.parametrize("folder", SEALED, ids=lambda folder: folder.name)
def test_a_sealed_run_is_of_sealed_scenes_and_its_ledger_of_its_run(folder: Path):
    run, ledger = read_run(folder), read_ledger(folder)
    assert ledger is not None
    assert run.edition == ledger.edition
    assert run.edition is not None
    assert run.edition.tag.startswith("edition-2")
    assert ledger.run_sha256 == sha256(folder / "run.json")
    assert all(scene.seed is not None and 901 <= scene.seed <= 999 for scene in run.scenes)


def test_published_runs_take_60_megabytes_of_git():
    """Git keeps each file of a commit compressed by zlib."""
    files = [path for parent in (SECOND, LARGE, SIZES, PAPER) for path in parent.rglob("*") if path.is_file()]
    assert len(files) > 40
    assert sum(len(zlib.compress(path.read_bytes(), 1)) for path in files) < 60e6


def test_no_two_runs_of_a_track_share_a_sealed_scene():
    runs = [(s.track, s.seed) for folder in SEALED for s in read_run(folder).scenes]
    assert len(set(runs)) == len(runs)


def test_a_claim_is_decided_where_nine_refits_in_ten_agree():
    claims = claims_in(OWN / "tabletop")
    held = replace(claims["R14"], stability=0.89)
    assert claims["R14"].verdict == "holds"
    assert is_decided(claims["R14"])
    assert not is_decided(held)
    assert not is_decided(claims["R1"])  # undecided
    assert decided_words({"R14": claims["R14"]}).endswith("decided (100 %): 1 holds.")
    three = {"R14": claims["R14"], "R1": claims["R1"], "R2": claims["R2"]}  # R2 is not testable
    assert decided_words(three) == (
        "1 of 2 claims and questions that this run can test are decided (50 %): 1 holds. "
        "1 more cannot be tested on it."
    )


def test_a_claim_has_the_verdict_of_the_newest_run_that_can_test_it():
    found = newest_claims(OWN / name for name in ("multilight", "tabletop", "second/tabletop-sealed"))
    assert found["R1"].verdict == "reproduced"
    assert found["R4"] == claims_in(OWN / "tabletop")["R4"]  # the sealed run has no row for it
    assert found["R2"].verdict == "not testable here"  # in neither
    assert decided_words({"R1": found["R1"], "R2": found["R2"]}, "these runs") == (
        "1 of 1 claims and questions that these runs can test are decided (100 %): 1 reproduced. "
        "1 more cannot be tested on them."
    )

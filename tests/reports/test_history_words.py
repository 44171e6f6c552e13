# SPDX-License-Identifier: Apache-2.0
"""Changes of verdicts as they are told: from numbers, and as a list."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from graycard.records import CheckEntry, ClaimEntry, LedgerEntry, PaperEntry, VerdictHistory, read_history
from graycard.reports.history._explain import check_words, explain
from graycard.reports.history._keep import OWN
from graycard.reports.history._reasons import Edition, Reasons, load_reasons
from graycard.reports.history._table import edition_list, edition_rows
from written_blocks import told_and_wanted

PAGE = Path(__file__).parents[2] / "docs" / "results" / "history.md"

CHECK = CheckEntry(
    "psnr", "mine − theirs", "PSNR", "reproduced", 8, "dB", 2.0, (0.5, 3.0), paper=2.0, accepted=(1.0, 4.0)
)
WITHIN = replace(CHECK, accepted=(-0.5, 0.5))


def claim(verdict: str, *checks: CheckEntry, text: str = "") -> ClaimEntry:
    return ClaimEntry("M1", "Mine is better.", verdict, checks, text)


@pytest.mark.parametrize(
    ("check", "told"),
    [
        (CHECK, "0.5 to 3 dB lies above zero and meets the claimed size, 1 to 4 dB"),
        (replace(CHECK, estimate=0.8), "1 to 4 dB, though its middle, 0.8, does not"),
        (replace(CHECK, accepted=None, paper=None), "0.5 to 3 dB lies above zero"),
        (replace(WITHIN, interval=(-0.2, 0.1)), "−0.2 to 0.1 dB lies within the bounds, −0.5 to 0.5 dB"),
        (
            replace(CHECK, verdict="undecided", interval=(-1.0, 2.0)),
            "holds both zero and the claimed size",
        ),
        (replace(CHECK, verdict="undecided", interval=(-1.0, 0.9)), "−1 to 0.9 dB holds zero"),
        (replace(WITHIN, verdict="undecided", interval=(0.1, 0.9)), "crosses the bounds, −0.5 to 0.5 dB"),
        (
            replace(CHECK, verdict="smaller than claimed", interval=(0.2, 0.9)),
            "0.2 to 0.9 dB lies above zero, but below the claimed size, 1 to 4 dB",
        ),
        (
            replace(CHECK, verdict="smaller than claimed", interval=(-0.9, 0.4)),
            "−0.9 to 0.4 dB lies below the claimed size, 1 to 4 dB",
        ),
        (replace(CHECK, verdict="larger than claimed", interval=(5.0, 6.0)), "lies above the claimed size"),
        (replace(CHECK, verdict="no effect", interval=(-0.1, 0.1)), "lies within what counts as no effect"),
        (replace(CHECK, verdict="contradicted", interval=(-3.0, -1.0)), "−3 to −1 dB lies wholly below zero"),
        (replace(WITHIN, verdict="contradicted", interval=(1.0, 2.0)), "lies outside of the bounds"),
        (replace(CHECK, interval=None, scenes=0), "psnr: no scenes give no interval"),
        (replace(CHECK, interval=(-math.inf, math.inf), scenes=5), "psnr: 5 scenes give no interval"),
        (replace(CHECK, accepted=(1.0, math.inf)), "the claimed size, at least 1 dB"),
        (
            replace(CHECK, unit="×", neutral=1.0, interval=(1.2, 1.9), accepted=(1.5, 2.0)),
            "1.2 to 1.9× lies above 1 and meets the claimed size, 1.5 to 2×",
        ),
    ],
)
def test_an_interval_is_told_from_no_effect_and_the_claimed_size(check: CheckEntry, told: str):
    assert told in check_words(check)


def test_only_the_checks_that_made_the_verdict_are_told():
    other = replace(CHECK, id="ssim", verdict="undecided", interval=(-1.0, 2.0))
    told = explain(claim("not supported", CHECK, other), claim("undecided", CHECK, other))
    assert told.startswith("not supported → undecided: ssim: the interval −1 to 2 dB")
    assert "psnr" not in told


def test_what_decides_no_longer_is_told():
    other = replace(CHECK, id="flip", effect_of="theirs − mine")
    told = explain(claim("contradicted", CHECK, other), claim("reproduced", CHECK))
    assert told.startswith("contradicted → reproduced: no longer decided by flip; psnr: the interval")


@pytest.mark.parametrize(
    ("check", "told"),
    [
        (
            {"verdict": "does not hold", "interval": (-3.0, -1.0)},
            "psnr: the interval −3 to −1 dB lies wholly below zero",
        ),
        (
            {"verdict": "does not hold", "interval": (0.1, 0.3), "accepted": (1.0, 2.0)},
            "lies below what is asked, 1 to 2 dB",
        ),
        (
            {"verdict": "does not hold", "interval": (3.0, 4.0), "accepted": (-1.0, 1.0)},
            "lies outside of the bounds",
        ),
        (
            {"verdict": "does not hold", "interval": (-0.1, 0.1), "accepted": None},
            "lies within what counts as no effect",
        ),
        ({"verdict": "holds", "interval": (1.0, 3.0), "accepted": None}, "lies above zero"),
        ({"verdict": "open", "interval": (-1.0, 3.0), "accepted": None}, "holds zero"),
    ],
)
def test_own_questions_are_told_in_their_words(check: dict[str, Any], told: str):
    found = replace(CHECK, **check)
    after = replace(claim(found.verdict, found), asked_by="graycard")
    words = explain(claim("contradicted", replace(CHECK, **check | {"verdict": "contradicted"})), after)
    assert "graycard's own question, which no paper answers; " in words
    assert told in words


@pytest.mark.parametrize(
    ("before", "told"),
    [
        ("reproduced", "by the rule reproduced, but held back: mine has not converged."),
        (None, "mine has not converged."),
    ],
)
def test_what_holds_a_verdict_back_is_told(before: str | None, told: str):
    held = replace(claim("undecided", CHECK), suspended="mine has not converged.", before=before)
    assert explain(claim("direction only", CHECK), held) == f"direction only → undecided: {told}"


@pytest.mark.parametrize(
    ("after", "told"),
    [
        (claim("not testable here", text="needs real rooms."), "→ not testable here: needs real rooms."),
        (claim("inconsistent", CHECK), "→ inconsistent: tables have words of their own"),
    ],
)
def test_what_no_interval_decides_is_told(after: ClaimEntry, told: str):
    assert told in explain(claim("contradicted", *after.checks), after)


def test_verdicts_of_the_first_rules_are_not_told_from_these_numbers():
    assert explain(claim("contradicted", CHECK), claim("not supported", CHECK)) == ""


def test_the_list_of_editions_in_the_docs_is_made_from_the_data():
    history, reasons = read_history(OWN), load_reasons(OWN)
    told, wanted = told_and_wanted(PAGE, "editions", edition_list(history, reasons))
    assert told == wanted, "run `make docs`"


def test_every_verdict_that_an_edition_changed_has_a_reason_in_the_table():
    rows = edition_rows(read_history(OWN), load_reasons(OWN))
    assert rows
    assert all(row.why for row in rows if row.before != row.after)


def history_of(verdicts: dict[str, dict[str, tuple[str, str]]]) -> tuple[VerdictHistory, Reasons]:
    """Return suites whose claims were judged by two editions, one after the other."""
    entries = tuple(
        LedgerEntry(suite, 1, f"{suite}.json", f"2026-01-0{number + 1}", "ab", f"rules{number}", (paper,))
        for suite, claims in verdicts.items()
        for number in (0, 1)
        for paper in [PaperEntry("p", 1, "cd", tuple(told(c, words[number]) for c, words in claims.items()))]
    )
    editions = tuple(Edition(name, "", (), (f"rules{i}",)) for i, name in enumerate(("first", "second")))
    return VerdictHistory(entries), Reasons(editions)


def told(name: str, verdict: str) -> ClaimEntry:
    return ClaimEntry(name, "Mine is better.", verdict, (replace(CHECK, verdict=verdict),))


def test_new_words_for_the_same_finding_are_counted_apart_and_tables_once():
    table = {"T1": ("contradicted", "inconsistent")}
    run = {
        "A": ("not supported", "undecided"),
        "B": ("not checkable", "not testable here"),
        "C": ("reproduced", "reproduced"),
        "D": ("reproduced", "undecided"),
    }
    history, reasons = history_of({"dark": run | table, "": table})
    rows = edition_rows(history, reasons)
    assert [(row.suite, row.claim) for row in rows] == [*(("dark", claim) for claim in run), ("", "T1")]
    assert edition_list(history, reasons).splitlines()[0] == (
        "By the rules 'second', on the same fits as before, 2 of 5 verdicts tell another finding, 2 have a "
        "new word for the same one (not checkable → not testable here, contradicted → inconsistent), 1 "
        "stayed as before."
    )


def test_a_table_that_a_run_judges_otherwise_is_a_row_of_its_own():
    """Planted: as if a run had a say in it."""
    table = {"T1": ("contradicted", "inconsistent")}
    rows = edition_rows(*history_of({"dark": {"T1": ("contradicted", "undecided")}, "": table}))
    assert [(row.suite, row.found) for row in rows] == [("dark", "another finding"), ("", "renamed")]

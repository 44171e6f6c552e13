# SPDX-License-Identifier: Apache-2.0
"""The claims of papers in the report: verdicts, effects on their axes, and what is told beside them."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from graycard.io import sha256, write_json
from graycard.records import (
    CLAIMS,
    Budget,
    CheckResult,
    ClaimResult,
    Ledger,
    PaperResult,
    RowFit,
    RowMean,
)
from graycard.reports import write_report
from graycard.reports._claims import LEGEND, claims_section
from graycard.reports._effects import effect_plot
from opened import opened, parts_of
from runs_by_hand import run_of

CHECK = CheckResult(
    "psnr", "PSNR is <higher>", "Novel view PSNR", "dB", "mine − theirs", "the sign is certain",
    "reproduced", "as claimed: mine − theirs = 5 dB", True,
    scenes={"s0": 4.0, "s1": 6.0}, estimate=5.0, interval=(3.0, 7.0), p_rank=0.0312, paper=5.4,
    accepted=(2.7, 10.8), rows=(RowMean("mine", 35.0), RowMean("theirs", 30.0)),
    bound=RowMean("truth", math.inf), trivial=RowMean("gray", None, "not in this run"),
)  # fmt: skip
OPEN = replace(
    CHECK, id="gone", verdict="not testable here", reason="cannot be checked here: no row", decides=False,
    scenes={}, estimate=None, interval=None, p_rank=None, rows=(), bound=None, trivial=None,
)  # fmt: skip
CLAIM = ClaimResult(
    "S1", "It is <b>better</b>.", "Table 1", "reproduced", "as claimed", "all", (CHECK, OPEN),
    figures={"theirs": "30 dB"}, notes=("rooms are small",),
)  # fmt: skip


def ledger_of(*claims: ClaimResult, digest: str = "") -> Ledger:
    papers = (PaperResult("p", 2, "A paper", "ab", claims),)
    return Ledger("hand", 1, digest, 0.95, {"better": "what it asks for"}, {}, papers)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    write_json(tmp_path / "run.json", run_of({"mine": {"psnr": [1.0]}}))
    write_json(tmp_path / CLAIMS, ledger_of(CLAIM, digest=sha256(tmp_path / "run.json")))
    return tmp_path


def text_of(run: Path) -> str:
    return opened(write_report(run).read_text(encoding="utf-8"))


def test_a_claim_is_told_with_all_that_it_follows_from(run: Path) -> None:
    text = text_of(run)
    told = (
        "A paper", "1 claim: 1 reproduced", "It is &lt;b&gt;better&lt;/b&gt;.", "PSNR is &lt;higher&gt;",
        '<span class="verdict reproduced">reproduced</span>', "5.00 dB", "3.00 to 7.00", "p = 0.031, n = 2",
        "5.40 dB", "35.00", "upper bound truth", "∞", "trivial gray", "not in this run", "30 dB",
        "rooms are small", "told only; decides nothing", "cannot be checked here: no row", "Table 1",
        "what it asks for", 'href="#claims"', "Nothing is corrected for the\n    number of claims",
    )  # fmt: skip
    for words in told:
        assert words in text, words
    assert "of another state of this run" not in text
    assert (
        text.count('<svg class="effect"') == 2
    )  # at the claim and in its table; nothing was measured of the other


def test_verdicts_of_another_state_are_called_that(run: Path) -> None:
    write_json(run / CLAIMS, ledger_of(CLAIM, digest="other"))
    assert "These verdicts are of another state of this run" in text_of(run)


def test_a_run_without_verdicts_says_nothing_of_claims(run: Path) -> None:
    (run / CLAIMS).unlink()
    assert claims_section(run) is None
    assert 'id="claims"' not in text_of(run)


def test_a_ledger_that_is_broken_is_no_end_of_the_report(run: Path) -> None:
    (run / CLAIMS).write_text("{")
    assert "The verdicts cannot be read: expected JSON in" in text_of(run)


def place(value: float, low: float, high: float) -> float:
    return round(100 * (0.06 + 0.88 * (value - low) / (high - low)), 2)


def test_effects_stand_where_their_values_are() -> None:
    plot = effect_plot(CHECK)
    assert plot is not None
    ends = 0.0, 10.8  # from no effect to twice the paper's
    assert (plot.neutral, plot.estimate) == (place(0, *ends), place(5, *ends))
    assert plot.interval == (place(3, *ends), place(7, *ends))
    assert plot.scenes == (place(4, *ends), place(6, *ends))
    assert plot.paper == place(5.4, *ends)
    assert plot.accepted == (place(2.7, *ends), place(10.8, *ends))
    assert plot.ends == ("0.00", "10.80")


def test_a_ratio_of_nothing_has_no_place_on_the_axis() -> None:
    plot = effect_plot(
        replace(
            CHECK, unit="×", neutral=1.0, estimate=0.9, interval=(0.8, 1.0), scenes={"a": 0.85, "b": 0.95},
            paper=None, accepted=(0.0, 1.0),
        )
    )  # fmt: skip
    assert plot is not None
    assert plot.ends == ("0.80", "1.00")
    assert plot.accepted is not None
    assert plot.accepted[0] == 0.0


def test_an_open_end_reaches_to_the_border() -> None:
    half = effect_plot(replace(CHECK, accepted=(-math.inf, 6.0)))
    other = effect_plot(replace(CHECK, accepted=(6.0, math.inf)))
    assert half is not None
    assert other is not None
    assert half.accepted == (0.0, place(6, 0, 7))
    assert other.accepted == (place(6, 0, 7), 100.0)


def test_ratios_stand_on_a_logarithmic_axis() -> None:
    ratio = replace(
        CHECK,
        unit="×",
        neutral=1.0,
        estimate=4.0,
        interval=(2.0, 8.0),
        scenes={},
        paper=16.0,
        accepted=(0.0, 8.0),
    )
    plot = effect_plot(ratio)
    assert plot is not None
    assert plot.estimate == pytest.approx((plot.neutral + (plot.paper or 0)) / 2, abs=0.01)
    assert plot.accepted == (0.0, place(3, 0, 4))


def test_what_was_not_measured_has_no_plot() -> None:
    assert effect_plot(OPEN) is None


def test_arithmetic_has_no_interval_and_no_plot() -> None:
    assert effect_plot(replace(CHECK, interval=None)) is None


def test_an_interval_without_ends_reaches_to_the_borders() -> None:
    """Fewer than six scenes have no 95 % interval."""
    plot = effect_plot(replace(CHECK, interval=(-math.inf, math.inf)))
    assert plot is not None
    assert plot.interval == (0.0, 100.0)
    assert plot.ends == ("0.00", "10.80")


OWN = replace(CLAIM, id="S14", verdict="holds", asked_by="graycard")
TABLE = ClaimResult("RA1", "Means fit.", "Table 2", "inconsistent", "they do not", "arithmetic")


def test_words_of_verdicts_are_explained_beside_them(run: Path) -> None:
    text = text_of(run)
    for word, meaning in LEGEND.items():
        assert f'<span class="verdict {word.replace(" ", "-")}">{word}</span></dt><dd>{meaning}' in text


def test_own_questions_and_tables_have_sections_of_their_own(run: Path) -> None:
    write_json(run / CLAIMS, ledger_of(CLAIM, OWN, TABLE))
    section = claims_section(run)
    assert section is not None
    (paper,) = section.papers
    assert [(group.title, group.counted) for group in paper.groups] == [
        ("", "1 claim: 1 reproduced"),
        ("graycard's own questions", "1 question: 1 holds"),
        ("The paper's tables", "1 table: 1 inconsistent"),
    ]
    text = text_of(run)
    assert "No paper claims these, so none is contradicted by them." in text
    assert text.index('id="claim-S14"') > text.index("graycard's own questions".replace("'", "&#39;"))


def test_what_a_verdict_stands_on_is_beside_it(run: Path) -> None:
    budget = Budget(
        {"steps": "40,000", "priors": "Depth-Pro"},
        {"pixels": "112 x 112"},
        (RowFit("mine", 1000, 30.125, 29.5), RowFit("theirs", 2000, None, None)),
    )
    write_json(run / CLAIMS, ledger_of(replace(CLAIM, budget=budget)))
    text = text_of(run)
    told = (
        "<strong>steps</strong> here 1,000 to 2,000; in the paper 40,000.",
        "<strong>pixels</strong> here 112 x 112; in the paper not told.",
        "<strong>priors</strong> here not told; in the paper Depth-Pro.",
        "mine: training views 30.12 dB, held out 29.50 dB; theirs: training views –, held out –",
    )
    for words in told:
        assert words in text, words


def test_a_verdict_that_is_held_back_says_why_and_what_it_needs(run: Path) -> None:
    held = replace(
        CLAIM, verdict="undecided", before="reproduced", suspended="mine has not converged",
        needs="12 more scenes", stability=0.815,
        checks=(
            replace(
                CHECK, seed_sd=0.2, scene_sd=1.0, stability=0.815, at_budgets={"0.5": 1.0},
                at_sizes={"112 x 112 pixels, 20 views": 1.0, "256 x 256 pixels, 20 views": 0.25},
            ),
        ),
        turns="by estimates alone reproduced at 112, but smaller than claimed at 256",
    )  # fmt: skip
    write_json(run / CLAIMS, ledger_of(held))
    text = text_of(run)
    told = (
        "By the checks <em>reproduced</em>, but held back: mine has not converged.",
        "<strong>To decide it:</strong> 12 more scenes.",
        "82% of simulated refits agree with the checks.",
        "SD of scenes 1.00 dB, SD of fits 0.20 dB, stability 82%",
        "half the steps 1.00 dB",
        "112 x 112 pixels, 20 views: 1.00 dB, 256 x 256 pixels, 20 views: 0.25 dB",
        "<strong>With size:</strong> by estimates alone reproduced at 112, but smaller than claimed at 256.",
    )
    for words in told:
        assert words in text, words


def test_nobody_knows_what_refits_would_say_where_none_were_made(run: Path) -> None:
    assert "nobody fitted these rows twice" in text_of(run)


def test_a_ledger_of_the_first_rules_is_told_to_be_one(run: Path) -> None:
    write_json(run / CLAIMS, {"format": "graycard-claims", "format_version": 1, "papers": []})
    text = text_of(run)
    assert "The verdicts cannot be read: expected claims of format version 2" in text
    assert "Judge the run again" in text


def test_claims_of_two_files_with_one_id_are_both_reached(run: Path) -> None:
    ledger = ledger_of(CLAIM, digest=sha256(run / "run.json"))
    other = replace(ledger.papers[0], name="q", claims=(replace(CLAIM, sentence="It is worse."),))
    write_json(run / CLAIMS, replace(ledger, papers=(*ledger.papers, other)))
    page = write_report(run).read_text(encoding="utf-8")
    parts = parts_of(page)
    assert ["It is worse." in parts[name] for name in ("claim-S1", "claim-S1-2")] == [False, True]
    assert page.count('href="#claim-S1"') == page.count('href="#claim-S1-2"') == 1

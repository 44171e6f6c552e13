# SPDX-License-Identifier: Apache-2.0
"""docs/results/ against the published ledgers: every verdict, and every interval beside one."""

import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from graycard import RecordError
from graycard.io import from_builtins, read_json
from graycard.records import CheckResult, ClaimResult, Ledger
from graycard.reports.history._keep import OWN
from graycard.reports.history._reasons import load_reasons

RESULTS = Path(__file__).parents[2] / "docs" / "results"
RUNS = ("dark", "multilight", "tabletop", "robust", "matte")
TABLES = "tables"
HEADERS = {"| claim | verdict |": "paper", "| question | answer |": "graycard"}
IDS = re.compile(r"(?:[SGR]|GA|RA)\d+(?:, (?:[SGR]|GA|RA)\d+)*")
REASON = re.compile(r"^- \*\*([^*]+)\*\*: (.*?)(?=^\S|^\Z|\n\n)", re.MULTILINE | re.DOTALL)
TOLD = ("reproduced", "undecided", "not testable here", "holds", "open", "consistent", "inconsistent")
NUMBER = r"(?<![\w.-])-?\d+(?:\.\d+)?"
INTERVAL = re.compile(rf"\((?:({NUMBER})[^()]*?, )?({NUMBER}) to ({NUMBER})(?:; paper ({NUMBER}))?")
NO_INTERVAL = re.compile(rf"({NUMBER})(?: dB)? \(no interval")
NEEDS = {
    "more seeds would not mend": "no number of seeds is enough",
    "more than 400 scenes": "more than 400 scenes",
}
UNFINISHED = re.compile(r"(\d[\d.]*)\s+dB\s+worse,\s+on\s+(\d+)\s+of\s+(\d+)")


@dataclass(frozen=True)
class Row:
    """One line of a table of verdicts."""

    claim: str
    asked_by: str
    verdict: str
    why: str


@dataclass(frozen=True)
class Effect:
    """An effect with its interval, digit by digit as the page prints it."""

    estimate: str
    low: str
    high: str
    paper: str = ""

    def is_of(self, check: CheckResult) -> bool:
        """Return whether a check has these numbers, rounded as they are printed."""
        if check.estimate is None or check.interval is None:
            return False
        low, high = check.interval
        printed = (rounds(self.low, low), rounds(self.high, high), rounds(self.estimate, check.estimate))
        named = not self.paper or (check.paper is not None and rounds(self.paper, check.paper))
        return all(printed) and named


def effects_without_interval(claim: ClaimResult) -> list[float]:
    """Return the effects of the checks whose scenes are too few for an interval."""
    few = [check for check in claim.checks if check.interval == (-math.inf, math.inf)]
    return [check.estimate for check in few if check.estimate is not None]


def rounds(printed: str, value: float) -> bool:
    """Return whether a number can be printed so."""
    half = 0.5 * 10.0 ** -len(printed.partition(".")[2])
    return abs(float(printed) - value) <= half * (1 + 1e-9)


def page(name: str) -> str:
    """Return the text of one page of results."""
    return (RESULTS / f"{name}.md").read_text(encoding="utf-8")


def sections() -> dict[str, str]:
    """Return the page of each ledger, which names its folder or file."""
    found = {name: page(name) for name in (*RUNS, TABLES)}
    assert all(re.search(rf"`reports/published/{name}(?:/|\.json)`", text) for name, text in found.items())
    return found


def rows_of(section: str) -> Iterator[Row]:
    """Return the lines of its tables of verdicts, one for each claim that a line names, with its reason."""
    reasons = {ids: " ".join(why.split()) for ids, why in REASON.findall(section + "\n\n")}
    asked_by = ""
    for line in section.splitlines():
        if not line.startswith("|"):
            asked_by = ""
        elif line in HEADERS:
            asked_by = HEADERS[line]
        elif asked_by and not line.startswith("| ---"):
            first, verdict = (cell.strip() for cell in line.strip("|").split(" | "))
            ids = IDS.match(first)
            assert ids, f"expected claims, got {first!r}"
            yield from (Row(claim, asked_by, verdict, reasons[ids[0]]) for claim in ids[0].split(", "))


def effects_of(why: str) -> Iterator[Effect]:
    """Return each printed interval with its estimate: within the bracket, or the last number before it."""
    for found in INTERVAL.finditer(why):
        before = re.findall(NUMBER, why[: found.start()])
        estimate = found[1] or (before[-1] if before else "")
        yield Effect(estimate, found[2], found[3], found[4] or "")


def claims_of(name: str) -> dict[str, ClaimResult]:
    """Return the claims of a published ledger; those about papers' tables stand in theirs alone."""
    path = OWN / f"{name}.json" if name == TABLES else OWN / name / "claims.json"
    ledger = from_builtins(Ledger, read_json(path), RecordError, str(path))
    claims = [claim for paper in ledger.papers for claim in paper.claims]
    return {c.id: c for c in claims if (c.verdict in ("consistent", "inconsistent")) == (name == TABLES)}


def word_of(claim: ClaimResult) -> str:
    """Return a verdict as a table has it."""
    return f"{claim.verdict} (by the checks: {claim.before})" if claim.before else claim.verdict


SECTIONS = sections()
LEDGERS = {name: claims_of(name) for name in (*RUNS, TABLES)}
ROWS = {name: list(rows_of(section)) for name, section in SECTIONS.items()}


def test_every_published_ledger_has_a_section():
    published = {path.parent.name for path in OWN.glob("*/claims.json")} | {TABLES}
    assert set(LEDGERS) == published
    assert set(SECTIONS) == published


@pytest.mark.parametrize("name", LEDGERS)
def test_each_claim_has_the_verdict_of_its_ledger_once(name: str):
    told = [(row.claim, row.verdict, row.asked_by) for row in ROWS[name]]
    assert sorted(told) == sorted((c.id, word_of(c), c.asked_by) for c in LEDGERS[name].values())


@pytest.mark.parametrize("name", LEDGERS)
def test_each_interval_beside_a_verdict_is_that_of_a_check(name: str):
    for row in ROWS[name]:
        checks = LEDGERS[name][row.claim].checks
        for effect in effects_of(row.why):
            assert any(effect.is_of(check) for check in checks), f"{row.claim}: no check has {effect}"


@pytest.mark.parametrize("name", LEDGERS)
def test_each_effect_without_interval_is_that_of_a_check_with_too_few_scenes(name: str):
    for row in ROWS[name]:
        few = effects_without_interval(LEDGERS[name][row.claim])
        for printed in NO_INTERVAL.findall(row.why):
            assert any(rounds(printed, effect) for effect in few), f"{row.claim}: no check has {printed}"


@pytest.mark.parametrize("name", LEDGERS)
def test_each_share_of_refits_and_each_need_is_that_of_the_ledger(name: str):
    for row in ROWS[name]:
        claim = LEDGERS[name][row.claim]
        for share in re.findall(r"(\d+) % of refits", row.why):
            assert rounds(share, 100 * (claim.stability or 0)), row.claim
        for need in re.findall(r"about (\d+ (?:scenes|seeds a scene))", row.why, re.IGNORECASE):
            assert f"about {need}" in claim.needs, row.claim
        for said, needed in NEEDS.items():
            assert said not in row.why.lower() or needed in claim.needs, row.claim


@pytest.mark.parametrize("name", RUNS)
def test_what_has_not_converged_is_told_as_in_the_ledger(name: str):
    held = " ".join(claim.suspended for claim in LEDGERS[name].values())
    told = UNFINISHED.findall(SECTIONS[name])
    assert set(told) <= set(UNFINISHED.findall(held))
    assert bool(told) == bool(UNFINISHED.search(held)), "expected the section to say what has not converged"


def test_the_summary_counts_the_verdicts():
    order = ("tabletop", "dark", "multilight", "robust", "matte", TABLES)  # first what others judge anew
    judged = {claim.id: claim for name in order for claim in LEDGERS[name].values()}
    count = Counter(claim.verdict for claim in judged.values())
    tables = len(LEDGERS[TABLES])
    own = sum(claim.asked_by == "graycard" for claim in judged.values())
    assert count.total() == sum(count[word] for word in TOLD)
    reproduced = f"{count['reproduced'] or 'none'} is reproduced"
    assert (
        f"Of the papers' {len(judged) - own - tables} claims {reproduced}, "
        f"{count['undecided']} are undecided and {count['not testable here']} are not testable here; none "
        f"is contradicted. Of {own} own questions {count['holds']} holds and {count['open']} are open. Of "
        f"{tables} tables {count['consistent']} is consistent and {count['inconsistent']} are inconsistent."
    ) in " ".join(page("index").split())


def test_words_of_earlier_rules_stand_only_where_earlier_rules_are_told():
    editions = load_reasons(OWN).editions
    gone = {word for edition in editions[:-1] for word in edition.words} - set(editions[-1].words)
    assert gone == {"not supported", "direction only", "not checkable"}
    pages = "\n\n".join((*SECTIONS.values(), page("index").replace("none is contradicted", "")))
    for paragraph in pages.split("\n\n"):
        text = " ".join(paragraph.split())
        if "earlier rules" not in text:
            old = [word for word in (*sorted(gone), "contradicted") if word in text]
            assert not old, f"expected {old} only beside earlier rules, got {text[:200]}"


@pytest.mark.parametrize(
    ("why", "found"),
    [
        ("2.2 dB over it (1.2 to 3.1; paper 5.4)", [Effect("2.2", "1.2", "3.1", "5.4")]),
        ("open (-0.3, -0.7 to 0.1; views lose 1.3)", [Effect("-0.3", "-0.7", "0.1")]),
        ("(0.2°, -0.0 to 0.4), 1 more (0 to 2)", [Effect("0.2", "-0.0", "0.4"), Effect("1", "0", "2")]),
        ("4.2 dB over `r3dg` (2.3 to 5.8)", [Effect("4.2", "2.3", "5.8")]),
        ("0.13 (11) to 0.96 (14)", []),
    ],
)  # fmt: skip
def test_effects_are_read_from_prose(why: str, found: list[Effect]):
    assert list(effects_of(why)) == found


@pytest.mark.parametrize(
    ("why", "found"),
    [
        ("it changes by -1.3 dB (no interval) from 5 to 40 cm", ["-1.3"]),
        ("2.2 (no interval: one scene), 0.4 dB (0 to 1)", ["2.2"]),
        ("0.3 dB (-0.2 to 0.7)", []),
    ],
)
def test_effects_without_interval_are_read_from_prose(why: str, found: list[str]):
    assert NO_INTERVAL.findall(why) == found


@pytest.mark.parametrize(
    "effect",
    [
        Effect("2.2", "1.2", "3.2", "5.4"),
        Effect("2.2", "1.1", "3.1", "5.4"),
        Effect("2.3", "1.2", "3.1", "5.4"),
        Effect("2.2", "1.2", "3.1", "5.5"),
    ],
)
def test_a_wrong_digit_is_seen(effect: Effect):
    claim = LEDGERS["dark"]["S1"]
    right = Effect("2.2", "1.2", "3.1", "5.4")
    assert any(right.is_of(check) for check in claim.checks)
    assert not any(effect.is_of(check) for check in claim.checks)


def test_a_wrong_verdict_a_missing_and_a_doubled_claim_are_seen():
    section = SECTIONS["robust"]
    told = Counter((row.claim, row.verdict) for row in rows_of(section))
    for planted in (
        section.replace("| not testable here |", "| undecided |"),
        "\n".join(line for line in section.splitlines() if not line.startswith("| R12 ")),
        section.replace("| R12 three", "| R12, R11 three").replace("- **R12**", "- **R12, R11**"),
    ):
        assert Counter((row.claim, row.verdict) for row in rows_of(planted)) != told

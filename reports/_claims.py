# SPDX-License-Identifier: Apache-2.0
"""The claims of papers as the report shows them: verdicts in words, and each effect on an axis."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, get_args

from graycard import GraycardError
from graycard.io import sha256
from graycard.records import (
    RUN_FILE,
    CheckResult,
    ClaimResult,
    ClaimVerdict,
    Ledger,
    PaperResult,
    RowMean,
    read_ledger,
)
from graycard.reports._budgets import BudgetTable, budget_table
from graycard.reports._effects import EffectPlot, effect_plot
from graycard.reports._format import count, format_number, format_p, format_value, format_with_unit

LEGEND: Final[Mapping[str, str]] = {
    "reproduced": "the sign is certain, and the size is compatible with the claimed one",
    "larger than claimed": "the sign is certain, and the claimed size is exceeded for certain",
    "smaller than claimed": "the claimed size is out of reach for certain, whether or not the sign is; "
    "or no more is left than what counts as none",
    "no effect": "the whole interval is so near to none that the difference counts as none",
    "contradicted": "the opposite is certain: the other sign, or a difference where none was claimed",
    "undecided": "the interval leaves it open, a fit has not converged, or another fit or budget may turn it",
    "not testable here": "what the claim needs is not in these scenes or rows",
}
"""Verdicts on claims of papers, and what they mean."""

TABLE_WORDS: Final = ("consistent", "inconsistent")
"""Verdicts on the figures of a paper's table held against each other."""


@dataclass(frozen=True, slots=True)
class CheckRow:
    """One comparison that a claim comes down to."""

    check: CheckResult
    plot: EffectPlot | None
    estimate: str
    interval: str
    evidence: str
    """Chance of such ranks, number of scenes, scatter of scenes and fits, stability."""
    paper: str
    at_budgets: str
    """The estimate at other numbers of steps; empty where nobody measured it."""
    at_sizes: str
    """The estimate at each size of pictures, views and surfels; empty where nobody measured it."""
    rows: tuple[tuple[str, str], ...]
    """Label and mean of each compared row."""
    limits: tuple[tuple[str, str], ...]
    """The same of the upper bound and of what is trivial."""


@dataclass(frozen=True, slots=True)
class ClaimRow:
    """One claim with its comparisons."""

    claim: ClaimResult
    stability: str
    """Share of refits with this verdict, in words."""
    budget: BudgetTable | None
    checks: tuple[CheckRow, ...]
    anchor: str = ""
    """Place in the page."""


@dataclass(frozen=True, slots=True)
class ClaimGroup:
    """Claims of one paper that are judged in the same words."""

    title: str
    about: str
    """Sentence below the title; empty for claims of the paper itself."""
    counted: str
    """Counts: how many claims came to which verdict."""
    claims: tuple[ClaimRow, ...]


@dataclass(frozen=True, slots=True)
class PaperRows:
    """The claims of one paper."""

    title: str
    version: int
    groups: tuple[ClaimGroup, ...]


@dataclass(frozen=True, slots=True)
class ClaimsSection:
    """Statements of a run about papers."""

    papers: tuple[PaperRows, ...]
    rules: Mapping[str, str]
    stale: bool
    """True if ``run.json`` has changed since."""
    legend: Mapping[str, str]
    """Verdicts on claims of papers, and what they mean."""
    level: str = ""
    """Level of the intervals, in words."""
    fault: str = ""
    """Why the ledger cannot be read; empty where it can."""


def claims_section(run: Path) -> ClaimsSection | None:
    """Return the section of a run; None where its claims were not judged."""
    try:
        ledger = read_ledger(run)
    except GraycardError as cause:
        return ClaimsSection((), {}, stale=False, legend=LEGEND, fault=str(cause))
    if ledger is None:
        return None
    return section_of(ledger, run)


def section_of(ledger: Ledger, run: Path) -> ClaimsSection:
    """Return the section of a ledger, whose run lies in a folder."""
    stale = ledger.run_sha256 != sha256(run / RUN_FILE)
    level = f"{100 * ledger.level:.4g} %"
    papers = tuple(_anchored(map(_paper, ledger.papers)))
    return ClaimsSection(papers, ledger.rules, stale, LEGEND, level)


def _anchored(papers: Iterable[PaperRows]) -> Iterator[PaperRows]:
    """Yield papers whose claims have places of their own in the page: two files may use one id."""
    times: Counter[str] = Counter()

    def place(row: ClaimRow) -> ClaimRow:
        times[row.claim.id] += 1
        number = times[row.claim.id]
        return replace(row, anchor=f"claim-{row.claim.id}" + (f"-{number}" if number > 1 else ""))

    for paper in papers:
        groups = (replace(group, claims=tuple(map(place, group.claims))) for group in paper.groups)
        yield replace(paper, groups=tuple(groups))


def _paper(paper: PaperResult) -> PaperRows:
    tables = [claim for claim in paper.claims if claim.verdict in TABLE_WORDS]
    own = [claim for claim in paper.claims if claim.asked_by == "graycard"]
    claims = [claim for claim in paper.claims if claim not in tables and claim not in own]
    groups = (
        _group("", "", "claim", claims),
        _group(
            "graycard's own questions",
            "No paper claims these, so none is contradicted by them.",
            "question",
            own,
        ),
        _group(
            "The paper's tables",
            "Printed figures held against each other; no run is needed.",
            "table",
            tables,
        ),
    )
    return PaperRows(paper.title, paper.version, tuple(group for group in groups if group.claims))


def _group(title: str, about: str, noun: str, claims: Sequence[ClaimResult]) -> ClaimGroup:
    counted = Counter(claim.verdict for claim in claims)
    words = [f"{counted[v]} {v}" for v in get_args(ClaimVerdict) if counted[v]]
    told = f"{count(len(claims), noun)}: {', '.join(words)}"
    return ClaimGroup(title, about, told, tuple(map(_claim, claims)))


def _claim(claim: ClaimResult) -> ClaimRow:
    stability = ""
    if claim.stability is not None:
        stability = f"{claim.stability:.0%} of simulated refits agree with the checks"
    elif claim.verdict != "not testable here" and any(map(_has_interval, claim.checks)):
        stability = "How refits would judge it is not known: nobody fitted these rows twice"
    return ClaimRow(claim, stability, budget_table(claim.budget), tuple(map(_check, claim.checks)))


def _has_interval(check: CheckResult) -> bool:
    return check.interval is not None and any(map(math.isfinite, check.interval))


def _check(check: CheckResult) -> CheckRow:
    interval = check.interval
    return CheckRow(
        check,
        effect_plot(check),
        "" if check.estimate is None else format_with_unit(check.estimate, check.unit),
        "" if interval is None else " to ".join(format_value(end, check.unit) for end in interval),
        ", ".join(_evidence(check)),
        "" if check.paper is None else format_with_unit(check.paper, check.unit),
        _at_budgets(check),
        ", ".join(f"{size}: {format_with_unit(value, check.unit)}" for size, value in check.at_sizes.items()),
        tuple((row.row, _mean(row, check)) for row in check.rows),
        _limits(check),
    )


def _evidence(check: CheckResult) -> list[str]:
    """Return what an interval comes from, in pieces."""
    found = [format_p(check.p_rank)] if check.p_rank is not None else []
    found += [f"n = {len(check.scenes)}"] if check.scenes else []
    found += [f"SD of scenes {_spread(check.scene_sd, check)}"] if check.scene_sd is not None else []
    found += [f"SD of fits {_spread(check.seed_sd, check)}"] if check.seed_sd is not None else []
    return found + ([f"stability {check.stability:.0%}"] if check.stability is not None else [])


def _spread(deviation: float, check: CheckResult) -> str:
    """Return a standard deviation with its unit; that of logarithms has none."""
    return format_number(deviation) if check.unit == "×" else format_with_unit(deviation, check.unit)


def _at_budgets(check: CheckResult) -> str:
    """Return the estimate at other budgets, as in ``half the steps 1.20 dB``."""
    named = {"0.5": "half the steps", "2": "twice the steps", "2.0": "twice the steps"}
    found = (
        f"{named.get(factor, f'{factor} × the steps')} {format_with_unit(value, check.unit)}"
        for factor, value in check.at_budgets.items()
    )
    return ", ".join(found)


def _limits(check: CheckResult) -> tuple[tuple[str, str], ...]:
    beside = (("upper bound", check.bound), ("trivial", check.trivial))
    return tuple((f"{what} {row.row}", _mean(row, check)) for what, row in beside if row is not None)


def _mean(row: RowMean, check: CheckResult) -> str:
    return ", ".join(filter(None, (_mean_alone(row.value, check), row.reason)))


def _mean_alone(value: float | None, check: CheckResult) -> str:
    if value is None:
        return ""
    if check.unit == "×":  # of which the rows themselves have another unit
        return f"{value:.0f}" if abs(value) >= 100 else format_number(value)
    return format_value(value, check.unit)

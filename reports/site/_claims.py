# SPDX-License-Identifier: Apache-2.0
"""The claims of all papers over all published runs, each once, with every verdict that it ever had."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import get_args

from graycard.records import ClaimResult, ClaimVerdict, Ledger, PaperResult
from graycard.reports._budgets import BudgetTable, budget_table
from graycard.reports._format import count, format_value, format_with_unit
from graycard.reports.history._changes import TABLES
from graycard.reports.history._page import suite_histories
from graycard.reports.site._sources import Kept, Published

NOT_TESTED = "not testable here"


@dataclass(frozen=True, slots=True)
class Effect:
    """One comparison that decides, in words."""

    says: str
    estimate: str
    interval: str
    paper: str
    scenes: int
    verdict: str


@dataclass(frozen=True, slots=True)
class Judgement:
    """Statement of one published run on a claim."""

    run: str
    """Name of the published folder; empty for papers' own tables."""
    suite: str
    verdict: str
    before: str
    """Verdict of the checks alone, where it is held back."""
    suspended: str
    text: str
    needs: str
    stability: str
    size: str
    """Pixels and steps, in words; empty where nothing is told."""
    budget: tuple[tuple[str, str, str], ...]
    """Name of what is counted, in the paper, and here."""
    effects: tuple[Effect, ...]
    link: str
    """Place in the full report, relative to the site; empty without one."""


@dataclass(frozen=True, slots=True)
class PastVerdict:
    """A verdict of one ledger, or of several in a row that say the same."""

    suite: str
    entry: str
    date: str
    edition: str
    facts: tuple[str, ...]
    verdict: str
    mark: str
    causes: str
    why: str


@dataclass(slots=True)
class SiteClaim:
    """A claim."""

    anchor: str
    id: str
    sentence: str
    source: str = ""
    asked_by: str = "paper"
    judgements: list[Judgement] = field(default_factory=list)
    past: list[PastVerdict] = field(default_factory=list)

    @property
    def shown(self) -> list[Judgement]:
        """Return the judgements of an overview: of runs that can test it, or one where none can."""
        told = [judgement for judgement in self.judgements if judgement.verdict != NOT_TESTED]
        return told or self.judgements[:1]

    @property
    def turned(self) -> int:
        """Return how often its verdict changed."""
        return sum(past.mark == "changed" for past in self.past)


@dataclass(slots=True)
class SitePaper:
    """A paper with all of its claims."""

    anchor: str
    title: str
    claims: list[SiteClaim] = field(default_factory=list)

    @property
    def counted(self) -> str:
        """Return how many claims have which verdict; one of several runs counts by the first shown."""
        found = Counter(claim.shown[0].verdict for claim in self.claims if claim.shown)
        words = ", ".join(f"{found[word]} {word}" for word in get_args(ClaimVerdict) if found[word])
        return f"{count(len(self.claims), 'claim')}: {words}" if words else count(len(self.claims), "claim")


def site_papers(
    runs: Sequence[Published], tables: Sequence[Ledger], kept: Sequence[Kept]
) -> tuple[SitePaper, ...]:
    """Return all papers with their claims, in the order in which runs and histories have them."""
    shelf = _Shelf()
    ledgers = [(run, run.ledger) for run in runs if run.ledger] + [(None, ledger) for ledger in tables]
    for title in sorted({paper.title for _, ledger in ledgers for paper in ledger.papers}, key=len):
        shelf.open(title)
    for run, ledger in ledgers:
        for paper in ledger.papers:
            for claim in paper.claims:
                shelf.claim(paper, claim).judgements.append(_judgement(run, ledger, claim))
    for one in kept:
        shelf.add_past(one)
    return shelf.papers()


class _Shelf:
    """Papers and claims as they are found; each claim of a paper once, by its id."""

    def __init__(self) -> None:
        self._papers: dict[str, SitePaper] = {}
        self._names: dict[str, str] = {}
        self._claims: dict[tuple[str, str], SiteClaim] = {}
        self._anchors: set[str] = set()

    def open(self, title: str) -> SitePaper:
        """Return the paper of a title; ``Title, more words`` is the paper ``Title`` where there is that."""
        whole = next(
            (known for known in self._papers if title == known or title.startswith(f"{known}, ")), title
        )
        if whole not in self._papers:
            self._papers[whole] = SitePaper(self._anchor(f"paper-{whole.partition(' (')[0]}"), whole)
        return self._papers[whole]

    def claim(self, paper: PaperResult, claim: ClaimResult) -> SiteClaim:
        """Return a claim of a paper, with its words if they are new."""
        self._names[paper.name] = paper.title
        found = self._find(paper.title, claim.id, claim.sentence)
        found.source, found.asked_by = found.source or claim.source, claim.asked_by
        return found

    def add_past(self, kept: Kept) -> None:
        """Add what a history tells of each claim."""
        papers = {
            (entry.suite, claim.id): paper.name
            for entry in kept.history.entries
            for paper in entry.papers
            for claim in paper.claims
        }
        for suite in suite_histories(kept.history, kept.reasons):
            name = "" if suite.title == TABLES else suite.title
            for row in suite.rows:
                paper = papers[name, row.claim]
                claim = self._find(self._names.get(paper, paper), row.claim, row.sentence)
                claim.past += [
                    PastVerdict(
                        suite.title, column.title, column.date, column.edition, column.facts, cell.verdict,
                        cell.mark, cell.causes, cell.why,
                    )
                    for column, cell in zip(suite.columns, row.cells, strict=True)
                    if cell.verdict
                ]  # fmt: skip

    def papers(self) -> tuple[SitePaper, ...]:
        """Return the papers that have claims, claims by number."""
        for paper in self._papers.values():
            paper.claims.sort(key=lambda claim: _natural(claim.id))
        return tuple(sorted((p for p in self._papers.values() if p.claims), key=lambda p: p.title))

    def _find(self, title: str, claim: str, sentence: str) -> SiteClaim:
        paper = self.open(title)
        key = paper.title, claim
        if key not in self._claims:
            self._claims[key] = SiteClaim(self._anchor(claim), claim, sentence)
            paper.claims.append(self._claims[key])
        return self._claims[key]

    def _anchor(self, text: str) -> str:
        """Return a name that no other part of the page has: the text itself where that can be."""
        plain = re.sub(r"[^A-Za-z0-9._-]+", "-", text).strip("-") or "claim"
        tries = (plain if number == 1 else f"{plain}-{number}" for number in range(1, 10_000))
        found = next(name for name in tries if name not in self._anchors)
        self._anchors.add(found)
        return found


def _natural(text: str) -> list[tuple[int, int | str]]:
    """Return a key by which S2 comes before S10."""
    return [(0, int(part)) if part.isdecimal() else (1, part) for part in re.split(r"(\d+)", text) if part]


def _judgement(run: Published | None, ledger: Ledger, claim: ClaimResult) -> Judgement:
    table = budget_table(claim.budget)
    anchor = f"claim-{claim.id}"
    linked = run is not None and anchor in run.anchors
    return Judgement(
        run=run.name if run else "",
        suite=ledger.suite or TABLES,
        verdict=claim.verdict,
        before=claim.before or "",
        suspended=claim.suspended,
        text=claim.text,
        needs=claim.needs,
        stability="" if claim.stability is None else f"{claim.stability:.0%}",
        size=_size(table),
        budget=table.lines if table else (),
        effects=tuple(_effects(claim)),
        link=f"runs/{run.name}/index.html#{anchor}" if run and linked else "",
    )


def _size(table: BudgetTable | None) -> str:
    """Return the pixels and steps here, in words."""
    here = {name: ours for name, _, ours in table.lines} if table else {}
    known = [
        f"{here[name]} {name}" for name in ("pixels", "steps") if here.get(name, "not told") != "not told"
    ]
    return ", ".join(known)


def _effects(claim: ClaimResult) -> Iterator[Effect]:
    for check in claim.checks:
        if check.decides and check.estimate is not None:
            yield Effect(
                check.says,
                format_with_unit(check.estimate, check.unit),
                "" if check.interval is None else " to ".join(_numbers(check.interval, check.unit)),
                "" if check.paper is None else format_with_unit(check.paper, check.unit),
                len(check.scenes),
                check.verdict,
            )


def _numbers(values: Iterable[float], unit: str) -> Iterator[str]:
    return (format_value(value, unit) for value in values)

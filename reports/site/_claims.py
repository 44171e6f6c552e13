# SPDX-License-Identifier: Apache-2.0
"""The claims of all papers over all published runs, each once, with every verdict that it ever had."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import get_args

from graycard.records import Asker, ClaimResult, ClaimVerdict, Ledger, PaperResult, read_run
from graycard.reports._budgets import BudgetTable, budget_table
from graycard.reports._claims import TABLE_WORDS
from graycard.reports._format import count, format_value, format_with_unit
from graycard.reports.history._changes import TABLES
from graycard.reports.history._explain import NOT_TESTED
from graycard.reports.history._page import Row, SuiteHistory, suite_histories
from graycard.reports.site._anchors import Anchors
from graycard.reports.site._sources import Kept, Published


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
    anchor: str
    """Place of the run in the page of leaderboards; empty as ``run``."""
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


@dataclass(frozen=True, slots=True)
class SiteClaim:
    """A claim."""

    anchor: str
    id: str
    sentence: str
    source: str = ""
    asked_by: Asker = "paper"
    judgements: tuple[Judgement, ...] = ()
    past: tuple[PastVerdict, ...] = ()

    @property
    def shown(self) -> tuple[Judgement, ...]:
        """Return the judgements of an overview: of runs that can test it, or one where none can."""
        told = tuple(judgement for judgement in self.judgements if judgement.verdict != NOT_TESTED)
        return told or self.judgements[:1]

    @property
    def turned(self) -> int:
        """Return how often its verdict changed."""
        return sum(past.mark == "changed" for past in self.past)


def _counted(noun: str, claims: Sequence[SiteClaim]) -> str:
    """Return a number of claims of one kind, and of them how many have which verdict."""
    head = count(len(claims), noun)
    found = Counter(claim.shown[0].verdict for claim in claims if claim.shown)
    words = ", ".join(f"{found[word]} {word}" for word in get_args(ClaimVerdict) if found[word])
    return f"{head}: {words}" if words else head


@dataclass(frozen=True, slots=True)
class SitePaper:
    """A paper with all of its claims."""

    anchor: str
    title: str
    claims: tuple[SiteClaim, ...]

    @property
    def counted(self) -> str:
        """Return how many claims, own questions and tables have which verdict.

        One of several runs counts by the first shown.
        """
        kinds: dict[str, list[SiteClaim]] = {"claim": [], "own question": [], "table": []}
        for claim in self.claims:
            asked = "own question" if claim.asked_by == "graycard" else "claim"
            kinds["table" if claim.shown and claim.shown[0].verdict in TABLE_WORDS else asked].append(claim)
        return "; ".join(_counted(noun, found) for noun, found in kinds.items() if found)


def site_papers(
    runs: Sequence[Published], tables: Sequence[Ledger], kept: Sequence[Kept]
) -> tuple[SitePaper, ...]:
    """Return all papers with their claims, in the order in which runs and histories have them.

    Of several runs that judge a claim those on sealed scenes come first, the newest of them before others.
    """
    judged = [(run, ledger) for run in _in_order(runs) if (ledger := run.ledger)]
    ledgers = [*judged, *((None, ledger) for ledger in tables)]
    shelf = _Shelf(sorted({paper.title for _, ledger in ledgers for paper in ledger.papers}, key=len))
    for run, ledger in ledgers:
        for paper in ledger.papers:
            for claim in paper.claims:
                shelf.add(paper, claim, _judgement(run, ledger, claim))
    for one in kept:
        shelf.add_past(one)
    return shelf.papers()


def _in_order(runs: Iterable[Published]) -> list[Published]:
    """Return runs on sealed scenes, of which the newest comes first, and then the others as they came."""
    sealed, others = [], []
    for run in runs:
        (sealed if run.ledger and run.ledger.edition else others).append(run)
    return [*sorted(sealed, key=lambda run: read_run(run.folder).started, reverse=True), *others]


class _Shelf:
    """Papers and claims as they are found; each claim of a paper once, by its id.

    Args:
        titles: All titles of papers, the shortest first: ``Title, more words`` is the paper ``Title``.
    """

    def __init__(self, titles: Iterable[str]) -> None:
        self._anchors = Anchors()
        self._papers: dict[str, str] = {}
        self._names: dict[str, str] = {}
        self._claims: dict[tuple[str, str], SiteClaim] = {}
        for title in titles:
            self._open(title)

    def add(self, paper: PaperResult, claim: ClaimResult, judgement: Judgement) -> None:
        """Add what one run says of a claim."""
        self._names[paper.name] = paper.title
        key, found = self._find(paper.title, claim.id, claim.sentence)
        self._claims[key] = replace(
            found,
            source=found.source or claim.source,
            asked_by=claim.asked_by,
            judgements=(*found.judgements, judgement),
        )

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
                key, found = self._find(self._names.get(paper, paper), row.claim, row.sentence)
                self._claims[key] = replace(found, past=(*found.past, *_past(suite, row)))

    def papers(self) -> tuple[SitePaper, ...]:
        """Return the papers that have claims, by title, and their claims by number."""
        found: dict[str, list[SiteClaim]] = {}
        for (title, _), claim in self._claims.items():
            found.setdefault(title, []).append(claim)
        return tuple(
            SitePaper(self._papers[title], title, tuple(sorted(found[title], key=lambda c: _natural(c.id))))
            for title in sorted(found)
        )

    def _find(self, title: str, claim: str, sentence: str) -> tuple[tuple[str, str], SiteClaim]:
        key = self._open(title), claim
        if key not in self._claims:
            self._claims[key] = SiteClaim(self._anchors.take(claim), claim, sentence)
        return key, self._claims[key]

    def _open(self, title: str) -> str:
        """Return the title of the paper that a title is of."""
        alike = (known for known in self._papers if title == known or title.startswith(f"{known}, "))
        whole = next(alike, title)
        if whole not in self._papers:
            self._papers[whole] = self._anchors.take(f"paper-{whole.partition(' (')[0]}")
        return whole


def _past(suite: SuiteHistory, row: Row) -> Iterator[PastVerdict]:
    """Yield each verdict that a claim had in one suite."""
    for column, cell in zip(suite.columns, row.cells, strict=True):
        if cell.verdict:
            yield PastVerdict(
                suite.title,
                column.title,
                column.date,
                column.edition,
                column.facts,
                cell.verdict,
                cell.mark,
                cell.causes,
                cell.why,
            )


def _natural(text: str) -> list[tuple[int, int | str]]:
    """Return a key by which S2 comes before S10."""
    return [(0, int(part)) if part.isdecimal() else (1, part) for part in re.split(r"(\d+)", text) if part]


def _judgement(run: Published | None, ledger: Ledger, claim: ClaimResult) -> Judgement:
    table = budget_table(claim.budget)
    anchor = f"claim-{claim.id}"
    linked = run is not None and anchor in run.anchors
    return Judgement(
        run=run.name if run else "",
        anchor=run.anchor if run else "",
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

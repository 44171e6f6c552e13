# SPDX-License-Identifier: Apache-2.0
"""The verb that holds a run against the claims of papers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, get_args

import tyro
from rich.table import Table

from graycard._errors import GraycardError
from graycard.cli._history import show_history
from graycard.cli._options import Json, optional
from graycard.cli._power import power_table
from graycard.cli._terminal import OK, Terminal, new_table, write_optional_json
from graycard.io import write_json
from graycard.records import (
    CLAIMS,
    ClaimResult,
    ClaimVerdict,
    Ledger,
    PaperResult,
    RowMean,
    RunRecord,
    is_published,
    read_run,
)


@dataclass(frozen=True)
class ClaimsCommand:
    """Say which claims of papers a run bears out, and write them into it and its report."""

    run_folder: Annotated[Path | None, tyro.conf.Positional, optional("[RUN]")] = None
    """The run folder; its claims.json is written anew from run.json, unless it is a published one.
    Without a run, only papers' own tables are held against themselves."""
    claims: Annotated[tuple[str, ...], optional("NAME ...")] = ()
    """Judge these only: names, or paths that end in .toml. Those made for the run's suite by default.
    Claims for the runs of another suite are refused."""
    any_suite: bool = False
    """Also judge claims that are made for the runs of another suite.
    All that come along, where --claims names none and none are made for this suite."""
    checks: bool = False
    """Also show every comparison that a claim comes down to."""
    half: Annotated[Path | None, optional("RUN")] = None
    """The same scenes at half the budget, by `graycard bench SUITE --budget 0.5`.
    A verdict that turns between the budgets is undecided."""
    twice: Annotated[Path | None, optional("RUN")] = None
    """The same scenes at twice the budget, by `graycard bench SUITE --budget 2`."""
    sizes: Annotated[tuple[Path, ...], optional("RUN ...")] = ()
    """Runs of one suite that differ in size alone, by `graycard bench SUITE --pixels 256`, `--views` or
    `--surfels`. Checks are told at each size, and a verdict that the estimates alone would turn is named."""
    power: bool = False
    """Also say how many scenes or seeds each undecided claim needs, and what they cost here."""
    history: bool = False
    """Judge nothing: show every verdict that changed, and why; RUN is then a folder with history.json.
    Of a published run the folder above is read, for its suite. Without RUN, graycard's own."""
    republish: bool = False
    """Also write the verdicts into a published folder, its page and the history above it.
    The page follows today's rules, tables and all; its pictures stay.
    Without a run: into the file of --json, and the history beside that."""
    json: Json = None
    """Also write the ledger to this file; what undecided claims need with --power, the changes with
    --history."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Judge the claims; a contradicted claim is a finding, no failure.

        Raises:
            GraycardError: ``--republish`` has nothing to write to, or ``--history`` has an option that judges
                beside it.
        """
        if self.history:
            self._refuse_with_history()
            return show_history(self.run_folder, self.json, terminal)
        if self.republish and not (self.run_folder or self.json):
            raise GraycardError("expected a published folder or --json FILE with --republish, got neither")
        from graycard.benchmarks.claims import judge_tables

        if self.run_folder is None:
            self._refuse_without_run()
            found, report = judge_tables(self.claims), ""
        else:
            found, report = self._judged(self.run_folder, terminal)
        for paper in found.papers:
            self._show(terminal, paper)
        if self.sizes:
            terminal.out.print(f"\n{_told_of_sizes(found)}")
        if self.power and self.run_folder is not None:
            self._show_power(terminal, found, self.run_folder)
        else:
            self._write_json(found)
        counted = Counter(claim.verdict for paper in found.papers for claim in paper.claims)
        words = ", ".join(f"{counted[v]} {v}" for v in get_args(ClaimVerdict) if counted[v])
        terminal.out.print(f"claims: {words}{report}")
        return OK

    def _judged(self, run: Path, terminal: Terminal) -> tuple[Ledger, str]:
        """Return the ledger of a run, written into it, and a note on its report; leave a published run alone.

        Raises:
            RecordError: No claims are made for the run's suite, or those asked for are of another.
        """
        from graycard.benchmarks.claims import (
            claims_names,
            claims_of_suite,
            claims_of_tracks,
            judge_run,
            made_for_others,
        )

        record = read_run(run)
        known = claims_names() if self.any_suite else claims_of_tracks(scene.track for scene in record.scenes)
        names = self.claims or claims_of_suite(record.suite) or known
        others = self._others(record)
        found = judge_run(record, run, names, any_suite=self.any_suite, **others)
        if self.sizes:
            _check_told(found, self.sizes)
        for name, suite in made_for_others(record.suite, names).items():
            terminal.err.print(
                f"not of these scenes: {name} is made for runs of {suite}, not of {record.suite}"
            )
        if is_published(run) and not self.republish:
            return found, "; the folder is a published one and left as it is"
        from graycard.eval.statistics import compare_first_look  # slow to import, as reports are
        from graycard.reports import republish_claims, write_report

        if is_published(run):
            republish_claims(run, found, compare_first_look(record))
            return found, f"; published anew in {run}"
        write_json(run / CLAIMS, found)
        return found, f"; report: {write_report(run).resolve()}"

    def _refuse_with_history(self) -> None:
        """Refuse options that judge.

        Raises:
            GraycardError: One is given.
        """
        given = {
            "--claims": self.claims, "--any-suite": self.any_suite, "--checks": self.checks,
            "--half": self.half, "--twice": self.twice, "--sizes": self.sizes, "--power": self.power,
            "--republish": self.republish,
        }  # fmt: skip
        if named := [name for name, value in given.items() if value]:
            raise GraycardError(
                f"expected --history without {', '.join(named)}, got both. It shows what was judged before"
            )

    def _refuse_without_run(self) -> None:
        """Refuse options that are about a run.

        Raises:
            GraycardError: One is given.
        """
        given = {"--half": self.half, "--twice": self.twice, "--sizes": self.sizes, "--power": self.power}
        if named := [name for name, value in given.items() if value]:
            raise GraycardError(f"expected a run with {', '.join(named)}, got none. Name its folder first")

    def _others(self, record: RunRecord) -> dict[str, Any]:
        """Return the runs at other budgets and sizes, checked, as arguments of the judge; none without any.

        Raises:
            RecordError: One differs from the run in more than its budget, or from those of other sizes in
                more than its size.
        """
        from graycard.benchmarks.claims import check_budgets, read_sizes

        given = {factor: run for factor, run in ((0.5, self.half), (2.0, self.twice)) if run is not None}
        budgets = {factor: read_run(run) for factor, run in given.items()}
        check_budgets(record, budgets)
        sizes = read_sizes(self.sizes)
        return ({"budgets": budgets} if budgets else {}) | ({"sizes": sizes} if sizes else {})

    def _show_power(self, terminal: Terminal, found: Ledger, run: Path) -> None:
        """Show what undecided claims need."""
        from graycard.benchmarks.claims import claims_names, claims_power, load_claims

        names = {paper.name for paper in found.papers}
        papers = [load_claims(name) for name in self.claims or claims_names()]
        needs = claims_power(found, read_run(run), [paper for paper in papers if paper.name in names])
        terminal.out.print(f"\nneeds of {len({(n.paper, n.claim) for n in needs})} undecided claims")
        terminal.out.print(power_table(needs))
        for claim in (c for paper in found.papers for c in paper.claims if c.suspended):
            terminal.out.print(f"{claim.id} is held back. To decide it: {claim.needs}")
        write_optional_json(self.json, needs)

    def _write_json(self, found: Ledger) -> None:
        from graycard.reports import republish_tables

        if self.republish and self.run_folder is None and self.json:
            republish_tables(self.json, found)
        else:
            write_optional_json(self.json, found)

    def _show(self, terminal: Terminal, paper: PaperResult) -> None:
        terminal.out.print(f"\n{paper.title}, claims version {paper.version}")
        own = [claim for claim in paper.claims if claim.asked_by == "graycard"]
        terminal.out.print(_claims([claim for claim in paper.claims if claim not in own]))
        if own:
            terminal.out.print("\ngraycard's own questions, which no paper claims")
            terminal.out.print(_claims(own))
        if self.checks:
            for claim in paper.claims:
                if claim.checks:
                    terminal.out.print(f"\n{claim.id}: {claim.sentence}")
                    terminal.out.print(_checks(claim))


def _check_told(found: Ledger, sizes: Sequence[Path]) -> None:
    """Refuse runs at other sizes in which no check of the claims can be made.

    Raises:
        GraycardError: None can.
    """
    if not any(check.at_sizes for paper in found.papers for claim in paper.claims for check in claim.checks):
        raise GraycardError(
            f"expected runs with rows that these claims compare, got none in {', '.join(map(str, sizes))}. "
            "Name runs of a suite that has these rows, as `sizes-dark` has those of `claims-dark`"
        )


def _told_of_sizes(found: Ledger) -> str:
    """Say which verdicts would turn by estimates at other sizes, which stay, and which nobody can compare."""
    of_papers = [claim for paper in found.papers for claim in paper.claims]
    of_no_run = ("not testable here", "consistent", "inconsistent")
    claims = [claim for claim in of_papers if claim.checks and claim.verdict not in of_no_run]
    compared = [claim for claim in claims if claim.sizes_compared]
    lists = {
        "turn": [claim.id for claim in compared if claim.turns],
        "stay": [claim.id for claim in compared if not claim.turns],
        "not compared, as rows or scenes are lacking": [
            claim.id for claim in claims if claim not in compared
        ],
    }
    told = "; ".join(f"{what}: {', '.join(names)}" for what, names in lists.items() if names)
    return f"verdicts over sizes, by estimates alone: {told}"


def _claims(claims: Sequence[ClaimResult]) -> Table:
    table = new_table("", "claim", "verdict", "refits that agree", "why")
    for claim in claims:
        stability = "" if claim.stability is None else f"{claim.stability:.0%}"
        table.add_row(claim.id, claim.sentence, claim.verdict, stability, _why(claim))
    return table


def _why(claim: ClaimResult) -> str:
    """Say what a verdict comes from: what holds it back where something does, and what would decide it."""
    found = claim.suspended or claim.text
    if claim.before is not None:
        found += f". By the checks alone: {claim.before}"
    if claim.turns:
        found += f". With size: {claim.turns}"
    return f"{found}. To decide it: {claim.needs}" if claim.needs else found


def _checks(claim: ClaimResult) -> Table:
    heads = (
        "",
        "effect",
        "estimate",
        "interval",
        "p of ranks",
        "n",
        "paper",
        "upper bound",
        "trivial",
        "verdict",
    )
    most_first = sorted((check.at_sizes for check in claim.checks), key=len, reverse=True)
    sizes = list(dict.fromkeys(size for found in most_first for size in found))
    table = new_table(*heads, *sizes)
    for check in claim.checks:
        told = "" if check.decides else " (decides nothing)"
        table.add_row(
            check.id,
            check.effect_of,
            _number(check.estimate, check.unit),
            "" if check.interval is None else f"{check.interval[0]:.3g} to {check.interval[1]:.3g}",
            _number(check.p_rank),
            str(len(check.scenes) or ""),
            _number(check.paper, check.unit),
            _row(check.bound),
            _row(check.trivial),
            check.verdict + told,
            *(_number(check.at_sizes.get(size), check.unit) for size in sizes),
        )
    return table


def _row(row: RowMean | None) -> str:
    if row is None:
        return ""
    return f"{row.row}: {', '.join(filter(None, (_number(row.value), row.reason)))}"


def _number(value: float | None, unit: str = "1") -> str:
    return "" if value is None else f"{value:.3g}" + ("" if unit == "1" else f" {unit}")

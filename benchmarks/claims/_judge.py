# SPDX-License-Identifier: Apache-2.0
"""The claims of papers against a run: a verdict for each, from nothing but the record of the run."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from graycard import RecordError
from graycard.benchmarks.claims._arithmetic import judge_arithmetic
from graycard.benchmarks.claims._claim import Paper, claims_names, claims_path, load_claims
from graycard.benchmarks.claims._readings import Readings
from graycard.benchmarks.claims._rules import RULES
from graycard.benchmarks.claims._sizes import Sized, scale_in
from graycard.benchmarks.claims._verdicts import Case, judge_claim
from graycard.eval.statistics import LEVEL
from graycard.io import sha256
from graycard.records import RUN_FILE, ClaimResult, Ledger, PaperResult, RunRecord, Scale


def judge_claims(
    record: RunRecord,
    run: Path,
    names: Sequence[str],
    *,
    any_suite: bool = False,
    level: float = LEVEL,
    budgets: Mapping[float, RunRecord] | None = None,
    sizes: Sequence[Sized] = (),
) -> Ledger:
    """Return the ledger of a run; a pure function of what its folder keeps and of the files of claims.

    Args:
        record: Of the run.
        run: The folder that it was read from; for the hash, and for pixels and views of its suite.
        names: Of files of claims, or paths to them.
        any_suite: Also judge claims that are made for the runs of another suite.
        level: Of the intervals, between 0 and 1.
        budgets: Runs of the same scenes with other numbers of steps, by their factor, as 0.5 and 2.
        sizes: Runs that differ in size alone, of :func:`read_sizes`; verdicts that would turn are named.

    Raises:
        UnknownNameError: There are no such claims.
        RecordError: A file of claims is broken, or is made for the runs of another suite.
    """
    if not any_suite:
        _check_suites(record.suite, names)
    scale = scale_in(run, record.size)
    papers = []
    for name in names:
        paper = load_claims(name)
        claims = judge_paper(paper, record, level, scale=scale, budgets=budgets, sizes=sizes)
        papers.append(PaperResult(paper.name, paper.version, paper.title, sha256(claims_path(name)), claims))
    rows = {method.name: method.summary for method in record.methods}
    digest = sha256(Path(run) / RUN_FILE)
    return Ledger(record.suite, record.suite_version, digest, level, RULES, rows, tuple(papers))


def judge_tables(names: Sequence[str] = ()) -> Ledger:
    """Return verdicts on the papers' own tables held against themselves, which needs no run.

    Args:
        names: Of files of claims, or paths to them; all that come along if empty. Those without tables are
            left out.

    Raises:
        UnknownNameError: There are no such claims.
        RecordError: A file of claims is broken.
    """
    papers = [(load_claims(name), sha256(claims_path(name))) for name in names or claims_names()]
    judged = tuple(
        PaperResult(p.name, p.version, p.title, digest, tuple(map(judge_arithmetic, p.arithmetic)))
        for p, digest in papers
        if p.arithmetic
    )
    return Ledger("", 0, "", LEVEL, RULES, {}, judged)


def judge_paper(
    paper: Paper,
    record: RunRecord,
    level: float = LEVEL,
    *,
    scale: Scale | None = None,
    budgets: Mapping[float, RunRecord] | None = None,
    sizes: Sequence[Sized] = (),
) -> tuple[ClaimResult, ...]:
    """Return the verdicts on all claims of one paper, and on its tables.

    Args:
        paper: The claims.
        record: Of the run.
        level: Of the intervals.
        scale: Pixels and views of the run, to stand beside those of the paper.
        budgets: As of :func:`judge_claims`.
        sizes: As of :func:`judge_claims`.
    """
    readings = Readings(record)
    others = {factor: Readings(other) for factor, other in (budgets or {}).items()}
    case = Case(paper, readings, level, scale, others, tuple(sizes))
    claims = (judge_claim(claim, case) for claim in paper.claims)
    return *claims, *(judge_arithmetic(found) for found in paper.arithmetic)


def made_for_others(suite: str, names: Iterable[str]) -> dict[str, str]:
    """Return files of claims that are made for the runs of another suite than ``suite``, with the name of
    theirs.

    Claims that name no suite are about any run with their rows.

    Raises:
        UnknownNameError: There are no such claims.
        RecordError: A file of claims is broken.
    """
    suites = {name: load_claims(name).suite for name in names}
    return {name: own for name, own in suites.items() if own not in ("", suite)}


def _check_suites(suite: str, names: Sequence[str]) -> None:
    """Refuse claims of other scenes and rows, which may go by the same names.

    Raises:
        RecordError: Some are made for the runs of another suite.
    """
    if others := made_for_others(suite, names):
        wanted = ", ".join(f"a run of suite {own!r} for claims {name!r}" for name, own in others.items())
        raise RecordError(
            f"expected {wanted}, got a run of suite {suite!r}. Give a run of that suite, or claims for this "
            "one (those that name no suite are for any), or judge all the same with --any-suite. If "
            "this run is of another size, give one of that suite first, and this one behind --sizes"
        )

# SPDX-License-Identifier: Apache-2.0
"""The claims of papers against a run: a verdict for each, from nothing but the record of the run."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from graycard import RecordError
from graycard.benchmarks.claims._arithmetic import judge_arithmetic
from graycard.benchmarks.claims._claim import (
    Check,
    Claim,
    Paper,
    Quantity,
    claims_names,
    claims_path,
    load_claims,
)
from graycard.benchmarks.claims._effects import effect_of
from graycard.benchmarks.claims._readings import Reading, Readings
from graycard.benchmarks.claims._rules import RULES, combined, verdict_of
from graycard.benchmarks.claims._words import (
    beside_words,
    claim_words,
    effect_words,
    limits_words,
    reason_words,
    rule_words,
)
from graycard.eval.statistics import LEVEL
from graycard.io import sha256
from graycard.records import (
    CheckResult,
    ClaimResult,
    ClaimVerdict,
    Ledger,
    PaperResult,
    RowMean,
    RunRecord,
    SceneRecord,
)


def judge_claims(record: RunRecord, run: Path, names: Sequence[str], *, any_suite: bool = False) -> Ledger:
    """The ledger of a run; a pure function of its ``run.json`` and of the files of claims.

    Args:
        record: Of the run.
        run: The folder that it was read from; for the hash.
        names: Of files of claims, or paths to them.
        any_suite: Also judge claims that are made for the runs of another suite.

    Raises:
        UnknownNameError: There are no such claims.
        RecordError: A file of claims is broken, or is made for the runs of another suite.
    """
    if not any_suite:
        _check_suites(record.suite, names)
    papers = tuple(_paper(load_claims(name), sha256(claims_path(name)), record) for name in names)
    return Ledger(
        record.suite,
        record.suite_version,
        sha256(Path(run) / "run.json"),
        LEVEL,
        RULES,
        {method.name: method.summary for method in record.methods},
        papers,
    )


def judge_tables(names: Sequence[str] = ()) -> Ledger:
    """The papers' own tables against themselves, which needs no run.

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


def judge_paper(paper: Paper, record: RunRecord) -> tuple[ClaimResult, ...]:
    """All claims of one paper."""
    readings = Readings(record)
    claims = (_claim(claim, paper, readings) for claim in paper.claims)
    return *claims, *(judge_arithmetic(found) for found in paper.arithmetic)


def made_for_others(suite: str, names: Iterable[str]) -> dict[str, str]:
    """Files of claims that are made for the runs of another suite than ``suite``, with the name of theirs.

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
            "one (those that name no suite are for any), or judge all the same with --any-suite"
        )


def _paper(paper: Paper, digest: str, record: RunRecord) -> PaperResult:
    return PaperResult(paper.name, paper.version, paper.title, digest, judge_paper(paper, record))


def _claim(claim: Claim, paper: Paper, readings: Readings) -> ClaimResult:
    beside = claim.bound or paper.bound, claim.trivial or paper.trivial
    checks = tuple(_check(check, paper.track, beside, readings) for check in claim.checks)
    deciding: list[ClaimVerdict] = [check.verdict for check in checks if check.decides]
    verdict: ClaimVerdict = "not checkable" if claim.unavailable else combined(deciding, claim.verdict_by)
    return ClaimResult(
        claim.id,
        claim.sentence,
        claim.source,
        verdict,
        claim_words(claim, verdict, checks),
        RULES[claim.verdict_by],
        checks,
        claim.figures,
        claim.notes,
    )


def _check(check: Check, track: str, beside: tuple[str, str], readings: Readings) -> CheckResult:
    told = _told(check, readings)
    try:
        effect = effect_of(check, track, readings)
    except RecordError as cause:
        return replace(told, reason=f"{told.reason}: {cause}")
    verdict = verdict_of(check, effect)
    rows = tuple(RowMean(row, mean) for row, mean in effect.means.items())
    scenes = [s for s in readings.scenes(track, check.scenes) if s.scene in effect.scenes]
    bound, trivial = (_mean(row, check, scenes, readings) for row in beside)
    record = readings.record(check.quantity)
    reason = reason_words(check, verdict, effect, told.unit, told.quantity)
    reason += f"; {limits_words(record, bound, trivial)}"
    doubt = beside_words(check, record, rows, bound, trivial)
    return replace(
        told,
        verdict=verdict,
        reason=f"{reason}. But {doubt}" if doubt else reason,
        scenes=effect.scenes,
        mean=effect.mean,
        interval=effect.interval,
        p_mean=effect.p_mean,
        p_rank=effect.p_rank,
        rows=rows,
        bound=bound,
        trivial=trivial,
    )


def _told(check: Check, readings: Readings) -> CheckResult:
    """A check before anything is measured: what it asks for, which is told even where it cannot be made."""
    try:
        quantity, unit = _quantity_words(check, readings), readings.record(check.quantity).unit
    except RecordError:
        quantity, unit = check.quantity.metric, "1"
    unit = "×" if check.scale == "ratio" else unit
    return CheckResult(
        check.id,
        check.says,
        quantity,
        unit,
        effect_words(check),
        rule_words(check, unit),
        "not checkable",
        "cannot be checked here",
        check.decides,
        neutral=check.neutral,
        paper=check.paper,
        accepted=check.range,
    )


def _quantity_words(check: Check, readings: Readings) -> str:
    quantity = check.quantity
    words = readings.record(quantity).title
    if quantity.part:
        words += f" ({quantity.part})"
    if quantity.less:
        words += f" less {readings.record(Quantity(quantity.less)).title}"
    return words


def _mean(row: str, check: Check, scenes: Iterable[SceneRecord], readings: Readings) -> RowMean:
    """The mean of a row that stands beside a check, over its scenes."""
    if readings.missing_rows([row]):
        return RowMean(row, None, "not in this run")
    found = [readings.value(row, scene, check.quantity) for scene in scenes]
    lacking = [reading.reason for reading in found if reading.value is None]
    if lacking:
        return RowMean(row, None, lacking[0])
    values = [_limit(reading) for reading in found]
    if None in values:
        return RowMean(row, None, "has no error")
    told = "noise ceiling" if values != [r.value for r in found] else ""
    return RowMean(row, sum(value for value in values if value is not None) / len(values), told)


def _limit(reading: Reading) -> float | None:
    """A value; of one without error how far the noise of the truth lets it tell anything."""
    if reading.value is None or not math.isinf(reading.value):
        return reading.value
    return reading.ceiling

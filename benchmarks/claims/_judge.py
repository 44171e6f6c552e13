# SPDX-License-Identifier: Apache-2.0
"""The claims of papers against a run: a verdict for each, from nothing but the record of the run."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from graycard import (
    CheckResult,
    ClaimResult,
    Ledger,
    PaperResult,
    RecordError,
    RowMean,
    RunRecord,
    SceneRecord,
    sha256,
)
from graycard.benchmarks.claims._arithmetic import judge_arithmetic
from graycard.benchmarks.claims._claim import Check, Claim, Paper, Quantity, claims_path, load_claims
from graycard.benchmarks.claims._effects import Effect, effect_of
from graycard.benchmarks.claims._readings import Readings
from graycard.benchmarks.claims._rules import RULES, combined, neutral_of, verdict_of
from graycard.benchmarks.claims._words import (
    beside_words,
    claim_words,
    effect_words,
    reason_words,
    rule_words,
)
from graycard.eval.statistics import LEVEL


def judge_claims(record: RunRecord, run: Path, names: Sequence[str]) -> Ledger:
    """The ledger of a run; a pure function of its ``run.json`` and of the files of claims.

    Args:
        record: Of the run.
        run: The folder that it was read from; for the hash.
        names: Of files of claims, or paths to them.

    Raises:
        UnknownNameError: There are no such claims.
        RecordError: A file of claims is broken.
    """
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


def judge_paper(paper: Paper, record: RunRecord) -> tuple[ClaimResult, ...]:
    """All claims of one paper."""
    readings = Readings(record)
    claims = (_claim(claim, paper, readings) for claim in paper.claims)
    return *claims, *(judge_arithmetic(found) for found in paper.arithmetic)


def _paper(paper: Paper, digest: str, record: RunRecord) -> PaperResult:
    return PaperResult(paper.name, paper.version, paper.title, digest, judge_paper(paper, record))


def _claim(claim: Claim, paper: Paper, readings: Readings) -> ClaimResult:
    beside = claim.bound or paper.bound, claim.trivial or paper.trivial
    checks = tuple(_check(check, paper.track, beside, readings) for check in claim.checks)
    deciding = [check.verdict for check in checks if check.decides]
    verdict = "not checkable" if claim.unavailable else combined(deciding, claim.verdict_by)
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
    try:
        effect = effect_of(check, track, readings)
    except RecordError as cause:
        return _unchecked(check, readings, str(cause))
    record = readings.record(check.quantity)
    unit = "×" if check.scale == "ratio" else record.unit
    verdict = verdict_of(check, effect)
    rows = tuple(RowMean(row, mean) for row, mean in effect.means.items())
    scenes = [s for s in readings.scenes(track, check.scenes) if s.scene in effect.scenes]
    bound, trivial = (_mean(row, check, scenes, readings) for row in beside)
    reason = reason_words(check, verdict, effect, unit, _quantity_words(check, readings))
    doubt = beside_words(check, record, rows, bound, trivial)
    return CheckResult(
        check.id,
        check.says,
        _quantity_words(check, readings),
        unit,
        effect_words(check),
        rule_words(check, unit),
        verdict,
        f"{reason}. But {doubt}" if doubt else reason,
        check.decides,
        **_numbers(effect),
        neutral=neutral_of(check),
        paper=check.paper,
        accepted=check.range,
        rows=rows,
        bound=bound,
        trivial=trivial,
    )


def _numbers(effect: Effect) -> dict[str, object]:
    names = ("scenes", "mean", "interval", "p_mean", "p_rank")
    return {name: getattr(effect, name) for name in names}


def _unchecked(check: Check, readings: Readings, reason: str) -> CheckResult:
    """A check that this run cannot make; what it would ask for is told all the same."""
    try:
        record = readings.record(check.quantity)
        title, unit = _quantity_words(check, readings), record.unit
    except RecordError:
        title, unit = check.quantity.metric, "1"
    unit = "×" if check.scale == "ratio" else unit
    return CheckResult(
        check.id,
        check.says,
        title,
        unit,
        effect_words(check),
        rule_words(check, unit),
        "not checkable",
        f"cannot be checked here: {reason}",
        check.decides,
        neutral=neutral_of(check),
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
    values = [reading.value for reading in found if reading.value is not None]
    return RowMean(row, sum(values) / len(values))

# SPDX-License-Identifier: Apache-2.0
"""One claim against a run: the rules' verdict from its checks, and what holds that verdict back."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from graycard import RecordError
from graycard.benchmarks.claims._claim import Check, Claim, Paper, Quantity
from graycard.benchmarks.claims._effects import Levels, Sample, p_of, sample_of, summarise
from graycard.benchmarks.claims._fitted import budget_of, suspension
from graycard.benchmarks.claims._noise import FitNoise, noise_of
from graycard.benchmarks.claims._readings import Reading, Readings
from graycard.benchmarks.claims._rules import (
    OWN,
    RULES,
    STABLE,
    combined,
    is_decided,
    levels_for,
    verdict_of,
)
from graycard.benchmarks.claims._stability import Judged, same_share
from graycard.benchmarks.claims._words import (
    beside_words,
    claim_words,
    effect_words,
    limits_words,
    reason_words,
    rule_words,
)
from graycard.records import CheckResult, ClaimResult, ClaimVerdict, RowMean, SceneRecord

NOT_TESTABLE: ClaimVerdict = "not testable here"


@dataclass(frozen=True, slots=True)
class Case:
    """All that the claims of a paper are judged by."""

    paper: Paper
    readings: Readings
    level: float
    """Of intervals that every deciding check has to agree on."""
    here: Mapping[str, str] = field(default_factory=dict)
    """Means of the run, by what is counted."""
    budgets: Mapping[float, Readings] = field(default_factory=dict)
    """Runs of the same scenes with other steps, by their factor."""


@dataclass(frozen=True, slots=True)
class _Asked:
    """How the checks of a claim are judged."""

    by: str
    """``all`` or ``any``."""
    levels: Levels

    @classmethod
    def of(cls, claim: Claim, level: float) -> "_Asked":
        deciding = sum(check.decides for check in claim.checks)
        return cls(claim.verdict_by, Levels(level, levels_for(deciding, level)))


@dataclass(frozen=True, slots=True)
class _Made:
    """A check as it was made, or could not be."""

    result: CheckResult
    judged: Judged | None


def judge_claim(claim: Claim, case: Case) -> ClaimResult:
    """Return the verdict on a claim with everything that it follows from."""
    asked = _Asked.of(claim, case.level)
    made = [_check(check, claim, case, asked) for check in claim.checks]
    verdict = NOT_TESTABLE if claim.unavailable else _combined(made, asked)
    stability = None if verdict == NOT_TESTABLE else _stability(verdict, made, asked)
    held = "" if verdict == NOT_TESTABLE else _held(claim, verdict, stability, case, asked)
    checks = tuple(one.result for one in made)
    text = claim_words(claim, verdict, checks)
    own = OWN if claim.asked_by == "graycard" else {}
    before = own.get(verdict, verdict) if held and is_decided(verdict) else None
    final: ClaimVerdict = "undecided" if held else verdict
    return ClaimResult(
        claim.id,
        claim.sentence,
        claim.source,
        own.get(final, final),
        text,
        RULES[claim.verdict_by],
        tuple(replace(check, verdict=own.get(check.verdict, check.verdict)) for check in checks),
        claim.asked_by,
        stability,
        held,
        before,
        budget=budget_of(claim, case.paper, case.readings, case.here),
        figures=claim.figures,
        notes=claim.notes,
    )


def _combined(made: Sequence[_Made], asked: _Asked) -> ClaimVerdict:
    return combined([one.result.verdict for one in made if one.result.decides], asked.by)


def _stability(verdict: ClaimVerdict, made: Sequence[_Made], asked: _Asked) -> float | None:
    """Return the share of refits in which the claim has the same verdict; None where nobody knows."""
    deciding = [one for one in made if one.result.decides]
    checks = [one.judged for one in deciding if one.judged is not None]
    others = [one.result.verdict for one in deciding if one.judged is None]
    return same_share(verdict, checks, asked.levels, asked.by, others)


def _held(claim: Claim, verdict: ClaimVerdict, stability: float | None, case: Case, asked: _Asked) -> str:
    """Say why a verdict of the rules is held back; empty if it stands."""
    if short := suspension(claim, case.paper, case.readings):
        return short
    if not is_decided(verdict):
        return ""
    for factor, readings in sorted(case.budgets.items()):
        other = replace(case, readings=readings, budgets={})
        found = _combined([_check(check, claim, other, asked) for check in claim.checks], asked)
        if found not in (verdict, NOT_TESTABLE):
            return f"{verdict} turns to {found} with {factor:g} times the steps"
    if stability is not None and stability < STABLE:
        return f"{verdict}, but only {stability:.0%} of simulated refits of these scenes say so"
    return ""


def _check(check: Check, claim: Claim, case: Case, asked: _Asked) -> _Made:
    told = _told(check, case.readings)
    try:
        sample = sample_of(check, case.paper.track, case.readings)
    except RecordError as cause:
        return _Made(replace(told, reason=f"{told.reason}: {cause}"), None)
    effect = summarise(sample, asked.levels)
    verdict = verdict_of(check, effect, asked.by)
    judged = Judged(sample, effect, verdict, noise_of(sample, case.paper.track, case.readings))
    alone = same_share(verdict, [judged], asked.levels, "all" if asked.by == "all" else "any")
    result = replace(
        told,
        verdict=verdict,
        scenes={s.scene: sample.back(float(e)) for s, e in zip(sample.scenes, sample.effects, strict=True)},
        estimate=effect.estimate,
        interval=effect.interval,
        p_rank=p_of(sample),
        scene_sd=_scene_sd(sample, judged.noise),
        seed_sd=judged.noise.sd if judged.noise else None,
        noise_from=judged.noise.source if judged.noise else "",
        stability=alone,
        at_budgets=_at_budgets(check, case, asked),
    )
    return _Made(_beside(result, judged, claim, case), judged)


def _told(check: Check, readings: Readings) -> CheckResult:
    """Return a check before anything is measured: it tells what it asks for even where it cannot be made."""
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
        NOT_TESTABLE,
        "cannot be tested here",
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


def _beside(result: CheckResult, judged: Judged, claim: Claim, case: Case) -> CheckResult:
    """Return a check with its reason, its rows, and what is possible and trivial beside them."""
    sample, check = judged.sample, judged.sample.check
    names = claim.bound or case.paper.bound, claim.trivial or case.paper.trivial
    bound, trivial = (_mean(row, check, sample.scenes, case.readings) for row in names)
    rows = tuple(map(RowMean, (*check.rows, *check.minus), map(float, sample.rows)))
    record = case.readings.record(check.quantity)
    reason = reason_words(check, judged.verdict, judged.effect, len(sample.scenes), case.level, result)
    reason += f"; {limits_words(record, bound, trivial)}"
    doubt = beside_words(check, record, rows, bound, trivial)
    reason = f"{reason}. But {doubt}" if doubt else reason
    return replace(result, reason=reason, rows=rows, bound=bound, trivial=trivial)


def _scene_sd(sample: Sample, noise: FitNoise | None) -> float:
    """Return the spread between scenes, less that which fits make."""
    rest = sample.effects - sample.centre
    free = len(rest) - (2 if sample.check.along else 1)
    total = float((rest - rest.mean()) @ (rest - rest.mean())) / free
    return math.sqrt(max(0.0, total - (noise.sd_of_mean**2 if noise else 0.0)))


def _at_budgets(check: Check, case: Case, asked: _Asked) -> dict[str, float]:
    """Return the estimate in runs with other steps, by their factor; without those that lack it."""
    found = {}
    for factor, readings in sorted(case.budgets.items()):
        try:
            sample = sample_of(check, case.paper.track, readings)
        except RecordError:
            continue
        found[f"{factor:g}"] = summarise(sample, asked.levels).estimate
    return found


def _mean(row: str, check: Check, scenes: Iterable[SceneRecord], readings: Readings) -> RowMean:
    """Return the mean of a row that stands beside a check, over its scenes."""
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
    """Return a value; of one without error how far the noise of the truth lets it tell anything."""
    if reading.value is None or not math.isinf(reading.value):
        return reading.value
    return reading.ceiling

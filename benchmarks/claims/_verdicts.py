# SPDX-License-Identifier: Apache-2.0
"""One claim against a run: the rules' verdict from its checks, and what holds that verdict back."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from graycard import RecordError
from graycard.benchmarks.claims._claim import Check, Claim, Paper, Quantity
from graycard.benchmarks.claims._effects import (
    Levels,
    Sample,
    effect_in,
    p_of,
    sample_of,
    spread_of,
    summarise,
)
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
    words_of,
)
from graycard.benchmarks.claims._sizes import Sized, estimates_at, turned_by_size
from graycard.benchmarks.claims._stability import Deciding, Judged
from graycard.benchmarks.claims._words import (
    beside_words,
    claim_words,
    effect_words,
    limits_words,
    reason_words,
    rule_words,
    strict_words,
)
from graycard.records import CheckResult, ClaimResult, ClaimVerdict, RowMean, Scale, SceneRecord

NOT_TESTABLE: ClaimVerdict = "not testable here"


@dataclass(frozen=True, slots=True)
class Case:
    """All that the claims of a paper are judged by."""

    paper: Paper
    readings: Readings
    level: float
    """Level of intervals that every deciding check has to agree on."""
    scale: Scale | None = None
    """Pixels and views of the run; None where nobody knows."""
    budgets: Mapping[float, Readings] = field(default_factory=dict)
    """Runs of the same scenes with other steps, by their factor."""
    sizes: tuple[Sized, ...] = ()
    """Runs that differ in size alone, from small to large."""

    def means(self) -> dict[str, str]:
        """Return means of the run by what is counted, with the other budgets that stand beside it."""
        others = ", ".join(f"{factor:g} times the steps" for factor in sorted(self.budgets))
        found = _means_of(self.scale) if self.scale else {}
        sizes = {"other sizes": "; ".join(size.words for size in self.sizes)} if self.sizes else {}
        return {**found, "other budgets": others or "not run", **sizes}


def _means_of(scale: Scale) -> dict[str, str]:
    """Return pixels and views, to stand beside those of a paper."""
    views = f"{scale.train_views} training, {scale.test_views} held out"
    return {"pixels": f"{scale.width} x {scale.height}", "views": views}


@dataclass(frozen=True, slots=True)
class _Made:
    """A check as it was made, or could not be."""

    result: CheckResult
    judged: Judged | None


class _Held(NamedTuple):
    """A reason to hold a verdict of the rules back, and what would remove it."""

    why: str
    needs: str


def judge_claim(claim: Claim, case: Case) -> ClaimResult:
    """Return the verdict on a claim with everything that it follows from."""
    made = _made(claim, case)
    deciding = _deciding(claim, made, case.level)
    verdict = NOT_TESTABLE if claim.unavailable else deciding.verdict
    stability = None if verdict == NOT_TESTABLE or not deciding.is_measured else deciding.stability()
    held = () if verdict == NOT_TESTABLE else tuple(_held(claim, deciding, stability, case))
    checks = tuple(one.result for one in made)
    return ClaimResult(
        claim.id,
        claim.sentence,
        claim.source,
        deciding.word("undecided" if held else verdict),
        claim_words(claim, verdict, checks),
        RULES[claim.verdict_by],
        tuple(_in_words_of(check, deciding) for check in checks),
        claim.asked_by,
        stability,
        "; ".join(reason.why for reason in held),
        deciding.word(verdict) if held and is_decided(verdict) else None,
        "; ".join(reason.needs for reason in held),
        budget_of(claim, case.paper, case.readings, case.means()),
        claim.figures,
        claim.notes,
        "" if verdict == NOT_TESTABLE else _turned_by_size(claim, case, deciding.word(verdict)),
    )


def _turned_by_size(claim: Claim, case: Case, verdict: ClaimVerdict) -> str:
    here = case.scale.words if case.scale else ""
    return turned_by_size(claim, case.sizes, here, case.paper.track, _levels(claim, case.level), verdict)


def _in_words_of(check: CheckResult, deciding: Deciding) -> CheckResult:
    """Return a check in the words of its claim; one that decides nothing contradicts nobody either."""
    word = deciding.word(check.verdict) if check.decides else OWN.get(check.verdict, check.verdict)
    return replace(check, verdict=word)


def _made(claim: Claim, case: Case) -> list[_Made]:
    """Return all checks of a claim."""
    levels = _levels(claim, case.level)
    return [_check(check, claim, case, levels) for check in claim.checks]


def _levels(claim: Claim, level: float) -> Levels:
    return Levels(level, levels_for(claim.statements, level))


def _deciding(claim: Claim, made: Sequence[_Made], level: float) -> Deciding:
    """Return the checks that decide, with how they do."""
    mine = [check for check in made if check.result.decides]
    checks = tuple(check.judged for check in mine if check.judged is not None)
    others: list[ClaimVerdict] = [check.result.verdict for check in mine if check.judged is None]
    return Deciding(checks, tuple(others), _levels(claim, level), claim.verdict_by, words_of(claim))


def _held(claim: Claim, deciding: Deciding, stability: float | None, case: Case) -> Iterator[_Held]:
    """Yield why a verdict of the rules is held back."""
    if short := suspension(claim, case.paper, case.readings):
        yield _Held(short, "fits that are run to the end")
    if not is_decided(deciding.verdict):
        return
    if turned := _turned(claim, deciding, case):
        yield _Held(turned, "fits of so many steps that more do not turn the verdict")
    if stability is None:
        yield _Held("nobody measured how far fits of these rows differ", "several seeds a scene")
    elif stability < STABLE:
        yield _unstable(deciding, stability)


def _unstable(deciding: Deciding, stability: float) -> _Held:
    """Say how seldom refits agree, whose noise that takes, and what would be enough."""
    seeds = deciding.seeds()
    needs = f"about {seeds} seeds a scene" if seeds else "more scenes: no number of seeds is enough"
    measured = all(check.noise is None or check.noise.origin != "other rows" for check in deciding.checks)
    whose = "" if measured else ", if their noise is that of the rows that stand in for these"
    return _Held(f"only {stability:.0%} of simulated refits of these scenes give this verdict{whose}", needs)


def _turned(claim: Claim, deciding: Deciding, case: Case) -> str:
    """Say what a verdict turns to with other numbers of steps; empty if it stays."""
    for factor, readings in sorted(case.budgets.items()):
        found = _verdict_by(readings, claim, case)
        if found != NOT_TESTABLE and deciding.word(found) != deciding.word(deciding.verdict):
            return f"with {factor:g} times the steps it turns to {deciding.word(found)}"
    return ""


def _verdict_by(readings: Readings, claim: Claim, case: Case) -> ClaimVerdict:
    """Return what the rules say of a claim by another run."""
    levels, found = _levels(claim, case.level), list[ClaimVerdict]()
    for check in claim.checks:
        if check.decides:
            effect = effect_in(readings, check, case.paper.track, levels)
            found.append(verdict_of(check, effect, claim.verdict_by) if effect else NOT_TESTABLE)
    return combined(found, claim.verdict_by)


def _check(check: Check, claim: Claim, case: Case, levels: Levels) -> _Made:
    told = _told(check, case.readings)
    try:
        sample = sample_of(check, case.paper.track, case.readings)
    except RecordError as cause:
        return _Made(replace(told, reason=f"{told.reason}: {cause}"), None)
    effect = summarise(sample, levels)
    verdict = verdict_of(check, effect, claim.verdict_by)
    judged = Judged(sample, effect, verdict, noise_of(sample, case.paper.track, case.readings))
    alone = Deciding((judged,), (), levels, claim.verdict_by, words_of(claim))
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
        stability=alone.stability(),
        at_budgets=_at_budgets(check, case, levels),
        at_sizes=estimates_at(case.sizes, check, case.paper.track, levels),
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
    levels = _levels(claim, case.level)
    reason = reason_words(check, judged.verdict, judged.effect, len(sample.scenes), levels, result)
    if held := strict_words(
        check, judged.verdict, judged.effect, len(sample.scenes), levels, claim.verdict_by
    ):
        reason += f"; {held}"
    reason += f"; {limits_words(record, bound, trivial)}"
    doubt = beside_words(check, record, rows, bound, trivial)
    reason = f"{reason}. But {doubt}" if doubt else reason
    return replace(result, reason=reason, rows=rows, bound=bound, trivial=trivial)


def _scene_sd(sample: Sample, noise: FitNoise | None) -> float:
    """Return the spread between scenes, less that which fits make."""
    return math.sqrt(max(0.0, spread_of(sample) ** 2 - (noise.sd_of_mean**2 if noise else 0.0)))


def _at_budgets(check: Check, case: Case, levels: Levels) -> dict[str, float]:
    """Return the estimate in runs with other steps, by their factor; without those that lack it."""
    effects = {f: effect_in(run, check, case.paper.track, levels) for f, run in sorted(case.budgets.items())}
    return {f"{factor:g}": effect.estimate for factor, effect in effects.items() if effect}


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

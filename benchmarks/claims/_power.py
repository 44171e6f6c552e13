# SPDX-License-Identifier: Apache-2.0
"""Scenes or seeds that an undecided claim needs, and what they cost here.

Scenes to come are drawn from those seen: residuals from the Hodges-Lehmann estimate, their signs tossed, are
put around an effect. The rule is applied to many such samples. The number of scenes is the least with which
it decides 80 % of them. Beside it stands the number for normal effects: the power of the t-test, and the
efficiency 3/π of the signed-rank test against it (Hollander et al. 2014, section 3.11).
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from graycard.benchmarks.claims._claim import Check, Claim, Paper
from graycard.benchmarks.claims._rules import OPEN, levels_for
from graycard.eval.statistics import rank_limit
from graycard.records import CheckResult, ClaimResult, Ledger, RunRecord

WANTED: Final = 0.8
"""The power that is asked for."""
MOST: Final = 400
"""Scenes from which on no number is reasonable."""
_DRAWS, _SEED = 1000, 80_1945
_LEAST_RESIDUALS: Final = 6
"""Fewer do not show the shape of a distribution: normal ones of their spread are drawn in their place."""


@dataclass(frozen=True, slots=True)
class Need:
    """Scenes and seeds that would decide a check, if its effect were a certain one."""

    effect: float
    """In the unit of the check."""
    scenes: int | None
    """By simulation of the rule; None where :data:`MOST` scenes are not enough."""
    normal: int | None
    """The same for normal effects, by formula; may be above :data:`MOST`, None for no effect to find."""
    seeds: int | None
    """Fits of each scene with which the scenes at hand would do; None where seeds cannot, or nobody knows."""
    hours: float | None
    """Hours of the fits that are still to be made for those scenes, one at a time; None without
    ``scenes``."""


@dataclass(frozen=True, slots=True)
class CheckPower:
    """One deciding check of an undecided claim."""

    paper: str
    claim: str
    check: str
    effect_of: str
    unit: str
    estimate: float
    interval: tuple[float, float] | None
    count: int
    """Scenes at hand."""
    sd: float
    """Over them, fits included; of ratios that of the logarithm."""
    seed_sd: float | None
    hours: float
    """Hours of fits for one scene more, of the rows that the check stands on."""
    seen: Need
    """For a verdict of any kind, if the effect is as seen."""
    claimed: Need | None
    """For ``reproduced``, if the effect is the paper's; None where it names none."""
    none: Need | None
    """For ``no effect``, or smallness as claimed, if there is no effect; None without a margin."""


@dataclass(frozen=True, slots=True)
class _Rule:
    """A check as statements about the ends of an interval, on the scale on which effects are averaged."""

    check: Check
    levels: tuple[float, float]
    """Level of words for the claim, and of words against it."""
    decided: Callable[["_Ends"], np.ndarray]
    reproduced: Callable[["_Ends"], np.ndarray]
    none: Callable[["_Ends"], np.ndarray] | None
    """``no effect``; None where the check has no margin."""
    margin: float
    """Greatest distance of the ends from the middle for that."""
    ends: tuple[float, ...] = (0.0,)
    """Effects from which one has to be told."""


class _Ends:
    """Interval ends of many samples, asked by comparison: above a value is a count of signed ranks."""

    def __init__(self, samples: np.ndarray, level: float, against: float | None = None) -> None:
        self._samples = samples
        count = samples.shape[1]
        self._limits = [rank_limit(count, level), rank_limit(count, against or level)]
        self._all = count * (count + 1) // 2
        self._known: dict[float, np.ndarray] = {}

    def above(self, value: float, *, against: bool = False) -> np.ndarray:
        """Tell which intervals lie above a value, at the level of words against the claim or for it."""
        limit = self._limits[against]
        return self._statistic(value) >= self._all - limit if limit >= 0 else self._never()

    def below(self, value: float, *, against: bool = False) -> np.ndarray:
        """Tell which intervals lie below a value, at the level of words against the claim or for it."""
        limit = self._limits[against]
        return self._statistic(value) <= limit if limit >= 0 else self._never()

    def _never(self) -> np.ndarray:
        return np.zeros(len(self._samples), bool)

    def _statistic(self, value: float) -> np.ndarray:
        """Return the sum of the ranks of what is above a value, shape ``(samples,)``."""
        if value not in self._known:
            apart = self._samples - value
            order = np.argsort(np.abs(apart), axis=1)
            ranks = np.arange(1, apart.shape[1] + 1)
            self._known[value] = (np.take_along_axis(apart, order, axis=1) > 0) @ ranks
        return self._known[value]


def claims_power(ledger: Ledger, record: RunRecord, papers: Sequence[Paper]) -> list[CheckPower]:
    """Return what each undecided claim of a ledger needs, one entry for each deciding check that leaves it
    open.

    Checks along a knob are left out: their scenes are not repetitions of one effect. So are claims that are
    held back: no number of scenes frees them, and the ledger says what does.

    Args:
        ledger: Verdicts with the effect on each scene.
        record: The run, for what fits cost.
        papers: The claims of the ledger.
    """
    by_name = {paper.name: paper for paper in papers}
    return [
        _power(by_name[judged.name], claim, result, check, record, ledger.level)
        for judged in ledger.papers
        if judged.name in by_name
        for claim, result, check in _open(by_name[judged.name], judged.claims)
    ]


def _open(paper: Paper, results: Sequence[ClaimResult]) -> Iterator[tuple[ClaimResult, CheckResult, Check]]:
    """Yield the deciding checks that leave claims open; none of a claim that something else holds back."""
    claims: Mapping[str, Claim] = {claim.id: claim for claim in paper.claims}
    for result in results:
        if result.verdict not in OPEN or result.suspended or result.id not in claims:
            continue
        checks = {check.id: check for check in claims[result.id].checks}
        deciding = [c for c in result.checks if c.decides and c.scenes and checks[c.id].along is None]
        yield from ((result, check, checks[check.id]) for check in deciding if check.verdict in OPEN)


def _power(
    source: Paper, claim: ClaimResult, result: CheckResult, check: Check, record: RunRecord, level: float
) -> CheckPower:
    """Return what one check needs."""
    scale = math.log if check.scale == "ratio" else float
    effects = np.array([scale(value) for value in result.scenes.values()])
    estimate = float(scale(result.estimate if result.estimate is not None else 1.0))
    rows = {*check.rows, *check.minus, *_beside(source, claim.id)}
    hours = _hours(record, rows)
    rule = _rule(check, _levels(source, claim.id, level))
    asked = _Asked(rule, effects, estimate, result.seed_sd, _seeds(record), hours)
    paper = None if check.rule == "within" else check.paper
    return CheckPower(
        source.name, claim.id, result.id, result.effect_of, result.unit,
        estimate=float(result.estimate or 0.0), interval=result.interval, count=len(effects),
        sd=asked.sd, seed_sd=result.seed_sd, hours=hours,
        seen=asked.need(estimate, rule.decided, min(abs(estimate - end) for end in rule.ends)),
        claimed=None if paper is None else asked.need(scale(paper), rule.reproduced, abs(scale(paper))),
        none=asked.need(_nothing(check, scale), rule.none, rule.margin, both=True) if rule.none else None,
    )  # fmt: skip


def _levels(paper: Paper, claim: str, level: float) -> tuple[float, float]:
    """Return the levels of words for a claim and against it."""
    found = _claim_of(paper, claim)
    strict = levels_for(found.statements, level)
    return (level, strict) if found.verdict_by == "all" else (strict, level)


def _claim_of(paper: Paper, claim: str) -> Claim:
    return next(c for c in paper.claims if c.id == claim)


def _beside(paper: Paper, claim: str) -> set[str]:
    """Return the rows of the bound and of what is trivial."""
    found = _claim_of(paper, claim)
    return {found.bound or paper.bound, found.trivial or paper.trivial}


def _nothing(check: Check, scale: Callable[[float], float]) -> float:
    """Return the effect that is none, or the middle of what counts as small."""
    neutral = scale(check.neutral)
    if check.rule != "within" or check.accepted is None:
        return neutral
    low, high = check.accepted
    middle = (low + high) / 2 if math.isfinite(low + high) else check.neutral
    return neutral if low < check.neutral < high else scale(middle)


def _log(value: float) -> float:
    return math.log(value) if value > 0 else -math.inf


def _rule(check: Check, levels: tuple[float, float]) -> _Rule:
    """Return the rule of a check on the scale on which its effects are averaged."""
    scale = _log if check.scale == "ratio" else float
    if check.rule == "within":
        assert check.accepted is not None, "the file was refused without"
        return _within(check, levels, *map(scale, check.accepted))
    small, large = map(scale, check.range or (check.neutral, math.inf))
    margins = scale(check.neutral - check.negligible), scale(check.neutral + check.negligible)
    none = _inside(*margins, against=True) if check.negligible else None

    def reproduced(ends: _Ends) -> np.ndarray:
        return ends.above(0.0) & ~ends.below(small) & ~ends.above(large)

    def decided(ends: _Ends) -> np.ndarray:
        larger = ends.above(max(large, 0.0))
        found = reproduced(ends) | larger | ends.below(max(small, margins[1]), against=True)
        return found | none(ends) if none else found

    return _Rule(check, levels, decided, reproduced, none, margins[1])


def _within(check: Check, levels: tuple[float, float], low: float, high: float) -> _Rule:
    """Return the rule of a check that asks for a small effect."""
    inside, scale = _inside(low, high), _log if check.scale == "ratio" else float
    ends = tuple(end for end in (low, high) if math.isfinite(end))
    reach = min(abs(end - _nothing(check, scale)) for end in ends)

    def decided(e: _Ends) -> np.ndarray:
        return inside(e) | e.below(low, against=True) | e.above(high, against=True)

    return _Rule(check, levels, decided, inside, inside, reach, ends)


def _inside(low: float, high: float, *, against: bool = False) -> Callable[[_Ends], np.ndarray]:
    """Return the question which intervals lie between two values."""
    return lambda ends: ends.above(low, against=against) & ends.below(high, against=against)


@dataclass(frozen=True, slots=True)
class _Asked:
    """One check with the effects that were seen."""

    rule: _Rule
    effects: np.ndarray
    """Shape ``(scenes,)``."""
    estimate: float
    seed_sd: float | None
    seeds: int
    hours: float

    @property
    def sd(self) -> float:
        """Standard deviation over the scenes."""
        return float(self.effects.std(ddof=1)) if len(self.effects) > 1 else 0.0

    def need(
        self, effect: float, says: Callable[[_Ends], np.ndarray], distance: float, *, both: bool = False
    ) -> Need:
        """Return what it takes that the rule says something of an effect.

        Args:
            effect: On the scale of averages.
            says: What the rule has to say.
            distance: From the effect to what it has to be told from, for the formula.
            both: Whether it has to be told from that on either side.
        """
        samples = effect + self._residuals()

        def power(count: int) -> float:
            return float(says(_Ends(samples[:, :count], *self.rule.levels)).mean())

        scenes = least_count(power)
        normal = _normal(distance, self.sd, both=both)
        missing = None if scenes is None else max(0, scenes - len(self.effects)) * self.hours
        back = math.exp if self.rule.check.scale == "ratio" else float
        return Need(float(back(effect)), scenes, normal, self._seeds(scenes), missing)

    def _residuals(self) -> np.ndarray:
        """Return residuals of scenes to come, shape ``(draws, MOST)``."""
        chance = np.random.default_rng(_SEED)
        shape, count = (_DRAWS, MOST), len(self.effects)
        if count < _LEAST_RESIDUALS:
            return self.sd * chance.normal(size=shape)
        seen = (self.effects - self.estimate) * math.sqrt(count / (count - 1))
        drawn = chance.choice(seen, shape) * chance.choice([-1.0, 1.0], shape)
        return drawn + 1e-6 * max(self.sd, 1e-12) * chance.normal(size=shape)  # without ties

    def _seeds(self, scenes: int | None) -> int | None:
        """Return fits of a scene with which the scenes at hand are as good as so many with those of now."""
        have = len(self.effects)
        if self.seed_sd is None or scenes is None or scenes <= have:
            return None
        fits = self.seed_sd**2
        between = max(0.0, self.sd**2 - fits / self.seeds)
        if fits / self.seeds <= between:
            return None  # scenes make most of the spread
        room = self.sd**2 * have / scenes - between
        return math.ceil(fits / room) if room > 0 else None


def least_count(power: Callable[[int], float]) -> int | None:
    """Return the least number of scenes with the power that is wanted, by bisection; None above :data:`MOST`.

    Args:
        power: Of a number of scenes; taken to rise with it.
    """
    if power(MOST) < WANTED:
        return None
    low, high = 1, MOST
    while high - low > 1:
        middle = int(math.sqrt(low * high)) if high > 2 * low else (low + high) // 2
        low, high = (low, middle) if power(middle) >= WANTED else (middle, high)
    return high


def _normal(distance: float, sd: float, *, both: bool) -> int | None:
    """Return the number of scenes for normal effects, by formula.

    Args:
        distance: From the effect to what has to be told from it.
        sd: Over scenes.
        both: Whether both ends of the interval have to be nearer than that.
    """
    from scipy import special

    if not distance or not math.isfinite(distance) or not sd:
        return None
    missed = (1 - WANTED) / 2 if both else 1 - WANTED
    reach = -special.ndtri(0.025) - special.ndtri(missed)
    exact = (reach * sd / distance) ** 2 + special.ndtri(0.025) ** 2 / 2  # of the t-test (Guenther 1981)
    return math.ceil(exact * math.pi / 3)


def _hours(record: RunRecord, rows: set[str]) -> float:
    """Return the hours of fits that a scene takes, the mean over those of the run, one fit at a time."""
    times: dict[str, list[float]] = {row: [] for row in rows}
    for result in record.results:
        if result.job.method in times and result.cost is not None:
            times[result.job.method].append(result.cost.wall_s)
    return _seeds(record) * sum(sum(found) / len(found) for found in times.values() if found) / 3600


def _seeds(record: RunRecord) -> int:
    return max(1, len({result.job.seed for result in record.results}))

# SPDX-License-Identifier: Apache-2.0
"""Who is best by a metric, by how much, and how sure that is: the comparison of a run in words."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Literal

from graycard.records import (
    Comparison,
    MethodStanding,
    MetricComparison,
    MetricRecord,
    PairDifference,
    PairVerdict,
)
from graycard.reports._format import count, format_p, format_value

Kind = Literal["clear", "tied", "too few", "alone", "open", "nobody"]
"""``open``: nothing says whether a lead is significant."""


@dataclass(frozen=True, slots=True)
class LeaderVerdict:
    """The best competing method by one metric on one track."""

    kind: Kind
    words: str
    """Verdict as ``clear lead`` or ``tied with gray``."""
    leader: str = ""
    """Empty where nobody has a score of every scene."""
    value: str = ""
    lead: str = ""
    """By how much, and over whom; empty without a rival."""
    evidence: str = ""
    """The p value with and without the correction, and the number of scenes."""
    tied: tuple[str, ...] = ()
    """Those that cannot be told from the leader."""


def judge(
    metric: MetricRecord,
    found: MetricComparison,
    comparison: Comparison,
    variants: Collection[str] = (),
) -> LeaderVerdict:
    """Return the verdict on one metric of one track.

    Only methods that compete and have a score of every scene can lead; variants neither lead nor are rivals.

    Args:
        metric: Which one.
        found: How methods compare by it.
        comparison: Of the run.
        variants: See :meth:`graycard.records.RunRecord.variants_on`.
    """
    methods = [m for m in found.methods if m.method not in variants]
    order = _in_order(metric, methods)
    if not order:
        return _nobody(methods)
    first, n = order[0], count(order[0].scenes, "scene")
    value = format_value(_mean(first), metric.unit)
    if len(order) == 1:
        return LeaderVerdict("alone", _alone(methods), first.method, value, evidence=n)
    pair = _pair(found, first.method, order[1].method)
    lead = _lead(metric, first, order[1], pair)
    if pair is None or pair.verdict == "too few scenes":
        least = comparison.least_scenes
        more = f"{least} needed" if first.scenes < least else "among so many pairs"
        words = f"too few scenes to tell: {more}"
        return LeaderVerdict("too few", words, first.method, value, lead, n)
    evidence = _evidence(pair, first.scenes)
    tied = _told(found, order, "tie")
    if tied:
        return LeaderVerdict("tied", f"tied with {_list(tied)}", first.method, value, lead, evidence, tied)
    if untold := _told(found, order, "too few scenes"):
        words = f"too few scenes to tell from {_list(untold)}"
        return LeaderVerdict("too few", words, first.method, value, lead, evidence)
    return LeaderVerdict("clear", "clear lead", first.method, value, lead, evidence)


def judge_without_intervals(
    metric: MetricRecord, methods: Sequence[MethodStanding], variants: Collection[str] = ()
) -> LeaderVerdict:
    """Return the same for a run without a comparison: who is best is known, not whether that is
    significant.
    """
    methods = [m for m in methods if m.method not in variants]
    order = _in_order(metric, methods)
    if not order:
        return _nobody(methods)
    first, value = order[0], format_value(_mean(order[0]), metric.unit)
    n = count(first.scenes, "scene")
    if len(order) == 1:
        return LeaderVerdict("alone", _alone(methods), first.method, value, evidence=n)
    lead = _ahead(metric, _mean(first), _mean(order[1]), order[1].method)
    return LeaderVerdict("open", "significance not computed", first.method, value, lead, n)


def standing_note(standing: MethodStanding, verdict: LeaderVerdict) -> str:
    """Words of a leaderboard below the number of a method."""
    if standing.method == verdict.leader:
        more = f", {verdict.evidence}" if verdict.evidence else ""
        return verdict.words + more
    return f"tied with {verdict.leader}" if standing.method in verdict.tied else ""


def _nobody(methods: Sequence[MethodStanding]) -> LeaderVerdict:
    some = any(m.competes and m.mean is not None for m in methods)
    return LeaderVerdict("nobody", "no method has every scene" if some else "no method provides it")


def _alone(methods: Sequence[MethodStanding]) -> str:
    """Return the words on the only method with a score of every scene."""
    partial = sum(m.competes and m.mean is not None and m.scenes < m.expected for m in methods)
    return "no rival with every scene" if partial else "no rival"


def _in_order(metric: MetricRecord, methods: Sequence[MethodStanding]) -> list[MethodStanding]:
    """Competing methods with a score of every scene, the best first."""
    whole = [m for m in methods if m.competes and m.mean is not None and m.scenes == m.expected]
    return sorted(whole, key=_mean, reverse=metric.higher_is_better)


def _mean(standing: MethodStanding) -> float:
    return float("nan") if standing.mean is None else standing.mean


def _told(found: MetricComparison, order: Sequence[MethodStanding], verdict: PairVerdict) -> tuple[str, ...]:
    """Return those of whom that is said against the first: ranks would say so of variants too."""
    pairs = ((m.method, _pair(found, order[0].method, m.method)) for m in order[1:])
    return tuple(method for method, pair in pairs if pair is not None and pair.verdict == verdict)


def _pair(found: MetricComparison, first: str, second: str) -> PairDifference | None:
    return next((p for p in found.pairs if {p.first, p.second} == {first, second}), None)


def _lead(
    metric: MetricRecord,
    first: MethodStanding,
    second: MethodStanding,
    pair: PairDifference | None,
) -> str:
    if pair is None or pair.interval is None:
        return _ahead(metric, _mean(first), _mean(second), second.method)
    low, high = pair.interval
    if (pair.first == first.method) != metric.higher_is_better:  # the one swap that remains of two
        low, high = -high, -low
    interval = f" ({format_value(low, metric.unit)} to {format_value(high, metric.unit)})"
    return _ahead(metric, _mean(first), _mean(second), second.method, interval)


def _ahead(metric: MetricRecord, first: float, second: float, rival: str, interval: str = "") -> str:
    """By how much the first is better than its rival, as a positive number whichever way is better."""
    if first == second:
        return f"level with {rival}"
    unit = " %" if metric.unit.startswith("%") else "" if metric.unit == "1" else f" {metric.unit}"
    return f"{format_value(abs(first - second), metric.unit)}{unit}{interval} ahead of {rival}"


def _evidence(pair: PairDifference, scenes: int) -> str:
    """Return the larger p value of the two tests that must agree, and the number of scenes.

    It is told as it decides, and as it is of this pair alone where that is another number: intervals are of
    pairs alone, and so is what claims come down to.
    """
    infinite = pair.p_mean_corrected is None  # there is no mean then, and ranks alone decide
    decides = _larger(pair.p_rank_holm if infinite else pair.p_rank, pair.p_mean_corrected)
    own = _larger(pair.p_rank, pair.p_mean)
    if decides is None or own is None:
        return f"n = {scenes}"
    told = f"{format_p(decides)} after correction for all pairs"
    if format_p(own) != format_p(decides):
        told += f", {format_p(own).removeprefix('p = ').removeprefix('p ')} for this pair alone"
    return f"{told}, n = {scenes}"


def _larger(*found: float | None) -> float | None:
    return max((p for p in found if p is not None), default=None)


def _list(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"

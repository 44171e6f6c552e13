# SPDX-License-Identifier: Apache-2.0
"""Rows by one metric, two at a time, on the scenes that both have scores of."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import combinations
from typing import NamedTuple

import numpy as np

from graycard.eval.statistics._correction import FAR, correct
from graycard.eval.statistics._interval import LEAST_FOR_INTERVAL, LEVEL, mean_intervals
from graycard.eval.statistics._signed_rank import holm, least_scenes
from graycard.eval.statistics._student import signed_rank_ps, student_test
from graycard.records import PairDifference, PairVerdict

LEAST_SCENES = least_scenes(LEVEL)
"""The fewest scenes with which the rank test of a pair can fall below 0.05: six."""
_AT_A_TIME = 64
"""Pairs whose intervals are made together: always as many, so that a pair has equal bits in every table."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A method's scores by one metric on one track."""

    method: str
    competes: bool
    """True if it was handed nothing beyond the capture."""
    by_scene: Mapping[str, float]
    """Mean over seeds; may be infinite."""
    variant: bool = False
    """True for another row's method with other settings, as an ablation is."""


_Two = tuple[Candidate, Candidate]


def compare_pairs(
    candidates: Sequence[Candidate], higher_is_better: bool, *, intervals: bool = True
) -> tuple[PairDifference, ...]:
    """Return the difference of every two methods that share a scene, the earlier first.

    The correction is over all pairs of methods that compete; apart from them over pairs in which one is a
    variant of another row; and apart over all others. A table with many ablations, or with a row that is
    handed truth, must not cost the methods their evidence. As all pairs count, the best row may be chosen by
    the same scores and compared with each other one.

    Args:
        candidates: One metric on one track.
        higher_is_better: Of that metric.
        intervals: Whether differences get an interval; most of the time goes into them.
    """
    return _compared(list(combinations(candidates, 2)), higher_is_better, intervals)


def compare_against(
    candidates: Sequence[Candidate], row: str, higher_is_better: bool, *, intervals: bool = True
) -> tuple[PairDifference, ...]:
    """Return the difference of each other method less one row that was chosen before the scores were seen.

    The correction is over these comparisons alone, so that it asks for less than :func:`compare_pairs`. The
    families are the same.

    Args:
        candidates: One metric on one track.
        row: Name of the chosen one; a table without it has no comparisons.
        higher_is_better: Of that metric.
        intervals: Whether differences get an interval.
    """
    chosen = [c for c in candidates if c.method == row]
    others = [c for c in candidates if c.method != row]
    return _compared([(other, one) for one in chosen for other in others], higher_is_better, intervals)


class _Tested(NamedTuple):
    """Tests of one pair, as in :class:`PairDifference`."""

    scenes: int
    difference: float | None
    interval: tuple[float, float] | None
    p_rank: float | None
    p_mean: float | None
    p_mean_corrected: float | None
    error: float | None


def _compared(twos: Sequence[_Two], higher_is_better: bool, intervals: bool) -> tuple[PairDifference, ...]:
    differences, known = _differences(twos)
    counts = known.sum(axis=1).tolist()
    families: dict[tuple[str, int], list[int]] = {}
    for i, (two, count) in enumerate(zip(twos, counts, strict=True)):
        if count:
            families.setdefault((_family(*two), count), []).append(i)
    found: dict[int, _Tested] = {}
    for (family, count), members in families.items():
        testable = sum(
            len(own) for (name, n), own in families.items() if name == family and n >= LEAST_SCENES
        )
        values = differences[members][known[members]].reshape(len(members), count).T
        found |= dict(zip(members, _tested(values, max(testable, 1), intervals), strict=True))
    ranks: dict[int, float | None] = {}
    for name in {name for name, _ in families}:
        every = sorted(i for (own, _), members in families.items() if own == name for i in members)
        ranks |= dict(zip(every, holm([found[i].p_rank for i in every]), strict=True))
    return tuple(_judged(twos[i], found[i], ranks[i], higher_is_better) for i in sorted(found))


def _family(first: Candidate, second: Candidate) -> str:
    """Pairs of one family are corrected together."""
    if not (first.competes and second.competes):
        return "handed truth"
    return "variants" if first.variant or second.variant else "methods"


def _differences(twos: Sequence[_Two]) -> tuple[np.ndarray, np.ndarray]:
    """Return first less second by scene, in an order that does not depend on which is first.

    Returns:
        Differences and whether both have a number, each of shape ``(pairs, scenes)``.
    """
    rows = {id(one): one.by_scene for two in twos for one in two}
    scenes = sorted({scene for row in rows.values() for scene in row})
    places = {name: place for place, name in enumerate(rows)}
    values = np.array([[row.get(scene, math.nan) for scene in scenes] for row in rows.values()], np.float64)
    values = values.reshape(len(rows), len(scenes))
    first, second = (values[[places[id(two[side])] for two in twos]] for side in (0, 1))
    with np.errstate(invalid="ignore"):
        apart = np.where(first == second, 0.0, first - second)  # equal infinities have no difference either
    return apart, ~(np.isnan(first) | np.isnan(second))


def _tested(values: np.ndarray, comparisons: int, intervals: bool) -> Iterator[_Tested]:
    """Yield the tests of the pairs of one family and number of scenes; values of shape ``(N, K)``."""
    count, pairs = values.shape
    ranks = signed_rank_ps(values)
    finite = np.isfinite(values).all(axis=0)
    means = np.full((4, pairs), np.nan)
    means[0] = _means(values)
    ends = np.full((2, pairs), np.nan)
    if count >= LEAST_FOR_INTERVAL and finite.any():
        test = student_test(values[:, finite])
        means[:, finite] = test.mean, test.error, test.p, correct(test, comparisons)
        if intervals:
            ends[:, finite] = _intervals(values[:, finite])
    known = [[None if math.isnan(x) else x for x in row] for row in (*means.tolist(), ranks.tolist())]
    spans = [None if math.isnan(low) else (low, high) for low, high in ends.T.tolist()]
    for span, mean, error, p, corrected, p_rank in zip(spans, *known, strict=True):
        yield _Tested(count, mean, span, p_rank, p, corrected, error)


def _means(values: np.ndarray) -> np.ndarray:
    """Return the mean of each column; of both infinities it is not a number."""
    with np.errstate(invalid="ignore"):
        return reduce(np.add, values) / len(values)


def _intervals(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of the intervals of all columns, made of whole batches."""
    count = values.shape[1]
    padded = np.pad(values, ((0, 0), (0, -count % _AT_A_TIME)), mode="edge")
    batches = np.split(padded, padded.shape[1] // _AT_A_TIME, axis=1)
    ends = np.concatenate([np.stack(mean_intervals(batch)) for batch in batches], axis=1)[:, :count]
    return ends[0], ends[1]


def _judged(two: _Two, found: _Tested, p_rank_holm: float | None, higher_is_better: bool) -> PairDifference:
    first, second = two
    return PairDifference(
        first.method,
        second.method,
        found.scenes,
        found.difference,
        found.interval,
        found.p_rank,
        p_rank_holm,
        found.p_mean,
        found.p_mean_corrected,
        _verdict(found, p_rank_holm, higher_is_better),
        found.error,
    )


def _verdict(pair: _Tested, p_rank_holm: float | None, higher_is_better: bool) -> PairVerdict:
    if pair.scenes < LEAST_SCENES:
        return "too few scenes"
    if pair.difference is None or not _told_apart(pair, p_rank_holm):
        return "too few scenes" if _is_far(pair) else "tie"
    return "better" if (pair.difference > 0) is higher_is_better else "worse"


def _is_far(pair: _Tested) -> bool:
    """Return true for a gap that is no tie, though too few scenes tell it from chance among so many pairs."""
    if not pair.difference or pair.p_rank is None or pair.p_rank >= 1 - LEVEL:
        return False
    gap = abs(pair.difference) * (1 + 1e-9)  # ten of them, up to rounding
    return math.isinf(gap) if pair.error is None else gap >= FAR * pair.error


def _told_apart(pair: _Tested, p_rank_holm: float | None) -> bool:
    if pair.p_rank is None or p_rank_holm is None:  # equal on every scene
        return False
    if pair.p_mean_corrected is None:  # infinite scores have no mean to test
        return p_rank_holm < 1 - LEVEL
    return pair.p_rank < 1 - LEVEL and pair.p_mean_corrected < 1 - LEVEL

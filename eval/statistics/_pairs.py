# SPDX-License-Identifier: Apache-2.0
"""Every two methods by one metric, on the scenes that both have scores of."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from graycard.eval.statistics._interval import LEVEL, mean_interval, mean_p
from graycard.eval.statistics._signed_rank import holm, least_scenes, signed_rank_p
from graycard.records import PairDifference, PairVerdict

LEAST_SCENES = least_scenes(LEVEL)
"""The fewest scenes with which the rank test of a pair can fall below 0.05: six."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A method's scores by one metric on one track."""

    method: str
    competes: bool
    """Whether it was handed nothing beyond the capture."""
    by_scene: Mapping[str, float]
    """Mean over seeds; may be infinite."""
    variant: bool = False
    """Whether it is another row of the table with other settings, as an ablation is."""


def compare_pairs(candidates: Sequence[Candidate], higher_is_better: bool) -> tuple[PairDifference, ...]:
    """Every two methods that share a scene, the earlier first.

    Holm's correction is over all pairs of methods that compete; apart from them over pairs in which one is a
    variant of another row; and apart over all others. A table with many ablations, or with a row that is
    handed truth, must not cost the methods their evidence.

    Args:
        candidates: One metric on one track.
        higher_is_better: Of that metric.
    """
    both = [(a, b) for a, b in combinations(candidates, 2) if a.by_scene.keys() & b.by_scene.keys()]
    pairs = [_difference(a, b) for a, b in both]
    families = [_family(a, b) for a, b in both]
    for family in sorted(set(families)):
        members = [i for i, own in enumerate(families) if own == family]
        for i, corrected in zip(members, _corrected([pairs[i] for i in members]), strict=True):
            pairs[i] = replace(corrected, verdict=_verdict(corrected, higher_is_better))
    return tuple(pairs)


def _family(first: Candidate, second: Candidate) -> str:
    """Pairs of one family are corrected together."""
    if not (first.competes and second.competes):
        return "handed truth"
    return "variants" if first.variant or second.variant else "methods"


def _difference(first: Candidate, second: Candidate) -> PairDifference:
    common = [scene for scene in first.by_scene if scene in second.by_scene]
    values = np.array([_less(first.by_scene[s], second.by_scene[s]) for s in common])
    opposed = np.isposinf(values).any() and np.isneginf(values).any()
    return PairDifference(
        first.method,
        second.method,
        len(values),
        difference=None if opposed else float(values.mean()),
        interval=mean_interval(values),
        p_rank=signed_rank_p(values),
        p_rank_holm=None,
        p_mean=mean_p(values),
        p_mean_holm=None,
        verdict="tie",
    )


def _less(value: float, other: float) -> float:
    """Their difference; equal infinities have none."""
    return 0.0 if value == other else value - other


def _corrected(pairs: Sequence[PairDifference]) -> list[PairDifference]:
    ranks, means = holm([p.p_rank for p in pairs]), holm([p.p_mean for p in pairs])
    return [replace(p, p_rank_holm=r, p_mean_holm=m) for p, r, m in zip(pairs, ranks, means, strict=True)]


def _verdict(pair: PairDifference, higher_is_better: bool) -> PairVerdict:
    if pair.scenes < LEAST_SCENES:
        return "too few scenes"
    if pair.difference is None or not _told_apart(pair):
        return "tie"
    return "better" if (pair.difference > 0) is higher_is_better else "worse"


def _told_apart(pair: PairDifference) -> bool:
    if pair.p_rank is None or pair.p_rank_holm is None:  # equal on every scene
        return False
    if pair.p_mean_holm is None:  # infinite scores have no mean to test
        return pair.p_rank_holm < 1 - LEVEL
    return pair.p_rank < 1 - LEVEL and pair.p_mean_holm < 1 - LEVEL

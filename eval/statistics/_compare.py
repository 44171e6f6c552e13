# SPDX-License-Identifier: Apache-2.0
"""All that the score sheets of a run say about which method is better."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from graycard.eval.scoring._ceiling import MARGINS, excess, is_suspicious
from graycard.eval.statistics._correction import FAR, MARGIN
from graycard.eval.statistics._interval import LEVEL, mean_interval
from graycard.eval.statistics._pairs import LEAST_SCENES, Candidate, compare_against, compare_pairs
from graycard.eval.statistics._ranks import rank_groups
from graycard.eval.statistics._variance import split_variance
from graycard.records import (
    AboveCeiling,
    Comparison,
    Job,
    MethodRecord,
    MethodStanding,
    MetricComparison,
    MetricRecord,
    PairDifference,
    RunRecord,
    Score,
)

RULE = (
    f"Means are over scenes, intervals hold {LEVEL:.0%} of the time for scenes like these. One method is "
    "better than another if two tests of their differences scene by scene agree. The exact Wilcoxon "
    f"signed-rank test has p < {1 - LEVEL:.2g}, for which at least {LEAST_SCENES} scenes are needed. "
    f"Student's test of the mean difference has p < {1 - LEVEL:.2g} after Šidák's correction over all pairs "
    f"of the table, times {MARGIN:g} as differences may be skewed. Else they are tied: these scenes do not "
    "say which is better, which does not mean that the methods are equal. A difference of "
    f"{FAR:g} standard errors or more is never called a tie: among very many pairs it may need more scenes. "
    "Variants of a method and rows that are handed truth are corrected apart. Rank 1 is the best mean and "
    "all methods that are not told from it, rank 2 the best of the rest and all not told from that, and so "
    "on; only methods that have a score of every scene and were handed nothing beyond the capture but "
    "priors, which their rows name, are ranked."
)


def _rule(against: str) -> str:
    """Return how verdicts are come by, of a chosen row as well."""
    if not against:
        return RULE
    return (
        f"{RULE} Verdicts against {against!r}, which was chosen before the scores were seen, stand apart: "
        "their correction is over the comparisons with that row alone, not over all pairs."
    )


@dataclass(frozen=True, slots=True)
class _Row:
    """A method's scores by one metric on one track."""

    method: MethodRecord
    values: Mapping[str, Sequence[float]]
    """By scene: one for each seed, where every seed has a score."""
    ceilings: Mapping[str, float | None] = field(default_factory=dict)
    """By scene: the mean over seeds."""

    @property
    def by_scene(self) -> dict[str, float]:
        """Mean over seeds."""
        return {scene: _mean(values) for scene, values in self.values.items()}


@dataclass(frozen=True, slots=True)
class Question:
    """The part of a comparison that is asked for."""

    metrics: Collection[str] | None = None
    """Ids; None for all of the run."""
    against: str = ""
    """Row that each other one is compared with; it was chosen before the scores were seen."""
    pair_intervals: bool = True
    """True where the difference of every two rows gets an interval; nearly all of the time goes into them."""


def compare_run(run: RunRecord, question: Question | None = None) -> Comparison:
    """Return standings, pairs and ranks of every track and metric; a pure function of the record.

    Args:
        run: Its score sheets are read, and nothing else on disk.
        question: The whole comparison, as ``comparison.json`` holds it, by default.
    """
    asked = question or Question()
    tracks = dict.fromkeys(result.job.track for result in run.results)
    metrics = [m for m in run.metrics if asked.metrics is None or m.id in asked.metrics]
    tables = [_table(run, track, metric, asked) for track in tracks for metric in metrics]
    return Comparison(
        run.suite,
        run.suite_version,
        LEVEL,
        LEAST_SCENES,
        MARGINS,
        _rule(asked.against),
        tuple(table for table in tables if table is not None),
        tuple(_above_ceiling(run)),
        asked.against,
    )


def _table(run: RunRecord, track: str, metric: MetricRecord, asked: Question) -> MetricComparison | None:
    """Return one metric on one track; None where no scene of the track has it."""
    readings = _readings(run, track, metric.id)
    scenes = {scene for scene, _ in readings}
    if not any(score.value is not None for scores in readings.values() for score in scores if score):
        return None
    present = {result.job.method for result in run.results if result.job.track == track}
    rows = [_row(method, readings) for method in run.methods if method.name in present]
    candidates = _candidates(rows, run.variants_on(track))
    pairs = compare_pairs(candidates, metric.higher_is_better, intervals=asked.pair_intervals)
    against = compare_against(candidates, asked.against, metric.higher_is_better)
    ranks = _ranks(candidates, pairs, len(scenes), metric.higher_is_better)
    standings = tuple(_standing(row, len(scenes), ranks.get(row.method.name)) for row in rows)
    return MetricComparison(track, metric.id, standings, pairs, against)


def _candidates(rows: Sequence[_Row], variants: Collection[str]) -> list[Candidate]:
    return [Candidate(r.method.name, not r.method.sees, r.by_scene, r.method.name in variants) for r in rows]


_Readings = Mapping[tuple[str, str], Sequence[Score | None]]
"""By scene and method: a score for each seed, None for a job without."""


def _readings(run: RunRecord, track: str, metric: str) -> _Readings:
    """The scores of a metric on the scenes that have it; a job that failed has none of them."""
    results = [result for result in run.results if result.job.track == track]
    found: dict[tuple[str, str], list[Score | None]] = {}
    for result in results:
        scores = result.sheet.scores if result.sheet else ()
        score = next((s for s in scores if s.metric == metric), None)
        found.setdefault((result.job.scene, result.job.method), []).append(score)
    having = {scene for (scene, _), scores in found.items() if any(scores)}
    return {key: scores for key, scores in found.items() if key[0] in having}


def _row(method: MethodRecord, readings: _Readings) -> _Row:
    own = {scene: scores for (scene, name), scores in readings.items() if name == method.name}
    values = {scene: [_value(score) for score in scores] for scene, scores in own.items()}
    whole = {
        scene: [v for v in found if v is not None] for scene, found in values.items() if None not in found
    }
    return _Row(method, whole, {scene: _ceiling(own[scene]) for scene in whole})


def _value(score: Score | None) -> float | None:
    if score is None or score.status != "scored" or score.value is None or math.isnan(score.value):
        return None
    return score.value


def _ceiling(scores: Sequence[Score | None]) -> float | None:
    found = [score.noise_ceiling for score in scores if score]
    known = [ceiling for ceiling in found if ceiling is not None]
    return _mean(known) if known and len(known) == len(found) else None


def _standing(row: _Row, expected: int, rank: int | None) -> MethodStanding:
    means, ceilings = list(row.by_scene.values()), list(row.ceilings.values())
    known = [ceiling for ceiling in ceilings if ceiling is not None]
    split = split_variance(list(row.values.values()))
    mean = _mean(means) if means else math.nan
    return MethodStanding(
        row.method.name,
        competes=not row.method.sees,
        scenes=len(means),
        expected=expected,
        seeds=min((len(v) for v in row.values.values()), default=0),
        mean=None if math.isnan(mean) else mean,
        interval=mean_interval(means),
        scene_sd=split.scene_sd,
        seed_sd=split.seed_sd,
        ceiling=_mean(known) if known and len(known) == len(ceilings) else None,
        rank=rank,
    )


def _ranks(
    candidates: Sequence[Candidate],
    pairs: Sequence[PairDifference],
    scenes: int,
    higher_is_better: bool,
) -> dict[str, int]:
    """Groups of the methods that compete and have a score of every scene."""
    means = {c.method: _mean(list(c.by_scene.values())) for c in candidates if len(c.by_scene) == scenes}
    ranked = [c.method for c in candidates if c.competes and not math.isnan(means.get(c.method, math.nan))]
    ranked.sort(key=lambda method: -means[method] if higher_is_better else means[method])
    won = {(p.first, p.second) for p in pairs if p.verdict == "better"}
    won |= {(p.second, p.first) for p in pairs if p.verdict == "worse"}
    return rank_groups(ranked, lambda first, second: (first, second) in won)


def _above_ceiling(run: RunRecord) -> list[AboveCeiling]:
    privileged = {method.name: method.sees for method in run.methods}
    return [
        found
        for result in run.results
        for score in (result.sheet.scores if result.sheet else ())
        if (found := _too_good(result.job, score, privileged.get(result.job.method, ())))
    ]


def _too_good(job: Job, score: Score, told: tuple[str, ...]) -> AboveCeiling | None:
    """Return a score that is better than its noise ceiling by more than chance does it."""
    value, ceiling = score.value, score.noise_ceiling
    if value is None or ceiling is None:
        return None
    above = excess(value, ceiling, score.higher_is_better)
    if not is_suspicious(above, score.unit):
        return None
    return AboveCeiling(
        job.track, job.scene, job.method, job.seed, score.metric, value, ceiling, above, score.unit, told
    )


def _mean(values: Sequence[float]) -> float:
    """Mean of finite and infinite numbers; of both infinities it is not a number."""
    with np.errstate(invalid="ignore"):
        return float(np.mean(values))

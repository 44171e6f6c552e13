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
    JobResult,
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
    by_scene: Mapping[str, float]
    """The same, the mean over seeds."""
    ceilings: Mapping[str, float | None] = field(default_factory=dict)
    """By scene: the mean over seeds."""


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
    by_track: dict[str, list[JobResult]] = {}
    for result in run.results:
        by_track.setdefault(result.job.track, []).append(result)
    metrics = [m for m in run.metrics if asked.metrics is None or m.id in asked.metrics]
    tracks = [_Track(run, name, results) for name, results in by_track.items()]
    tables = [_table(track, metric, asked) for track in tracks for metric in metrics]
    return Comparison(
        run.suite,
        run.suite_version,
        LEVEL,
        LEAST_SCENES,
        MARGINS,
        _rule(asked.against),
        tuple(table for table in tables if table is not None),
        tuple(above_ceiling(run)),
        asked.against,
    )


def compare_first_look(run: RunRecord, question: Question | None = None) -> Comparison:
    """Return the comparison that stands beside a run: of the scenes that it began with.

    Scenes that later looks added have the rows of undecided claims alone, and were added for what was seen.

    Args:
        run: As of :func:`compare_run`.
        question: As of :func:`compare_run`.
    """
    return compare_run(run.at_look(0), question)


class _Track:
    """The results of a track, sorted once for all its metrics."""

    def __init__(self, run: RunRecord, name: str, results: Sequence[JobResult]) -> None:
        self.name = name
        self.variants = run.variants_on(name)
        self.jobs: dict[str, dict[str, list[JobResult]]] = {}
        """By method and scene: one for each seed."""
        for result in results:
            by_scene = self.jobs.setdefault(result.job.method, {})
            by_scene.setdefault(result.job.scene, []).append(result)
        self.methods = [method for method in run.methods if method.name in self.jobs]


def _table(track: _Track, metric: MetricRecord, asked: Question) -> MetricComparison | None:
    """Return one metric on one track; None where no scene of the track has it."""
    readings = _readings(track, metric.id)
    scenes = {scene for own in readings.values() for scene in own}
    every = (score for own in readings.values() for scores in own.values() for score in scores)
    if not any(score.value is not None for score in every if score):
        return None
    rows = [_row(method, readings[method.name]) for method in track.methods]
    candidates = _candidates(rows, track.variants)
    pairs = compare_pairs(candidates, metric.higher_is_better, intervals=asked.pair_intervals)
    against = compare_against(candidates, asked.against, metric.higher_is_better)
    ranks = _ranks(candidates, pairs, len(scenes), metric.higher_is_better)
    standings = tuple(_standing(row, len(scenes), ranks.get(row.method.name)) for row in rows)
    return MetricComparison(track.name, metric.id, standings, pairs, against)


def _candidates(rows: Sequence[_Row], variants: Collection[str]) -> list[Candidate]:
    return [Candidate(r.method.name, not r.method.sees, r.by_scene, r.method.name in variants) for r in rows]


_Scores = Mapping[str, Sequence[Score | None]]
"""By scene: a score for each seed, None for a job without."""


def _readings(track: _Track, metric: str) -> dict[str, _Scores]:
    """Return the scores of a metric by method, on the scenes that have it; a job that failed has none of
    them.
    """
    found = {
        method: {scene: [_score(result, metric) for result in results] for scene, results in jobs.items()}
        for method, jobs in track.jobs.items()
    }
    having = {scene for own in found.values() for scene, scores in own.items() if any(scores)}
    return {
        method: {scene: scores for scene, scores in own.items() if scene in having}
        for method, own in found.items()
    }


def _score(result: JobResult, metric: str) -> Score | None:
    return result.sheet.by_metric.get(metric) if result.sheet else None


def _row(method: MethodRecord, own: _Scores) -> _Row:
    values = {scene: [_value(score) for score in scores] for scene, scores in own.items()}
    whole = {
        scene: [v for v in found if v is not None] for scene, found in values.items() if None not in found
    }
    means = {scene: _mean(found) for scene, found in whole.items()}
    return _Row(method, whole, means, {scene: _ceiling(own[scene]) for scene in whole})


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
    """Return groups of the methods that compete and have a score of every scene."""
    means = {c.method: _mean(list(c.by_scene.values())) for c in candidates if len(c.by_scene) == scenes}
    ranked = [c.method for c in candidates if c.competes and not math.isnan(means.get(c.method, math.nan))]
    ranked.sort(key=lambda method: -means[method] if higher_is_better else means[method])
    won = {(p.first, p.second) for p in pairs if p.verdict == "better"}
    won |= {(p.second, p.first) for p in pairs if p.verdict == "worse"}
    return rank_groups(ranked, lambda first, second: (first, second) in won)


def above_ceiling(run: RunRecord) -> list[AboveCeiling]:
    """Return the scores of a run that are better than the noise of the truth allows, in its order."""
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
    if len(values) == 1:
        return float(values[0])
    with np.errstate(invalid="ignore"):
        return float(np.mean(values))

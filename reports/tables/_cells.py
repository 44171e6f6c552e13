# SPDX-License-Identifier: Apache-2.0
"""Contents of one cell of a table of scores, pooled from the readings of one or more jobs."""

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from graycard.records import JobResult, Score
from graycard.reports._format import format_name, format_value
from graycard.reports._scores import find_score
from graycard.reports.tables._intervals import IntervalPlot
from graycard.reports.tables._unpaired import Unpaired, unpaired_lights, unpaired_words

CellStatus = Literal["scored", "failed", "not provided", "not run"]


@dataclass(frozen=True, slots=True)
class Reading:
    """Statement of one job about one metric."""

    scene: str
    status: CellStatus
    value: float | None = None
    noise_ceiling: float | None = None
    gauge: tuple[float, ...] | None = None
    interval: tuple[float, float] | None = None
    reason: str = ""
    breakdown: Mapping[str, float] = field(default_factory=dict)
    unpaired: Unpaired | None = None
    """Lights without a partner that enter the value; None where none can."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One cell: a value, a failure, or a quiet dash."""

    status: CellStatus
    text: str
    value: float | None = None
    notes: tuple[str, ...] = ()
    """Small lines below the value."""
    reason: str = ""
    complete: bool = False
    """True if every job that should be in the mean is in it: only then may it be compared."""
    best: bool = False
    plot: IntervalPlot | None = None
    """Plot of the mean with its interval; None where scores of one scene stand."""
    lacks: tuple[str, ...] = ()
    """Those notes that say which jobs or scenes are not in the mean; empty where all are."""
    interval: tuple[str, str] | None = None
    """The ends of its 95 % interval; None where there is none."""
    unpaired: str = ""
    """Lights without a partner in words, which weigh in the value; empty where all have one."""
    standing: str = ""
    """The note that says who leads, and who is tied with whom; empty where it concerns other methods."""
    price: str = ""
    """By how much a light without a partner weighs."""


def read_metric(result: JobResult, metric: str) -> Reading:
    """Read the score of a job by a metric; a failed job failed in each."""
    scene = result.job.scene
    if result.sheet is None:
        return Reading(scene, "failed", reason=result.reason or "expected scores of this job, got none")
    score = find_score(result, metric)
    if score is None:
        return Reading(scene, "not provided", reason="this scene has no such score")
    return replace(_reading_of(scene, score), unpaired=unpaired_lights(result, score))


def pool(readings: Sequence[Reading], unit: str, detailed: bool = False) -> Cell:
    """One cell from the readings of one method: the mean over seeds, then over scenes.

    What failed is counted, never left out silently and never replaced by a number.

    Args:
        readings: One for each job of the method.
        unit: Of the metric.
        detailed: Also note the gauge and interval, where there is a single reading.
    """
    if not readings:
        return Cell("not run", "–", reason="not run here")
    scored = [r for r in readings if r.status == "scored"]
    failed = [r for r in readings if r.status == "failed"]
    if scored:
        return _scored_cell(scored, len(readings), unit, detailed)
    if failed:
        part = f"{len(failed)} of {len(readings)}" if len(failed) < len(readings) else ""
        return Cell("failed", "failed", notes=(part,) if part else (), reason=failed[0].reason)
    return Cell("not provided", "–", reason="not provided")


def breakdown_text(readings: Sequence[Reading], unit: str) -> str:
    """Return the same number by neighbouring rules, the mean over seeds, then scenes; empty where there are
    none.

    A rule enters if every reading has it: another mean would be over other scenes.
    """
    scored = [r for r in readings if r.status == "scored"]
    rules = dict.fromkeys(rule for r in scored for rule in r.breakdown)
    means = {
        rule: mean_over_scenes((r.scene, r.breakdown[rule]) for r in scored)
        for rule in rules
        if all(rule in r.breakdown for r in scored)
    }
    return ", ".join(f"{format_name(rule).lower()} {format_value(m, unit)}" for rule, m in means.items())


def mean_over_scenes(values: Iterable[tuple[str, float]]) -> float:
    """Mean of the scene values, each the mean over its seeds; of pairs of scene and value."""
    by_scene: dict[str, list[float]] = defaultdict(list)
    for scene, value in values:
        by_scene[scene].append(value)
    return _mean([_mean(found) for found in by_scene.values()])


def _reading_of(scene: str, score: Score) -> Reading:
    if score.status == "scored" and (score.value is None or math.isnan(score.value)):
        return Reading(scene, "failed", reason=f"expected a value of {score.metric}, got {score.value}")
    return Reading(
        scene,
        score.status,
        score.value,
        score.noise_ceiling,
        score.gauge,
        score.interval,
        score.reason,
        score.breakdown,
    )


def _scored_cell(scored: Sequence[Reading], expected: int, unit: str, detailed: bool) -> Cell:
    value = mean_over_scenes((r.scene, r.value) for r in scored if r.value is not None)
    lacks = (f"{len(scored)} of {expected} scored",) if len(scored) < expected else ()
    details = _details(scored[0], unit) if detailed and expected == 1 else ()
    ends = scored[0].interval if expected == 1 else None
    found = [(r.scene, r.unpaired) for r in scored if r.unpaired is not None]
    unpaired = unpaired_words(found, unit, mean_over_scenes)
    return Cell(
        "scored",
        format_value(value, unit),
        value,
        (*lacks, *([unpaired] if unpaired else []), *_ceiling(scored, unit), *details),
        complete=not lacks,
        lacks=lacks,
        interval=None if ends is None else (format_value(ends[0], unit), format_value(ends[1], unit)),
        unpaired=unpaired,
        price=found[0][1].hint if unpaired else "",
    )


def _ceiling(scored: Sequence[Reading], unit: str) -> tuple[str, ...]:
    ceilings = [(r.scene, r.noise_ceiling) for r in scored if r.noise_ceiling is not None]
    if len(ceilings) < len(scored):
        return ()
    return (f"ceiling {format_value(mean_over_scenes(ceilings), unit)}",)


def _details(reading: Reading, unit: str) -> tuple[str, ...]:
    notes = []
    if reading.interval is not None:
        low, high = (format_value(end, unit) for end in reading.interval)
        notes.append(f"95 %: {low} to {high}")
    if reading.gauge is not None:
        notes.append("gauge " + " ".join(f"{g:.3g}" for g in reading.gauge))
    return tuple(notes)


def _mean(values: Sequence[float]) -> float:
    """Mean of finite and infinite numbers; of both infinities nan, as it should be."""
    return sum(values) / len(values)

# SPDX-License-Identifier: Apache-2.0
"""The numbers of a run that claims are about: one for each row and scene, the mean over seeds."""

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from graycard import RecordError
from graycard.benchmarks.claims._claim import Quantity, Scenes
from graycard.records import JobResult, MetricRecord, RunRecord, SceneRecord, Score

COSTS = {
    "cost.wall_s": MetricRecord(
        "cost.wall_s", "Time of the fit", "cost", "s", False, 0.0, "wall clock", False, 0.0
    ),
    "cost.peak_memory_mib": MetricRecord(
        "cost.peak_memory_mib", "Peak memory", "cost", "MiB", False, 0.0, "of the process", False, 0.0
    ),
}
"""Values of a fit besides its scores."""
COUNT = "count."
"""Prefix of ids of counts."""


@dataclass(frozen=True, slots=True)
class Reading:
    """A row on a scene."""

    value: float | None
    """None where there is none."""
    reason: str = ""
    """Why."""
    absent: bool = False
    """True if the scene has no such quantity, rather than the row having failed to give it."""
    ceiling: float | None = None
    """Score without any error where the truth is noisy; None where that is not known."""


class Readings:
    """A run as a table of rows, scenes and quantities."""

    def __init__(self, run: RunRecord) -> None:
        self._metrics = {metric.id: metric for metric in run.metrics}
        self._scenes = run.scenes
        self.suite = run.suite
        self.size = run.size
        self.rows = {method.name for method in run.methods}
        self._entries = {method.name: method.entry or method.name for method in run.methods}
        self._settings = {result.job.method: result.job.settings for result in run.results}
        self._priors = {result.job.method: result.job.priors for result in run.results}
        self._results: dict[tuple[str, str, str], list[JobResult]] = defaultdict(list)
        for result in run.results:
            self._results[result.job.track, result.job.scene, result.job.method].append(result)

    def scenes(self, track: str, wanted: Scenes) -> list[SceneRecord]:
        """Return the scenes of a track that a check is about.

        Raises:
            RecordError: It is about knobs, and the run does not tell them.
        """
        here = [s for s in self._scenes if s.track == track]
        here = [s for s in here if not wanted.families or s.family in wanted.families]
        return [
            s for s in here if all(low <= knob_of(s, k) <= high for k, (low, high) in wanted.knobs.items())
        ]

    def record(self, quantity: Quantity) -> MetricRecord:
        """Meaning of a quantity; direction and unit are those of its metric.

        Raises:
            RecordError: The run has no such metric.
        """
        if quantity.metric.startswith(COUNT):
            name = quantity.metric.removeprefix(COUNT)
            return MetricRecord(
                quantity.metric, f"{name.capitalize()} a picture", "cost", "count", False, 0.0, "", False, 0.0
            )
        if quantity.protocol:
            return self._protocol(quantity)
        for name in filter(None, (quantity.metric, quantity.less)):
            if name not in self._metrics | COSTS:
                raise RecordError(f"the run has no metric {name}")
        return (self._metrics | COSTS)[quantity.metric]

    def _protocol(self, quantity: Quantity) -> MetricRecord:
        """Descriptions of scores by a published protocol."""
        sheets = [r.sheet for results in self._results.values() for r in results if r.sheet]
        for score in (s for sheet in sheets for s in sheet.protocols):
            if score.protocol == quantity.protocol:
                facts = score.unit, score.higher_is_better, score.optimum
                return MetricRecord(quantity.protocol, quantity.metric, "albedo", *facts, "", False, 0.0)
        raise RecordError(f"the run has no score by the protocol {quantity.protocol}")

    def value(self, row: str, scene: SceneRecord, quantity: Quantity) -> Reading:
        """Return a row on a scene: the mean over seeds, each of which must have a value."""
        readings = self.by_seed(row, scene, quantity)
        lacking = [reading for reading in readings if reading.value is None]
        if lacking:
            return lacking[0]
        mean = math.fsum(r.value for r in readings if r.value is not None) / len(readings)
        return Reading(
            mean, ceiling=readings[0].ceiling
        )  # of the scene's noise, whatever the seed of the fit

    def by_seed(self, row: str, scene: SceneRecord, quantity: Quantity) -> list[Reading]:
        """Return a row on a scene with each seed of the fit, in the order of the seeds."""
        results = self._results.get((scene.track, scene.scene, row), [])
        if not results:
            return [Reading(None, f"was not run on {scene.scene}")]
        return [_read(result, quantity) for result in sorted(results, key=lambda r: r.job.seed)]

    def settings(self, row: str) -> Mapping[str, Any]:
        """Return the settings of a row's fits; empty for one that nobody ran."""
        return self._settings.get(row, {})

    def priors(self, row: str) -> Mapping[str, Any]:
        """Return the source of a row's priors; empty for one that asks for none."""
        return self._priors.get(row, {})

    def entry(self, row: str) -> str:
        """Return what was loaded for a row: the name of a method."""
        return self._entries.get(row, row)

    def missing_rows(self, rows: Iterable[str]) -> list[str]:
        """Rows that the run does not have."""
        return [row for row in dict.fromkeys(rows) if row not in self.rows]


def knob_of(scene: SceneRecord, knob: str) -> float:
    """Return the value of a knob of a scene.

    Raises:
        RecordError: The record does not tell it, or it is no number.
    """
    value: Any = scene.knobs.get(knob)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise RecordError(f"the run does not tell the knob {knob} of {scene.scene}")
    return float(value)


def _read(result: JobResult, quantity: Quantity) -> Reading:
    if result.status == "failed" or result.sheet is None:
        return Reading(None, f"failed on {result.job.scene}: {result.reason or 'no reason given'}")
    if quantity.metric in COSTS or quantity.metric.startswith(COUNT):
        return _cost(result, quantity.metric)
    first = _score(result, quantity.protocol or quantity.metric, quantity.part, bool(quantity.protocol))
    if first.value is None or not quantity.less:
        return first
    second = _score(result, quantity.less, "", published=False)
    if second.value is None:
        return second
    if math.isinf(first.value) and math.isinf(second.value):
        return Reading(None, "has no error, and so no difference")
    return Reading(first.value - second.value)


def _score(result: JobResult, name: str, part: str, published: bool) -> Reading:
    assert result.sheet is not None, "the caller looked"
    scores: Sequence[Score] = result.sheet.protocols if published else result.sheet.scores
    score = next((s for s in scores if name == (s.protocol if published else s.metric)), None)
    if score is None:
        return Reading(None, f"has no {name} on {result.job.scene}", absent=True)
    if score.status == "scored" and (score.value is None or math.isnan(score.value)):
        return Reading(None, f"gave no number for {name} on {result.job.scene}")
    if score.status != "scored" or score.value is None:
        why = f" ({score.reason})" if score.reason else ""
        return Reading(None, f"{name} {score.status} on {result.job.scene}{why}")
    if not part:
        return Reading(score.value, ceiling=score.noise_ceiling)
    return _part(score.breakdown, name, part, result.job.scene)


def _part(breakdown: Mapping[str, float], name: str, part: str, scene: str) -> Reading:
    if part not in breakdown:
        return Reading(None, f"{name} has no part {part} on {scene}")
    return Reading(breakdown[part])


def _cost(result: JobResult, name: str) -> Reading:
    cost, scene = result.cost, result.job.scene
    if cost is None:
        return Reading(None, f"cost was not measured on {scene}")
    if name in COSTS:
        return Reading(float(getattr(cost, name.removeprefix("cost."))))
    count = cost.counts.get(name.removeprefix(COUNT))
    return Reading(None, f"counts no {name.removeprefix(COUNT)}") if count is None else Reading(float(count))

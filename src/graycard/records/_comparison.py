# SPDX-License-Identifier: Apache-2.0
"""Comparison of methods by the scores of a run: means with intervals, differences, ties, scores too good."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from graycard._errors import OlderRecordError, RecordError
from graycard.io import Label, Name, read_json
from graycard.records._run import read_record

COMPARISON = "comparison.json"
"""Beside ``run.json``; made from it alone."""
COMPARISON_VERSION = 3

PairVerdict = Literal["better", "worse", "tie", "too few scenes"]
"""Verdict on the first method of a pair against the second. A tie says that these scenes do not tell which is
better. Too few scenes says that so few cannot tell, or not among so many pairs."""


@dataclass(frozen=True, slots=True)
class MethodStanding:
    """One method by one metric on one track."""

    method: Label
    competes: bool
    """True if it was handed nothing beyond the capture; only such methods are ranked."""
    scenes: int
    """Number of scenes in the mean: those with a score from every seed."""
    expected: int
    """Number of scenes of the track that have this metric."""
    seeds: int
    """Number of fits of one scene with different seeds; the least over its scenes."""
    mean: float | None
    """Mean over scenes of the mean over seeds, in the metric's unit; None where no scene is scored."""
    interval: tuple[float, float] | None = None
    """95 % interval of the mean over scenes like these; None for fewer than 3 scenes or infinite values."""
    scene_sd: float | None = None
    """Standard deviation between scenes, that of seeds taken off; None for fewer than 2 scenes."""
    seed_sd: float | None = None
    """Standard deviation between fits of one scene; None where each scene was fitted once."""
    ceiling: float | None = None
    """Mean over its scenes of the best value that the truth's noise allows; None where truth is exact."""
    rank: int | None = None
    """Group of methods that cannot be told from the best of the group, 1 for the best; None for a method
    that does not compete or lacks a scene."""


@dataclass(frozen=True, slots=True)
class PairDifference:
    """Two methods by one metric, on the scenes that both have scores of."""

    first: Label
    second: Label
    scenes: int
    difference: float | None
    """Mean over scenes of first less second, in the metric's unit, whichever way is better."""
    interval: tuple[float, float] | None
    """95 % interval of that mean, for this pair alone; None as for a single method."""
    p_rank: float | None
    """Exact two-sided Wilcoxon signed-rank test; None where no scene differs, or there is none."""
    p_rank_holm: float | None
    """The same after Holm's correction over the compared pairs."""
    p_mean: float | None
    """Student's test of that mean, of this pair alone; None for fewer than 3 scenes or infinite values."""
    p_mean_corrected: float | None
    """The same after Šidák's correction over the compared pairs and the margin for skewed differences."""
    verdict: PairVerdict
    error: float | None = None
    """Standard error of the mean difference; None where there is no test of it."""


@dataclass(frozen=True, slots=True)
class MetricComparison:
    """All methods by one metric on one track."""

    track: Name
    metric: Label
    methods: tuple[MethodStanding, ...]
    """In the order of the run."""
    pairs: tuple[PairDifference, ...]
    """Every two of the methods that share a scene, the earlier first."""
    against: tuple[PairDifference, ...] = ()
    """Each other method less the one that was chosen; empty where none was."""


@dataclass(frozen=True, slots=True)
class AboveCeiling:
    """A score better than the noise of the truth allows: the prediction holds that very noise."""

    track: Name
    scene: Name
    method: Label
    seed: int
    metric: Label
    value: float
    ceiling: float
    excess: float
    """By how much it is better, in the metric's unit; more than the margin of that unit."""
    unit: str
    """The metric's."""
    handed: tuple[str, ...]
    """Names of all that the method was handed beyond the capture; where it is empty, truth has leaked."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """All that a run says about which method is better: ``comparison.json``."""

    suite: Name
    suite_version: int
    level: float
    """Level of all intervals, as in 0.95."""
    least_scenes: int
    """The fewest scenes with which the rank test of one pair can fall below 1 - level."""
    margins: Mapping[str, float]
    """By unit: how much above the ceiling is still put down to chance."""
    rule: str
    """Rule of verdicts and ranks, in words for a reader."""
    metrics: tuple[MetricComparison, ...]
    above_ceiling: tuple[AboveCeiling, ...] = ()
    against: str = ""
    """Row that was chosen, for each other row to be compared with; empty for none."""
    format: str = "graycard-comparison"
    format_version: int = COMPARISON_VERSION

    def find(self, track: str, metric: str) -> MetricComparison:
        """Return the methods by a metric on a track.

        Raises:
            RecordError: The run has no such scores.
        """
        for found in self.metrics:
            if (found.track, found.metric) == (track, metric):
                return found
        raise RecordError(f"expected a track and metric of this comparison, got {track!r}, {metric!r}")


def read_comparison(run: Path) -> Comparison | None:
    """Return the comparison in a run folder; None where an older graycard wrote none.

    Raises:
        OlderRecordError: It is of an older version of the format.
        RecordError: It is damaged, misspelt, or of a newer version.
    """
    path = Path(run) / COMPARISON
    if not path.is_file():
        return None
    data = read_json(path)
    version = data.get("format_version") if isinstance(data, dict) else None
    if isinstance(version, int) and version < COMPARISON_VERSION:
        raise OlderRecordError(
            f"expected {path} of format version {COMPARISON_VERSION}, got version {version} of an older "
            "graycard. Run `graycard bench` again: it fits nothing anew"
        )
    return read_record(Comparison, path, "graycard-comparison", COMPARISON_VERSION)

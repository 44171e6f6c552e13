# SPDX-License-Identifier: Apache-2.0
"""From what a metric finds in each view to one score."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from graycard.eval._protocol import PROTOCOL
from graycard.eval.scoring._ceiling import ceiling_warnings, pooled_ceiling
from graycard.eval.scoring._gauge import Factors
from graycard.eval.scoring._training import Training
from graycard.records import MetricRecord, Score, Status


class Measurement(NamedTuple):
    """The value of a metric in one view, or in all views together, before ``finish``."""

    value: float
    parts: Mapping[str, float] = MappingProxyType({})
    """The same by neighbouring rules, by the name of each."""
    evidence: np.ndarray | None = None
    """Sample or sums that the value follows from, shape ``(N,)``, where they are pooled over views."""


@dataclass(frozen=True, slots=True)
class Finding:
    """The result of one metric in one view (or picture), before ``finish``."""

    value: float | None = None
    """None where it failed."""
    reason: str = ""
    """Why it failed."""
    warnings: tuple[str, ...] = ()
    noise: float | None = None
    """The best value that the truth's noise allows; None where it is not known."""
    parts: Mapping[str, float] = field(default_factory=dict)
    """The same by neighbouring rules."""
    evidence: np.ndarray | None = None
    """See :class:`Measurement`."""


@dataclass(frozen=True, slots=True)
class SceneFacts:
    """Facts that all test views of a scene and a prediction share."""

    exposure: float
    training: Training
    gauges: Mapping[str, Factors | str] = field(default_factory=dict)
    """By name: the factors, or why there are none."""
    light_names: Mapping[str, str] | None = None
    """True names of lights by predicted ones; None where they are as they are."""

    def fitted(self, gauge: str | None) -> Factors | None:
        """Return the factors of a gauge, if there is such a gauge and it could be fitted."""
        factors = self.gauges.get(gauge, "") if gauge else ""
        return None if isinstance(factors, str) else factors


def mean(values: Sequence[float]) -> float:
    """Return the arithmetic mean, by an exact sum."""
    return math.fsum(values) / len(values)


def pooled(
    record: MetricRecord,
    finish: Callable[[float], float],
    findings: Mapping[str, Finding],
    *,
    status: Status,
    reason: str,
    gauge: Factors | None = None,
    pool: Callable[[np.ndarray], Measurement] | None = None,
) -> Score:
    """Return the score of findings: their mean, or what ``pool`` makes of their evidence, then finished.

    Args:
        record: Of the metric.
        finish: From the mean to the score: PSNR of a mean square error.
        findings: By view.
        status: Of the score.
        reason: Why it is not scored.
        gauge: Factors that were applied.
        pool: From the evidence of all views together; None for the mean of their values. The mean of a part
            is over the views that have it.
    """
    values = {name: f.value for name, f in findings.items() if f.value is not None}
    together = _together(list(findings.values()), pool) if status == "scored" else None
    value = finish(together.value) if together else None
    ceiling = pooled_ceiling([f.noise for f in findings.values()], finish)
    return Score(
        record.id,
        PROTOCOL,
        status,
        value,
        record.unit,
        record.higher_is_better,
        record.optimum,
        per_view={name: finish(value) for name, value in values.items()},
        noise_ceiling=ceiling,
        gauge=gauge,
        expected=len(findings),
        scored=len(values),
        reason=reason,
        warnings=ceiling_warnings(value, ceiling, record.unit, record.higher_is_better),
        breakdown={name: finish(part) for name, part in together.parts.items()} if together else {},
    )


def status_of(
    layer: str, findings: Mapping[str, Finding], provided: bool, unreadable: Sequence[str]
) -> tuple[Status, str]:
    """Return the status of a score, and the reason if it is not scored.

    Args:
        layer: The judged layer, for the reason.
        findings: By view.
        provided: Some view has the layer.
        unreadable: Why files cannot be read.
    """
    if unreadable:
        return "failed", unreadable[0]
    if not provided:
        return "not provided", f"no view has {layer}"
    faults = list(dict.fromkeys(f.reason for f in findings.values() if f.value is None))
    return ("failed", first_of(faults)) if faults else ("scored", "")


def first_of(faults: Sequence[str]) -> str:
    """Return the first fault, and how many more there are."""
    return faults[0] + (f" (and {len(faults) - 1} more)" if len(faults) > 1 else "")


def _together(findings: Sequence[Finding], pool: Callable[[np.ndarray], Measurement] | None) -> Measurement:
    """Return the measurement over all scored views."""
    if pool is not None:
        return pool(np.concatenate([f.evidence for f in findings if f.evidence is not None]))
    names = dict.fromkeys(name for f in findings for name in f.parts)
    parts = {name: mean([f.parts[name] for f in findings if name in f.parts]) for name in names}
    return Measurement(mean([f.value for f in findings if f.value is not None]), parts)

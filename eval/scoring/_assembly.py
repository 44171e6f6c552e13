# SPDX-License-Identifier: Apache-2.0
"""From what was found in each view to one score."""

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field

import numpy as np

from graycard import DatasetError
from graycard.eval.metrics._albedo import IMAGE_METRICS
from graycard.eval.metrics._image_metric import ImageMetric
from graycard.eval.protocols import PROTOCOL
from graycard.eval.scoring._breakdown import breakdown
from graycard.eval.scoring._ceiling import ceiling_warnings, pooled_ceiling
from graycard.eval.scoring._gauge import Factors
from graycard.eval.scoring._training import Training
from graycard.records import Score, Status


@dataclass(frozen=True, slots=True)
class Finding:
    """What one metric says about one test view."""

    value: float | None = None
    """Before ``finish``; None where it failed."""
    reason: str = ""
    """Why it failed."""
    warnings: tuple[str, ...] = ()
    noise: float | None = None
    """The best value that the truth's noise allows, before ``finish``; None where it is not known."""
    parts: Mapping[str, float] = field(default_factory=dict)
    """The same by neighbouring rules, before ``finish``."""
    evidence: np.ndarray | None = None
    """What is pooled over views where their values are not, shape ``(N,)``."""


@dataclass(frozen=True, slots=True)
class Scene:
    """What is the same for all test views."""

    exposure: float
    training: Training
    gauges: Mapping[str, Factors | str] = field(default_factory=dict)
    """By name: the factors, or why there are none."""


def by_record(table: Sequence[ImageMetric]) -> list[list[ImageMetric]]:
    """Metrics that share a record, together: those of one layer for each light."""
    groups: dict[str, list[ImageMetric]] = {}
    for metric in table:
        groups.setdefault(metric.record.id, []).append(metric)
    return list(groups.values())


def assemble(
    metrics: Sequence[ImageMetric],
    found: Mapping[ImageMetric, Mapping[str, Finding]],
    scene: Scene,
    provided: Set[str],
    unreadable: Sequence[str],
    extra: tuple[str, ...],
) -> Score:
    """One score.

    Args:
        metrics: Those of one record: of a single layer, or of a layer for each light. What is judged of a
            light that the prediction has not is darkness, and a warning says so.
        found: Findings by metric and view.
        scene: What is the same for all views.
        provided: Names of the layers that some view has.
        unreadable: Why files cannot be read.
        extra: Warnings of the whole folder.

    Raises:
        DatasetError: No test view sees anything that is judged.
    """
    metric = metrics[0]
    given = [m for m in metrics if m.layer in provided]
    findings = _mean_over_lights([found[m] for m in metrics])
    if not findings:
        raise DatasetError(
            f"expected a test view that sees something to judge by {metric.record.id}, got none. "
            "Render the scene again"
        )
    values = {name: f.value for name, f in findings.items() if f.value is not None}
    status, reason = status_of(_generic(metric), findings, bool(given), unreadable)
    pooled = metric.finish(math.fsum(values.values()) / len(values)) if status == "scored" else None
    ceiling = pooled_ceiling([f.noise for f in findings.values()], metric.finish)
    warnings = extra + tuple(w for f in findings.values() for w in f.warnings)
    warnings += _dark(metrics, given) if status == "scored" else ()
    return Score(
        metric.record.id,
        PROTOCOL,
        status,
        pooled,
        metric.record.unit,
        metric.record.higher_is_better,
        metric.record.optimum,
        per_view={name: metric.finish(value) for name, value in values.items()},
        noise_ceiling=ceiling,
        gauge=_fitted(metric, scene),
        expected=len(findings),
        scored=len(values),
        reason=reason,
        warnings=warnings
        + ceiling_warnings(pooled, ceiling, metric.record.unit, metric.record.higher_is_better),
        breakdown=breakdown(metric, list(values.values()), [f.parts for f in findings.values()])
        if status == "scored"
        else {},
    )


def _mean_over_lights(found: Sequence[Mapping[str, Finding]]) -> dict[str, Finding]:
    if len(found) == 1:
        return dict(found[0])
    views = dict.fromkeys(name for findings in found for name in findings)
    return {name: _mean([findings[name] for findings in found if name in findings]) for name in views}


def _mean(findings: Sequence[Finding]) -> Finding:
    """The mean over lights of one view, or the first reason why there is none."""
    values = [f.value for f in findings if f.value is not None]
    if len(values) < len(findings):
        return Finding(reason=next(f.reason for f in findings if f.value is None))
    names = set.intersection(*(set(f.parts) for f in findings))
    parts = {n: math.fsum(f.parts[n] for f in findings) / len(findings) for n in sorted(names)}
    return Finding(math.fsum(values) / len(values), parts=parts)


def _generic(metric: ImageMetric) -> str:
    """The layer as the table has it, with ``<light>`` where there is one for each."""
    return next(m.layer for m in IMAGE_METRICS if m.record.id == metric.record.id)


def _fitted(metric: ImageMetric, scene: Scene) -> Factors | None:
    """The gauge that was fitted, if any was."""
    gauge = scene.gauges.get(metric.gauge or "raw", "")
    return None if isinstance(gauge, str) or (metric.gauge or "raw").endswith("raw") else gauge


def _dark(metrics: Sequence[ImageMetric], given: Sequence[ImageMetric]) -> tuple[str, ...]:
    absent = [m.layer for m in metrics if m not in given]
    return (f"lights that are not predicted count as dark: {', '.join(absent)}",) if absent else ()


def status_of(
    layer: str, findings: Mapping[str, Finding], provided: bool, unreadable: Sequence[str]
) -> tuple[Status, str]:
    """Whether findings of a layer make a score, and why not."""
    if unreadable:
        return "failed", unreadable[0]
    if not provided:
        return "not provided", f"no view has {layer}"
    reasons = list(dict.fromkeys(f.reason for f in findings.values() if f.value is None))
    if reasons:
        more = f" (and {len(reasons) - 1} more)" if len(reasons) > 1 else ""
        return "failed", reasons[0] + more
    return "scored", ""

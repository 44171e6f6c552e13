# SPDX-License-Identifier: Apache-2.0
"""Failures of a run, and warnings of its scores."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from graycard.records import HOLDS_NOISE, JobResult, MetricRecord
from graycard.reports.tables._cells import read_metric


@dataclass(frozen=True, slots=True)
class Trouble:
    """Something that failed, or that the reader should be warned of."""

    method: str
    where: str
    what: str
    reason: str


def failures(results: Sequence[JobResult], metrics: Sequence[MetricRecord]) -> tuple[Trouble, ...]:
    """Everything that failed, the metrics that failed for one reason in one line."""
    found = []
    for result in results:
        where = f"{result.job.scene}, seed {result.job.seed}"
        if result.sheet is None:
            reason = result.reason or "expected scores of this job, got none"
            found.append(Trouble(result.job.method, where, "the whole job", reason))
            continue
        readings = [(m, read_metric(result, m.id)) for m in metrics]
        failed = [(m.title, r.reason) for m, r in readings if r.status == "failed"]
        for reason in dict.fromkeys(reason for _, reason in failed):
            titles = ", ".join(title for title, why in failed if why == reason)
            found.append(Trouble(result.job.method, where, titles, reason or "no reason given"))
    return tuple(found)


def warnings(results: Sequence[JobResult], handed: Collection[str] = ()) -> tuple[Trouble, ...]:
    """Return everything that the scores of these jobs warn of, the metrics of one warning in one line.

    Args:
        results: Of the jobs.
        handed: Names of methods that are handed truth: that they are too good is no news, and left out.
    """
    found: dict[tuple[str, str, str], list[str]] = {}
    for result in (r for r in results if r.sheet):
        assert result.sheet is not None
        where = f"{result.job.scene}, seed {result.job.seed}"
        told = [("the whole folder", warning) for warning in result.sheet.warnings]
        told += [(s.metric, warning) for s in result.sheet.scores for warning in dict.fromkeys(s.warnings)]
        for what, warning in told:
            if not (warning.endswith(HOLDS_NOISE) and result.job.method in handed):
                found.setdefault((result.job.method, where, warning), []).append(what)
    return tuple(Trouble(name, where, ", ".join(ids), why) for (name, where, why), ids in found.items())

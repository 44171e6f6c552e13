# SPDX-License-Identifier: Apache-2.0
"""Scores of a job by metric."""

from graycard.records import JobResult, Score


def find_score(result: JobResult, metric: str) -> Score | None:
    """Return the score of a job by a metric; None where the job failed or its scene has no such score."""
    return result.sheet.by_metric.get(metric) if result.sheet else None

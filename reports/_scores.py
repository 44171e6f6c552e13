# SPDX-License-Identifier: Apache-2.0
"""Scores of a job by metric."""

from graycard.records import JobResult, Score


def find_score(result: JobResult, metric: str) -> Score | None:
    """Return the score of a job by a metric; None where the job failed or its scene has no such score."""
    scores = result.sheet.scores if result.sheet else ()
    return next((score for score in scores if score.metric == metric), None)

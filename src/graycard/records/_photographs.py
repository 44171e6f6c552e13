# SPDX-License-Identifier: Apache-2.0
"""Scores of real photographs, a record of their own: they say nothing about light, albedo or shape.

No claim, gate or table of scores with truth reads it, so neither kind of number can be taken for the other.
"""

from dataclasses import dataclass
from pathlib import Path

from graycard.io import Label, Name
from graycard.records._run import MetricRecord, Score, read_record

KIND = "photographs, no truth"
"""Mark of such scores, wherever they are shown."""
PHOTOGRAPH_SCORES_VERSION = 1


@dataclass(frozen=True, slots=True)
class PhotographSheet:
    """Scores of a predictions folder against the photographs that were held out of a capture."""

    track: Name
    scene: Name
    method: Label
    predictions_sha256: str
    """Hash over the files of the predictions folder."""
    photographs_sha256: str
    """Hash of the manifest of the photographs, which holds the hash of each file."""
    scores: tuple[Score, ...]
    metrics: tuple[MetricRecord, ...]
    """Meaning of the scores, in their order."""
    views: int
    """Held-out views with a photograph."""
    lacking: tuple[Name, ...] = ()
    """Held-out views without one, which are not judged."""
    kind: str = KIND
    format: str = "graycard-photograph-scores"
    format_version: int = PHOTOGRAPH_SCORES_VERSION
    warnings: tuple[str, ...] = ()


def read_photograph_sheet(path: Path) -> PhotographSheet:
    """Return the scores in a file that ``graycard score --json`` wrote for an imported capture.

    Raises:
        RecordError: It is missing, damaged, misspelt, of another kind, or of a newer format.
    """
    return read_record(PhotographSheet, path, "graycard-photograph-scores", PHOTOGRAPH_SCORES_VERSION)

# SPDX-License-Identifier: Apache-2.0
"""Places of the parts of a run: the machine of each task of a job array, and the fits that it made.

``RUN/places/<part>-of-<parts>-<time>.json`` is written before a task begins its fits, with those that it is
about to make, and once more after them, with those that it made. ``whole-<time>.json`` has those of the
machine that gathers the parts.
"""

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from graycard import RecordError
from graycard.benchmarks._jobs import FitJob, is_told_done
from graycard.benchmarks._run_record import BEGINNING
from graycard.benchmarks.planning._parts import Part
from graycard.io import read_json, to_builtins, write_json
from graycard.processes import Outcome
from graycard.records import EARLIER, RunRecord

PLACES = "places"
"""Folder of a run."""
_OF_THE_RUN = ("machines", "renderer", "jobs", "made")
"""Keys that do not tell what a machine is."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where fits are made."""

    path: Path
    environment: Mapping[str, Any]
    """Of this machine, as in a record."""

    @classmethod
    def told(
        cls, run: Path, part: Part | None, plan: Iterable[FitJob], environment: Mapping[str, Any]
    ) -> "Place | None":
        """Write down which fits are about to be made here, and return the place.

        Args:
            run: The run folder.
            part: Which; None for the whole.
            plan: The fits that it needs.
            environment: Of this machine, as in a record.

        Returns:
            None where none is to be made, and for a whole of which no part has told its place.

        Raises:
            OutputError: The folder cannot be written to, or the disk is full.
        """
        if part is None and not (run / PLACES).is_dir():
            return None
        missing = [fit for fit in plan if fit.given is None and not is_told_done(fit)]
        if not missing:
            return None
        name = f"{part.number}-of-{part.of}" if part else "whole"
        place = cls(run / PLACES / f"{name}-{time.time_ns()}.json", environment)
        place._write(missing, made=False)
        return place

    def made(self, fitted: Iterable[tuple[FitJob, Outcome]]) -> None:
        """Write down which fits were made here, and not found.

        Raises:
            OutputError: As of :meth:`told`.
        """
        self._write((fit for fit, outcome in fitted if fit.given is None and not outcome.reused), made=True)

    def _write(self, fits: Iterable[FitJob], *, made: bool) -> None:
        jobs = [fit.job_hash[:BEGINNING] for fit in fits]
        write_json(self.path, {**to_builtins(dict(self.environment)), "made": made, "jobs": jobs})


def with_places_of_parts(record: RunRecord, run: Path) -> RunRecord:
    """Return a record whose environment also says where the fits were made that parts of the run have done.

    ``earlier`` has each such place that differs from the record's own, with the beginnings of the hashes of
    its jobs. Where two were about to make a job, it is told of who made it, or of the later one.

    Args:
        record: Of the whole.
        run: Its folder.
    """
    of = {result.job_hash[:BEGINNING]: {} for result in record.results if result.cost}
    for told in _told(run):
        of |= {job: told for job in told["jobs"] if job in of}
    own, found = _kind(record.environment), list[dict[str, Any]]()
    for job, told in of.items():
        kind = _kind(told)
        alike = [one for one in found if _kind(one) == kind]
        if alike:
            alike[0]["jobs"].append(job)
        elif told and kind != own:
            found.append({**{key: value for key, value in told.items() if key != "made"}, "jobs": [job]})
    return replace(record, environment={**record.environment, EARLIER: found}) if found else record


def _kind(place: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a machine is."""
    return {key: value for key, value in to_builtins(dict(place)).items() if key not in _OF_THE_RUN}


def _told(run: Path) -> list[dict[str, Any]]:
    """Return what was told of places: first of fits that were to be made, then of those that were."""
    found = []
    for path in sorted((run / PLACES).glob("*-*.json"), key=lambda path: path.stem.rpartition("-")[2]):
        try:
            told = read_json(path)
        except RecordError:  # a record is about fits: it does not end for what is said beside them
            continue
        if isinstance(told, dict) and isinstance(told.get("jobs"), list):
            found.append(told)
    return sorted(found, key=lambda told: told.get("made") is True)

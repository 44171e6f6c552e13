# SPDX-License-Identifier: Apache-2.0
"""Places of the parts of a run: the machine of each task of a job array, and the fits that it did.

``RUN/places/<part>-of-<parts>-<time>.json`` is written before a task begins its fits. The machine that
gathers the parts finds fits done; ``whole-<time>.json`` has those that it makes itself.
"""

import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from graycard import RecordError
from graycard.benchmarks._jobs import FitJob, find_fit
from graycard.benchmarks._run_record import BEGINNING, renderers
from graycard.benchmarks._sources import environment
from graycard.benchmarks.planning._parts import Part
from graycard.io import read_json, to_builtins, write_json
from graycard.records import EARLIER, RunRecord
from graycard.synth import SceneSpec

PLACES = "places"
"""Folder of a run."""


def tell_place(
    run: Path, part: Part | None, plan: Iterable[FitJob], scenes: list[tuple[SceneSpec, Path]]
) -> None:
    """Write down where those fits are made that are not there yet.

    Args:
        run: The run folder.
        part: Which; None for the whole, of which nothing is written where no part has told of its place.
        plan: Its fits.
        scenes: Those that it needs, with their folders.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    if part is None and not (run / PLACES).is_dir():
        return
    fits = (fit for fit in plan if fit.given is None and find_fit(fit) is None)
    jobs = [fit.job_hash[:BEGINNING] for fit in fits]
    if jobs:
        name = f"{part.number}-of-{part.of}" if part else "whole"
        path = run / PLACES / f"{name}-{time.time_ns()}.json"
        write_json(path, {**environment(), "renderer": renderers(scenes), "jobs": jobs})


def with_places_of_parts(record: RunRecord, run: Path) -> RunRecord:
    """Return a record whose environment also says where the fits were made that parts of the run have done.

    ``earlier`` has each such place that differs from the record's own, with the beginnings of the hashes of
    its jobs. Of two that took the same job the later one has made it.

    Args:
        record: Of the whole.
        run: Its folder.
    """
    made = {result.job_hash[:BEGINNING] for result in record.results if result.cost}
    found: list[dict[str, Any]] = []
    for told in _told(run):
        jobs = [job for job in told.pop("jobs", ()) if job in made]
        for other in found:
            other["jobs"] = [job for job in other["jobs"] if job not in jobs]
        alike = [other for other in found if {**other, "jobs": 0} == {**told, "jobs": 0}]
        if alike:
            alike[0]["jobs"] += jobs
        else:
            found.append({**told, "jobs": jobs})
    own = to_builtins(dict(record.environment))
    places = [one for one in found if one["jobs"] and {**own, "jobs": 0} != {**one, "jobs": 0}]
    return replace(record, environment={**own, EARLIER: places}) if places else record


def _told(run: Path) -> list[dict[str, Any]]:
    """Return what tasks have told, the first one first; what cannot be read tells nothing."""
    found = []
    for path in sorted((run / PLACES).glob("*-*.json"), key=lambda path: path.stem.rpartition("-")[2]):
        try:
            told = read_json(path)
        except RecordError:
            continue
        if isinstance(told, dict):
            found.append(told)
    return found

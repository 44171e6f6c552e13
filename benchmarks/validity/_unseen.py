# SPDX-License-Identifier: Apache-2.0
"""Scenes of a run whose files lie on another machine."""

from collections.abc import Sequence
from pathlib import Path

from graycard.benchmarks._run_record import BEGINNING
from graycard.benchmarks.validity._record import Breach
from graycard.records import JobResult, RunRecord, SceneRecord, job_folder

OF_FILES = ("hashes", "gauge")
"""Rules that ask for the files of scenes and fits."""


def unseen_scenes(record: RunRecord, run: Path, breaches: Sequence[Breach]) -> tuple[str, ...]:
    """Return the scenes, as ``track/scene``, that have no file here, if nothing else is against the run.

    They were run elsewhere by an earlier bench, as the record says; one that was made before records told
    which jobs may have any. A run of secret scenes has none, for their seeds are read off their files.

    Args:
        record: Of the run.
        run: Its folder.
        breaches: All that was found.
    """
    elsewhere = record.environments[1:]
    if record.commitment or not elsewhere:
        return ()
    told = all("jobs" in place for place in elsewhere)
    jobs = {job for place in elsewhere for job in place.get("jobs", ())}
    gone = []
    for scene in record.scenes:
        results = [r for r in record.results if (r.job.track, r.job.scene) == (scene.track, scene.scene)]
        away = not told or all(result.job_hash[:BEGINNING] in jobs for result in results)
        if away and not _is_here(scene, results, run):
            gone.append(f"{scene.track}/{scene.scene}")
    excused = all(
        breach.unknown and breach.rule in OF_FILES and breach.where.partition(" ")[0] in gone
        for breach in breaches
    )
    return tuple(gone) if excused and len(gone) < len(record.scenes) else ()


def _is_here(scene: SceneRecord, results: Sequence[JobResult], run: Path) -> bool:
    """Tell whether a scene, or a fit to it, has a folder."""
    return (run / scene.folder).exists() or any(job_folder(run, result).exists() for result in results)

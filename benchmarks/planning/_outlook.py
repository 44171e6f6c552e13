# SPDX-License-Identifier: Apache-2.0
"""Work out what a large run would take, from the costs that a small one measured."""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean, median

from graycard import GraycardError, UnknownNameError, open_truth
from graycard.benchmarks._jobs import SCORING, CpuCost, read_or_none, rendering_cost
from graycard.records import JobResult, RunRecord, job_folder
from graycard.synth import donor_scene, scene_name


@dataclass(frozen=True, slots=True)
class Measured:
    """Mean costs on a track, as a run measured them."""

    track: str
    scenes: int
    """Scenes whose rendering was measured."""
    fits: int
    """Fits whose CPU time was measured, of all rows."""
    all_fits: int
    """The same with those that found stages done: their CPU time follows from their wall time."""
    rendering_s: float
    """CPU time of a scene, seconds, with a share of the scenes that objects come from."""
    fit_s: float
    """CPU time of a fit with its predictions, and of that of a scene that an object comes from, seconds."""
    scoring_s: float
    """CPU time of one set of scores, seconds."""
    scene_bytes: float
    job_bytes: float
    """Predictions and records of a job."""
    peak_mib: float
    """The most memory that a fit held, MiB."""
    row_s: Mapping[str, float]
    """CPU time of a fit with its predictions by row, seconds."""


@dataclass(frozen=True, slots=True)
class Outlook:
    """Cost of a large run on one track."""

    measured: Measured
    scenes: int
    methods: int
    rendering_h: float
    """CPU hours."""
    fits_h: float
    scoring_h: float
    disk_gb: float
    """1e9 bytes."""
    hours: float
    """Hours on the cores that were asked for; no less than one scene with its longest fit takes on one."""
    price: float | None
    """In the currency of a core hour; None where no price was told."""

    @property
    def cpu_h(self) -> float:
        """CPU hours of all stages."""
        return self.rendering_h + self.fits_h + self.scoring_h


def measured_costs(record: RunRecord, run: Path, rows: Collection[str] = ()) -> list[Measured]:
    """Return the mean costs of each track of a run.

    Args:
        record: Of the run.
        run: Its folder, with the jobs and, at the places that the record names, the scenes.
        rows: Rows that count; all if empty.

    Raises:
        UnknownNameError: The run has no such row.
        GraycardError: No scene or no fit of a track was measured, or a folder is not there.
    """
    known = [method.name for method in record.methods]
    if strange := [row for row in rows if row not in known]:
        raise UnknownNameError("row", strange[0], known)
    counted = [r for r in record.results if not rows or r.job.method in rows]
    there = {result.job.track for result in counted}
    tracks = [t for t in dict.fromkeys(scene.track for scene in record.scenes) if not rows or t in there]
    return [_measured(track, record, counted, run) for track in tracks]


def outlook(
    measured: Measured,
    scenes: int,
    methods: int,
    cores: int,
    efficiency: float = 1.0,
    price: float | None = None,
) -> Outlook:
    """Return what so many scenes and methods would take.

    A scene and a fit cost what they cost in the mean of the run: its sizes, steps and rows.

    Args:
        measured: Costs of a track.
        scenes: Number of scenes.
        methods: Number of rows.
        cores: Cores that work at the same time.
        efficiency: Share of their time in which they work; from 0 to 1.
        price: Of one core hour.

    Raises:
        ValueError: A number is not above 0, or the efficiency above 1.
    """
    for name, count in (("scenes", scenes), ("methods", methods), ("cores", cores)):
        if count < 1:
            raise ValueError(f"expected 1 or more {name}, got {count}. Mend --{name}")
    if not 0 < efficiency <= 1:
        raise ValueError(f"expected a share, as 0.84, got {efficiency:g}. Mend --efficiency")
    if price is not None and not 0 <= price < math.inf:
        raise ValueError(f"expected a price from 0, got {price:g}. Mend --price")
    jobs = scenes * methods
    rendering, fits, scoring = (
        count * seconds / 3600
        for count, seconds in (
            (scenes, measured.rendering_s),
            (jobs, measured.fit_s),
            (jobs, measured.scoring_s),
        )
    )
    longest = measured.rendering_s + max(measured.row_s.values()) + measured.scoring_s
    hours = max((rendering + fits + scoring) / (cores * efficiency), longest / 3600)
    disk = (scenes * measured.scene_bytes + jobs * measured.job_bytes) / 1e9
    cost = None if price is None else hours * cores * price
    return Outlook(measured, scenes, methods, rendering, fits, scoring, disk, hours, cost)


def _measured(track: str, record: RunRecord, counted: Sequence[JobResult], run: Path) -> Measured:
    scenes = [scene for scene in record.scenes if scene.track == track]
    folders = [run / scene.folder for scene in scenes]
    donors = _donors(folders)
    own = _rendering(run, track, [scene.scene for scene in scenes])
    of_donors = _rendering(run, track, donors)
    jobs = [result for result in counted if result.job.track == track and result.cost is not None]
    times = _fit_s(jobs, [result for result in record.results if result.job.track == track])
    scores = [
        cost.cpu_s
        for result in jobs
        if (cost := read_or_none(CpuCost, job_folder(run, result) / SCORING)) is not None
    ]
    for what, found in (("scene", own), ("fit", times), ("set of scores", scores)):
        if not found:
            raise GraycardError(
                f"expected {run} to have measured a {what} of track {track}, got none. Costs are kept of "
                "what this version made in one go, and of no scene that several workers rendered in parts. "
                "Run `graycard bench` into an empty folder, without --scheduler"
            )
    known = sum(result.cost is not None and result.cost.cpu_s is not None for result in jobs)
    places = [*folders, *(folders[0].with_name(name) for name in of_donors)]
    return Measured(
        track,
        len(own),
        known,
        len(jobs),
        fmean(own.values()) + sum(of_donors.values()) / len(scenes),
        fmean(times),
        fmean(scores),
        sum(map(_size, places)) / len(scenes),
        fmean(_size(job_folder(run, result)) for result in jobs),
        max(result.cost.peak_memory_mib for result in jobs if result.cost is not None),
        _by_row(jobs, times),
    )


def _donors(folders: Iterable[Path]) -> list[str]:
    """Return the names of the scenes that objects of some scenes come from."""
    found = (open_truth(f / "truth", check=False).composition() for f in folders if (f / "truth").is_dir())
    return sorted({scene_name(donor_scene(known.donor)) for known in found if known is not None})


def _rendering(run: Path, track: str, names: Iterable[str]) -> dict[str, float]:
    """Return the CPU time that scenes took, seconds; those are left out whose cost was not kept."""
    costs = {name: read_or_none(CpuCost, rendering_cost(run, track, name)) for name in names}
    return {name: cost.cpu_s for name, cost in costs.items() if cost is not None}


def _fit_s(jobs: Sequence[JobResult], track: Sequence[JobResult]) -> list[float]:
    """Return the CPU time of fits, seconds; that of a fit which found stages done follows from its wall time.

    Such fits are of some rows and not of others, so leaving them out would count the others alone.

    Args:
        jobs: The fits, with their costs.
        track: All fits of the track: they tell how many cores a fit of a row keeps busy.
    """
    shares: dict[str, list[float]] = {}
    for result in track:
        if result.cost is not None and result.cost.cpu_s is not None and result.cost.wall_s > 0:
            shares.setdefault(result.job.method, []).append(result.cost.cpu_s / result.cost.wall_s)
    cores = {row: fmean(of_row) for row, of_row in shares.items()}
    if not cores:
        return []
    usual = median(cores.values())
    costs = [(result.cost, cores.get(result.job.method, usual)) for result in jobs]
    return [c.wall_s * busy if c.cpu_s is None else c.cpu_s for c, busy in costs if c is not None]


def _by_row(jobs: Sequence[JobResult], times: Sequence[float]) -> dict[str, float]:
    """Return the mean of the times of each row."""
    found: dict[str, list[float]] = {}
    for result, seconds in zip(jobs, times, strict=True):
        found.setdefault(result.job.method, []).append(seconds)
    return {row: fmean(seconds) for row, seconds in found.items()}


def _size(folder: Path) -> int:
    """Return the bytes of all files below a folder.

    Raises:
        GraycardError: It is not there.
    """
    if not folder.is_dir():
        raise GraycardError(
            f"expected scenes and jobs where the record of the run names them, got no folder {folder}. Move "
            "it there, or run `graycard bench` anew"
        )
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())

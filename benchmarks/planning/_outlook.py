# SPDX-License-Identifier: Apache-2.0
"""Work out what a large run would take, from the costs that a small one measured."""

import math
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean

from graycard import GraycardError
from graycard.benchmarks._jobs import SCORING, CpuCost, read_or_none, rendering_cost
from graycard.records import RunRecord, job_folder


@dataclass(frozen=True, slots=True)
class Measured:
    """Mean costs on a track, as a run measured them."""

    track: str
    scenes: int
    """Scenes whose rendering was measured."""
    fits: int
    """Fits that were measured, of all rows."""
    rendering_s: float
    """CPU time of a scene, seconds."""
    fit_s: float
    """CPU time of a fit with its predictions, seconds."""
    scoring_s: float
    """CPU time of one set of scores, seconds."""
    scene_bytes: float
    job_bytes: float
    """Predictions and records of a job."""
    peak_mib: float
    """The most memory that a fit held, MiB."""


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
    """Hours on the cores that were asked for."""
    price: float | None
    """In the currency of a core hour; None where no price was told."""

    @property
    def cpu_h(self) -> float:
        """CPU hours of all stages."""
        return self.rendering_h + self.fits_h + self.scoring_h


def measured_costs(record: RunRecord, run: Path) -> list[Measured]:
    """Return the mean costs of each track of a run.

    Args:
        record: Of the run.
        run: Its folder, with the jobs and, at the places that the record names, the scenes.

    Raises:
        GraycardError: No scene or no fit of a track was measured.
    """
    tracks = dict.fromkeys(scene.track for scene in record.scenes)
    return [_measured(track, record, run) for track in tracks]


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
    hours = (rendering + fits + scoring) / (cores * efficiency)
    disk = (scenes * measured.scene_bytes + jobs * measured.job_bytes) / 1e9
    cost = None if price is None else hours * cores * price
    return Outlook(measured, scenes, methods, rendering, fits, scoring, disk, hours, cost)


def _measured(track: str, record: RunRecord, run: Path) -> Measured:
    scenes = [scene for scene in record.scenes if scene.track == track]
    rendered = [
        cost.cpu_s
        for s in scenes
        if (cost := read_or_none(CpuCost, rendering_cost(run, track, s.scene))) is not None
    ]
    jobs = [result for result in record.results if result.job.track == track and result.cost is not None]
    fits = [result.cost.cpu_s for result in jobs if result.cost and result.cost.cpu_s is not None]
    scores = [
        cost.cpu_s
        for result in jobs
        if (cost := read_or_none(CpuCost, job_folder(run, result) / SCORING)) is not None
    ]
    for what, found in (("scene", rendered), ("fit", fits), ("set of scores", scores)):
        if not found:
            raise GraycardError(
                f"expected {run} to have measured a {what} of track {track}, got none. Costs are kept of "
                "what this version made in one go, and of no scene that several workers rendered in parts. "
                "Run `graycard bench` into an empty folder, without --scheduler"
            )
    return Measured(
        track,
        len(rendered),
        len(fits),
        fmean(rendered),
        fmean(fits),
        fmean(scores),
        fmean(_size(run / scene.folder) for scene in scenes),
        fmean(_size(job_folder(run, result)) for result in jobs),
        max(result.cost.peak_memory_mib for result in jobs if result.cost),
    )


def _size(folder: Path) -> int:
    """Return the bytes of all files below a folder."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())

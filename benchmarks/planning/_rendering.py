# SPDX-License-Identifier: Apache-2.0
"""Render the scenes of a run: several at a time, or each in parts where workers would else be idle."""

from collections.abc import Callable
from dataclasses import replace
from math import ceil
from pathlib import Path

import psutil

from graycard import Progress
from graycard.benchmarks._jobs import (
    PartJob,
    RenderJob,
    find_rendered,
    run_begin,
    run_part,
    run_render,
)
from graycard.benchmarks._run_record import RunError
from graycard.machines import Machines
from graycard.processes import Outcome, named, narrowed
from graycard.synth import scene_name

_LEAST = 4
"""Pictures of a part at least: a worker takes seconds to import Mitsuba and to compile its kernels."""
_PARTS_EACH = 2
"""Parts for each worker, so that none waits long for the last."""
_SCENES_EACH = 2
"""Scenes for each worker that are enough: few workers are then idle at the end."""

_BYTES, _BYTES_A_PIXEL = 2**30, 14 * 2**10
"""Memory that it takes to render a scene, rounded up: 0.6 GiB were measured at 112 x 112 pixels, and 3.6 GiB
at 512 x 512."""

_IN_PARTS, _BEGUN = 0.9, 0.05
"""Shares of progress: of all at which the parts are done, and of the parts at which scenes are begun."""


def render_scenes(
    jobs: list[RenderJob],
    run_all: Callable[..., list[Outcome]],
    machines: Machines | None,
    progress: Progress,
    most: int = 1,
) -> list[Path]:
    """Render scenes that are not there, and return the folders of all.

    Args:
        jobs: The scenes.
        run_all: Does jobs, as :meth:`graycard.machines.Machines.run_all`.
        machines: Where it does them; None for this machine.
        progress: Called after each job.
        most: Scenes at a time on this machine, where its cores and its memory are enough for as many.

    Raises:
        RunError: A scene could not be rendered.
    """
    at_a_time = 1
    if machines is None:
        at_a_time = _side_by_side(jobs, most)
        jobs = [replace(job, threads=ceil(job.threads / at_a_time)) for job in jobs]
    elif absent := _to_cut(jobs, workers := machines.jobs_at_a_time()):
        _render_parts(absent, run_all, workers, narrowed(progress, 0.0, _IN_PARTS))
        progress = narrowed(progress, _IN_PARTS, 1.0)
    outcomes = run_all(run_render, jobs, at_a_time, progress, find_rendered)
    for job, outcome in zip(jobs, outcomes, strict=True):
        if outcome.reason:
            raise RunError(f"scene {job.spec.track}/{scene_name(job.spec)}: {outcome.reason}")
    return [outcome.value for outcome in outcomes]


def _side_by_side(jobs: list[RenderJob], most: int) -> int:
    """Return how many scenes this machine renders at a time.

    Much of a scene is done by one thread alone: Mitsuba traces a kernel before it runs, and files are
    written.
    """
    absent = [job for job in jobs if find_rendered(job) is None]
    if not absent:
        return 1
    pixels = max(job.settings.width * job.settings.height for job in absent)
    room = psutil.virtual_memory().available // (_BYTES + _BYTES_A_PIXEL * pixels)
    return max(1, min(most, len(absent), max(job.threads for job in absent), room))


def _to_cut(jobs: list[RenderJob], workers: int) -> list[RenderJob]:
    """Return the scenes that are not there, if it pays to render them in parts; else none.

    It does not where there are as many scenes as workers, or twice as many and more: each part loads its
    scene anew.
    """
    absent = [job for job in jobs if find_rendered(job) is None]
    return [] if len(absent) == workers or len(absent) >= _SCENES_EACH * workers else absent


def _render_parts(
    absent: list[RenderJob], run_all: Callable[..., list[Outcome]], workers: int, progress: Progress
) -> None:
    """Render pictures of scenes that are not there, in parts; whoever renders the scenes then finds them.

    A part that fails is left to the rendering of its scene, which says why.
    """
    begins = run_all(run_begin, absent, 1, named(narrowed(progress, 0.0, _BEGUN), "beginning"))
    begun = [(job, outcome.value or ()) for job, outcome in zip(absent, begins, strict=True)]
    size = part_size(sum(len(numbers) for _, numbers in begun), workers)
    parts = [PartJob(job, part) for job, numbers in begun for part in cut(numbers, size)]
    run_all(run_part, parts, 1, named(narrowed(progress, _BEGUN, 1.0), "parts"))


def part_size(pictures: int, workers: int) -> int:
    """Return how many pictures a part has."""
    return max(_LEAST, ceil(pictures / (_PARTS_EACH * max(1, workers))))


def cut(numbers: tuple[int, ...], size: int) -> list[tuple[int, ...]]:
    """Return numbers in parts of one size, the last perhaps smaller."""
    return [numbers[start : start + size] for start in range(0, len(numbers), size)]

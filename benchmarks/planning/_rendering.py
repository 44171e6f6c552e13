# SPDX-License-Identifier: Apache-2.0
"""Render the scenes of a run: several at a time, or each in parts where workers would else be idle."""

from collections.abc import Callable
from dataclasses import replace
from math import ceil
from pathlib import Path

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
from graycard.resources import free_memory
from graycard.synth import MOST_PATHS, SUB_BUFFERS, RenderSettings, scene_name

_LEAST = 4
"""Pictures of a part at least: a worker takes seconds to import Mitsuba and to compile its kernels."""
_PARTS_EACH = 2
"""Parts for each worker, so that none waits long for the last."""
_SCENES_EACH = 2
"""Scenes for each worker that are enough: few workers are then idle at the end."""

_BYTES, _BYTES_A_PIXEL, _BYTES_A_PATH = 2**30, 2**13, 120
"""Memory that it takes to render any scene; more for each pixel, and for each light path of a view, up to
those that are followed at once.

Rounded up from 0.6 GiB at 112 x 112 pixels with 64 paths, 3.6 at 512 x 512 with 64, and 2.8 at 256 x 256 with
400.
"""

_IN_PARTS, _BEGUN = 0.9, 0.05
"""Shares of progress: of all at which the parts are done, and of the parts at which scenes are begun."""


def render_scenes(
    jobs: list[RenderJob],
    run_all: Callable[..., list[Outcome]],
    machines: Machines | None,
    progress: Progress,
    most: int,
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
    found = {job.words: find_rendered(job) for job in jobs}  # reads every file of a scene
    absent = [job for job in jobs if found[job.words] is None]
    at_a_time = 1
    if machines is None:
        at_a_time = _side_by_side(absent, most)
        jobs = _sharing_threads(jobs, absent, at_a_time)
    elif _pays_to_cut(absent, workers := machines.jobs_at_a_time()):
        _render_parts(absent, run_all, workers, narrowed(progress, 0.0, _IN_PARTS))
        progress = narrowed(progress, _IN_PARTS, 1.0)
    outcomes = run_all(run_render, jobs, at_a_time, progress, lambda job: found[job.words])
    for job, outcome in zip(jobs, outcomes, strict=True):
        if outcome.reason:
            raise RunError(f"scene {job.spec.track}/{scene_name(job.spec)}: {outcome.reason}")
    return [outcome.value for outcome in outcomes]


def _sharing_threads(jobs: list[RenderJob], absent: list[RenderJob], at_a_time: int) -> list[RenderJob]:
    """Share the threads of this machine among scenes that are rendered at the same time.

    Much of a scene is done by one thread alone: Mitsuba traces a kernel before it runs, and files are
    written. The last scenes share all threads, too.
    """
    last = absent[len(absent) - len(absent) % at_a_time :]
    return [
        replace(job, threads=ceil(job.threads / (len(last) if job in last else at_a_time))) for job in jobs
    ]


def _side_by_side(absent: list[RenderJob], most: int) -> int:
    """Return how many of the scenes that are not there this machine renders at a time."""
    if not absent:
        return 1
    room = free_memory() // max(_memory(job.settings) for job in absent)
    return max(1, min(most, len(absent), max(job.threads for job in absent), room))


def _memory(settings: RenderSettings) -> int:
    """Return the bytes that it takes at most to render a scene."""
    pixels = settings.width * settings.height
    paths = min(pixels * max(settings.samples, settings.training_samples), SUB_BUFFERS * MOST_PATHS)
    return _BYTES + _BYTES_A_PIXEL * pixels + _BYTES_A_PATH * paths


def _pays_to_cut(absent: list[RenderJob], workers: int) -> bool:
    """Tell whether to render scenes that are not there in parts.

    It does not pay where there are as many scenes as workers, or twice as many and more: each part loads its
    scene anew.
    """
    return bool(absent) and len(absent) != workers and len(absent) < _SCENES_EACH * workers


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

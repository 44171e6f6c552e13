# SPDX-License-Identifier: Apache-2.0
"""Render the scenes of a run, each in parts where workers would else be idle."""

from collections.abc import Callable
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
from graycard.synth import scene_name

_LEAST = 4
"""Pictures of a part at least: a worker takes seconds to import Mitsuba and to compile its kernels."""
_PARTS_EACH = 2
"""Parts for each worker, so that none waits long for the last."""
_SCENES_EACH = 2
"""Scenes for each worker that are enough: few workers are then idle at the end."""

_IN_PARTS, _BEGUN = 0.9, 0.05
"""Shares of progress: of all at which the parts are done, and of the parts at which scenes are begun."""


def render_scenes(
    jobs: list[RenderJob],
    run_all: Callable[..., list[Outcome]],
    machines: Machines | None,
    progress: Progress,
) -> list[Path]:
    """Render scenes that are not there, and return the folders of all.

    Args:
        jobs: The scenes.
        run_all: Does jobs, as :meth:`graycard.machines.Machines.run_all`.
        machines: Where it does them; None for this machine, which renders one scene after the other.
        progress: Called after each job.

    Raises:
        RunError: A scene could not be rendered.
    """
    workers = 0 if machines is None else machines.jobs_at_a_time()
    if workers and (absent := _to_cut(jobs, workers)):
        _render_parts(absent, run_all, workers, narrowed(progress, 0.0, _IN_PARTS))
        progress = narrowed(progress, _IN_PARTS, 1.0)
    outcomes = run_all(run_render, jobs, 1, progress, find_rendered)
    for job, outcome in zip(jobs, outcomes, strict=True):
        if outcome.reason:
            raise RunError(f"scene {job.spec.track}/{scene_name(job.spec)}: {outcome.reason}")
    return [outcome.value for outcome in outcomes]


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

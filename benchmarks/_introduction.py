# SPDX-License-Identifier: Apache-2.0
"""Introductions: what a bench has to know of a method before it fits it, found out where truth is closed.

Code of others runs when it is imported. So a method that does not come with graycard is never imported by the
bench itself, but by a worker process of its own, behind the guard of a fit; what comes back is text.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from graycard import TRACKS, MethodError
from graycard.benchmarks._handed import OPAQUE, places_of, scratch_folder
from graycard.benchmarks._jobs import JOBS_EACH, guarded
from graycard.benchmarks._suites import SuiteMethod
from graycard.benchmarks.commands._fit import introduction_of_command
from graycard.io import from_builtins, silent, to_builtins
from graycard.methods import BUILT_IN
from graycard.methods.confined import SERVE, Introduction, confined
from graycard.methods.confined import introduce as introduced
from graycard.processes import USUAL, Limits, Outcome, run_all


@dataclass(frozen=True, slots=True)
class Meeting:
    """One method to be introduced, and what is closed meanwhile."""

    method: SuiteMethod
    dataset: Path
    jobs: Path
    allowed: tuple[Path, ...] = ()


def introduce(
    methods: Sequence[SuiteMethod],
    dataset: Path,
    jobs: Path,
    at_a_time: int,
    limits: Limits = USUAL,
    allowed: tuple[Path, ...] = (),
) -> list[Introduction]:
    """Return what each method says of itself.

    Args:
        methods: Of a suite.
        dataset: ``DATASET``, whose scenes are closed.
        jobs: The folder of all jobs of the run, closed as well.
        at_a_time: Number of workers.
        limits: Time and memory of each import.
        allowed: Files and folders that they may read and change.

    Raises:
        UnknownNameError: A method does not exist.
        MethodError: One does not load, or does not take its settings or its priors.
    """
    foreign = [m for m in methods if not (m.predictions or m.run) and m.name not in BUILT_IN]
    meetings = [Meeting(method, dataset, jobs, allowed) for method in foreign]
    found = run_all(meet, meetings, at_a_time, silent, limits=limits, tasks_each=JOBS_EACH, confines=SERVE)
    met = iter(found)
    return [_heard(next(met)) if method in foreign else introduction_of(method) for method in methods]


def introduction_of(method: SuiteMethod) -> Introduction:
    """Return what one method says of itself; it is imported. Of commands and predictions: that they are such.

    Raises:
        UnknownNameError: It does not exist.
        MethodError: It does not load, or does not take its settings or its priors.
    """
    if method.predictions:
        says = f"Predictions of other code, submitted ({method.predictions}): what they saw is not known"
        return Introduction(says, (), {}, (), "")
    if method.run:
        return introduction_of_command(method, method.settings)
    return introduced(method.name, method.settings, method.priors)


def meet(meeting: Meeting) -> Outcome:
    """Introduce a method in a process to which scenes and jobs are closed."""
    row = meeting.method
    asked = {"method": row.name, "settings": to_builtins(row.settings), "priors": to_builtins(row.priors)}

    def work() -> Outcome:
        with scratch_folder() as scratch:
            closed = [meeting.dataset / TRACKS[0] / OPAQUE]
            places = places_of(scratch, closed, row.settings, meeting.jobs, allowed=meeting.allowed)
            with confined(row.name, scratch, places) as method:
                told = method.call("graycard.methods.confined:introduction_as_json", **asked)
        what = "what a method says of itself"
        return Outcome(value=from_builtins(Introduction, told, MethodError, what))

    return guarded(work, None)


def _heard(outcome: Outcome) -> Introduction:
    if outcome.reason:
        raise MethodError(outcome.reason)
    return outcome.value

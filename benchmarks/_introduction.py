# SPDX-License-Identifier: Apache-2.0
"""What a bench has to know of a method before it fits it, found out where truth is closed.

Code of others runs when it is imported. So a method that does not come with graycard is never imported by the
bench itself, but by a worker process of its own, behind the guard of a fit; what comes back is text.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from graycard import MethodError
from graycard.benchmarks._guard import Guard, closed
from graycard.benchmarks._jobs import guarded
from graycard.benchmarks._suites import SuiteMethod
from graycard.benchmarks.workers import USUAL, Limits, Outcome, run_all
from graycard.io import dumps, from_builtins, parse_json, silent, to_builtins
from graycard.methods import BUILT_IN, Ask, asks_of, fingerprint, load_method, settings_of
from graycard.methods.priors import check_priors


@dataclass(frozen=True, slots=True)
class Introduction:
    """What a method says of itself, with the settings and priors of a suite."""

    summary: str
    needs: tuple[str, ...]
    settings: Mapping[str, Any]
    """All of them, as in JSON."""
    asks: tuple[Ask, ...]
    fingerprint: str
    """Version and hash of its code."""


@dataclass(frozen=True, slots=True)
class Meeting:
    """One method to be introduced, and what is closed meanwhile."""

    method: SuiteMethod
    dataset: Path
    jobs: Path


def introduce(
    methods: Sequence[SuiteMethod], dataset: Path, jobs: Path, at_a_time: int, limits: Limits = USUAL
) -> list[Introduction]:
    """What each method says of itself.

    Args:
        methods: Of a suite.
        dataset: ``DATASET``, whose truth is closed.
        jobs: The folder of all jobs of the run, closed as well.
        at_a_time: Number of workers.
        limits: Time and memory of each import.

    Raises:
        UnknownNameError: A method does not exist.
        MethodError: One does not load, or does not take its settings or its priors.
    """
    foreign = [m for m in methods if not m.predictions and m.name not in BUILT_IN]
    meetings = [Meeting(method, dataset, jobs) for method in foreign]
    met = iter(run_all(meet, meetings, at_a_time, silent, limits=limits) if foreign else ())
    return [_heard(next(met)) if method in foreign else introduction_of(method) for method in methods]


def introduction_of(method: SuiteMethod) -> Introduction:
    """What one method says of itself; it is imported. Of predictions of other code: that they are such.

    Raises:
        UnknownNameError: It does not exist.
        MethodError: It does not load, or does not take its settings or its priors.
    """
    if method.predictions:
        says = f"Predictions of other code, submitted ({method.predictions}): what they saw is not known"
        return Introduction(says, (), {}, (), "")
    loaded = load_method(method.name)
    settings, asks = settings_of(loaded, method.settings), asks_of(loaded)
    check_priors(method.priors, asks)
    code = fingerprint(method.name, with_priors=bool(asks or loaded.needs))
    return Introduction(loaded.summary, loaded.needs, to_builtins(settings), asks, code)


def meet(meeting: Meeting) -> Outcome:
    """Introduce a method in this process, truth closed; as JSON, for an object would bring its module."""

    def work() -> Outcome:
        with closed(Guard(meeting.dataset, meeting.jobs)):
            return Outcome(value=dumps(introduction_of(meeting.method)))

    return guarded(work, None)


def _heard(outcome: Outcome) -> Introduction:
    if outcome.reason:
        raise MethodError(outcome.reason)
    return from_builtins(Introduction, parse_json(outcome.value), MethodError, "what a method says of itself")

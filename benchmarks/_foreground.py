# SPDX-License-Identifier: Apache-2.0
"""Fit once, in a process of its own: the process that asks outlives a crash of the method."""

import contextlib
import os
import shutil
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from graycard import MethodError, Progress
from graycard.benchmarks._fit import FitSpec, Fitted, fit_scene
from graycard.benchmarks._handed import check_there, places_of, scratch_folder
from graycard.benchmarks._jobs import THREADS, guarded, threads_limited
from graycard.io import silent
from graycard.methods.confined import SERVE, confined
from graycard.processes import USUAL, Limits, Outcome, named, run_all, worker_progress
from graycard.resources import usable_cores


@dataclass(frozen=True, slots=True)
class _Asked:
    """A fit that is asked for, with the folders that it is written to."""

    spec: FitSpec
    predictions: Path
    save: Path | None


@dataclass(frozen=True, slots=True)
class _Question:
    """A call that is asked for."""

    method: str
    scene: Path
    function: str
    arguments: Mapping[str, Any]
    allowed: tuple[Path, ...]


def ask_apart(
    method: str,
    scene: Path,
    function: str,
    limits: Limits = USUAL,
    *,
    told: Mapping[str, Any],
    allowed: tuple[Path, ...] = (),
) -> Any:
    """Call a function where a method of others may be imported: in a process to which the dataset is closed.

    Args:
        method: ``module:attribute``, or a registered name.
        scene: ``DATASET/<track>/<scene>``.
        function: ``module:function``, called there.
        limits: Of time and memory.
        told: Its arguments by name, JSON data.
        allowed: Files and folders that the method may read and change.

    Returns:
        JSON data.

    Raises:
        MethodError: It fails, or ends its process; the traceback of the method's own code is printed.
    """
    asked = _Question(method, scene, function, told, allowed)
    (outcome,) = run_all(_ask, [asked], 1, silent, limits=limits, confines=SERVE)
    if outcome.reason:
        raise MethodError(outcome.reason)
    return outcome.value


def fit_words(spec: FitSpec) -> str:
    """Return what a fit is of."""
    return f"{spec.label or spec.method} on {spec.scene.parent.name}/{spec.scene.name}"


def fit_apart(
    spec: FitSpec,
    predictions: Path,
    progress: Progress,
    save: Path | None = None,
    limits: Limits = USUAL,
) -> Fitted:
    """Fit a method as :func:`fit_scene` does, in a process of its own.

    A fit that fails leaves no folder that was not there before.

    Args:
        spec: The fit.
        predictions: Folder of the predictions.
        progress: Called now and then.
        save: Folder of the decomposition itself; None: it is not saved.
        limits: Limits of time and memory.

    Raises:
        MethodError: The fit failed, for whatever reason, or its process ended. The traceback of the method's
            code is printed.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    new = [folder for folder in (predictions, save) if folder is not None and not folder.exists()]
    try:
        asked, told = _Asked(spec, predictions, save), named(progress, fit_words(spec))
        (outcome,) = run_all(_fit, [asked], 1, told, limits=limits, confines=SERVE)
        if outcome.reason:
            raise MethodError(outcome.reason)
    except BaseException:
        for folder in new:
            with contextlib.suppress(OSError):
                shutil.rmtree(folder)
        raise
    return outcome.value


def _ask(asked: _Question) -> Outcome:
    """Call a function in a confined process of a worker."""

    def work() -> Any:
        with scratch_folder() as scratch:
            check_there([asked.scene])
            places = places_of(scratch, [asked.scene], {}, allowed=asked.allowed)
            with confined(asked.method, scratch, places) as method:
                return method.call(asked.function, **asked.arguments)

    return guarded(lambda: _with_traceback(work), None)


def _fit(asked: _Asked) -> Outcome:
    """Fit, in a worker, with as many threads as cores; with those that the user has asked a library for."""
    given = asked.spec, asked.predictions, worker_progress(), asked.save
    of_user = {name: os.environ[name] for name in THREADS if name in os.environ}
    if "OMP_NUM_THREADS" in of_user:
        of_user.setdefault("MKL_NUM_THREADS", of_user["OMP_NUM_THREADS"])  # torch asks MKL first
    with threads_limited(usable_cores()):
        os.environ.update(of_user)
        return guarded(lambda: _with_traceback(lambda: fit_scene(*given)), None)


def _with_traceback(work: Callable[[], Any]) -> Outcome:
    """Do some work, and print the traceback of a method's own error, for whoever writes it."""
    try:
        return Outcome(value=work())
    except MethodError as error:
        if error.__cause__ is not None:
            traceback.print_exception(error.__cause__)
        raise

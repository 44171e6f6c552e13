# SPDX-License-Identifier: Apache-2.0
"""Fit once, in a process of its own: the process that asks outlives a crash of the method."""

import contextlib
import shutil
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from graycard import MethodError, Progress
from graycard.benchmarks._fit import FitSpec, Fitted, fit_scene, load_for
from graycard.benchmarks._jobs import guarded
from graycard.benchmarks.workers import USUAL, Limits, Outcome, run_all, worker_progress
from graycard.io import silent
from graycard.methods import BUILT_IN


@dataclass(frozen=True, slots=True)
class _Asked:
    """A fit that is asked for, with the folders that it is written to."""

    spec: FitSpec
    predictions: Path
    save: Path | None


def check_import(method: str, scene: Path, limits: Limits = USUAL) -> None:
    """Import a method of others in a process of its own, before this one does: its code may end a process.

    Args:
        method: A registered name or ``module:attribute``.
        scene: ``DATASET/<track>/<scene>``, whose dataset is closed meanwhile.
        limits: Of time and memory.

    Raises:
        MethodError: It fails to import, or ends its process; the traceback of its code is printed.
    """
    if method in BUILT_IN:
        return
    (outcome,) = run_all(_import, [(method, scene)], 1, silent, limits=limits)
    if outcome.reason:
        raise MethodError(outcome.reason)


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
        (outcome,) = run_all(_fit, [_Asked(spec, predictions, save)], 1, progress, limits=limits)
        if outcome.reason:
            raise MethodError(outcome.reason)
    except BaseException:
        for folder in new:
            with contextlib.suppress(OSError):
                shutil.rmtree(folder)
        raise
    return outcome.value


def _import(asked: tuple[str, Path]) -> Outcome:
    """Import a method, in a worker."""

    def imported() -> None:
        load_for(*asked)

    return guarded(lambda: _with_traceback(imported), None)


def _fit(asked: _Asked) -> Outcome:
    """Fit, in a worker."""
    given = asked.spec, asked.predictions, worker_progress(), asked.save
    return guarded(lambda: _with_traceback(lambda: fit_scene(*given)), None)


def _with_traceback(work: Callable[[], Fitted | None]) -> Outcome:
    """Do some work, and print the traceback of a method's own error, for whoever writes it."""
    try:
        return Outcome(value=work())
    except MethodError as error:
        if error.__cause__ is not None:
            traceback.print_exception(error.__cause__)
        raise

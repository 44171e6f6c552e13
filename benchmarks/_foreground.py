# SPDX-License-Identifier: Apache-2.0
"""A single fit, in a process of its own: whoever asked for it outlives a crash of the method."""

import contextlib
import shutil
import traceback
from dataclasses import dataclass
from pathlib import Path

from graycard import MethodError, Progress
from graycard.benchmarks._fit import FitSpec, Fitted, fit_scene
from graycard.benchmarks._introduction import introduce
from graycard.benchmarks._jobs import guarded
from graycard.benchmarks._suites import SuiteMethod
from graycard.benchmarks.workers import USUAL, Limits, Outcome, run_all, worker_progress


@dataclass(frozen=True, slots=True)
class _Asked:
    """What is fitted, and where it is written to."""

    spec: FitSpec
    predictions: Path
    save: Path | None


def check_import(method: str, scene: Path) -> None:
    """Import a method in a process of its own, before this one does: its code may end a process.

    Args:
        method: A registered name or ``module:attribute``.
        scene: ``DATASET/<track>/<scene>``, whose dataset is closed meanwhile.

    Raises:
        UnknownNameError: No method has this name.
        MethodError: It fails to import, or ends its process.
    """
    dataset = Path(scene).absolute().parents[1]
    introduce([SuiteMethod(method)], dataset, dataset, 1)


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
        spec: What to fit.
        predictions: Where to.
        progress: Called now and then.
        save: Also write the decomposition itself, to this folder.
        limits: Of time and memory.

    Raises:
        MethodError: The fit failed, or its process ended; the traceback of the method's code is printed.
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


def _fit(asked: _Asked) -> Outcome:
    """Fit, in a worker; the traceback of a method's own error is for whoever writes it."""

    def work() -> Outcome:
        try:
            return Outcome(value=fit_scene(asked.spec, asked.predictions, worker_progress(), asked.save))
        except MethodError as error:
            if error.__cause__ is not None:
                traceback.print_exception(error.__cause__)
            raise

    return guarded(work, None)

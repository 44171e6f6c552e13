# SPDX-License-Identifier: Apache-2.0
"""Check a command that stands in the place of a method: it is run twice on a tiny scene."""

import time
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from graycard import GraycardError, PredictionError, open_capture, open_predictions
from graycard.benchmarks._handed import scratch_folder
from graycard.benchmarks._jobs import guarded
from graycard.benchmarks.commands._command import Command
from graycard.benchmarks.commands._fit import CommandSpec, fit_command, introduction_of_command
from graycard.benchmarks.kit._check import STAGE_S, Findings, tiny_scene
from graycard.benchmarks.kit._conventions import faults_of_conventions
from graycard.benchmarks.kit._faults import Fault, once
from graycard.benchmarks.kit._layers import differences, faults_of_layers
from graycard.io import silent
from graycard.methods.confined import SERVE
from graycard.processes import Limits, Outcome, StandingWorker

_TIMES = 2
_SAME = 1e-4
_OUTPUTS = ("{out}", "expected views", "of shape")
"""Words of an error that speaks of outputs, not of the command."""


def check_command(
    command: Command,
    settings: Mapping[str, Any] | None = None,
    track: str = "dark",
    *,
    allowed: tuple[Path, ...] = (),
    timeout_s: float = STAGE_S,
) -> Findings:
    """Check a command on a tiny scene, confined as in a bench.

    Args:
        command: What is run.
        settings: In the place of placeholders.
        track: Of the tiny scene.
        allowed: Files and folders that it may read and change besides.
        timeout_s: Seconds that it may take.

    Raises:
        ValueError: The command has a placeholder that is none.
        MethodError: Its code or its interpreter is missing.
        OutputError: There is no room for the scene.
    """
    command.check("the command", settings or {})
    introduction_of_command(command, settings or {})
    begun = time.monotonic()
    with scratch_folder() as folder, closing(_worker(timeout_s)) as worker:
        scene = tiny_scene(folder / "data", track)
        spec = CommandSpec(command, "command", settings or {}, 0, scene, allowed)
        made = [folder / f"run-{number}" / "predictions" for number in range(_TIMES)]
        faults: list[Fault] = []
        for predictions in made:
            outcome = worker.do((spec, predictions))
            if outcome.reason:
                faults.append(_fault_of(outcome.reason))
                break
            faults += outcome.value
        provides: tuple[str, ...] = ()
        if not any(fault.name in ("command", "outputs", "hangs") for fault in faults):
            faults += _of_both(made, scene)
            shown = open_capture(scene / "capture").test[0].name
            provides = tuple(sorted(open_predictions(made[0]).layers(shown)))
    return Findings(command.run, once(faults), provides, settings or {}, track, time.monotonic() - begun)


def run_command(asked: tuple[CommandSpec, Path]) -> Outcome:
    """Run a command; the value is the faults of what it wrote."""
    spec, predictions = asked

    def work() -> Outcome:
        try:
            fit_command(spec, predictions, silent)
        except PredictionError as error:
            return Outcome(value=[Fault("outputs", str(error))])
        return Outcome(value=_of_outputs(predictions, spec.scene))

    return guarded(work, None)


def _worker(timeout_s: float) -> StandingWorker:
    return StandingWorker(run_command, Limits(timeout_s), tasks_each=_TIMES, confines=SERVE)


def _fault_of(reason: str) -> Fault:
    if "expected an end within" in reason:
        return Fault("hangs", "the command did not end in its time")
    ended = any(words in reason for words in ("ended with exit code", "did not end within"))
    is_of_outputs = not ended and any(words in reason for words in _OUTPUTS)
    return Fault("outputs" if is_of_outputs else "command", reason)


def _of_outputs(predictions: Path, scene: Path) -> list[Fault]:
    """Return faults of single arrays, and of conventions where the arrays are sound."""
    found = open_predictions(predictions)
    views = open_capture(scene / "capture", check=False).views
    faults = [
        fault
        for view in views
        if view.name in found.view_names()
        for fault in faults_of_layers(found.layers(view.name), view)
    ]
    return faults or list(faults_of_conventions(predictions, scene))


def _of_both(made: list[Path], scene: Path) -> list[Fault]:
    """Return a fault if two runs with one seed differ."""
    name = open_capture(scene / "capture", check=False).test[0].name
    try:
        these, those = (open_predictions(folder).layers(name) for folder in made)
    except GraycardError as error:
        return [Fault("outputs", str(error))]
    found = differences(these, those, _SAME)
    return [Fault("seed", f"view {name}: {', '.join(found)}")] if found else []

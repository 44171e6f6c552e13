# SPDX-License-Identifier: Apache-2.0
"""Check a method's contract on tiny scenes: seconds, no renderer, and each fault by name with its mend."""

import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from graycard import TRACKS, MethodError, Progress, UnknownNameError
from graycard.benchmarks._handed import scratch_folder
from graycard.benchmarks.kit._faults import Fault, once
from graycard.benchmarks.kit._stages import (
    MEET,
    REMOVE,
    TRY,
    Result,
    Trial,
    asks_in,
    run_stage,
    with_settings,
)
from graycard.io import silent
from graycard.methods import offers
from graycard.methods.confined import PROBE
from graycard.methods.priors import PriorSpec
from graycard.processes import Limits, StandingWorker
from graycard.tiny import add_materials, write_tiny_scene

TRAIN, TEST = 6, 2
"""Views of a tiny scene."""
STAGE_S = 120.0
"""Seconds that a stage may take by default: some, unless the machine is busy."""
_MEETING_S = 1800.0
"""Seconds in which a method is imported, and its kernels are compiled."""
_REMOVAL = "tabletop"
_STAGES = 20
"""Stages that a worker runs at most."""
_TOO_LONG = "expected an end within"
_ORACLE = PriorSpec("oracle", 2)
"""Answers a method that cannot do without a prior."""


@dataclass(frozen=True, slots=True)
class Findings:
    """The end of a check."""

    method: str
    faults: tuple[Fault, ...]
    provides: tuple[str, ...] = ()
    """Layers that it renders."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Those that it was fitted with, where they are not its defaults."""
    track: str = ""
    """Track of the tiny scene that it took; empty where it took none."""
    seconds: float = 0.0


def check_method(
    method: str,
    settings: Mapping[str, Any] | None = None,
    priors: PriorSpec | None = None,
    progress: Progress = silent,
    *,
    allowed: tuple[Path, ...] = (),
    timeout_s: float = STAGE_S,
) -> Findings:
    """Check a method on tiny scenes, its code confined as in a fit.

    Args:
        method: A registered name or ``module:attribute``.
        settings: Those that differ from its defaults; ``iterations`` are 20 if it has any.
        priors: Source of answers; for a method that has to ask the oracle if None.
        progress: Called after each stage.
        allowed: Files and folders that it may read and change besides.
        timeout_s: Seconds that each of the stages may take.

    Raises:
        UnknownNameError: No method has this name.
        OutputError: There is no room for the scenes.
    """
    if ":" not in method and method not in offers():
        raise UnknownNameError("method", method, offers(), "A method of your own: module:attribute")
    begun = time.monotonic()
    with scratch_folder() as folder, closing(_worker(timeout_s)) as worker:
        check = _Check(folder, worker, progress)
        first = Trial(method, settings or {}, priors or PriorSpec(), check.scene(TRACKS[0]), folder, allowed)
        with closing(_worker(_MEETING_S)) as patient:
            told = replace(check, worker=patient).told(first)
        found = check.met(first, told, ask_oracle=priors is None)
    return replace(found, faults=once(found.faults), seconds=time.monotonic() - begun)


def tiny_scene(dataset: Path, track: str) -> Path:
    """Write the scene of a track that methods are checked on, and return its folder."""
    return add_materials(write_tiny_scene(dataset, track, train=TRAIN, test=TEST, points=True))


def _worker(timeout_s: float) -> StandingWorker:
    """Return the worker that runs stages, one after another."""
    return StandingWorker(run_stage, Limits(timeout_s), tasks_each=_STAGES, confines=PROBE)


@dataclass(frozen=True)
class _Check:
    """A check under way."""

    folder: Path
    """For scenes, and for what one stage leaves to others."""
    worker: StandingWorker
    progress: Progress

    def scene(self, track: str) -> Path:
        """Return the tiny scene of a track, which is written when it is first asked for."""
        there = self.folder / "data" / track / "tiny-0000"
        if there.is_dir():
            return there
        return tiny_scene(self.folder / "data", track)

    def told(self, trial: Trial) -> tuple[Any, tuple[Fault, ...]]:
        """Import the method, and return what it says of itself (nothing if it cannot), and its faults."""
        told = self._done(MEET, trial) or ({}, (self._end(MEET),))
        self.progress(0.2, "imported")
        return told

    def met(self, trial: Trial, met: tuple[Any, tuple[Fault, ...]], *, ask_oracle: bool) -> Findings:
        """Fit the method.

        Args:
            trial: The method with the settings of whoever asks.
            met: What it says of itself, and its faults so far.
            ask_oracle: Whether the oracle may answer what the method has to ask.
        """
        told, faults = met
        if not told:
            return Findings(trial.method, faults)
        trial = with_settings(trial, told)
        if ask_oracle and any(not ask.optional for ask in asks_in(told["asks"])):
            trial = replace(trial, priors=_ORACLE)
        found = self._fitted(trial)
        return replace(found, faults=(*faults, *found.faults), settings=trial.settings)

    def _fitted(self, trial: Trial) -> Findings:
        """Fit on the first track that the method takes, then go through the other stages."""
        refused: list[str] = []
        for track in TRACKS:
            tried = replace(trial, scene=self.scene(track))
            result = self._result(TRY, tried)
            if result.refused:
                refused.append(f"{track}: {result.refused}")
                continue
            faults = [*result.faults]
            for number, stage in enumerate(result.able, 1):
                self.progress(0.4 + 0.6 * number / (1 + len(result.able)), stage)
                there = replace(tried, scene=self.scene(_REMOVAL)) if stage == REMOVE else tried
                faults += self._result(stage, there).faults
            return Findings(trial.method, tuple(faults), result.provides, track=track)
        return Findings(trial.method, (Fault("refuses", "\n".join(refused)),))

    def _result(self, stage: str, trial: Trial) -> Result:
        """Return what a stage found; one that takes too long is a fault."""
        return self._done(stage, trial) or Result((self._end(stage),))

    def _done(self, stage: str, trial: Trial) -> Any:
        """Return the value of a stage; None where it took too long.

        Raises:
            MethodError: The stage itself failed.
        """
        outcome = self.worker.do((stage, trial))
        if outcome.reason and _TOO_LONG not in outcome.reason:
            raise MethodError(f"stage {stage!r} of the check failed: {outcome.reason}")
        return outcome.value

    def _end(self, stage: str) -> Fault:
        return Fault("hangs", f"stage {stage!r} did not end in its time")

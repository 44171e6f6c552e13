# SPDX-License-Identifier: Apache-2.0
"""Stages of a check, each in a process of its own: what ends one is a fault, and leaves the others."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from graycard import Capture, GraycardError, MethodError, UnknownNameError, open_predictions
from graycard.benchmarks._handed import copied_capture, places_of, scratch_folder
from graycard.benchmarks._jobs import guarded
from graycard.benchmarks._privileged import priors_for
from graycard.benchmarks.kit._conventions import faults_of_conventions, write_rendered
from graycard.benchmarks.kit._decompositions import (
    faults_of_decomposition,
    faults_of_relighting,
    faults_of_removal,
    faults_of_saving,
    lights_of,
    rendered_views,
)
from graycard.benchmarks.kit._faults import Fault
from graycard.benchmarks.kit._layers import differences, usable
from graycard.benchmarks.kit._raised import ENDED, fault_of
from graycard.io import from_builtins, silent, to_builtins
from graycard.methods import Ask, Priors, Removable
from graycard.methods.confined import PROBE, Fact, Known, ProbedMethod, confined, of_kind
from graycard.methods.priors import PriorSpec
from graycard.processes import Outcome

_STEPS = 20
"""Iterations of a fit that has any, where nobody asks for others."""
_SILENT_S = 3.0
"""Seconds of processor time from which a fit without progress is a fault."""
_REPEATED = 1e-4
"""Share of a layer's range by which a second fit, or what was loaded, may differ."""
_SEED = 0
MEET, TRY, AGAIN, REMOVE = "import", "fit", "fit again", "remove"
"""Names of the stages."""


@dataclass(frozen=True, slots=True)
class Trial:
    """A method under check."""

    method: str
    settings: Mapping[str, Any]
    priors: PriorSpec
    scene: Path
    """``DATASET/<track>/<scene>`` of a tiny scene."""
    work: Path
    """Folder of the check, for what one stage leaves to others."""
    allowed: tuple[Path, ...] = ()

    @property
    def saved(self) -> Path:
        """Return the folder of the saved decomposition."""
        return self.work / "saved"

    @property
    def predictions(self) -> Path:
        """Return the folder of what was rendered, as predictions."""
        return self.work / "predictions"


@dataclass(frozen=True, slots=True)
class Result:
    """Findings of a stage."""

    faults: tuple[Fault, ...] = ()
    refused: str = ""
    """Words of a method that does not take the capture; empty if it does."""
    able: tuple[str, ...] = ()
    """Stages that can follow."""
    provides: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Course:
    """A method in its process, with what it is to fit."""

    trial: Trial
    method: ProbedMethod
    known: Known
    capture: Capture

    def fit(self) -> Any:
        """Fit, and return the decomposition.

        Raises:
            GraycardError: As the method raises.
        """
        return self.method.fit(self.capture, self.priors(), self.trial.settings, _SEED)[0]

    def priors(self) -> Priors:
        """Return what the method is handed.

        Raises:
            GraycardError: The scene has no such truth, as one without a target.
        """
        trial, known = self.trial, self.known
        return priors_for(known.needs, known.asks, trial.priors, self.capture, trial.scene)


def run_stage(asked: tuple[str, Trial]) -> Outcome:
    """Run a stage of a check, by its name."""
    name, trial = asked
    return meet(trial) if name == MEET else _staged(trial, _STAGES[name])


def meet(trial: Trial) -> Outcome:
    """Import a method; the value is its settings for the check and its faults."""

    def work(faults: list[Fault]) -> Any:
        with _process(trial) as method:
            method.watch()
            known = method.load(trial.settings)
            faults += [Fault("settings", f.what) for f in of_kind(method.facts(), "settings-not-frozen")]
            method.compile()
            return {"settings": _fewer_steps(trial, known), "asks": to_builtins(list(known.asks))}

    def done() -> Outcome:
        faults: list[Fault] = []
        told: Any = {}
        try:
            told = work(faults)
        except GraycardError as error:
            name = "import" if error.__cause__ is not None else "declaration"
            faults.append(fault_of(error, name))
        return Outcome(value=(told, tuple(faults)))

    return guarded(done, None)


def asks_in(told: Any) -> tuple[Ask, ...]:
    """Return what a method asks a prior for, by its own account."""
    return tuple(from_builtins(Ask, ask) for ask in told)


def _tried(course: _Course) -> Result:
    """Fit a method and look at all that it gives."""
    method, faults = course.method, list[Fault]()
    method.watch()
    try:
        course.priors()
    except GraycardError as error:
        return Result(refused=str(error))
    try:
        made = course.fit()
    except GraycardError as error:
        progress = list(_of_progress(method)) if ENDED not in str(error) else []
        if error.__cause__ is None and not progress and _is_refusal(error):
            return Result(refused=str(error))
        name = "decomposition" if error.__cause__ is None and _is_of_result(error) else "fit"
        return Result(tuple(progress) or (fault_of(error, name),))
    faults += _of_progress(method)
    rendered = rendered_views(method, made, course.capture, faults)
    faults += faults_of_decomposition(method, made, course.capture, rendered)
    lights = lights_of(made, faults)
    if renders := bool(rendered.get(course.capture.test[0].name)):
        faults += faults_of_relighting(made, course.capture, course.trial.scene)
        faults += faults_of_removal(made, course.capture)
    faults += faults_of_saving(made, course.trial.saved)
    faults += _of_files(method)
    views = {view.name: view for view in course.capture.views}
    fit = {name: usable(layers, views[name].camera) for name, layers in rendered.items()}
    write_rendered(fit, lights, course.capture, course.trial.predictions)
    if not _are_of_values(faults):
        faults += faults_of_conventions(course.trial.predictions, course.trial.scene)
    provides, able = tuple(sorted(made.provides)), tuple[str, ...]()
    if isinstance(made, Removable) and renders:
        able = (REMOVE,)
    if renders and not any(fault.name == "stateful" for fault in faults):
        able = (*able, AGAIN)
    return Result(tuple(faults), "", able, provides)


def _are_of_values(faults: list[Fault]) -> bool:
    """Tell whether arrays are such that their conventions cannot be told."""
    return any(f.name in ("dtype", "shape", "channels-first", "not-finite", "layers") for f in faults)


def _repeated(course: _Course) -> Result:
    """Fit a second time with the same seed, load what the first fit saved, and stop a third fit."""
    faults = _again(course)
    if not of_kind(course.method.facts(), "progress"):
        return Result(faults)
    return Result((*faults, *_stopped(course)))


def _again(course: _Course) -> tuple[Fault, ...]:
    view = course.capture.test[0]
    made, faults = course.fit(), list[Fault]()
    names = sorted(made.provides)
    before = _rendered_before(course.trial, view.name)
    again = usable(made.render(view.camera, names), view.camera)
    if found := differences(before, again, _REPEATED):
        faults.append(Fault("seed", f"view {view.name}: {', '.join(found)}"))
    if not course.trial.saved.is_dir():
        return tuple(faults)
    try:
        loaded = course.method.restored(course.trial.saved)
        after = usable(loaded.render(view.camera, sorted(loaded.provides)), view.camera)
    except GraycardError as error:
        return (*faults, fault_of(error, "load"))
    found = differences(before, after, _REPEATED)
    if missing := sorted({*before} - {*after}):
        found.append(f"{missing[0]} is not there")
    faults += [Fault("round-trip", ", ".join(found))] if found else []
    return tuple(faults)


def _rendered_before(trial: Trial, view: str) -> dict[str, Any]:
    """Return the layers of a view that the first fit rendered."""
    return open_predictions(trial.predictions).layers(view)


def _stopped(course: _Course) -> tuple[Fault, ...]:
    """Stop a fit at its first call of progress, as Ctrl-C does."""
    course.method.watch(stops=True)
    with suppress(GraycardError):
        course.fit()
    ended = of_kind(course.method.facts(), "fit-ended")
    if not ended or ended[0].what == "KeyboardInterrupt":
        return ()
    went_on = "went on to its end" if ended[0].what == "returned" else f"raised {ended[0].what} instead"
    return (Fault("cancel", f"the fit was told to stop, and {went_on}"),)


def _removed(course: _Course) -> Result:
    """Fit a scene with a target, and take that away."""
    try:
        made = course.fit()
    except GraycardError as error:
        return Result() if error.__cause__ is None else Result((fault_of(error, "remove"),))
    return Result(tuple(faults_of_removal(made, course.capture)))


_STAGES: Mapping[str, Callable[[_Course], Result]] = {
    TRY: _tried,
    AGAIN: _repeated,
    REMOVE: _removed,
}


def _of_progress(method: ProbedMethod) -> Iterator[Fault]:
    """Yield faults of calls of progress in the last fit."""
    facts = method.facts()
    yield from (Fault("progress", fact.what) for fact in of_kind(facts, "progress-wrong")[:1])
    taken = sum(fact.number for fact in of_kind(facts, "fit-ended"))
    if not of_kind(facts, "progress") and taken > _SILENT_S:
        yield Fault("silent", f"{taken:.1f} s of processor time without one call")


def _of_files(method: ProbedMethod) -> Iterator[Fault]:
    """Yield faults of what the method opened."""
    facts: list[Fact] = method.facts()
    yield from (Fault("writes", fact.what) for fact in of_kind(facts, "writes-outside")[:1])
    refused = [*(f.what for f in of_kind(facts, "reads-truth")), *method.process.refusals()]
    yield from (Fault("truth", what) for what in refused[:1])
    yield from (Fault("network", "a socket") for _ in of_kind(facts, "network")[:1])


def _is_refusal(error: GraycardError) -> bool:
    """Tell whether a method says that it does not take a capture, or graycard that it gives none."""
    return isinstance(error, MethodError) and ENDED not in str(error) and not _is_of_result(error)


def _is_of_result(error: GraycardError) -> bool:
    """Tell whether an error speaks of what a fit gave: no decomposition, no layer, or an unknown one."""
    words = ("to give a decomposition", "to provide a layer")
    return isinstance(error, UnknownNameError) or any(word in str(error) for word in words)


def _fewer_steps(trial: Trial, known: Known) -> dict[str, Any]:
    """Return the settings of the check: few iterations where the method has any."""
    steps = known.settings.get("iterations")
    if "iterations" in trial.settings or not isinstance(steps, int):
        return dict(trial.settings)
    return {**trial.settings, "iterations": min(steps, _STEPS)}


def _staged(trial: Trial, stage: Callable[[_Course], Result]) -> Outcome:
    """Run a stage; whatever ends the process of the method is a fault."""

    def work() -> Outcome:
        try:
            with scratch_folder() as copies, _process(trial, copies) as method:
                known = method.load(trial.settings)
                with copied_capture(trial.scene / "capture", copies / "a" / "capture") as capture:
                    return Outcome(value=stage(_Course(trial, method, known, capture)))
        except GraycardError as error:
            return Outcome(value=Result((fault_of(error, "fit"),)))

    return guarded(work, None)


@contextmanager
def _process(trial: Trial, *readable: Path) -> Iterator[ProbedMethod]:
    """Return a process for the method's code, to which the truth is closed."""
    with scratch_folder() as scratch:
        more = (*readable, *([trial.saved] if trial.saved.is_dir() else []))
        places = places_of(scratch, [trial.scene], trial.settings, allowed=trial.allowed, readable=more)
        told = {"serve": PROBE, "kind": ProbedMethod}
        with confined(trial.method, scratch, places, silent, **told) as method:
            assert isinstance(method, ProbedMethod), "it was asked for"
            yield method


def with_settings(trial: Trial, told: Mapping[str, Any]) -> Trial:
    """Return a trial with settings as :func:`meet` told them."""
    return replace(trial, settings=dict(told["settings"]))

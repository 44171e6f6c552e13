# SPDX-License-Identifier: Apache-2.0
"""Fit one method on one scene: the same for the command line, a process pool, and a cluster.

No code of the method runs in the process that calls: that one reads the truth, hands over what the method
needs, answers for priors, and writes the predictions.
"""

import tempfile
import time
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from graycard import Capture, MethodError, Progress
from graycard.benchmarks._changes import changes_for
from graycard.benchmarks._guest import check_donor, guest_of
from graycard.benchmarks._handed import check_there, copied_capture, places_of, scratch_folder
from graycard.benchmarks._privileged import priors_for
from graycard.io import sha256, writable_folder
from graycard.methods import (
    COMPOSITION,
    LIGHTS,
    RELIGHTING,
    Changes,
    Counting,
    Decomposition,
    Guest,
    Priors,
    blame,
    write_predictions,
)
from graycard.methods.confined import ConfinedMethod, Known, Spent, confined
from graycard.methods.priors import PriorSpec, weights_in
from graycard.predictions import clear_predictions
from graycard.processes import narrowed
from graycard.records import Access, Cost

FITTING = 0.9
"""Share of the progress that the fit itself has; the rest is that of its views, as they are rendered."""


@dataclass(frozen=True, slots=True)
class FitSpec:
    """All that a fit depends on."""

    method: str
    """A registered name or ``module:attribute``."""
    settings: Mapping[str, Any]
    """Those that differ from the method's defaults."""
    seed: int
    scene: Path
    """``DATASET/<track>/<scene>``."""
    label: str = ""
    """Name in tables; that of the method if empty."""
    priors: PriorSpec = field(default_factory=PriorSpec)
    """Source of answers to the method's asks."""
    donor: Path | None = None
    """The scene, ``DATASET/<track>/<scene>``, whose object the truth shows in this one: it is fitted too, and
    its object put in. None: that is left out."""
    stages: Path | None = None
    """``RUN/stages/<code>/<capture>``, where a :class:`graycard.methods.Staged` method saves what other fits
    go on from; None: nothing is saved but where the settings say so."""
    allowed: tuple[Path, ...] = ()
    """Files and folders that the method may read and change besides its code, its libraries and the capture:
    its weights, or ``/dev/shm`` for processes that share memory."""


@dataclass(frozen=True, slots=True)
class Fitted:
    """Record of a fit."""

    cost: Cost
    access: Access
    machine: Mapping[str, Any] | None = None
    """Hardware that it was fitted on, where that is known."""


def fit_scene(
    spec: FitSpec,
    predictions: Path,
    progress: Progress,
    save: Path | None = None,
    *,
    jobs: Path | None = None,
) -> Fitted:
    """Fit a method in a process of its own, to which truth is closed, and write its predictions folder.

    Wall time and memory are those of the fit to the scene. CPU time includes the fit to a donor.

    Args:
        spec: What to fit.
        predictions: Where to; older predictions are replaced, anything else is left alone.
        progress: Called now and then.
        save: Also write the decomposition itself, to this folder.
        jobs: Folder of all fits of a run: their predictions are closed too, and so are its records.

    Raises:
        MethodError: The method, its settings or the capture do not go together, it reached for truth, or its
            process ended.
        DatasetError: The scene is missing or damaged, or the donor is not where its object comes from.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    with ExitStack() as things:
        scratch, copies = things.enter_context(scratch_folder()), things.enter_context(scratch_folder())
        scenes = [spec.scene, *([spec.donor] if spec.donor else [])]
        check_there(scenes)
        weights = weights_in(spec.priors)
        more = {"allowed": spec.allowed, "readable": (copies, *weights)}
        places = places_of(scratch, scenes, spec.settings, jobs, spec.stages, **more)
        process = confined(spec.method, scratch, places, progress, spec.label)
        fit = _Fit(spec, things.enter_context(process), copies, things)
        known = fit.method.load(spec.settings)
        donor = None if COMPOSITION in known.needs else spec.donor
        if donor is not None:
            check_donor(spec.scene, donor)
        capture = fit.capture_of(spec.scene)
        priors = priors_for(known.needs, known.asks, spec.priors, capture, spec.scene)
        clear_predictions(predictions)
        if save is not None:
            writable_folder(save)
        fit.method.progress = narrowed(progress, 0.0, 0.0)
        fit.method.compile()
        fit.method.progress = narrowed(progress, 0.0, FITTING)
        decomposition, spent = fit.timed(capture, priors)
        changes = changes_for(decomposition, capture, spec.scene)
        if donor is not None:
            guest, resumed = _guest(fit, known, donor, changes)
            changes, spent = replace(changes, guest=guest), replace(spent, resumed=spent.resumed or resumed)
        fit.method.progress = narrowed(progress, FITTING, 1.0)
        cost = _written(fit, decomposition, capture, changes, spent, predictions, alone=donor is None)
        if save is not None:
            decomposition.save(save)
        if all(place.suffix == ".safetensors" for place in weights):
            fit.method.keep_kernels()  # no program in weights can have made them
        return Fitted(cost, _access(fit, priors, donor))


@dataclass(frozen=True, slots=True)
class _Cost:
    """Cost of a fit, with the stages that it found done."""

    seconds: float
    peak_mib: float
    resumed_peak_mib: float
    resumed: bool


@dataclass(frozen=True, slots=True)
class _Fit:
    """A fit under way: its spec, the process of the method, and what is open until the end."""

    spec: FitSpec
    method: ConfinedMethod
    copies: Path
    """Folder of the captures. The method may only read it: who writes there meets no links of others."""
    things: ExitStack

    def capture_of(self, scene: Path) -> Capture:
        """Return a copy of a scene's capture, in a folder that the method may read."""
        folder = Path(tempfile.mkdtemp(prefix="capture-", dir=self.copies))
        return self.things.enter_context(copied_capture(scene / "capture", folder / "capture"))

    def fitted(self, capture: Capture, priors: Priors) -> tuple[Decomposition, Spent]:
        """Return what the method makes of a capture, and the cost of what it found done.

        Raises:
            MethodError: It cannot fit the capture, or reaches for truth.
        """
        spec = self.spec
        return self.method.fit(capture, priors, spec.settings, spec.seed, spec.stages)

    def timed(self, capture: Capture, priors: Priors) -> tuple[Decomposition, _Cost]:
        """Return what the method makes of a capture, and what that took."""
        start = time.perf_counter()
        decomposition, resumed = self.fitted(capture, priors)
        elapsed = time.perf_counter() - start + resumed.seconds
        peak = max(self.method.process.peak_mib(), resumed.peak_mib)
        return decomposition, _Cost(elapsed, peak, resumed.peak_mib, resumed.seconds > 0)


def _written(
    fit: _Fit,
    decomposition: Decomposition,
    capture: Capture,
    changes: Changes,
    spent: _Cost,
    predictions: Path,
    *,
    alone: bool,
) -> Cost:
    """Write the predictions of what was fitted, and return the cost of both.

    Args:
        fit: The fit.
        decomposition: What came of it.
        capture: What it was fitted to.
        changes: What it is to show besides the scene as it is.
        spent: What the fit took.
        predictions: Where to.
        alone: Whether nothing else was fitted in this process, so that its peak memory is that of the fit.
    """
    fit.method.seed(fit.spec.seed)  # pictures are the same whatever was fitted besides
    start, begun = time.perf_counter(), time.process_time()
    write_predictions(decomposition, capture, fit.method.label, predictions, fit.method.progress, changes)
    elapsed = spent.seconds + time.perf_counter() - start
    peak = max(fit.method.process.peak_mib(), spent.resumed_peak_mib) if alone else spent.peak_mib
    taken = None if spent.resumed else fit.method.process.cpu_s()
    with blame(fit.spec.method):
        counts = _counts(decomposition, capture)
    return Cost(elapsed, peak, counts, None if taken is None else taken + time.process_time() - begun)


def _guest(fit: _Fit, known: Known, donor: Path, changes: Changes) -> tuple[Guest | None, bool]:
    """Return the object that is to be put in, and whether its fit found stages done.

    The copy of its capture lives as long as that of the scene.

    Raises:
        MethodError: The method puts no objects into scenes, or cannot fit this one.
    """
    spec = fit.spec
    if changes.composition is None:
        raise MethodError(
            f"expected {spec.method!r} to give a decomposition with compose(), got one without. Leave out "
            "--donor, or `composes` in the suite"
        )

    def fit_donor(capture: Capture) -> Decomposition:
        priors = priors_for(known.needs, known.asks, spec.priors, capture, donor)
        decomposition, found = fit.fitted(capture, priors)
        resumed.append(found.seconds > 0)
        return decomposition

    resumed: list[bool] = []
    return guest_of(donor, fit.capture_of(donor), changes.composition, fit_donor), any(resumed)


def _counts(decomposition: Decomposition, capture: Capture) -> dict[str, float]:
    """Return what a method that counts says of a held-out view: the means over them.

    Raises:
        MethodError: It does not give what it claims.
    """
    if not isinstance(decomposition, Counting):
        return {}
    found = [decomposition.counts(view.camera) for view in capture.test]
    if not all(counts.keys() == found[0].keys() for counts in found):
        raise MethodError(f"expected the same counts of each view, got {[sorted(c) for c in found]}")
    return {name: float(sum(counts[name] for counts in found)) / len(found) for name in found[0]}


def _access(fit: _Fit, priors: Priors, donor: Path | None) -> Access:
    """Return what a fit could see, for the record."""
    layers = {name for found in priors.layers.values() for name in found}
    beside = {
        LIGHTS: priors.lights is not None,
        RELIGHTING: bool(priors.relighting),
        COMPOSITION: priors.composition is not None,
    }
    privileged = layers | {name for name, there in beside.items() if there}
    manifest = sha256(fit.spec.scene / "capture" / "manifest.json")
    of_donor = "" if donor is None else sha256(donor / "capture" / "manifest.json")
    process = fit.method.process
    allowed = tuple(map(str, fit.spec.allowed))
    return Access(process.guard, manifest, tuple(sorted(privileged)), process.refusals(), of_donor, allowed)

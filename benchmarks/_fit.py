# SPDX-License-Identifier: Apache-2.0
"""Fit one method on one scene: the same for the command line, a process pool, and a cluster."""

import random
import sys
import time
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from graycard import Capture, MethodError, Progress
from graycard.benchmarks._changes import changes_for
from graycard.benchmarks._guard import GUARD, Guard, closed, closed_to_fits, copied_capture
from graycard.benchmarks._guest import check_donor, guest_of
from graycard.benchmarks._privileged import priors_for
from graycard.io import peak_memory_mib, sha256, writable_folder
from graycard.methods import (
    COMPOSITION,
    LIGHTS,
    RELIGHTING,
    Changes,
    Compiled,
    Counting,
    Decomposition,
    Guest,
    Method,
    Priors,
    Staged,
    blame,
    load_method,
    resumed_time,
    settings_of,
    write_predictions,
)
from graycard.methods.priors import PriorSpec
from graycard.predictions import clear_predictions
from graycard.records import Access, Cost


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
    """What answers the method's asks."""
    donor: Path | None = None
    """The scene, ``DATASET/<track>/<scene>``, whose object the truth shows in this one: it is fitted too, and
    its object put in. None: that is left out."""
    stages: Path | None = None
    """``RUN/stages/<code>/<capture>``, where a :class:`graycard.methods.Staged` method saves what other fits
    go on from; None: nothing is saved but where the settings say so."""


@dataclass(frozen=True, slots=True)
class Fitted:
    """What is to be recorded of a fit."""

    cost: Cost
    access: Access


def fit_scene(
    spec: FitSpec,
    predictions: Path,
    progress: Progress,
    save: Path | None = None,
    *,
    jobs: Path | None = None,
    own: Path | None = None,
) -> Fitted:
    """Fit a method and write its predictions folder; truth is closed while the method's code runs.

    What is recorded is of the scene alone: a fit of the donor costs neither time nor memory there.

    Args:
        spec: What to fit.
        predictions: Where to; older predictions are replaced, anything else is left alone.
        progress: Called now and then.
        save: Also write the decomposition itself, to this folder.
        jobs: Folder of other fits, whose predictions are closed too.
        own: The folder of this fit in ``jobs``.

    Raises:
        MethodError: The method, its settings or the capture do not go together, or it reached for truth.
        DatasetError: The scene is missing or damaged, or the donor is not where its object comes from.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    guard = closed_to_fits(spec.scene, own, jobs, spec.donor, spec.stages)
    with closed(guard):  # a module's own code runs when it is imported
        method = load_method(spec.method)
        settings_of(method, spec.settings)
    donor = None if COMPOSITION in method.needs else spec.donor
    if donor is not None:
        check_donor(spec.scene, donor)
    with ExitStack() as copies:
        capture = copies.enter_context(copied_capture(spec.scene / "capture"))
        fit = _Fit(spec, guard, capture, priors_for(method, spec.priors, capture, spec.scene), progress)
        clear_predictions(predictions)
        if save is not None:
            writable_folder(save)
        _compile_kernels(fit, method)
        decomposition, spent = _timed_fit(fit, method)
        changes = changes_for(decomposition, capture, spec.scene)
        if donor is not None:
            changes = replace(changes, guest=_guest(fit, donor, copies, changes))
        cost = _written(fit, decomposition, changes, spent, predictions, alone=donor is None)
        if save is not None:
            with closed(guard):
                decomposition.save(save)
        return Fitted(cost, _access(guard, capture, fit.priors, donor))


@dataclass(frozen=True, slots=True)
class _Fit:
    """A fit under way: its spec, what is closed meanwhile, and what the method is given."""

    spec: FitSpec
    guard: Guard
    capture: Capture
    """The copy."""
    priors: Priors
    progress: Progress


@dataclass(frozen=True, slots=True)
class _Spent:
    """Cost of a fit, with the stages that it found done."""

    seconds: float
    peak_mib: float
    resumed_peak_mib: float


def _timed_fit(fit: _Fit, method: Method) -> tuple[Decomposition, _Spent]:
    """Fit, and say what that took."""
    start = time.perf_counter()
    with resumed_time() as resumed:
        decomposition = _fitted(fit, method)
    elapsed = time.perf_counter() - start + resumed.seconds
    return decomposition, _Spent(elapsed, max(peak_memory_mib(), resumed.peak_mib), resumed.peak_mib)


def _compile_kernels(fit: _Fit, method: Method) -> None:
    """Compile the kernels that the method needs and the cache lacks: its clock does not run yet.

    Raises:
        UnknownNameError: It names kernels that there are not.
        MethodError: It reaches for truth.
    """
    with closed(fit.guard), blame(fit.spec.method):
        kernels = method.kernels if isinstance(method, Compiled) else ()
        if kernels:
            from graycard.methods.splat import warm_kernels  # PyTorch takes long to import

            warm_kernels(kernels, fit.progress)


def _fitted(fit: _Fit, method: Method) -> Decomposition:
    """Fit a method that has not been fitted before: what one keeps of a fit is not there in another.

    Raises:
        MethodError: It cannot fit the capture, or reaches for truth.
    """
    spec = fit.spec
    seed_everything(spec.seed)
    with closed(fit.guard), blame(spec.method):
        settings = settings_of(method, spec.settings)
        staged = isinstance(method, Staged) and method.staged
        if spec.stages is not None and staged and not settings.checkpoint:
            settings = replace(settings, checkpoint=f"{spec.stages}/")
        return method.fit(fit.capture, fit.priors, settings, spec.seed, fit.progress)


def _written(
    fit: _Fit,
    decomposition: Decomposition,
    changes: Changes,
    spent: _Spent,
    predictions: Path,
    *,
    alone: bool,
) -> Cost:
    """Write the predictions of what was fitted, and give the cost of both.

    Args:
        fit: What was fitted.
        decomposition: What came of it.
        changes: What it is to show besides the scene as it is.
        spent: What the fit took.
        predictions: Where to.
        alone: Whether nothing else was fitted in this process, so that its peak memory is that of the fit.
    """
    seed_everything(fit.spec.seed)  # pictures are the same whatever was fitted besides
    start = time.perf_counter()
    with closed(fit.guard):
        name = fit.spec.label or fit.spec.method
        write_predictions(decomposition, fit.capture, name, predictions, fit.progress, changes)
        elapsed = spent.seconds + time.perf_counter() - start
        peak = max(peak_memory_mib(), spent.resumed_peak_mib) if alone else spent.peak_mib
        with blame(fit.spec.method):
            return Cost(elapsed, peak, _counts(decomposition, fit.capture))


def _guest(fit: _Fit, donor: Path, copies: ExitStack, changes: Changes) -> Guest | None:
    """The object that is to be put in; the copy of its capture lives as long as that of the scene.

    Raises:
        MethodError: The method puts no objects into scenes, or cannot fit this one.
    """
    spec = fit.spec
    if changes.composition is None:
        raise MethodError(
            f"expected {spec.method!r} to give a decomposition with compose(), got one without. Leave out "
            "--donor, or `composes` in the suite"
        )
    capture = copies.enter_context(copied_capture(donor / "capture"))

    def fit_donor(known: Capture) -> Decomposition:
        method = load_for(spec.method, donor)
        priors = priors_for(method, spec.priors, known, donor)
        return _fitted(replace(fit, capture=known, priors=priors), method)

    return guest_of(donor, capture, changes.composition, fit_donor)


def _counts(decomposition: Decomposition, capture: Capture) -> dict[str, float]:
    """What a method that counts says of a held-out view: the means over them.

    Raises:
        MethodError: It does not give what it claims.
    """
    if not isinstance(decomposition, Counting):
        return {}
    found = [decomposition.counts(view.camera) for view in capture.test]
    if not all(counts.keys() == found[0].keys() for counts in found):
        raise MethodError(f"expected the same counts of each view, got {[sorted(c) for c in found]}")
    return {name: float(sum(counts[name] for counts in found)) / len(found) for name in found[0]}


def _access(guard: Guard, capture: Capture, priors: Priors, donor: Path | None) -> Access:
    """What a fit could see, for the record."""
    layers = {name for found in priors.layers.values() for name in found}
    beside = {
        LIGHTS: priors.lights is not None,
        RELIGHTING: bool(priors.relighting),
        COMPOSITION: priors.composition is not None,
    }
    privileged = layers | {name for name, there in beside.items() if there}
    manifest = sha256(Path(capture.root or "") / "manifest.json")
    of_donor = "" if donor is None else sha256(donor / "capture" / "manifest.json")
    return Access(GUARD, manifest, tuple(sorted(privileged)), tuple(guard.refused), of_donor)


def load_for(name: str, scene: Path) -> Method:
    """A method to fit on a scene, imported while truth is closed: a module's own code runs then.

    Raises:
        UnknownNameError: No method has this name.
        MethodError: It fails to import, also for reaching for truth, or does not follow the contract.
    """
    with closed(closed_to_fits(scene)):
        return load_method(name)


def seed_everything(seed: int) -> None:
    """Seed every global random source that a method may use; torch only if the method has loaded it."""
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002 -- third-party methods draw from the legacy global state
    if "torch" in sys.modules:
        sys.modules["torch"].manual_seed(seed)

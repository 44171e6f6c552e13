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

from graycard import Capture, DatasetError, EnvironmentLight, MethodError, Progress, Truth, open_truth
from graycard.benchmarks._changes import changes_for, true_composition, true_relighting
from graycard.benchmarks._guard import GUARD, Guard, closed, closed_to_fits, copied_capture
from graycard.benchmarks._guest import check_donor, guest_of
from graycard.io import peak_memory_mib, sha256, writable_folder
from graycard.layers import lights_of, with_derived
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
    asks_of,
    blame,
    load_method,
    resumed_time,
    settings_of,
    write_predictions,
)
from graycard.methods.priors import PriorSpec, make_priors, truth_of
from graycard.predictions import clear_predictions
from graycard.records import Access, Cost

ALWAYS = frozenset({"radiance", "base_color", "normal", "depth"})
"""Truth that every scene has; other layers need a target, lights of their own, or a renderer with LLVM."""


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
        priors = handed_priors(method, spec.priors, capture, spec.scene)
        clear_predictions(predictions)
        if save is not None:
            writable_folder(save)
        _compile_kernels(method, progress)
        start = time.perf_counter()
        with resumed_time() as resumed:
            decomposition = _fitted(spec, guard, capture, priors, progress)
        elapsed = time.perf_counter() - start + resumed.seconds
        peak = max(peak_memory_mib(), resumed.peak_mib)
        changes = changes_for(decomposition, capture, spec.scene)
        if donor is not None:
            changes = replace(changes, guest=_guest(spec, donor, guard, copies, changes, progress))
        seed_everything(spec.seed)  # pictures are the same whatever was fitted besides
        start = time.perf_counter()
        with closed(guard):
            name = spec.label or spec.method
            write_predictions(decomposition, capture, name, predictions, progress, changes)
            elapsed += time.perf_counter() - start
            peak = peak if donor is not None else max(peak_memory_mib(), resumed.peak_mib)
            with blame(spec.method):
                cost = Cost(elapsed, peak, _counts(decomposition, capture))
            if save is not None:
                decomposition.save(save)
        return Fitted(cost, _access(guard, capture, priors, donor))


def _compile_kernels(method: Method, progress: Progress) -> None:
    """Compile what the method's part of the engine lacks, lest its first steps wait, and be timed, for it."""
    if isinstance(method, Compiled):
        from graycard.methods.splat import warm_kernels  # PyTorch takes long to import

        warm_kernels(method.kernels, progress)


def _fitted(
    spec: FitSpec, guard: Guard, capture: Capture, priors: Priors, progress: Progress
) -> Decomposition:
    """Fit a new instance of the method: what one keeps of a fit is not there in another.

    Raises:
        MethodError: It cannot fit the capture, or reaches for truth.
    """
    seed_everything(spec.seed)
    with closed(guard), blame(spec.method):
        method = load_method(spec.method)
        settings = settings_of(method, spec.settings)
        staged = isinstance(method, Staged) and method.staged
        if spec.stages is not None and staged and not settings.checkpoint:
            settings = replace(settings, checkpoint=f"{spec.stages}/")
        return method.fit(capture, priors, settings, spec.seed, progress)


def _guest(
    spec: FitSpec, donor: Path, guard: Guard, copies: ExitStack, changes: Changes, progress: Progress
) -> Guest | None:
    """The object that is to be put in; the copy of its capture lives as long as that of the scene.

    Raises:
        MethodError: The method puts no objects into scenes, or cannot fit this one.
    """
    if changes.composition is None:
        raise MethodError(
            f"expected {spec.method!r} to give a decomposition with compose(), got one without. Leave out "
            "--donor, or `composes` in the suite"
        )
    capture = copies.enter_context(copied_capture(donor / "capture"))

    def fit(known: Capture) -> Decomposition:
        method = load_for(spec.method, donor)
        return _fitted(spec, guard, known, handed_priors(method, spec.priors, known, donor), progress)

    return guest_of(donor, capture, changes.composition, fit)


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
    handed = layers | {name for name, there in beside.items() if there}
    manifest = sha256(Path(capture.root or "") / "manifest.json")
    of_donor = "" if donor is None else sha256(donor / "capture" / "manifest.json")
    return Access(GUARD, manifest, tuple(sorted(handed)), tuple(guard.refused), of_donor)


def load_for(name: str, scene: Path) -> Method:
    """A method to fit on a scene, imported while truth is closed: a module's own code runs then.

    Raises:
        UnknownNameError: No method has this name.
        MethodError: It fails to import, also for reaching for truth, or does not follow the contract.
    """
    with closed(closed_to_fits(scene)):
        return load_method(name)


def handed_priors(method: Method, spec: PriorSpec, capture: Capture, scene: Path) -> Priors:
    """The truth that a method needs, and what answers its asks; a method is not to open the truth folder.

    Raises:
        DatasetError: Truth is asked for, and the scene has none or a damaged one.
        MethodError: Method, priors and weights do not go together.
    """
    asks = asks_of(method)
    told = truth_of(spec, asks)
    shown = told - {LIGHTS}
    known = _true_layers(scene, capture, shown, shown) if shown else {}
    lights = open_truth(scene / "truth").lights() if LIGHTS in told else ()
    asked = make_priors(spec, asks, capture, known, lights)
    if not method.needs:
        return asked
    wanted = frozenset(method.needs)
    layers = _true_layers(scene, capture, wanted, wanted & ALWAYS)
    found = replace(
        asked,
        source="oracle",
        layers=layers,
        relighting=true_relighting(scene, capture) if RELIGHTING in wanted else (),
        composition=true_composition(scene, capture) if COMPOSITION in wanted else None,
    )
    if LIGHTS not in wanted:
        return found
    truth = open_truth(scene / "truth")
    lights = truth.lights()
    images = {x.name: truth.environment(x) for x in lights if isinstance(x, EnvironmentLight)}
    return replace(found, lights=lights, environments=images)


def _true_layers(
    scene: Path, capture: Capture, wanted: frozenset[str], required: frozenset[str]
) -> dict[str, dict[str, np.ndarray]]:
    """True layers by view and name.

    Raises:
        DatasetError: The scene has none, or a damaged one.
    """
    truth = open_truth(scene / "truth")
    layers = {view.name: _pick(truth, view.name, wanted) for view in capture.views}
    absent = required.difference(*layers.values())
    if absent:
        raise DatasetError(
            f"expected the truth of {scene} to have {', '.join(sorted(absent))}, got none: scenes of track "
            f"{capture.track} have no such layers. Fit a scene of another track, or take other priors"
        )
    return layers


def seed_everything(seed: int) -> None:
    """Seed every global random source that a method may use; torch only if the method has loaded it."""
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002 -- third-party methods draw from the legacy global state
    if "torch" in sys.modules:
        sys.modules["torch"].manual_seed(seed)


def _pick(truth: Truth, view: str, wanted: frozenset[str]) -> dict[str, np.ndarray]:
    """The wanted layers that a view has; ``<layer>.<light>`` stands for those of all lights."""
    layers = with_derived(truth.layers(truth.view(view)))
    stems = [name.removesuffix(".<light>") for name in wanted if name.endswith(".<light>")]
    each = {f"{stem}.{light}" for stem in stems for light in lights_of(stem, layers)}
    return {name: a for name, a in layers.items() if name in wanted | each}

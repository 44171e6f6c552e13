# SPDX-License-Identifier: Apache-2.0
"""Fit one method on one scene: the same for the command line, a process pool, and a cluster."""

import random
import resource
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from graycard import (
    Capture,
    Cost,
    DatasetError,
    EnvironmentLight,
    Light,
    Progress,
    Truth,
    clear_predictions,
    lights_of,
    open_capture,
    open_truth,
    with_sums,
    writable_folder,
)
from graycard.methods import (
    LIGHTS,
    Method,
    Priors,
    Relightable,
    blame,
    load_method,
    settings_of,
    write_predictions,
)

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


def fit_scene(spec: FitSpec, predictions: Path, progress: Progress, save: Path | None = None) -> Cost:
    """Fit a method and write its predictions folder.

    Args:
        spec: What to fit.
        predictions: Where to; older predictions are replaced, anything else is left alone.
        progress: Called now and then.
        save: Also write the decomposition itself, to this folder.

    Raises:
        MethodError: The method, its settings or the capture do not go together.
        DatasetError: The scene is missing or damaged.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    method = load_method(spec.method)
    settings = settings_of(method, spec.settings)
    capture = open_capture(spec.scene / "capture")
    priors = oracle_priors(method, capture, spec.scene)
    clear_predictions(predictions)
    if save is not None:
        writable_folder(save)
    seed_everything(spec.seed)
    start = time.perf_counter()
    with blame(spec.method):
        decomposition = method.fit(capture, priors, settings, spec.seed, progress)
    relighting = relighting_of(spec.scene) if isinstance(decomposition, Relightable) else {}
    write_predictions(decomposition, capture, spec.label or spec.method, predictions, progress, relighting)
    cost = Cost(time.perf_counter() - start, peak_memory_mib())
    if save is not None:
        decomposition.save(save)
    return cost


def oracle_priors(method: Method, capture: Capture, scene: Path) -> Priors:
    """The truth that a method asks for, handed in as a prior; a method is not to open the truth folder.

    Raises:
        DatasetError: The method asks for truth, and the scene has none or a damaged one.
    """
    if not method.needs:
        return Priors()
    truth = open_truth(scene / "truth")
    wanted = set(method.needs)
    layers = {view.name: _pick(truth, view.name, wanted) for view in capture.views}
    absent = (wanted & ALWAYS).difference(*layers.values())
    if absent:
        raise DatasetError(f"expected the truth of {scene} to have {', '.join(sorted(absent))}, got none")
    if LIGHTS not in wanted:
        return Priors("oracle", layers)
    lights = truth.lights()
    images = {x.name: truth.environment(x) for x in lights if isinstance(x, EnvironmentLight)}
    return Priors("oracle", layers, lights, images)


def relighting_of(scene: Path) -> dict[str, tuple[Light, ...]]:
    """The lights after each change of a scene's lights; a method is handed them when it has been fitted.

    Returns:
        By the name of the change; the image of an environment is the full path of its file. Nothing for a
        scene without truth.

    Raises:
        DatasetError: The truth is damaged.
    """
    if not (scene / "truth").is_dir():
        return {}
    truth = open_truth(scene / "truth", check=False)
    return {
        edit.name: tuple(
            _in_place(light, scene / "truth" / edit.folder) for light in truth.relit_lights(edit.name)
        )
        for edit in truth.edits
    }


def _in_place(light: Light, folder: Path) -> Light:
    if not isinstance(light, EnvironmentLight):
        return light
    return replace(light, image=str((folder / light.image).absolute()))


def seed_everything(seed: int) -> None:
    """Seed every global random source that a method may use; torch only if the method has loaded it."""
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002 -- third-party methods draw from the legacy global state
    if "torch" in sys.modules:
        sys.modules["torch"].manual_seed(seed)


def peak_memory_mib() -> float:
    """The most memory that this process has held, MiB.

    On Linux from the kernel's high-water mark: what ``getrusage`` says is inherited from the parent.
    """
    status = Path("/proc/self/status")
    if status.is_file():
        lines = dict(line.split(":", 1) for line in status.read_text().splitlines() if ":" in line)
        return int(lines["VmHWM"].split()[0]) / 2**10
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10


def _pick(truth: Truth, view: str, wanted: set[str]) -> dict[str, np.ndarray]:
    """The wanted layers that a view has; ``<layer>.<light>`` stands for those of all lights."""
    layers = with_sums(truth.layers(truth.view(view)))
    stems = [name.removesuffix(".<light>") for name in wanted if name.endswith(".<light>")]
    each = {f"{stem}.{light}" for stem in stems for light in lights_of(stem, layers)}
    return {name: a for name, a in layers.items() if name in wanted | each}

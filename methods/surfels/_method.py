# SPDX-License-Identifier: Apache-2.0
"""``2dgs`` and ``2dgs-oracle``: 2D Gaussian Splatting (Huang et al. 2024) behind the contract."""

import hashlib
import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch

from graycard import Camera, Capture, Progress
from graycard.io import to_builtins
from graycard.methods._contract import Priors
from graycard.methods.splat import (
    CENTRES,
    GEOMETRY,
    LOG_SCALES,
    LOGITS,
    ROTATIONS,
    SURFEL_KERNELS,
    Checkpoint,
    DensityRules,
    Parameters,
    Plan,
    Rate,
    check_saved,
    initial_state,
    scene_extent,
    train,
)
from graycard.methods.surfels._checks import check_places
from graycard.methods.surfels._objective import Objective, Tones, photographs
from graycard.methods.surfels._scene import SurfelScene, load_scene
from graycard.methods.surfels._settings import OracleSurfelSettings, SurfelSettings
from graycard.methods.surfels._start import COEFFICIENTS, DETAIL, SKY, oracle_start, sparse_start

SAVES = 10
"""How often a fit is saved on its way."""


class SurfelMethod:
    """Surfels that begin on the sparse points and are densified; nothing but photographs is looked at."""

    summary = "2D Gaussian surfels with view-dependent colour, from photographs and sparse points"
    needs = ()
    kernels = SURFEL_KERNELS
    staged = True
    settings_type = SurfelSettings

    def fit(
        self, capture: Capture, priors: Priors, settings: SurfelSettings, seed: int, progress: Progress
    ) -> SurfelScene:
        """Fit surfels to the training photographs.

        Raises:
            MethodError: There are too few sparse points, or the fit has no way on.
        """
        check_places(capture)
        check_checkpoint("2dgs", settings, seed)
        rules = density_rules(settings.surfels)
        start = sparse_start(capture, settings, seed)
        parameters = fit_surfels("2dgs", capture, settings, seed, progress, start=start, rules=rules)
        return SurfelScene("2dgs", parameters, capture.exposure)

    def load(self, folder: Path) -> SurfelScene:
        """A saved decomposition.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        return load_scene(folder, "2dgs")


class OracleSurfelMethod:
    """Surfels that begin on the true surfaces; none comes or goes, and on request they stay where they are.

    It sees the truth of the training views, so it is a reference row: what ``2dgs`` would score if it began
    with perfect geometry (all free) or kept it (``frozen``).
    """

    summary = "2D Gaussian surfels that begin on the true surfaces of the training views"
    needs = ("depth", "normal")
    kernels = SURFEL_KERNELS
    settings_type = OracleSurfelSettings

    def fit(
        self, capture: Capture, priors: Priors, settings: OracleSurfelSettings, seed: int, progress: Progress
    ) -> SurfelScene:
        """Fit surfels to the training photographs.

        Raises:
            MethodError: Depth or normals were not handed in, or the fit has no way on.
        """
        check_places(capture)
        check_checkpoint("2dgs-oracle", settings, seed)
        start = oracle_start(capture, priors, settings, seed)
        parameters = fit_surfels("2dgs-oracle", capture, settings, seed, progress, start=start)
        return SurfelScene("2dgs-oracle", parameters, capture.exposure)

    def load(self, folder: Path) -> SurfelScene:
        """A saved decomposition.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        return load_scene(folder, "2dgs-oracle")


def fit_surfels(
    method: str,
    capture: Capture,
    settings: SurfelSettings,
    seed: int,
    progress: Progress,
    *,
    start: Parameters,
    rules: DensityRules | None = None,
    tones: Tones | None = None,
) -> Parameters:
    """Fit parameters to the training photographs of a capture.

    Args:
        method: Its name.
        capture: The photographs.
        settings: Of the fit.
        seed: Of the order of views, and of densification.
        progress: Called now and then.
        start: Before the first step.
        rules: When surfels come and go; None: never.
        tones: How photographs differ in colours; None: not at all.

    Raises:
        MethodError: The fit has no way on, or its checkpoint is of another one.
    """
    extent = scene_extent([view.camera for view in capture.train])
    views = photographs(capture, settings)
    rates = learning_rates(extent, settings) | dict(tones.rates if tones else {})
    pictures = [(view.camera, view.encoded) for view in views]
    checkpoint = fit_checkpoint(method, settings, seed, pictures)
    plan = Plan(settings.iterations, rates, extent, rules, checkpoint)
    state = train(initial_state(start, seed), plan, Objective(views, settings, seed, tones), progress)
    return state.parameters


def density_rules(limit: int) -> DensityRules:
    """When surfels come and go in a fit that is short and looks at few views; ``limit``: no more of them."""
    return DensityRules(start=0.1, every=0.05, reset_every=1.0, limit=limit)


def learning_rates(extent: float, settings: SurfelSettings) -> dict[str, Rate]:
    """Learning rates by the names of parameters, for a scene of an extent in metres."""
    rates = {
        CENTRES: Rate(5e-4, 5e-6).times(extent),
        LOG_SCALES: Rate(5e-3),
        ROTATIONS: Rate(1e-3),
        LOGITS: Rate(5e-2),
        COEFFICIENTS: Rate(5e-3),
        DETAIL: Rate(2.5e-4),
        SKY: Rate(1e-2),
    }
    if isinstance(settings, OracleSurfelSettings) and settings.frozen:
        rates = {name: rate for name, rate in rates.items() if name not in GEOMETRY}
    return rates


def fit_checkpoint(
    method: str,
    settings: Any,
    seed: int,
    views: Iterable[tuple[Camera, torch.Tensor]],
) -> Checkpoint | None:
    """Where a fit is saved; None if its settings name neither a file nor a folder.

    Args:
        method: Its name.
        settings: With ``checkpoint`` and ``iterations``.
        seed: Of the fit.
        views: Cameras and pictures that are fitted: a checkpoint of others is refused.
    """
    if not settings.checkpoint:
        return None
    digest = hashlib.sha256()
    for camera, picture in views:
        digest.update(camera.digest.encode() + picture.numpy().tobytes())
    every = max(1, settings.iterations // SAVES)
    identity = f"{_chosen(method, settings, seed)} {digest.hexdigest()}"
    return Checkpoint(Path(settings.checkpoint), every, identity, _is_folder(settings))


def check_checkpoint(method: str, settings: Any, seed: int) -> None:
    """Refuse the file of another fit before anything is asked of a prior or looked for in photographs.

    Args:
        method: Its name, as for :func:`fit_checkpoint`.
        settings: With ``checkpoint``.
        seed: Of the fit.

    Raises:
        MethodError: The file is damaged, or is of another method, other settings or another seed.
    """
    if settings.checkpoint and not _is_folder(settings):
        check_saved(Path(settings.checkpoint), _chosen(method, settings, seed))


def _chosen(method: str, settings: Any, seed: int) -> str:
    """A hash of what a fit depends on besides what it looks at."""
    chosen = to_builtins(replace(settings, checkpoint=""))
    return hashlib.sha256(json.dumps([method, seed, chosen]).encode()).hexdigest()


def _is_folder(settings: Any) -> bool:
    return settings.checkpoint.endswith("/")

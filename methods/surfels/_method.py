# SPDX-License-Identifier: Apache-2.0
"""``2dgs`` and ``2dgs-oracle``: 2D Gaussian Splatting (Huang et al. 2024) behind the contract."""

from typing import TypeVar

from graycard.methods.splat import (
    CENTRES,
    GEOMETRY,
    LOG_SCALES,
    LOGITS,
    ROTATIONS,
    SURFEL_KERNELS,
    DensityRules,
    LearningRateSchedule,
    Parameters,
)
from graycard.methods.surfels._checks import check_places
from graycard.methods.surfels._fitting import FitTask, SceneMethod, check_checkpoint, fit_checkpoint
from graycard.methods.surfels._objective import SurfelObjective, Tones, photographs
from graycard.methods.surfels._scene import SurfelScene
from graycard.methods.surfels._settings import OracleSurfelSettings, SurfelSettings
from graycard.methods.surfels._start import COEFFICIENTS, DETAIL, SKY, oracle_start, sparse_start
from graycard.methods.surfels._units import enlarged, shrunk

SurfelSettingsT = TypeVar("SurfelSettingsT", bound=SurfelSettings)


class SurfelMethod(SceneMethod[SurfelSettings, SurfelScene]):
    """Surfels that begin on the sparse points and are densified; nothing but photographs is looked at."""

    name = "2dgs"
    summary = "2D Gaussian surfels with view-dependent colour, from photographs and sparse points"
    kernels = SURFEL_KERNELS
    staged = True
    settings_type = SurfelSettings
    scene_type = SurfelScene
    checks = (check_places,)

    def _fitted(self, task: FitTask[SurfelSettings]) -> SurfelScene:
        check_checkpoint(self.name, task.settings, task.seed)
        capture, factor = enlarged(task.capture)
        task = task.with_capture(capture)
        start = sparse_start(capture, task.settings, task.seed)
        parameters = fit_surfels(self.name, task, start=start, rules=density_rules(task.settings.surfels))
        return SurfelScene(shrunk(parameters, factor), self.name, capture.exposure)


class OracleSurfelMethod(SceneMethod[OracleSurfelSettings, SurfelScene]):
    """Surfels that begin on the true surfaces; none comes or goes, and on request they stay where they are.

    It sees the truth of the training views, so it is a reference row: what ``2dgs`` would score if it began
    with perfect geometry (all free) or kept it (``frozen``).
    """

    name = "2dgs-oracle"
    summary = "2D Gaussian surfels that begin on the true surfaces of the training views"
    needs = ("depth", "normal")
    kernels = SURFEL_KERNELS
    settings_type = OracleSurfelSettings
    scene_type = SurfelScene
    checks = (check_places,)

    def _fitted(self, task: FitTask[OracleSurfelSettings]) -> SurfelScene:
        check_checkpoint(self.name, task.settings, task.seed)
        start = oracle_start(task.capture, task.priors, task.settings, task.seed)
        parameters = fit_surfels(self.name, task, start=start)
        return SurfelScene(parameters, self.name, task.capture.exposure)


def fit_surfels(
    method: str,
    task: FitTask[SurfelSettingsT],
    *,
    start: Parameters,
    rules: DensityRules | None = None,
    tones: Tones | None = None,
) -> Parameters:
    """Fit parameters to the training photographs of a capture.

    Args:
        method: Its name.
        task: The photographs, the settings and the seed of the order of views and of densification.
        start: Before the first step.
        rules: When surfels come and go; None: never.
        tones: How photographs differ in colours; None: not at all.

    Raises:
        MethodError: The fit has no way on, or its checkpoint is of another one.
    """
    settings, seed = task.settings, task.seed
    views = photographs(task.capture, settings)
    rates = learning_rates(task.extent, settings) | dict(tones.rates if tones else {})
    checkpoint = fit_checkpoint(method, settings, seed, [(view.camera, view.encoded) for view in views])
    config = task.config(settings.iterations, rates, rules, checkpoint)
    return task.train(start, config, SurfelObjective(views, settings, seed, tones))


def density_rules(limit: int) -> DensityRules:
    """Return the densification: when surfels come and go in a fit that is short and looks at few views;
    ``limit``: no more of them.
    """
    return DensityRules(start=0.1, every=0.05, reset_every=1.0, limit=limit)


def geometry_rates(extent: float) -> dict[str, LearningRateSchedule]:
    """Return the learning rates of geometry by name, for a scene of an extent in metres."""
    return {
        CENTRES: LearningRateSchedule(5e-4, 5e-6).times(extent),
        LOG_SCALES: LearningRateSchedule(5e-3),
        ROTATIONS: LearningRateSchedule(1e-3),
        LOGITS: LearningRateSchedule(5e-2),
    }


def learning_rates(extent: float, settings: SurfelSettings) -> dict[str, LearningRateSchedule]:
    """Learning rates by the names of parameters, for a scene of an extent in metres."""
    rates = {
        **geometry_rates(extent),
        COEFFICIENTS: LearningRateSchedule(5e-3),
        DETAIL: LearningRateSchedule(2.5e-4),
        SKY: LearningRateSchedule(1e-2),
    }
    if isinstance(settings, OracleSurfelSettings) and settings.frozen:
        rates = {name: rate for name, rate in rates.items() if name not in GEOMETRY}
    return rates

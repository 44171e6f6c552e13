# SPDX-License-Identifier: Apache-2.0
"""``goris`` (GOR-IS, CVPR 2026): an object is removed together with its reflection."""

from graycard.methods.goris._appearance import appearance_weights
from graycard.methods.goris._distil import distilled
from graycard.methods.goris._fit import as_glossy_as_told, fit_colours, fit_light
from graycard.methods.goris._flat import flat_surface
from graycard.methods.goris._remove import Removed, without_object
from graycard.methods.goris._scene import METHOD, DistilledScene, GlossyScene, GorisScene
from graycard.methods.goris._settings import GorisSettings
from graycard.methods.goris._training_views import ASKS, looked_at, training_views
from graycard.methods.removal import checked_for_removal
from graycard.methods.splat import Checkpoint, Parameters
from graycard.methods.surfels import FitTask, SceneMethod, fit_checkpoint


class GorisMethod(SceneMethod[GorisSettings, GorisScene]):
    """Surfels, some of them glossy: their reflections are traced, so the object's goes with the object."""

    name = METHOD
    summary = "surfels whose glossy ones reflect traced light; the object is removed with its reflection"
    kernels = ("maps 3", "maps 8", "photometric", "harmonics", "trace", "Adam")
    asks = ASKS
    staged = True
    settings_type = GorisSettings
    scene_type = GorisScene

    def _fitted(self, task: FitTask[GorisSettings]) -> GorisScene:
        """Fit surfels and light transport, remove the object's surfels, and fit what is left."""
        if task.settings.hole_loss == "lpips":
            appearance_weights()  # a fit that lacks them fails here, not after its first stage
        capture, priors, seed, progress = task.capture, task.priors, task.seed, task.progress
        masks = checked_for_removal(task, METHOD, task.settings.first)
        shots = training_views(capture, priors, masks, task.settings)
        saved = fit_checkpoint(METHOD, task.settings.first, seed, looked_at(shots))
        settings = as_glossy_as_told(task.settings, shots)
        flat = flat_surface(shots, capture.points().positions) if settings.flat_start else None
        if flat is not None:
            shots = flat.alone(shots)
        coloured = fit_colours(capture, shots, settings, seed, progress, flat=flat, saved=saved)
        light = fit_light(coloured, shots, settings, seed, progress, saved)
        removed = without_object(
            capture, light, shots, priors, settings=settings, seed=seed, progress=progress, saved=saved
        )
        return _decomposition(task.with_settings(settings), light.parameters, removed, saved)


def _decomposition(
    task: FitTask[GorisSettings], before: Parameters, removed: Removed, saved: Checkpoint | None
) -> GorisScene:
    """Return the scene with the object and without it, and, where settings want it, as radiance alone."""
    capture, settings = task.capture, task.settings
    with_object, without = (
        GlossyScene(parameters, settings, capture.exposure, task.extent)
        for parameters in (before, removed.parameters)
    )
    colours = None
    if settings.distilled:
        fitted = distilled(removed.parameters, capture, settings, task.seed, task.progress, saved)
        colours = DistilledScene(fitted, METHOD, capture.exposure)
    assert capture.target is not None, "it was checked"
    return GorisScene(with_object, without, capture.target, colours, removed.changed)

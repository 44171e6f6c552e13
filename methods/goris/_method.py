# SPDX-License-Identifier: Apache-2.0
"""``goris`` (GOR-IS, CVPR 2026): an object is removed together with its reflection."""

from pathlib import Path

from graycard import Capture, Progress
from graycard.methods._contract import Priors
from graycard.methods.goris._distil import distilled
from graycard.methods.goris._fit import as_glossy_as_told, fit_colours, fit_light
from graycard.methods.goris._flat import flat_surface
from graycard.methods.goris._remove import without_object
from graycard.methods.goris._scene import METHOD, DistilledScene, GlossyScene, GorisScene, load_scene
from graycard.methods.goris._settings import GorisSettings
from graycard.methods.goris._shots import ASKS, looked_at, shots_of
from graycard.methods.removal import checked_for_removal
from graycard.methods.splat import Parameters, scene_extent
from graycard.methods.surfels import fit_checkpoint


class GorisMethod:
    """Surfels, some of them glossy: their reflections are traced, so the object's goes with the object."""

    summary = "surfels whose glossy ones reflect traced light; the object is removed with its reflection"
    needs: tuple[str, ...] = ()
    kernels = ("maps 3", "maps 8", "photometric", "harmonics", "trace")
    asks = ASKS
    staged = True
    settings_type = GorisSettings

    def fit(
        self, capture: Capture, priors: Priors, settings: GorisSettings, seed: int, progress: Progress
    ) -> GorisScene:
        """Fit surfels and light transport, remove the object's surfels, and fit what is left.

        Raises:
            MethodError: The capture names no object or its masks are not sound, there are too few sparse
                points, photographs are black or not finite, an answer of the prior is not sound, or the loss
                or a gradient is not finite.
        """
        masks = checked_for_removal(capture, priors, settings, seed, METHOD, settings.first)
        shots = shots_of(capture, priors, masks, settings)
        saved = fit_checkpoint(METHOD, settings.first, seed, looked_at(shots))
        settings = as_glossy_as_told(settings, shots)
        flat = flat_surface(shots, capture.points().positions) if settings.flat_start else None
        shots = shots if flat is None else flat.alone(shots)
        coloured = fit_colours(capture, shots, settings, seed, progress, flat=flat, saved=saved)
        before = fit_light(coloured, shots, settings, seed, progress, saved)
        removed = without_object(
            capture, before, shots, priors, settings=settings, seed=seed, progress=progress, saved=saved
        )
        cameras = [view.camera for view in capture.train]
        extent = scene_extent(cameras)

        def scene(parameters: Parameters) -> GlossyScene:
            return GlossyScene(parameters, settings, capture.exposure, extent)

        colours = None
        if settings.distilled:
            fitted = distilled(removed.parameters, capture, settings, seed, progress, saved)
            colours = DistilledScene(METHOD, fitted, capture.exposure)
        assert capture.target is not None, "it was checked"
        after = scene(removed.parameters)
        return GorisScene(scene(before), after, capture.target, colours, removed.changed)

    def load(self, folder: Path) -> GorisScene:
        """A saved decomposition.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        return load_scene(folder)

# SPDX-License-Identifier: Apache-2.0
"""``gsid``: local lamps, surroundings and materials from photographs and a prior (Du et al., ICCV 2025)."""

from pathlib import Path

from graycard import Capture, Progress
from graycard.methods._contract import Priors
from graycard.methods.gsid._fit import fit_lights
from graycard.methods.gsid._geometry import fit_geometry
from graycard.methods.gsid._guess import ASKS, guesses_of
from graycard.methods.gsid._scene import GsidScene, load_scene
from graycard.methods.gsid._settings import GsidSettings
from graycard.methods.splat import scene_extent
from graycard.methods.surfels import check_photographs, check_places


class GsidMethod:
    """Surfels with materials under local lamps of spherical Gaussians and an environment."""

    summary = "surfels with materials under local lamps of spherical Gaussians and an environment (GS-ID)"
    needs = ()
    asks = ASKS
    settings_type = GsidSettings

    def fit(
        self, capture: Capture, priors: Priors, settings: GsidSettings, seed: int, progress: Progress
    ) -> GsidScene:
        """Fit surfels, then materials and lights on them, to the training photographs.

        Raises:
            MethodError: All views are from one place, photographs are black or not finite, there are too
                few sparse points, an answer of the prior is not sound, or the fit has no way on.
        """
        check_places(capture)
        check_photographs(capture)
        guesses = guesses_of(capture, priors)
        geometry = fit_geometry(capture, guesses, settings, seed, progress)
        parameters = fit_lights(capture, geometry, guesses, settings, seed, progress)
        extent = scene_extent([view.camera for view in capture.train])
        return GsidScene(parameters, settings, capture.exposure, extent)

    def load(self, folder: Path) -> GsidScene:
        """A saved decomposition.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        return load_scene(folder)

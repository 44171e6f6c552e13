# SPDX-License-Identifier: Apache-2.0
"""``gsid`` (Du et al., ICCV 2025), and ``gsir`` (Liang et al., CVPR 2024), of which it is a successor."""

from pathlib import Path

from graycard import Capture, Progress
from graycard.methods._contract import Ask, Priors
from graycard.methods.gsid._fit import check_told, fit_lights
from graycard.methods.gsid._geometry import fit_geometry
from graycard.methods.gsid._guess import ASKS, guesses_of
from graycard.methods.gsid._scene import GSID, GSIR, GsidScene, load_scene
from graycard.methods.gsid._settings import GsidSettings, GsirSettings
from graycard.methods.splat import scene_extent
from graycard.methods.surfels import check_photographs, check_places


class GsidMethod:
    """Surfels with materials under local lamps of spherical Gaussians and an environment."""

    summary = "surfels with materials under local lamps of spherical Gaussians and an environment (GS-ID)"
    needs: tuple[str, ...] = ()
    kernels = ("maps 3", "features 8", "photometric", "harmonics", "trace")
    asks: tuple[Ask, ...] = ASKS
    settings_type: type[GsidSettings] = GsidSettings
    name = GSID

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
        check_told(guesses, settings)
        geometry = fit_geometry(capture, guesses, settings, seed, progress)
        parameters = fit_lights(capture, geometry, guesses, settings, seed, progress)
        extent = scene_extent([view.camera for view in capture.train])
        return GsidScene(parameters, settings, capture.exposure, extent, self.name)

    def load(self, folder: Path) -> GsidScene:
        """A saved decomposition.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        return load_scene(folder, self.name, self.settings_type)


class GsirMethod(GsidMethod):
    """Surfels with materials under an environment alone, with occlusion and without a prior."""

    summary = "surfels with materials under an environment alone, without a prior (GS-IR)"
    asks = ()
    settings_type = GsirSettings
    name = GSIR

# SPDX-License-Identifier: Apache-2.0
"""``gsid`` (Du et al., ICCV 2025), and ``gsir`` (Liang et al., CVPR 2024), of which it is a successor."""

from graycard.methods._contract import Ask
from graycard.methods.gsid._fit import check_told, fit_lights
from graycard.methods.gsid._geometry import fit_geometry
from graycard.methods.gsid._guess import ASKS, guesses_of
from graycard.methods.gsid._scene import GSID, GSIR, GsidScene
from graycard.methods.gsid._settings import GsidSettings, GsirSettings
from graycard.methods.surfels import FitTask, SceneMethod, check_photographs, check_places


class GsidMethod(SceneMethod[GsidSettings, GsidScene]):
    """Surfels with materials under local lamps of spherical Gaussians and an environment."""

    name = GSID
    summary = "surfels with materials under local lamps of spherical Gaussians and an environment (GS-ID)"
    kernels = ("maps 3", "features 8", "photometric", "harmonics", "trace", "Adam")
    asks: tuple[Ask, ...] = ASKS
    settings_type: type[GsidSettings] = GsidSettings
    scene_type = GsidScene
    checks = (check_places, check_photographs)

    def _fitted(self, task: FitTask[GsidSettings]) -> GsidScene:
        guesses = guesses_of(task.capture, task.priors)
        check_told(guesses, task.settings)
        geometry = fit_geometry(task, guesses)
        parameters = fit_lights(task, geometry, guesses)
        return GsidScene(parameters, task.settings, task.capture.exposure, task.extent, self.name)


class GsirMethod(GsidMethod):
    """Surfels with materials under an environment alone, with occlusion and without a prior."""

    summary = "surfels with materials under an environment alone, without a prior (GS-IR)"
    asks = ()
    settings_type = GsirSettings
    name = GSIR

# SPDX-License-Identifier: Apache-2.0
"""``appearance``: each photograph may change the colours of the surfels, as WildGaussians has it."""

from dataclasses import replace

from graycard import Capture
from graycard.methods.appearance._nearest import eyes_of
from graycard.methods.appearance._scene import METHOD, AppearanceScene
from graycard.methods.appearance._settings import AppearanceSettings
from graycard.methods.appearance._tone import CODE, codes_of, tone_parameters, tone_rates, toned
from graycard.methods.splat import CENTRES, SURFEL_KERNELS, Parameters
from graycard.methods.surfels import (
    FitTask,
    SceneMethod,
    Tones,
    check_checkpoint,
    check_photographs,
    check_places,
    density_rules,
    enlarged,
    fit_surfels,
    shrunk,
    sparse_start,
)


class AppearanceMethod(SceneMethod[AppearanceSettings, AppearanceScene]):
    """The surfels of ``2dgs``, and what is different about each photograph.

    A new view is shown as the photograph from nearest to it would have it: no held-out photograph is looked
    at, unlike in the paper, which fits an embedding to it.
    """

    name = METHOD
    summary = "2D Gaussian surfels whose colours each photograph may change (as WildGaussians)"
    kernels = SURFEL_KERNELS
    settings_type = AppearanceSettings
    scene_type = AppearanceScene
    checks = (check_places, check_photographs)

    def _fitted(self, task: FitTask[AppearanceSettings]) -> AppearanceScene:
        settings, eyes = task.settings, eyes_of([view.camera for view in task.capture.train])
        check_checkpoint(METHOD, settings, task.seed)
        capture, factor = enlarged(task.capture)
        parameters = fit_surfels(
            METHOD,
            task.with_capture(capture),
            start=start(capture, settings, task.seed),
            rules=density_rules(settings.surfels),
            tones=Tones(toned, tone_rates(settings)),
        )
        return AppearanceScene(shrunk(parameters, factor), eyes, capture.exposure)


def start(capture: Capture, settings: AppearanceSettings, seed: int) -> Parameters:
    """Parameters before the first step.

    Raises:
        MethodError: There are too few sparse points.
    """
    plain = sparse_start(capture, settings, seed)
    surfels = {**plain.surfels, CODE: codes_of(plain.surfels[CENTRES])}
    shared = {**plain.shared, **tone_parameters(len(capture.train), settings, seed)}
    return replace(plain, surfels=surfels, shared=shared)

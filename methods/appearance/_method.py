# SPDX-License-Identifier: Apache-2.0
"""``appearance``: each photograph may change the colours of the surfels, as WildGaussians has it."""

from dataclasses import replace
from pathlib import Path

from graycard import Capture, Progress
from graycard.methods._contract import Priors
from graycard.methods.appearance._nearest import eyes_of
from graycard.methods.appearance._scene import METHOD, AppearanceScene, load_scene
from graycard.methods.appearance._settings import AppearanceSettings
from graycard.methods.appearance._tone import CODE, codes_of, tone_parameters, tone_rates, toned
from graycard.methods.splat import CENTRES, SURFEL_KERNELS, Parameters
from graycard.methods.surfels import (
    Tones,
    check_checkpoint,
    check_photographs,
    check_places,
    density_rules,
    fit_surfels,
    sparse_start,
)


class AppearanceMethod:
    """The surfels of ``2dgs``, and what is different about each photograph.

    A new view is shown as the photograph from nearest to it would have it: no held-out photograph is looked
    at, unlike in the paper, which fits an embedding to it.
    """

    summary = "2D Gaussian surfels whose colours each photograph may change (as WildGaussians)"
    needs = ()
    kernels = SURFEL_KERNELS
    settings_type = AppearanceSettings

    def fit(
        self, capture: Capture, priors: Priors, settings: AppearanceSettings, seed: int, progress: Progress
    ) -> AppearanceScene:
        """Fit surfels, embeddings and the network to the training photographs.

        Raises:
            MethodError: Photographs are black, not finite or all from one place, there are too few sparse
                points, or the fit has no way on.
        """
        check_places(capture)
        check_photographs(capture)
        check_checkpoint(METHOD, settings, seed)
        parameters = fit_surfels(
            METHOD,
            capture,
            settings,
            seed,
            progress,
            start=start(capture, settings, seed),
            rules=density_rules(settings.surfels),
            tones=Tones(toned, tone_rates(settings)),
        )
        return AppearanceScene(parameters, eyes_of([v.camera for v in capture.train]), capture.exposure)

    def load(self, folder: Path) -> AppearanceScene:
        """A saved decomposition.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        return load_scene(folder)


def start(capture: Capture, settings: AppearanceSettings, seed: int) -> Parameters:
    """Parameters before the first step.

    Raises:
        MethodError: There are too few sparse points.
    """
    plain = sparse_start(capture, settings, seed)
    surfels = {**plain.surfels, CODE: codes_of(plain.surfels[CENTRES])}
    shared = {**plain.shared, **tone_parameters(len(capture.train), settings, seed)}
    return replace(plain, surfels=surfels, shared=shared)

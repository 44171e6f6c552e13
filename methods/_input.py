# SPDX-License-Identifier: Apache-2.0
"""``input``: the photograph as albedo and as diffuse light. Who does not beat it has taken nothing apart."""

from pathlib import Path

import numpy as np

from graycard import Capture, Progress
from graycard.methods._contract import NoSettings, Priors
from graycard.methods._lookup import Lookup, load_lookup, photographs


class InputMethod:
    """Takes the photograph, exposed for display, for the albedo; and all of its light for diffuse light.

    It sees the photograph of the very view on which it is scored, which no multi-view method does; so it
    is a reference row, not a competitor.
    """

    summary = "The photograph of the scored view as albedo, and as diffuse light"
    needs = ("radiance",)
    settings_type = NoSettings

    def fit(
        self, capture: Capture, priors: Priors, settings: NoSettings, seed: int, progress: Progress
    ) -> Lookup:
        """Scale the photographs to display range.

        Raises:
            MethodError: A held-out photograph was not handed in.
        """
        taken = photographs(capture, priors)
        return Lookup("input", {key: _undivided(image, capture.exposure) for key, image in taken.items()})

    def load(self, folder: Path) -> Lookup:
        """Return a saved decomposition.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        return load_lookup(folder, "input")


def _undivided(image: np.ndarray, exposure: float) -> dict[str, np.ndarray]:
    """Return the layers of a photograph of which nothing is known."""
    return {"base_color": image * exposure, "diffuse": image, "specular": np.zeros_like(image)}

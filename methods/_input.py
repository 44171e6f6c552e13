# SPDX-License-Identifier: Apache-2.0
"""``input``: the photograph as albedo. A method that does not beat it has taken nothing apart."""

from pathlib import Path

from graycard import Capture, Progress
from graycard.methods._contract import NoSettings, Priors
from graycard.methods._lookup import Lookup, load_lookup, photographs


class InputMethod:
    """Takes the photograph, exposed for display, for the albedo.

    It sees the photograph of the very view on which it is scored, which no multi-view method does; so it
    is a reference row, not a competitor.
    """

    summary = "The photograph of the scored view as albedo"
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
        return Lookup(
            "input", {key: {"base_color": image * capture.exposure} for key, image in taken.items()}
        )

    def load(self, folder: Path) -> Lookup:
        """A saved decomposition.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        return load_lookup(folder, "input")

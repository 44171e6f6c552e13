# SPDX-License-Identifier: Apache-2.0
"""Small captures on which ``goris`` is fitted in a second, and priors that answer for them."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from graycard import methods, open_capture, open_truth
from graycard.methods.goris import GorisMethod, GorisSettings
from graycard.methods.priors import Override, PriorSpec, make_priors

QUICK = GorisSettings(iterations=12, surfels=400, fill=0.0, sky_size=2)
UNTOLD = {kind: Override(source="none") for kind in ("mask", "normal")}


def with_emptied(layers: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """A polished floor behind the object, which scatters half of what is seen there."""
    even = np.ones_like(layers["radiance"])
    emptied = {
        "diffuse": 0.5 * layers["counterfactual.radiance"],
        "f0": 0.04 * even,
        "roughness": 0.2 * even[..., 0],
        "normal": even * (0, 0, 1),
    }
    return {**layers, **{f"counterfactual.{name}": values for name, values in emptied.items()}}


def told(scene: Path, spec: PriorSpec) -> methods.Priors:
    capture, truth = open_capture(scene / "capture", check=False), open_truth(scene / "truth")
    known = {view.name: with_emptied(truth.layers(truth.view(view.name))) for view in capture.train}
    return make_priors(spec, GorisMethod.asks, capture, known, ())


class NothingGlossy:
    """A prior to which all is rough, and faces up."""

    def answer(self, question: methods.Question) -> np.ndarray:
        if question.kind == "mask":
            return np.zeros(question.image.shape[:2], bool)
        return np.tile([0.0, 0.0, 1.0], (*question.image.shape[:2], 1))

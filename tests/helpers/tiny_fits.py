# SPDX-License-Identifier: Apache-2.0
"""Short fits of tiny scenes by all methods that fit surfels, in this process."""

from pathlib import Path
from typing import Any

import numpy as np

from graycard import Capture, methods, open_truth, srgb_encode
from graycard.io import silent
from graycard.methods.priors import PriorSpec, make_priors
from sparse_points import with_points

TRACKS = {
    "2dgs": "dark",
    "2dgs-oracle": "dark",
    "appearance": "dark",
    "darkgs": "dark",
    "sunfaded": "dark",
    "gsid": "multilight",
    "r3dg": "multilight",
    "goris": "tabletop",
    "removal": "tabletop",
}
"""Methods that fit surfels, and a track of each."""


def fitted(name: str, scene: Path, backend: str, **changes: Any) -> methods.Decomposition:
    method = methods.load_method(name)
    capture, chosen = with_points(scene), methods.settings_of(method, {"backend": backend, **changes})
    return method.fit(capture, told(name, scene, capture), chosen, 0, silent)


def told(name: str, scene: Path, capture: Capture) -> methods.Priors:
    """Answers to what a method asks, as far as the tiny scene's truth has them."""
    truth = open_truth(scene / "truth", check=False)
    known, asks = {v.name: truth.layers(v) for v in truth.views}, methods.asks_of(methods.load_method(name))
    if not asks:
        return methods.Priors("oracle", known, truth.lights())
    spec = PriorSpec("classical") if TRACKS.get(name, "tabletop") == "tabletop" else PriorSpec("oracle", 1)
    asks = tuple(ask for ask in asks if ask.kind in ("light", "depth", "normal", "base_color", "inpainting"))
    return make_priors(spec, asks, capture, known, truth.lights())


def pictures(found: methods.Decomposition, scene: Path) -> np.ndarray:
    """Draw all views of a fit, encoded."""
    truth = open_truth(scene / "truth", check=False)
    drawn = [found.render(view.camera, ["radiance"])["radiance"] for view in truth.views]
    return np.stack([srgb_encode(image * truth.exposure) for image in drawn])

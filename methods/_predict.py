# SPDX-License-Identifier: Apache-2.0
"""From a decomposition to the predictions folder that is scored."""

from pathlib import Path

import numpy as np

from graycard import Capture, Predictions, Progress, View, finish_predictions, write_view
from graycard.methods._contract import Decomposition, Removable


def write_predictions(
    decomposition: Decomposition, capture: Capture, method: str, folder: Path, progress: Progress
) -> None:
    """Render every layer that a decomposition provides, for every view, and its lights.

    Training views are rendered too: gauges are fitted on them. If the scene has a target and the
    decomposition can remove objects, the radiance without the target is rendered as well.

    Raises:
        MethodError: The decomposition does not give a layer that it claims.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    without = _without_target(decomposition, capture)
    for done, view in enumerate(capture.views):
        progress(done / len(capture.views), f"rendering {view.name}")
        write_view(folder, view.name, _layers(decomposition, without, view))
    index = Predictions(method, capture.track, capture.scene)
    finish_predictions(folder, index, decomposition.lights())


def _without_target(decomposition: Decomposition, capture: Capture) -> Decomposition | None:
    if capture.target is None or not isinstance(decomposition, Removable):
        return None
    return decomposition.remove(capture.target)


def _layers(decomposition: Decomposition, without: Decomposition | None, view: View) -> dict[str, np.ndarray]:
    layers = decomposition.render(view.camera, sorted(decomposition.provides))
    if without is not None:
        layers["counterfactual.radiance"] = without.render(view.camera, ["radiance"])["radiance"]
    return layers

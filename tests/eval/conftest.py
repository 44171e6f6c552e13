# SPDX-License-Identifier: Apache-2.0
"""Predictions made from the truth itself, changed where a test wants them wrong."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from graycard import Light, Predictions, View, open_truth
from graycard.predictions import finish_predictions, write_view
from layer_references import random_inception, write_random_weights

Layers = dict[str, np.ndarray]
Change = Callable[[View, Layers], Mapping[str, np.ndarray] | None]
PREDICTED = ("radiance", "base_color", "normal", "depth", "counterfactual.radiance")


@pytest.fixture
def random_lpips(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of small random weights for LPIPS, named as the user's would be; Inception has some, too."""
    folder = tmp_path / "weights"
    write_random_weights(folder)
    inception = random_inception()
    monkeypatch.setattr("graycard.eval.measures._inception.inception_weights", lambda: inception)
    monkeypatch.setenv("GRAYCARD_LPIPS", str(folder))
    return folder


def unchanged(view: View, layers: Layers) -> Layers:
    return layers


@pytest.fixture
def predict(tmp_path: Path) -> Callable[..., Path]:
    """``predict(scene, change=..., lights=...)`` writes the truth as predictions and gives the folder.

    ``change(view, layers)`` gives the layers to be written, or None for a view without a file;
    ``lights`` are the truth's unless others, or None, are handed in.
    """
    made = iter(range(1000))

    def write(
        scene: Path, change: Change = unchanged, lights: tuple[Light, ...] | str | None = "truth"
    ) -> Path:
        truth = open_truth(scene / "truth")
        folder = tmp_path / f"predictions-{next(made)}"
        for view in truth.views:
            layers = {k: v for k, v in truth.layers(view).items() if k in PREDICTED}
            if (changed := change(view, layers)) is not None:
                write_view(folder, view.name, changed)
        found = truth.lights() if isinstance(lights, str) else lights
        finish_predictions(folder, Predictions("truth", truth.track, truth.scene), found)
        return folder

    return write

# SPDX-License-Identifier: Apache-2.0
"""Layers taken from disk for scoring: whole, of the right size and finite, or a reason why not."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

import graycard as gc
from graycard.eval._mask import judged_mask


@dataclass(frozen=True, slots=True)
class PredictedView:
    """What a predictions folder holds for one view."""

    view: gc.View
    layers: Mapping[str, np.ndarray] = field(default_factory=dict)
    fault: str = ""
    """Why its file cannot be read; empty where it can, or where there is none."""
    exists: bool = True

    def take(self, layer: str) -> np.ndarray:
        """A layer that is fit to be scored.

        Raises:
            PredictionError: It is missing, of another size, or not finite.
        """
        name, camera = self.view.name, self.view.camera
        if self.fault:
            raise gc.PredictionError(self.fault)
        if layer not in self.layers:
            have = ", ".join(self.layers) if self.exists else "no file"
            raise gc.PredictionError(
                f"{name}: expected {layer} in views/{name}.exr, got {have}. Write this layer in every view"
            )
        if found := gc.find_fault(layer, self.layers[layer], camera.height, camera.width):
            raise gc.PredictionError(f"{name}: {found}. Write this view again")
        return self.layers[layer]


@dataclass(frozen=True, slots=True)
class TrueView:
    """The truth of one view, with the pixels that are judged."""

    view: gc.View
    layers: Mapping[str, np.ndarray]
    emitters: frozenset[int]

    def take(self, layer: str) -> np.ndarray:
        """A layer that is fit to be compared with.

        Raises:
            DatasetError: It is missing, of another size, or not finite.
        """
        name, camera = self.view.name, self.view.camera
        if layer not in self.layers:
            raise gc.DatasetError(
                f"expected {layer} in the truth of view {name}, got {', '.join(self.layers)}. "
                "Run `graycard render` again"
            )
        if found := gc.find_fault(layer, self.layers[layer], camera.height, camera.width):
            raise gc.DatasetError(f"truth of view {name}: {found}. Run `graycard render` again")
        return self.layers[layer]

    def mask(self, layer: str) -> np.ndarray:
        """The judged pixels of a layer, shape ``(H, W)``, bool.

        Raises:
            DatasetError: The truth has no object ids.
        """
        return judged_mask(self.take("object_id"), self.emitters if layer == "base_color" else frozenset())

    def pure(self) -> np.ndarray | None:
        """Pixels that show one surface of one colour, shape ``(H, W)``, bool; None where none are named.

        Raises:
            DatasetError: The layer is of another size, or not finite.
        """
        return self.take("pure") > 0.5 if "pure" in self.layers else None


def read_prediction(predictions: gc.Predictions, view: gc.View) -> PredictedView:
    """What is predicted for a view; a file that cannot be read becomes a fault."""
    if view.name not in predictions.view_names():
        listed = f"views/{view.name}.exr" in predictions.files
        return PredictedView(view, fault=_gone(view.name) if listed else "", exists=False)
    try:
        return PredictedView(view, predictions.layers(view.name))
    except gc.GraycardError as cause:
        return PredictedView(view, fault=f"{view.name}: {cause}")


def read_truth(truth: gc.Truth, view: gc.View) -> TrueView:
    """The truth of a view.

    Raises:
        DatasetError: The file is missing or broken.
    """
    return TrueView(view, truth.layers(view), truth.emitter_ids())


def _gone(name: str) -> str:
    return (
        f"{name}: expected views/{name}.exr, which predictions.json lists, got none. "
        "Write the predictions again"
    )

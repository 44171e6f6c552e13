# SPDX-License-Identifier: Apache-2.0
"""What the training views of a prediction are read for: the gauge, and which layers there are."""

from dataclasses import dataclass

import graycard as gc
from graycard.eval._gauge import Factors, Kind, Moments, fit_gauge, moments
from graycard.eval._readings import PredictedView, TrueView, read_prediction, read_truth

GAUGED = "base_color"


@dataclass(frozen=True, slots=True)
class Training:
    """Findings on the training views."""

    provided: frozenset[str]
    """Layers that at least one view has."""
    unreadable: tuple[str, ...]
    """Why a file cannot be read, for each such file."""
    moments: tuple[Moments, ...]
    """Of the views in which base colour is fit to be used."""
    faults: tuple[str, ...]
    """Why base colour is not, for the others."""

    def gauge(self, kind: Kind) -> Factors:
        """The fitted factors.

        Raises:
            PredictionError: Base colour is missing or faulty in a training view, or black.
        """
        if kind != "raw" and (self.faults or not self.moments):
            first = self.faults[0] if self.faults else "no training view sees an object"
            raise gc.PredictionError(
                f"expected {GAUGED} on the training views, where the gauge is fitted, got "
                f"{len(self.faults)} of them without: {first}"
            )
        return fit_gauge(self.moments, kind)


def survey_training(predictions: gc.Predictions, truth: gc.Truth) -> Training:
    """Read the training views one after the other.

    Raises:
        DatasetError: The truth of a view is missing or broken.
    """
    provided: set[str] = set()
    unreadable: list[str] = []
    sums: list[Moments] = []
    faults: list[str] = []
    for view in (v for v in truth.views if v.split == "train"):
        predicted = read_prediction(predictions, view)
        provided |= predicted.layers.keys()
        unreadable += [predicted.fault] if predicted.fault else []
        try:
            sums += _moments(predicted, read_truth(truth, view))
        except gc.PredictionError as cause:
            faults.append(str(cause))
    return Training(frozenset(provided), tuple(unreadable), tuple(sums), tuple(faults))


def _moments(predicted: PredictedView, true: TrueView) -> list[Moments]:
    mask = true.mask(GAUGED)
    values = predicted.take(GAUGED)
    return [moments(values, true.take(GAUGED), mask)] if mask.any() else []

# SPDX-License-Identifier: Apache-2.0
"""Survey of the training views of a prediction: the gauges, and which layers there are."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import get_args

from graycard import PredictionError, Predictions, Truth
from graycard.eval.measures._psnr import mean_square_error
from graycard.eval.measures._spaces import display
from graycard.eval.scoring._gauge import Factors, Kind, LinearMoments, fit_gauge, moments
from graycard.eval.scoring._readings import PredictedView, TrueView, read_prediction, read_truth

PICTURE = "radiance"
GAUGED = "base_color"
REFLECTANCES = (GAUGED, "diffuse_reflectance", "albedo")
"""Layers that trade a scale with light; the first that a prediction has says what its light is divided by."""


@dataclass(frozen=True, slots=True)
class Fit:
    """Sums that the gauge of one layer is fitted to."""

    moments: tuple[LinearMoments, ...]
    """Names of views in which the layer is fit to be used."""
    faults: tuple[str, ...] = ()
    """Why it is not, for the others."""


@dataclass(frozen=True, slots=True)
class Training:
    """Findings on the training views."""

    provided: frozenset[str]
    """Layers that at least one view has."""
    unreadable: tuple[str, ...]
    """Why a file cannot be read, for each such file."""
    fits: Mapping[str, Fit]
    """By reflectance: those that the prediction and the truth have, and base colour in any case."""
    errors: Mapping[str, float | str] = field(default_factory=dict)
    """By view that sees an object: mean square error of the displayed picture, or why there is none."""

    def gauge(self, kind: Kind, layer: str = GAUGED) -> Factors:
        """Return the fitted factors.

        Raises:
            PredictionError: The layer is missing or faulty in a training view, or black.
        """
        fit = self.fits[layer]
        if kind != "raw" and (fit.faults or not fit.moments):
            first = fit.faults[0] if fit.faults else "no training view sees an object"
            raise PredictionError(
                f"expected {layer} on the training views, where the gauge is fitted, got "
                f"{len(fit.faults)} of them without: {first}"
            )
        return fit_gauge(fit.moments, kind, layer)


def survey_training(
    predictions: Predictions, truth: Truth, names: Mapping[str, str] | None = None
) -> Training:
    """Read the training views one after the other.

    Args:
        predictions: What is scored.
        truth: What it is scored by.
        names: True names of lights by predicted ones, as for :func:`read_prediction`.

    Raises:
        DatasetError: The truth of a view is missing or broken.
    """
    provided: set[str] = set()
    unreadable: list[str] = []
    sums: dict[str, list[LinearMoments]] = {layer: [] for layer in REFLECTANCES}
    faults: dict[str, list[str]] = {layer: [] for layer in REFLECTANCES}
    errors: dict[str, float | str] = {}
    known = {GAUGED}
    for view in (v for v in truth.views if v.split == "train"):
        predicted, true = read_prediction(predictions, view, names), read_truth(truth, view)
        provided |= predicted.provided
        unreadable += [predicted.fault] if predicted.fault else []
        known |= true.layers.keys()
        if true.mask(PICTURE).any():
            errors[view.name] = _picture_error(predicted, true, truth.exposure)
        for layer in known.intersection(REFLECTANCES):
            try:
                sums[layer] += _moments(layer, predicted, true)
            except PredictionError as cause:
                faults[layer].append(str(cause))
    gauged = [layer for layer in REFLECTANCES if layer == GAUGED or layer in provided & known]
    fits = {layer: Fit(tuple(sums[layer]), tuple(faults[layer])) for layer in gauged}
    return Training(frozenset(provided), tuple(unreadable), fits, errors)


def fit_gauges(training: Training) -> dict[str, Factors | str]:
    """Return all gauges by name: the factors, or why there are none.

    ``raw``, ``scalar`` and ``channel`` are those of base colour, ``<layer>.<kind>`` those of another
    reflectance. ``traded`` is the scale per channel of the first reflectance that is predicted, and 1 where
    none is, as nothing was traded; ``light`` is one over it: what light gains where albedo loses.
    """
    found: dict[str, Factors | str] = {}
    for layer in training.fits:
        for kind in get_args(Kind):
            found[kind if layer == GAUGED else f"{layer}.{kind}"] = _gauge(training, kind, layer)
    traded = [layer for layer in REFLECTANCES if layer in training.provided and layer in training.fits]
    scale = _gauge(training, "channel", traded[0]) if traded else (1.0, 1.0, 1.0)
    found["traded"] = scale
    found["light"] = scale if isinstance(scale, str) else (1 / scale[0], 1 / scale[1], 1 / scale[2])
    return found


def _gauge(training: Training, kind: Kind, layer: str) -> Factors | str:
    try:
        return training.gauge(kind, layer)
    except PredictionError as cause:
        return str(cause)


def _picture_error(predicted: PredictedView, true: TrueView, exposure: float) -> float | str:
    """Mean square error of the displayed picture, or why there is none."""
    try:
        p = display(predicted.take(PICTURE, true.mask(PICTURE)), exposure)
    except PredictionError as cause:
        return str(cause)
    return mean_square_error(p, display(true.take(PICTURE), exposure), true.mask(PICTURE))


def _moments(layer: str, predicted: PredictedView, true: TrueView) -> list[LinearMoments]:
    mask = true.mask(layer)
    values = predicted.take(layer, mask)
    return [moments(values, true.take(layer), mask)] if mask.any() else []

# SPDX-License-Identifier: Apache-2.0
"""From a predictions folder to the images that published protocols judge."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from graycard import DatasetError, EditKind, PredictionError, Predictions, Truth, View
from graycard.eval.kinds._changed import (
    ABSENT,
    LAYER,
    ChangedPicture,
    Changes,
    predicted_picture,
    status_of_changes,
)
from graycard.eval.metrics._relighting import relit_pictures
from graycard.eval.protocols._base import JudgedView, JudgedViews, Subject
from graycard.eval.scoring._findings import Finding
from graycard.eval.scoring._readings import TrueView, read_prediction, read_truth
from graycard.records import Status


@dataclass(frozen=True, slots=True)
class Gathered:
    """The images of one subject, or why there are none."""

    expected: int
    """Number of test images that should be there."""
    views: JudgedViews | None = None
    status: Status = "scored"
    reason: str = ""


def gather(subject: Subject, predictions: Predictions, truth: Truth) -> Gathered:
    """Return the images of a subject; a fault of the prediction is in the result, not raised.

    Raises:
        DatasetError: The truth of a view is missing or broken, or no test view sees an object.
    """
    if subject == "relit":
        return _relit(predictions, truth)
    tests = _judged(subject, truth)
    if not tests and subject in ("base_color", "radiance", "normal"):
        raise DatasetError("expected a test view that sees an object, got none. Render the scene again")
    if not tests:
        return Gathered(0, status="not provided", reason=f"the scene has no {subject} to judge")
    try:
        seen = tuple(_view(subject, predictions, truth, view) for view in tests)
    except PredictionError as cause:
        status, reason = _absence(subject, predictions, truth, cause)
        return Gathered(len(tests), None, status, reason)
    validation = _validation(predictions, truth) if subject == "base_color" else None
    return Gathered(len(tests), JudgedViews(seen, validation))


def _judged(subject: Subject, truth: Truth) -> list[View]:
    """Return the test views in which a layer is judged."""
    tests = (view for view in truth.views if view.split == "test")
    return [view for view in tests if _sees(read_truth(truth, view), subject)]


def _sees(true: TrueView, layer: str) -> bool:
    """Tell whether a view has a true layer with pixels to judge; base colour must be there."""
    has_layer = layer in true.layers or layer == "base_color"
    return has_layer and bool(true.mask(layer).any())


def _absence(
    subject: Subject, predictions: Predictions, truth: Truth, cause: PredictionError
) -> tuple[Status, str]:
    """Tell a layer that some view lacks from one that no view has; a broken file may hold it."""
    found = (read_prediction(predictions, view) for view in truth.views)
    if any(p.fault or subject in p.layers for p in found):
        return "failed", str(cause)
    return "not provided", f"no view has {subject}"


def _view(subject: Subject, predictions: Predictions, truth: Truth, view: View) -> JudgedView:
    true = read_truth(truth, view)
    exposure = truth.exposure if subject == LAYER else 1.0
    predicted = read_prediction(predictions, view).take(subject)
    wanted = true.take(subject)
    return JudgedView(
        view.name, _exposed(predicted, exposure), _exposed(wanted, exposure), true.mask(subject)
    )


def _exposed(image: np.ndarray, exposure: float) -> np.ndarray:
    return image if exposure == 1 else image.astype(np.float64) * exposure


def _validation(predictions: Predictions, truth: Truth) -> JudgedView | None:
    """Return the first training view that sees an object; None where its prediction cannot be used."""
    for view in (v for v in truth.views if v.split == "train"):
        if _sees(read_truth(truth, view), "base_color"):
            try:
                return _view("base_color", predictions, truth, view)
            except PredictionError:
                return None
    return None


def _relit(predictions: Predictions, truth: Truth) -> Gathered:
    """Return the pictures under changed lights, each at the exposure of the scene and without a gauge."""
    tests = [view for view in truth.views if view.split == "test"]
    masks = {view.name: read_truth(truth, view).mask(LAYER) for view in tests}
    pictures = list(relit_pictures(Changes(predictions, truth, masks)))
    if not pictures:
        return Gathered(0, status="not provided", reason="the scene has no picture under other lights")
    findings: dict[str, Finding] = {}
    seen = tuple(_found(pictures, truth.exposure, findings))
    kinds: Mapping[str, EditKind | None] = {picture.key: picture.kind for picture in pictures}
    status, reason = status_of_changes(findings, kinds)
    return Gathered(len(pictures), JudgedViews(seen) if status == "scored" else None, status, reason)


def _found(
    pictures: list[ChangedPicture], exposure: float, findings: dict[str, Finding]
) -> Iterator[JudgedView]:
    """Yield the pictures that are there, and note of each whether it is."""
    for picture in pictures:
        try:
            predicted = predicted_picture(picture)
        except PredictionError as cause:
            findings[picture.key] = Finding(reason=str(cause))
            continue
        findings[picture.key] = Finding(reason=ABSENT) if predicted is None else Finding(0.0)
        if predicted is not None:
            true = TrueView(picture.view, picture.true, frozenset()).take(LAYER).astype(np.float64)
            yield JudgedView(picture.key, exposure * predicted, exposure * true, picture.mask)

# SPDX-License-Identifier: Apache-2.0
"""From a predictions folder to the images that published protocols judge."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from graycard import DatasetError, EditKind, PredictionError, Predictions, Truth
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
from graycard.eval.scoring._readings import PredictedView, TrueView, read_prediction, read_truth
from graycard.records import Status


@dataclass(frozen=True, slots=True)
class Gathered:
    """The images of one subject, or why there are none."""

    expected: int
    """Number of test images that should be there."""
    views: JudgedViews | None = None
    status: Status = "scored"
    reason: str = ""


def gather(subjects: Collection[Subject], predictions: Predictions, truth: Truth) -> dict[Subject, Gathered]:
    """Return the images of subjects, for which each test view is read once; a fault is in the result.

    Raises:
        DatasetError: The truth of a view is missing or broken, or no test view sees an object.
    """
    found: dict[Subject, _Images] = {subject: _Images() for subject in subjects if subject != "relit"}
    masks: dict[str, np.ndarray] = {}
    for view in (v for v in truth.views if v.split == "test"):
        true, predicted = read_truth(truth, view), read_prediction(predictions, view)
        for subject, images in found.items():
            if _sees(true, subject):
                images.add(subject, predicted, true, truth.exposure)
        if "relit" in subjects:
            masks[view.name] = true.mask(LAYER)
    gathered: dict[Subject, Gathered] = {
        s: _gathered(s, images, predictions, truth) for s, images in found.items()
    }
    if "relit" in subjects:
        gathered["relit"] = _relit(predictions, truth, masks)
    return gathered


@dataclass(slots=True)
class _Images:
    """Images of one subject, gathered while views pass by."""

    expected: int = 0
    seen: list[JudgedView] = field(default_factory=list)
    fault: str = ""
    """Reason why the first view that lacks a usable prediction does; those after it are left out."""

    def add(self, subject: Subject, predicted: PredictedView, true: TrueView, exposure: float) -> None:
        """Take the images of a view in which the subject is judged."""
        self.expected += 1
        if self.fault:
            return
        try:
            self.seen.append(_view(subject, predicted, true, exposure))
        except PredictionError as cause:
            self.fault = str(cause)


def _gathered(subject: Subject, images: _Images, predictions: Predictions, truth: Truth) -> Gathered:
    if not images.expected and subject in ("base_color", "radiance", "normal"):
        raise DatasetError("expected a test view that sees an object, got none. Render the scene again")
    if not images.expected:
        return Gathered(0, status="not provided", reason=f"the scene has no {subject} to judge")
    if images.fault:
        status, reason = _absence(subject, predictions, truth, images.fault)
        return Gathered(images.expected, None, status, reason)
    validation = _validation(predictions, truth) if subject == "base_color" else None
    return Gathered(images.expected, JudgedViews(tuple(images.seen), validation))


def _sees(true: TrueView, layer: str) -> bool:
    """Tell whether a view has a true layer with pixels to judge; base colour must be there."""
    has_layer = layer in true.layers or layer == "base_color"
    return has_layer and bool(true.mask(layer).any())


def _absence(subject: Subject, predictions: Predictions, truth: Truth, fault: str) -> tuple[Status, str]:
    """Tell a layer that some view lacks from one that no view has; a broken file may hold it."""
    found = (read_prediction(predictions, view) for view in truth.views)
    if any(p.fault or subject in p.provided for p in found):
        return "failed", fault
    return "not provided", f"no view has {subject}"


def _view(subject: Subject, predicted: PredictedView, true: TrueView, exposure: float) -> JudgedView:
    factor = exposure if subject == LAYER else 1.0
    mask, wanted = true.mask(subject), true.take(subject)
    image = predicted.take(subject, mask)
    return JudgedView(true.view.name, _exposed(image, factor), _exposed(wanted, factor), mask)


def _exposed(image: np.ndarray, exposure: float) -> np.ndarray:
    return image if exposure == 1 else image.astype(np.float64) * exposure


def _validation(predictions: Predictions, truth: Truth) -> JudgedView | None:
    """Return the first training view that sees an object; None where its prediction cannot be used."""
    for view in (v for v in truth.views if v.split == "train"):
        if _sees(true := read_truth(truth, view), "base_color"):
            try:
                return _view("base_color", read_prediction(predictions, view), true, truth.exposure)
            except PredictionError:
                return None
    return None


def _relit(predictions: Predictions, truth: Truth, masks: Mapping[str, np.ndarray]) -> Gathered:
    """Return the pictures under changed lights, each at the exposure of the scene and without a gauge.

    Args:
        predictions: The folder.
        truth: The scene.
        masks: Judged pixels of each test view, shape ``(H, W)``, bool, by its name.
    """
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

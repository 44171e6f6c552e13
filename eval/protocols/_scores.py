# SPDX-License-Identifier: Apache-2.0
"""From the base colour of a predictions folder to one score for each albedo protocol."""

from collections.abc import Sequence

from graycard import DatasetError, GraycardError, PredictionError, Predictions, Truth, View
from graycard.eval.protocols._base import AlbedoProtocol, AlbedoView, AlbedoViews
from graycard.eval.scoring._readings import read_prediction, read_truth
from graycard.records import Score, Status

LAYER = "base_color"


def score_protocols(
    protocols: Sequence[AlbedoProtocol], predictions: Predictions, truth: Truth
) -> tuple[Score, ...]:
    """Judge base colour by each protocol; a fault of the prediction is in the scores, not raised.

    Raises:
        DatasetError: The truth of a view is missing or broken, or no test view sees an object.
    """
    tests = [v for v in truth.views if v.split == "test" and read_truth(truth, v).mask(LAYER).any()]
    if not tests:
        raise DatasetError("expected a test view that sees an object, got none. Render the scene again")
    try:
        seen = tuple(_view(predictions, truth, view) for view in tests)
    except PredictionError as cause:
        status, reason = _absence(predictions, truth, cause)
        return tuple(_unscored(p, status, reason, len(tests)) for p in protocols)
    views = AlbedoViews(seen, _validation(predictions, truth))
    return tuple(score_views(protocol, views) for protocol in protocols)


def score_views(protocol: AlbedoProtocol, views: AlbedoViews) -> Score:
    """The score of views by a protocol; what the protocol cannot judge is a failed score."""
    expected = len(views.test)
    try:
        found = protocol.score(views)
    except GraycardError as cause:
        return _unscored(protocol, "failed", str(cause), expected)
    record = protocol.record
    return Score(
        record.id,
        protocol.id,
        "scored",
        found.value,
        record.unit,
        record.higher_is_better,
        record.optimum,
        per_view=found.per_view,
        gauge=found.gauge,
        expected=expected,
        scored=len(found.per_view),
    )


def _absence(predictions: Predictions, truth: Truth, cause: PredictionError) -> tuple[Status, str]:
    """Tell base colour that some view lacks from one that no view has; a broken file may hold it."""
    found = (read_prediction(predictions, view) for view in truth.views)
    if any(p.fault or LAYER in p.layers for p in found):
        return "failed", str(cause)
    return "not provided", f"no view has {LAYER}"


def _view(predictions: Predictions, truth: Truth, view: View) -> AlbedoView:
    true = read_truth(truth, view)
    values = read_prediction(predictions, view).take(LAYER)
    return AlbedoView(view.name, values, true.take(LAYER), true.mask(LAYER))


def _validation(predictions: Predictions, truth: Truth) -> AlbedoView | None:
    """The first training view that sees an object; None where its prediction cannot be used."""
    for view in (v for v in truth.views if v.split == "train"):
        if read_truth(truth, view).mask(LAYER).any():
            try:
                return _view(predictions, truth, view)
            except PredictionError:
                return None
    return None


def _unscored(protocol: AlbedoProtocol, status: Status, reason: str, expected: int) -> Score:
    record = protocol.record
    ranking = record.unit, record.higher_is_better, record.optimum
    return Score(record.id, protocol.id, status, None, *ranking, expected=expected, reason=reason)

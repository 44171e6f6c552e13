# SPDX-License-Identifier: Apache-2.0
"""From a predictions folder to one score for each published protocol."""

import math
from collections.abc import Sequence

from graycard import GraycardError, Predictions, Truth, WeightsError
from graycard.eval.protocols._base import JudgedViews, PublishedProtocol, Subject
from graycard.eval.protocols._gather import Gathered, gather
from graycard.records import Score, Status


def score_protocols(
    protocols: Sequence[PublishedProtocol], predictions: Predictions, truth: Truth
) -> tuple[Score, ...]:
    """Judge a predictions folder by each protocol; a fault of the prediction is in the scores, not raised.

    Each test view is read once, and images of a subject are kept no longer than its protocols need them.

    Raises:
        DatasetError: The truth of a view is missing or broken, or no test view sees an object.
    """
    found: dict[str, Score] = {}
    subjects: list[Subject] = list(dict.fromkeys(protocol.subject for protocol in protocols))
    gathered = gather(subjects, predictions, truth)
    for subject in subjects:
        images = gathered.pop(subject)
        found |= {p.id: _score(p, images) for p in protocols if p.subject == subject}
    return tuple(found[protocol.id] for protocol in protocols)


def score_views(protocol: PublishedProtocol, views: JudgedViews) -> Score:
    """Return the score of views by a protocol; one that cannot be judged, or is not a number, has failed.

    Without the weights of a network that it needs, a protocol's score is not provided.
    """
    expected = len(views.test)
    try:
        found = protocol.score(views)
    except WeightsError as cause:  # it says nothing of the prediction
        return _unscored(protocol, "not provided", str(cause), expected)
    except GraycardError as cause:
        return _unscored(protocol, "failed", str(cause), expected)
    if math.isnan(found.value):
        reason = f"expected a number from {protocol.name}, got nan. Look for values that are not finite"
        return _unscored(protocol, "failed", reason, expected)
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


def _score(protocol: PublishedProtocol, gathered: Gathered) -> Score:
    if gathered.views is None:
        return _unscored(protocol, gathered.status, gathered.reason, gathered.expected)
    return score_views(protocol, gathered.views)


def _unscored(protocol: PublishedProtocol, status: Status, reason: str, expected: int) -> Score:
    record = protocol.record
    ranking = record.unit, record.higher_is_better, record.optimum
    return Score(record.id, protocol.id, status, None, *ranking, expected=expected, reason=reason)

# SPDX-License-Identifier: Apache-2.0
"""A view relit, and with an object put in: what competing methods hand in of it, beside the truth.

Embedded in one view only, one change of each kind: a report must stay small enough to be mailed, and scores
are over all.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from graycard import GraycardError, Predictions, Truth, View
from graycard.reports._evidence import MethodEvidence, SceneEvidence
from graycard.reports.pictures._layer_rows import LayerRow, judged_layer, layer_row


@dataclass(frozen=True, slots=True)
class Change:
    """One change of a scene."""

    title: str
    true: Callable[[View], Mapping[str, np.ndarray]]
    """True layers of a view."""
    predicted: Callable[[Predictions, View], Mapping[str, np.ndarray] | None]
    """The same of a prediction; None where it has none."""
    gauged: bool
    """True if the picture is scored in the gauge of the albedo."""


def changed_rows(scene: SceneEvidence, methods: Sequence[MethodEvidence]) -> tuple[LayerRow, ...]:
    """Rows of the first shown view, of those changes that a competing method has a picture of.

    Raises:
        DatasetError: The truth of a change is missing or broken.
    """
    rows = []
    for change in _changes(scene.truth) if scene.shown else ():
        view = scene.shown[0]
        found = [_under(change, method, view) for method in methods]
        if any(m.competes and (m.layers or view.name in m.faults) for m in found):
            true = {**scene.layers[view.name], **change.true(view)}
            bare = {name: true[name] for name in ("radiance", "object_id") if name in true}
            here = replace(scene, shown=(view,), layers={view.name: bare})
            layer = replace(judged_layer("radiance", here, found), title=change.title)
            rows.append(layer_row(layer, view, here, found))
    return tuple(rows)


def _changes(truth: Truth) -> Iterator[Change]:
    """Yield the first change of lights of each kind, and what is put in."""
    kinds = {edit.kind: edit for edit in reversed(truth.edits)}
    for edit in (e for e in truth.edits if kinds[e.kind] is e):
        yield Change(
            f"Relit: {edit.summary}",
            lambda view, name=edit.name: truth.relit(name, view),
            lambda predictions, view, name=edit.name: predictions.relit(name, view.name),
            gauged=True,
        )
    if (composition := truth.composition()) is not None:
        donor = composition.donor
        yield Change(
            f"Composed: with {donor.object} of another scene",
            truth.composed,
            lambda predictions, view: predictions.composed(view.name),
            gauged=False,
        )


def _under(change: Change, method: MethodEvidence, view: View) -> MethodEvidence:
    """Return a method with its picture of a change in the place of its own view, or why that cannot
    be read.
    """
    gauge = method.relit_gauge if change.gauged else None
    bare = replace(method, layers={}, faults={}, gauge=gauge, gauged="radiance")
    if method.predictions is None or method.fault:
        return bare
    try:
        layers = change.predicted(method.predictions, view)
    except GraycardError as cause:
        return replace(bare, faults={view.name: str(cause)})
    return bare if layers is None else replace(bare, layers={view.name: layers})

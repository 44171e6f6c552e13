# SPDX-License-Identifier: Apache-2.0
"""Looks at a training while it runs: its loss, and the network's errors on validation views."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import torch

from graycard.benchmarks.training._batches import whole_views
from graycard.benchmarks.training._errors import UNITS, best_constant, errors_of
from graycard.methods.priors.network import GeometryNet, inputs_of
from graycard.methods.surfels import srgb_decode_tensor

Views = Mapping[str, np.ndarray]
Errors = Mapping[str, Mapping[str, tuple[float, ...]]]
"""Errors by track and kind, in the units of :func:`errors_of`; means over views."""


@dataclass(frozen=True, slots=True)
class Look:
    """One point of the curves."""

    step: int
    loss: float
    """Mean over the steps since the last look."""
    errors: Errors
    """Errors on validation views."""


@torch.inference_mode()
def errors_of_network(net: GeometryNet, validation: Mapping[str, Views]) -> Errors:
    """Return how wrong a network is about all views of scenes.

    Args:
        net: In the mode of training, as it is left.
        validation: Views of :func:`read_views`; the part of a name before the first ``/`` is the track.
    """

    def answers(views: Views) -> Views:
        batch = whole_views(views, np.arange(len(views["image"])))
        told = net(inputs_of(batch["image"], batch["rays"]))
        told["depth"], told["base_color"] = told["depth"].exp(), srgb_decode_tensor(told["base_color"])
        arrays = {kind: told[kind].movedim(1, -1).numpy() for kind in UNITS}
        return {kind: a if a.shape[-1] == 3 else a[..., 0] for kind, a in arrays.items()}

    net.eval()
    found = _means(validation, answers)
    net.train()
    return found


def errors_of_constants(validation: Mapping[str, Views]) -> Errors:
    """Return how wrong the best constant of each view is: what a network has to beat."""

    def answers(views: Views) -> Views:
        seen = np.isfinite(views["depth"])
        return {
            kind: np.stack([best_constant(kind, *one) for one in zip(views[kind], seen, strict=True)])
            for kind in UNITS
        }

    return _means(validation, answers)


def _means(validation: Mapping[str, Views], answers: Callable[[Views], Views]) -> Errors:
    """Errors of the answers, shape ``(V, H, W)`` or ``(V, H, W, 3)`` for each kind of a scene."""
    found: dict[str, dict[str, list[tuple[float, ...]]]] = {}
    for name, views in validation.items():
        of_track, seen = found.setdefault(name.partition("/")[0], {}), np.isfinite(views["depth"])
        told = answers(views)
        for kind in UNITS:
            true = views[kind].astype(np.float32)
            errors = [errors_of(kind, *one) for one in zip(told[kind], true, seen, strict=True)]
            of_track.setdefault(kind, []).extend(errors)
    return {
        track: {kind: tuple(float(x) for x in np.mean(errors, axis=0)) for kind, errors in kinds.items()}
        for track, kinds in found.items()
    }

# SPDX-License-Identifier: Apache-2.0
"""Whose a surfel is, learnt from masks: an identity each, and one classifier for all (Gaussian Grouping).

Ye, Danelljan, Yu and Ke (ECCV 2024), equations 3 to 5. A capture grants masks of one object, so there are two
classes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import log, pi, sqrt

import numpy as np
import torch
from scipy.spatial import KDTree
from torch.nn.functional import cross_entropy, linear

from graycard import Camera
from graycard.methods.removal._settings import GroupingSettings
from graycard.methods.splat import (
    CENTRES,
    GEOMETRY,
    LearningRateSchedule,
    LossResult,
    Parameters,
    rasterize_features,
    surfels_of,
    view_at,
)
from graycard.methods.surfels import SurfelObjective

IDENTITIES = "identities"
"""Parameter of the surfels, shape ``(N, D)``."""
WEIGHTS, BIASES = "classifier weights", "classifier biases"
"""Parameters of the classifier, shapes ``(2, D)`` and ``(2,)``."""
REST, OBJECT = 0, 1
"""The classes."""
CLASSES = 2
SPREAD = sqrt(pi)
"""Identities begin between plus and minus this: as harmonics of degree zero of random colours."""


def with_identities(start: Parameters, settings: GroupingSettings, seed: int) -> Parameters:
    """Surfels with random identities, and a classifier that has learnt nothing.

    Weights and biases are uniform within one over the root of the number of inputs, as ``torch.nn.Linear``
    begins.
    """
    random, width = torch.Generator().manual_seed(seed), settings.identity_dim

    def uniform(bound: float, *shape: int) -> torch.Tensor:
        return bound * (2 * torch.rand(shape, generator=random) - 1)

    surfels = {**start.surfels, IDENTITIES: uniform(SPREAD, len(start), width)}
    weights, biases = uniform(1 / sqrt(width), CLASSES, width), uniform(1 / sqrt(width), CLASSES)
    return Parameters(surfels, {**start.shared, WEIGHTS: weights, BIASES: biases})


def without_identities(parameters: Parameters) -> Parameters:
    """Return the surfels as they would be without what says whose they are."""
    surfels = {name: values for name, values in parameters.surfels.items() if name != IDENTITIES}
    shared = {name: values for name, values in parameters.shared.items() if name not in (WEIGHTS, BIASES)}
    return Parameters(surfels, shared)


def identity_rates(settings: GroupingSettings) -> dict[str, LearningRateSchedule]:
    """Learning rates by the names of parameters."""
    classifier = LearningRateSchedule(settings.classifier_rate)
    return {IDENTITIES: LearningRateSchedule(settings.identity_rate), WEIGHTS: classifier, BIASES: classifier}


def class_scores(values: Mapping[str, torch.Tensor], identities: torch.Tensor) -> torch.Tensor:
    """Return what the classifier says of identities, shape ``(..., 2)`` of ``(..., D)``: before the
    softmax.
    """
    return linear(identities, values[WEIGHTS], values[BIASES])


@torch.no_grad()
def object_probabilities(values: Mapping[str, torch.Tensor]) -> torch.Tensor:
    """Return how probable it is that surfels are the object's, shape ``(N,)``."""
    return class_scores(values, values[IDENTITIES]).softmax(dim=-1)[:, OBJECT]


@dataclass(frozen=True, eq=False)
class IdentityObjective:
    """The loss of colours, and that of identities beside it: neither has a part in what the other moves."""

    colours: SurfelObjective
    masks: Sequence[torch.Tensor]
    """Labels of the object, one a view, shape ``(H, W)``: classes, int64."""
    settings: GroupingSettings

    def __call__(self, values: Mapping[str, torch.Tensor], step: int) -> LossResult:
        """Return the loss of a step, with what else the fit is told."""
        result, seed, settings = self.colours(values, step), self.colours.seed, self.settings
        number = view_at(step, len(self.masks), seed)
        loss = result.loss + mask_loss(values, self.colours.views[number].camera, self.masks[number])
        if step % settings.consistency_every == 0:
            places = values[CENTRES].detach().cpu().numpy()
            which, others = neighbours_of_some(places, settings, (seed, step))
            scores = class_scores(values, values[IDENTITIES])
            loss = loss + settings.consistency_weight * disagreement_of(scores[which], scores[others])
        return replace(result, loss=loss)


def mask_loss(values: Mapping[str, torch.Tensor], camera: Camera, mask: torch.Tensor) -> torch.Tensor:
    """Cross entropy of drawn identities and a mask, 1 for a classifier that cannot tell (equation 3).

    The surfels themselves get no gradient: they are where photographs say.

    Args:
        values: Parameters by name.
        camera: Of the view.
        mask: Shape ``(H, W)``: classes, int64.
    """
    still = {name: values[name].detach() for name in GEOMETRY}
    drawn = rasterize_features(surfels_of(still, values[IDENTITIES]), camera).features
    return cross_entropy(class_scores(values, drawn).flatten(end_dim=1), mask.flatten()) / log(CLASSES)


def disagreement_of(scores: torch.Tensor, others: torch.Tensor) -> torch.Tensor:
    """Mean divergence (Kullback-Leibler) of surfels' classes from their neighbours', a class (equation 4).

    Args:
        scores: Shape ``(S, 2)``: of surfels, before the softmax.
        others: Shape ``(S, K, 2)``: of their neighbours.
    """
    own = scores.log_softmax(dim=-1)[:, None]
    return (own.exp() * (own - others.log_softmax(dim=-1))).sum(dim=-1).mean() / CLASSES


def neighbours_of_some(
    places: np.ndarray, settings: GroupingSettings, seed: tuple[int, ...]
) -> tuple[torch.Tensor, torch.Tensor]:
    """Numbers of some surfels, shape ``(S,)``, and of those nearest to each, shape ``(S, K)``.

    Args:
        places: Shape ``(N, 3)``, metres.
        settings: How many of either.
        seed: Decides which.
    """
    some = np.random.default_rng(seed).permutation(len(places))[: settings.samples]
    count = min(settings.neighbours, len(places) - 1)
    nearest = np.asarray(KDTree(places).query(places[some], k=count + 1)[1])
    return torch.from_numpy(some), torch.from_numpy(nearest[:, 1:])  # a surfel is its own nearest

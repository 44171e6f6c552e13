# SPDX-License-Identifier: Apache-2.0
"""The shape of a protocol: a name, a version, and rules that turn images into one number."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from graycard.records import Invariance, MetricRecord

Subject = Literal["base_color", "radiance", "relit", "normal", "depth", "roughness"]
"""Images that a protocol judges: a layer of the test views, or the pictures under changed lights."""


GROUPS: Mapping[Subject, tuple[str, str]] = {
    "base_color": ("albedo", "Albedo"),
    "radiance": ("novel_view", "Novel view"),
    "relit": ("relighting", "Relighting"),
    "normal": ("normal", "Normal"),
    "depth": ("depth", "Depth"),
    "roughness": ("roughness", "Roughness"),
}
"""By subject: the first part of the ids of its metrics, and the first word of their titles."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """The steps of a protocol, in words for a table."""

    pixels: str
    """Pixels that the error is averaged over."""
    gauge: str = "none"
    """Factors that are taken off, and the fit that gives them."""
    fitted_on: str = "no view"
    """Views that the fit sees."""
    space: str
    """Colour space of the comparison, or the quantity compared."""
    pooling: str = "mean of views"
    """Step from views to one number."""
    channels: str = "together"
    """Step from channels to one number."""
    exposure: str = "1 is white"
    """Factor that brings light to display range."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Protocol(ABC):
    """A named, versioned, immutable way of turning layers into one number."""

    name: str
    version: int = 1
    summary: str
    """One line: whose protocol it is."""
    source: str
    """Source of its definition."""

    @property
    def id(self) -> str:
        """Name and version, as scores carry them: ``tensoir-three-1``."""
        return f"{self.name}-{self.version}"

    @abstractmethod
    def rules_of(self, metric: str) -> Rules:
        """Return what it does to come to a metric, in words for a table."""


@dataclass(frozen=True, slots=True)
class JudgedView:
    """One predicted image beside the true one, linear; light is at the exposure of the scene.

    Images of colour and of directions have the shape ``(H, W, 3)``, of depth and roughness ``(H, W)``.
    """

    name: str
    predicted: np.ndarray
    """May hold anything outside the mask, NaN and infinities too."""
    true: np.ndarray
    mask: np.ndarray
    """Shape ``(H, W)``, bool: where the truth sees an object; for base colour, one that is no light."""


@dataclass(frozen=True, slots=True)
class JudgedViews:
    """The images that a published protocol may look at."""

    test: tuple[JudgedView, ...]
    """The scored ones."""
    validation: JudgedView | None = None
    """One that is not scored: the first training view. None where its prediction cannot be used."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of a protocol on the views."""

    value: float
    per_view: Mapping[str, float] = field(default_factory=dict)
    gauge: tuple[float, ...] | None = None
    """The factors for R, G, B where all views share them; None where each view has its own, or none."""


def mean_of_views(each: Mapping[str, float], gauge: tuple[float, ...] | None = None) -> Outcome:
    """Return the mean over views as the outcome.

    Args:
        each: Values by view, at least one.
        gauge: As in :class:`Outcome`.
    """
    return Outcome(float(np.mean(list(each.values()))), each, gauge)


@dataclass(frozen=True, slots=True, kw_only=True)
class PublishedProtocol(Protocol, ABC):
    """A protocol that judges images of one subject, as published code does."""

    subject: Subject = "base_color"
    ignores: tuple[Invariance, ...] = ()
    """The gauge groups under which its score does not change."""
    refuses: tuple[Invariance, ...] = ()
    """The changes of a prediction by which its score fails."""

    @property
    @abstractmethod
    def record(self) -> MetricRecord:
        """Record of its number: unit, direction, optimum."""

    @abstractmethod
    def score(self, views: JudgedViews) -> Outcome:
        """Judge the test views.

        Raises:
            PredictionError: A prediction is not finite inside the mask, no factor can be fitted, or the view
                that it is fitted on cannot be used.
            DatasetError: The views are too small, or the mask is too narrow, for the definition.
            WeightsError: It needs the weights of a network, and there are none.
        """

# SPDX-License-Identifier: Apache-2.0
"""The one shape of a metric, and the interface of the ways to compute one."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from graycard import Predictions, Truth
from graycard.eval.kinds._references import Reference
from graycard.eval.scoring._ceiling import Ceiling
from graycard.eval.scoring._findings import SceneFacts
from graycard.eval.scoring._readings import PredictedView, TrueView
from graycard.records import Invariance, MetricRecord, Score

R = TypeVar("R", bound="Rule")

LIGHTS = "lights.json"
"""Stands among the layers of a metric that reads the predicted lights."""


def always() -> bool:
    """Return true: a metric needs nothing but this package."""
    return True


class Scorer(ABC):
    """Scores all metrics of one kind on one scene: it sees each test view once, then gives the scores."""

    def observe(self, predicted: PredictedView, true: TrueView, scene: SceneFacts) -> None:  # noqa: B027
        """Look at a test view; a fault of the prediction is kept for its score, not raised.

        Raises:
            DatasetError: The truth of the view is broken.
        """

    @abstractmethod
    def scores(self) -> list[Score]:
        """Return one score for each metric that the scene has, after all test views were observed.

        Raises:
            DatasetError: The truth is missing or broken.
        """


class Rule(ABC):
    """Computes the value of a metric; rules of one kind share a scorer."""

    @classmethod
    @abstractmethod
    def scorer(
        cls, metrics: "Sequence[Metric[Any]]", predictions: Predictions, truth: Truth, scene: SceneFacts
    ) -> Scorer:
        """Begin to score the metrics of this kind.

        Args:
            metrics: Those with a rule of this class, in the order of the registry.
            predictions: What is scored.
            truth: What it is compared with.
            scene: What is the same for all views: exposure, training views, gauges.
        """

    @property
    def space_name(self) -> str:
        """Space of the comparison in words."""
        return "sRGB"


@dataclass(frozen=True, kw_only=True)  # without slots, which break calls of an alias such as Metric[X]
class Metric(Generic[R]):
    """One number about a prediction: what it means, how it is computed, and what is known of it."""

    record: MetricRecord
    """Record that runs publish: id, title, unit, direction, formula."""
    rule: R
    """Rule that computes it."""
    layers: tuple[str, ...]
    """Parts of a prediction that it reads beside its gauge, the judged one first: layers, where ``<light>``
    stands for each light, or :data:`LIGHTS`."""
    ceiling: Ceiling
    """Rule by which the truth's own noise bounds the score, and its reason."""
    references: tuple[Reference, ...]
    """Independent computations that tests hold it against; at least one."""
    gauge: str | None = None
    """Name of the gauge that is applied first (:func:`graycard.eval.scoring._training.fit_gauges`)."""
    refuses: tuple[Invariance, ...] = ()
    """The changes of a prediction by which its score fails: no positive gauge undoes a sign."""
    breakdown: tuple[str, ...] = ()
    """Names in the breakdown of its scores; those of single changes of a scene come on top."""
    note: str = ""
    """Remark that a reader needs beside the number."""
    after: str = ""
    """Id of the metric behind which it stands; empty: behind the metric before it in its module."""
    available: Callable[[], bool] = always
    """Tell whether it can be computed here; a sheet goes without what cannot."""
    advice: str = ""
    """Advice to whoever lacks what it needs: where it is not available."""

    @property
    def id(self) -> str:
        """Id of the record."""
        return self.record.id

    @property
    def layer(self) -> str:
        """The judged layer."""
        return self.layers[0]

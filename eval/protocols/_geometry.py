# SPDX-License-Identifier: Apache-2.0
"""Protocols that judge normals and depth."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from graycard.eval.kinds._records import error
from graycard.eval.protocols._alignment import check_finite, eroded
from graycard.eval.protocols._base import (
    JudgedView,
    JudgedViews,
    Outcome,
    PublishedProtocol,
    Rules,
    Subject,
    mean_of_views,
)
from graycard.eval.protocols._encoding import STORED
from graycard.records import MetricRecord

ORB_EROSION = 5
"""Side of the square, in pixels, by which Stanford-ORB erodes its masks."""
_NO_LENGTH = 1e-6
"""Stanford-ORB adds it to the length that a normal is divided by."""
_NO_DEPTH = 1e-6
"""Sum of squares up to which Stanford-ORB takes a depth for missing, and puts 1 in its place."""
_BACKGROUND = (0.0, 0.0, 1.0)
_NEAREST_TO_BACKGROUND = np.array([128, 128, 255]) / 255
"""8-bit normal that GS-IR takes for the background."""

Directions = Literal["float", "8 bits"]


@dataclass(frozen=True, slots=True, kw_only=True)
class AngleProtocol(PublishedProtocol):
    """Mean angle between normals over the whole picture, in which the true background is (0, 0, 1).

    The prediction is not masked. Where it has no length, no surface was drawn: there it is the background,
    as the renderers of the published methods draw it.
    """

    subject: Subject = "normal"
    stored_as: Directions = "float"
    """Format of the files of both; 8 bits hold (n + 1) / 2."""

    @property
    def record(self) -> MetricRecord:
        """Mean angle."""
        return error(
            "normal",
            "mean_angle",
            "Normal error, mean",
            self.summary,
            unit="°",
            tolerance=0.5,
            ignores=self.ignores,
        )

    def rules_of(self, metric: str) -> Rules:
        """Return the steps in words for a table."""
        return Rules(pixels="whole image, background (0, 0, 1)", space=f"world, {self.stored_as}")

    def score(self, views: JudgedViews) -> Outcome:
        """Judge the test views; see :class:`PublishedProtocol`."""
        return mean_of_views({view.name: self._angle(view) for view in views.test})

    def _angle(self, view: JudgedView) -> float:
        check_finite(view.name, view.predicted, view.mask)
        predicted = self._stored(_with_background(view.predicted))
        predicted[(np.abs(predicted / 2 + 0.5 - _NEAREST_TO_BACKGROUND) < 1e-9).all(axis=-1)] = _BACKGROUND
        true = np.where(view.mask[..., None], self._stored(np.asarray(view.true, np.float64)), _BACKGROUND)
        cosine = (_unit(predicted) * _unit(true)).sum(axis=-1)
        return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())

    def _stored(self, normals: np.ndarray) -> np.ndarray:
        return normals if self.stored_as == "float" else STORED["8 bits"](normals / 2 + 0.5) * 2 - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class CosineProtocol(PublishedProtocol):
    """Mean of 1 - cos of the angle between normals, inside the mask eroded by 5 x 5, mean over views."""

    subject: Subject = "normal"

    @property
    def record(self) -> MetricRecord:
        """Mean of 1 - cos."""
        return error(
            "normal", "cosine", "Normal error, 1 - cos", self.summary, tolerance=0.005, ignores=self.ignores
        )

    def rules_of(self, metric: str) -> Rules:
        """Return the steps in words for a table."""
        return Rules(pixels=f"mask, eroded {ORB_EROSION}x{ORB_EROSION}", space="world")

    def score(self, views: JudgedViews) -> Outcome:
        """Judge the test views; see :class:`PublishedProtocol`."""
        return mean_of_views({view.name: _distance(view) for view in views.test})


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthProtocol(PublishedProtocol):
    """Mean square error of depth after one scale a scene, over the whole picture.

    The scale Σ p t / Σ p² is of all scored views, inside the mask eroded by 5 x 5; so is the error, which is
    divided by all pixels.
    """

    subject: Subject = "depth"

    @property
    def record(self) -> MetricRecord:
        """Mean square error after a scale."""
        title = "Depth error, square, one scale"
        return error("depth", "mse", title, self.summary, unit="m²", tolerance=0.001, ignores=self.ignores)

    def rules_of(self, metric: str) -> Rules:
        """Return the steps in words for a table."""
        pixels = f"whole image, eroded {ORB_EROSION}x{ORB_EROSION}"
        return Rules(
            pixels=pixels, gauge="least squares, one factor", fitted_on="all scored views", space="depth"
        )

    def score(self, views: JudgedViews) -> Outcome:
        """Judge the test views; see :class:`PublishedProtocol`."""
        pairs = [_depths(view) for view in views.test]
        scale = sum((p * t).sum() for p, t in pairs) / sum((p * p).sum() for p, _ in pairs)
        each = [
            ((scale * p - t) ** 2).sum() / v.mask.size for v, (p, t) in zip(views.test, pairs, strict=True)
        ]
        return mean_of_views({v.name: float(e) for v, e in zip(views.test, each, strict=True)})


def _with_background(normals: np.ndarray) -> np.ndarray:
    """Return normals with the background where they are not finite or have no length."""
    normals = np.nan_to_num(np.asarray(normals, np.float64), nan=0.0, posinf=0.0, neginf=0.0)
    return np.where((normals == 0).all(axis=-1, keepdims=True), _BACKGROUND, normals)


def _unit(normals: np.ndarray) -> np.ndarray:
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def _distance(view: JudgedView) -> float:
    mask = eroded(view.name, view.mask, ORB_EROSION)
    check_finite(view.name, view.predicted, mask)
    predicted, true = (np.asarray(image, np.float64)[mask] for image in (view.predicted, view.true))
    lengths = [np.linalg.norm(n, axis=-1) + _NO_LENGTH for n in (predicted, true)]
    return float((1 - (predicted * true).sum(axis=-1) / (lengths[0] * lengths[1])).mean())


def _depths(view: JudgedView) -> tuple[np.ndarray, np.ndarray]:
    """Return predicted and true depths inside the eroded mask, each of shape ``(N,)``."""
    mask = eroded(view.name, view.mask, ORB_EROSION)
    check_finite(view.name, view.predicted, mask)
    predicted, true = (np.asarray(image, np.float64)[mask] for image in (view.predicted, view.true))
    return (predicted if (predicted**2).sum() > _NO_DEPTH else np.ones_like(true)), true

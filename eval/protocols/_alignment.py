# SPDX-License-Identifier: Apache-2.0
"""Steps by which published code makes a predicted picture comparable with the true one."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from graycard import DatasetError, PredictionError, srgb_encode
from graycard.eval.protocols._base import JudgedView, JudgedViews
from graycard.eval.protocols._encoding import ENCODED, STORED, Space, Storage
from graycard.eval.protocols._estimators import Estimator, estimate

FittedOn = Literal[
    "no view",
    "each scored view",
    "the first scored view",
    "20 scored views",
    "all scored views",
    "the first training view",
]
Outside = Literal["black", "white", "prediction on black", "as it is"]
Exposure = Literal["1 is white", "as bright as sRGB"]

RATIO_VIEWS = 20
"""Number of views of ``20 scored views``."""
_DARK = 1e-8
"""Mean of a true picture below which it is not made brighter."""


class Picture(NamedTuple):
    """One view, whole, with linear values."""

    predicted: np.ndarray
    """Shape ``(H, W, 3)``."""
    true: np.ndarray
    """Shape ``(H, W, 3)``."""
    mask: np.ndarray
    """Shape ``(H, W)``, bool."""


@dataclass(frozen=True, slots=True)
class Aligned:
    """One view as it is compared."""

    name: str
    predicted: np.ndarray
    """Shape ``(H, W, 3)``, in the space of the comparison."""
    true: np.ndarray
    """Shape ``(H, W, 3)``, in the same space."""
    mask: np.ndarray
    """Shape ``(H, W)``, bool: eroded, if the rules say so."""
    factors: tuple[float, ...]
    """The prediction was multiplied by these for R, G, B, inside the mask, in linear light."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """The rules by which predicted and true pictures become comparable, in the order of the fields."""

    erosion: int = 1
    """Side of the square, in pixels, by which the mask is eroded; beyond the image counts as mask."""
    outside: Outside = "black"
    """Both pictures outside the mask. ``prediction on black`` keeps the prediction there, without factors,
    before a black truth; ``as it is`` keeps both."""
    predicted_as: Storage = "float"
    true_as: Storage = "float"
    exposure: Exposure = "1 is white"
    """``as bright as sRGB`` multiplies both by the mean of the sRGB of the true picture over its mean."""
    estimator: Estimator = "none"
    fitted_on: FittedOn = "no view"
    fitted_in: Space = "linear"
    """Space in which the factors are fitted; they are always applied in linear light."""
    limit: float | None = None
    """Both pictures are cut to [0, limit] once the factors are applied."""
    space: Space = "linear"

    def apply(self, views: JudgedViews, fitter: str) -> list[Aligned]:
        """Return the test views as they are compared.

        Args:
            views: The predicted and the true pictures.
            fitter: Name of the protocol, for messages.

        Raises:
            PredictionError: A prediction is not finite inside the mask, no factor can be fitted, or the view
                that it is fitted on cannot be used.
            DatasetError: A mask is too narrow to be eroded.
        """
        pictures = [self._read(view) for view in views.test]
        factors = self._fit(pictures, views, fitter)
        named = zip(views.test, pictures, factors, strict=True)
        return [self._aligned(view.name, picture, each) for view, picture, each in named]

    def shared_by(self, aligned: Sequence[Aligned]) -> tuple[float, ...] | None:
        """Return the factors of all views; None where each has its own, or none has any."""
        return None if self.fitted_on in ("no view", "each scored view") else aligned[0].factors

    def _read(self, view: JudgedView) -> Picture:
        mask = eroded(view.name, view.mask, self.erosion)
        predicted, true = (np.asarray(image, np.float64) for image in (view.predicted, view.true))
        check_finite(view.name, predicted, mask)
        predicted, true = self._filled(predicted, true, mask[..., None])
        predicted, true = STORED[self.predicted_as](predicted), STORED[self.true_as](true)
        factor = _brightening(true) if self.exposure == "as bright as sRGB" else 1.0
        return Picture(factor * predicted, factor * true, mask)

    def _filled(
        self, predicted: np.ndarray, true: np.ndarray, inside: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return both pictures with what the rules have outside the mask; what is not finite is black."""
        match self.outside:
            case "as it is":
                return np.where(np.isfinite(predicted), predicted, 0.0), true
            case "prediction on black":
                return np.where(np.isfinite(predicted), predicted, 0.0), np.where(inside, true, 0.0)
            case "black" | "white":
                fill = float(self.outside == "white")
                return np.where(inside, predicted, fill), np.where(inside, true, fill)

    def _fit(self, pictures: list[Picture], views: JudgedViews, fitter: str) -> list[np.ndarray]:
        """Return the factors of each test view."""
        match self.fitted_on:
            case "no view" | "each scored view":
                return [self._factors([picture]) for picture in pictures]
            case "the first training view":
                if views.validation is None:
                    raise PredictionError(
                        f"expected base_color on the first training view, where {fitter} fits its "
                        "factors, got none that can be used. Write this layer in every view"
                    )
                seen = [self._read(views.validation)]
            case "the first scored view":
                seen = pictures[:1]
            case "20 scored views":
                # With fewer than 20 views the published step is 0: it takes the first view 20 times.
                step = len(pictures) // RATIO_VIEWS
                seen = pictures[: RATIO_VIEWS * step : step] if step else pictures[:1]
            case "all scored views":
                seen = pictures
        return [self._factors(seen)] * len(pictures)

    def _factors(self, seen: Sequence[Picture]) -> np.ndarray:
        encode = ENCODED[self.fitted_in]
        predicted = np.concatenate([encode(picture.predicted[picture.mask]) for picture in seen])
        true = np.concatenate([encode(picture.true[picture.mask]) for picture in seen])
        return estimate(self.estimator, predicted, true)

    def _aligned(self, name: str, picture: Picture, factors: np.ndarray) -> Aligned:
        predicted, true, mask = picture
        predicted = np.where(mask[..., None], predicted * factors, predicted)
        if self.limit is not None:
            predicted, true = (np.clip(image, 0, self.limit) for image in (predicted, true))
        encode = ENCODED[self.space]
        return Aligned(name, encode(predicted), encode(true), mask, tuple(factors.tolist()))


def check_finite(name: str, predicted: np.ndarray, mask: np.ndarray) -> None:
    """Raise PredictionError unless a prediction is finite inside the mask.

    Args:
        name: Of the view, for the message.
        predicted: Shape ``(H, W)`` or ``(H, W, C)``.
        mask: Shape ``(H, W)``, bool.
    """
    bad = int((~np.isfinite(predicted[mask])).sum())
    if bad:
        raise PredictionError(
            f"{name}: expected finite values inside the mask, got {bad} that are not. Write this view again"
        )


def _brightening(true: np.ndarray) -> float:
    """Return the mean of the sRGB of a linear picture over its mean; 1 for a black one."""
    mean = float(np.clip(true, 0, 1).mean())
    return float(srgb_encode(true).mean()) / mean if mean > _DARK else 1.0


def eroded(name: str, mask: np.ndarray, side: int) -> np.ndarray:
    """Return a mask eroded by a square, shape ``(H, W)``, bool; beyond the image counts as mask.

    Args:
        name: Of the view, for the message.
        mask: Shape ``(H, W)``, bool.
        side: Of the square, in pixels; 1 leaves the mask as it is.

    Raises:
        DatasetError: Nothing is left.
    """
    from scipy.ndimage import binary_erosion

    left = mask if side == 1 else binary_erosion(mask, np.ones((side, side), bool), border_value=1)
    if not left.any():
        raise DatasetError(
            f"expected {name} to see something inside its mask eroded by {side} pixels, got nothing. "
            "Render the scene larger"
        )
    return left

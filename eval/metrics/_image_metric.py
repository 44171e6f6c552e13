# SPDX-License-Identifier: Apache-2.0
"""What a metric of images is made of: a layer, a space, a gauge, and a measure over judged pixels."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from graycard import srgb_encode
from graycard.records import Invariance, MetricRecord

Space = Callable[[np.ndarray, float], np.ndarray]
"""``(linear, exposure) -> values that are compared``."""
Measure = Callable[[np.ndarray, np.ndarray, np.ndarray], float]
"""``(predicted, true, mask) -> value of one view`` that is averaged over views."""

GLOBAL: tuple[Invariance, ...] = ("global gain",)
CHANNEL: tuple[Invariance, ...] = ("global gain", "channel gain")
ANY: tuple[Invariance, ...] = ("global gain", "channel gain", "sign")
IGNORED: dict[str, tuple[Invariance, ...]] = {"raw": (), "scalar": GLOBAL, "channel": CHANNEL}
"""What a gauge of each kind makes a metric blind to."""


def always() -> bool:
    """For what needs nothing but this package."""
    return True


@dataclass(frozen=True, slots=True)
class ImageMetric:
    """How one number is made from one layer of the test views."""

    record: MetricRecord
    layer: str
    """Ends in ``.<light>`` where there is one such image for each light."""
    space: Space
    measure: Measure
    finish: Callable[[float], float]
    """Applied to the mean over views."""
    gauge: str | None = None
    """Name of the gauge that is applied first (:func:`graycard.eval.scoring._training.fit_gauges`); None for
    a layer that has none."""
    noisy: bool = False
    """Whether the noise of the truth bounds it from above."""
    beside: tuple[str, Space] | None = None
    """Another space that the breakdown has the same number in, and its name."""
    brightness: float = 1.0
    """Factor on the exposure of the scene, for a layer that is not itself seen in photographs."""
    chart: bool = False
    """Whether only the colour chart is judged."""
    available: Callable[[], bool] = always
    """Whether it can be computed here; a sheet goes without what cannot."""


def display(radiance: np.ndarray, exposure: float) -> np.ndarray:
    """What a display shows of linear radiance, [0, 1]."""
    return srgb_encode(np.asarray(radiance, np.float64) * exposure)


def linear(values: np.ndarray, exposure: float) -> np.ndarray:
    """The values as they are."""
    return values


def exposed(radiance: np.ndarray, exposure: float) -> np.ndarray:
    """Linear, in the range of the display: a light in the picture would outweigh all else."""
    return np.clip(radiance * exposure, 0, 1)


def display_of_reflectance(values: np.ndarray, exposure: float) -> np.ndarray:
    """A reflectance has no exposure: 1 is white."""
    return srgb_encode(values)


def same(value: float) -> float:
    """Nothing is left to be done to the mean over views."""
    return value

# SPDX-License-Identifier: Apache-2.0
"""Facts about the camera that took the photographs: its bits, its noise and its exposures."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from graycard.io import Name

MOST_BITS = 16


@dataclass(frozen=True, slots=True)
class Sensor:
    """A camera that saturates at white, that is where radiance × exposure × the view's own factor is 1.

    A pixel collects ``Poisson(shot_noise × x)`` electrons at the share x of white, reads them with a normal
    error, and what lies outside [0, 1] of white is cut off. So a level x has the variance
    ``x / shot_noise + (read_noise / shot_noise)²``. Photographs are divided by their exposure again.

    Raises:
        ValueError: A number is out of its range.
    """

    bits: int = 0
    """Bits of the sRGB-encoded levels that were kept; 0 where linear ones were kept without rounding."""
    shot_noise: float = 0.0
    """Electrons at white; 0 where light was counted without noise."""
    read_noise: float = 0.0
    """Standard deviation, electrons."""
    exposures: Mapping[Name, float] = field(default_factory=dict)
    """Factor on the capture's exposure by name of a training view, as EXIF tells it; 1 where none is."""

    def __post_init__(self) -> None:
        if not 0 <= self.bits <= MOST_BITS:
            raise ValueError(f"expected bits from 0 to {MOST_BITS}, got {self.bits}")
        for name, value in (("shot_noise", self.shot_noise), ("read_noise", self.read_noise)):
            if not 0 <= value < math.inf:
                raise ValueError(f"expected {name} to be 0 or more, got {value}")
        if self.read_noise and not self.shot_noise:
            raise ValueError(
                f"expected shot_noise, the electrons at white, beside read_noise {self.read_noise}, got 0"
            )
        bad = {name: factor for name, factor in self.exposures.items() if not 0 < factor < math.inf}
        if bad:
            raise ValueError(f"expected finite exposures above 0, got {bad}")

    def exposure(self, view: str) -> float:
        """Return the factor of a view: white is at the radiance ``1 / (capture.exposure × factor)``."""
        return self.exposures.get(view, 1.0)

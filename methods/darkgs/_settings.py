# SPDX-License-Identifier: Apache-2.0
"""Settings of ``darkgs``."""

from dataclasses import dataclass
from typing import Literal

from graycard.methods.splat import FitBackend

Normals = Literal["own", "discs"]
Beam = Literal["told", "measured"]


@dataclass(frozen=True, slots=True)
class DarkGsSettings:
    """Settings of ``darkgs``; times are shares of ``iterations``, so that a budget of any size fits."""

    iterations: int = 2000
    surfels: int = 5000
    """No more than these."""
    fill: float = 0.75
    """Share of ``surfels`` that begin where stereo finds depth; 0: on the sparse points alone, as in the
    paper."""
    warm_up: float = 1 / 3
    """Until when the lamp goes from the middle of the lens to where the calibration has it."""
    beam: Beam = "told"
    """``told``: the lamp shines by the formula of its kind, which is the renderer's own; ``measured``: its
    beam and the fall with distance are fitted to noisy photographs of a white board, as in a laboratory
    (paper), and nothing is known of that formula. Its place and axis are told in both."""
    normals: Normals = "own"
    """``own``: each surfel has a normal for shading, which begins as that of its disc (paper); ``discs``:
    it is shaded by the normal of its disc, on which the losses of geometry bear."""
    cover_weight: float = 0.05
    """Weight of what shines through all surfels: photographs of rooms show surfaces everywhere. Not in the
    paper."""
    normal_weight: float = 0.01
    """Weight of the difference of the discs' normals and those of the drawn depth. Not in the paper, whose
    Gaussians are no discs."""
    distortion_weight: float = 1.0
    """Weight of the spread of surfels along rays. Not in the paper."""
    geometry_start: float = 0.1
    """Start of these two losses."""
    checkpoint: str = ""
    """File that the fit is saved to ten times and goes on from; none if empty."""
    backend: FitBackend = "cpu"
    """Device of the fit: ``cpu``, or ``cuda``, a GPU with gsplat's kernels (extra ``gpu``). Two fits
    differ by rounding there."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.iterations < 1 or self.surfels < 2:
            raise ValueError(
                f"expected 1 or more iterations and 2 or more surfels, got {self.iterations}, {self.surfels}"
            )
        shares = (self.fill, self.warm_up, self.geometry_start)
        if not all(0 <= share <= 1 for share in shares):
            raise ValueError(f"expected fill, warm_up and geometry_start in [0, 1], got {shares}")
        weights = (self.cover_weight, self.normal_weight, self.distortion_weight)
        if not all(weight >= 0 for weight in weights):
            raise ValueError(f"expected weights of 0 or more, got {weights}")

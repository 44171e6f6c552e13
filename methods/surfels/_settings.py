# SPDX-License-Identifier: Apache-2.0
"""Settings of ``2dgs`` and of what stands beside it."""

from dataclasses import dataclass
from math import inf

from graycard.methods.splat import FitBackend, coefficient_count


@dataclass(frozen=True, slots=True)
class SurfelSettings:
    """Settings of ``2dgs``; times are shares of ``iterations``, so that a budget of any size fits."""

    iterations: int = 1000
    surfels: int = 5000
    """No more than these."""
    fill: float = 0.75
    """Share of ``surfels`` that begin where stereo and large planes give depth; 0: on the sparse points
    alone, as in the paper, whose captures have many more views and points."""
    degree: int = 3
    """Degree of the spherical harmonics of each surfel's colour, 0 to 3."""
    sky_degree: int = 0
    """Degree of those of what is seen past all surfels, 0 to 3; nothing is lit by it."""
    ssim_share: float = 0.2
    """SSIM's share of the photometric loss, the rest is the mean absolute difference (Kerbl et al. 2023)."""
    cover_weight: float = 0.05
    """Weight of what shines through all surfels: photographs show surfaces nearly everywhere."""
    normal_weight: float = 0.1
    """Weight of the difference of drawn normals and those of the drawn depth (Huang et al. 2024: 0.05, and
    from 7/30 on; a short fit of few views wants it stronger and sooner)."""
    normal_start: float = 0.1
    distortion_weight: float = 100.0
    """Weight of the spread of surfels along rays (Huang et al. 2024, for scenes without bounds)."""
    distortion_start: float = 0.1
    checkpoint: str = ""
    """File that the fit is saved to ten times and goes on from; none if empty. With a slash at the end, a
    folder for many fits of one capture by one version of graycard: each goes on from what another has left
    there that depends on the same."""
    backend: FitBackend = "cpu"
    """Device of the fit: ``cpu``, or ``cuda``, a GPU with gsplat's kernels (extra ``gpu``). Two fits
    differ by rounding there."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.iterations < 1:
            raise ValueError(f"expected 1 or more iterations, got {self.iterations}")
        if self.surfels < 2:
            raise ValueError(f"expected 2 or more surfels, got {self.surfels}")
        if not 0 <= self.fill <= 1:
            raise ValueError(f"expected a share of surfels in [0, 1] to begin by stereo, got {self.fill}")
        coefficient_count(self.degree)
        coefficient_count(self.sky_degree)
        if not 0 <= self.ssim_share <= 1:
            raise ValueError(f"expected a share of SSIM in [0, 1], got {self.ssim_share}")
        weights = (self.normal_weight, self.distortion_weight, self.cover_weight)
        starts = (self.normal_start, self.distortion_start)
        if not (all(0 <= weight < inf for weight in weights) and all(start >= 0 for start in starts)):
            raise ValueError(
                f"expected finite weights, and starts, of 0 or more, got weights {weights} and starts "
                f"{starts}"
            )


@dataclass(frozen=True, slots=True)
class OracleSurfelSettings(SurfelSettings):
    """Settings of ``2dgs-oracle``, which begins on the true surfaces."""

    frozen: bool = False
    """True if the surfels stay where they begin: only colours are fitted."""

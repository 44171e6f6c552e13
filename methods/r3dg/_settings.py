# SPDX-License-Identifier: Apache-2.0
"""Settings of ``r3dg``."""

from dataclasses import dataclass

from graycard.methods.splat import FitBackend


@dataclass(frozen=True, slots=True)
class R3dgSettings:
    """Settings of ``r3dg``; times are shares of ``iterations``, so that a budget of any size fits.

    Weights are those of the paper's code for synthetic scenes (``run_syn4.sh``).
    """

    iterations: int = 1500
    """Steps of both stages (paper: 50 000)."""
    surfels: int = 5000
    """No more than these."""
    fill: float = 0.75
    """Share of ``surfels`` that begin where stereo finds depth, as in ``2dgs``."""
    geometry_share: float = 0.6
    """Share of the budget: the first stage, surfels with view-dependent colours (paper: 30 000 of 50 000)."""
    sky_size: int = 16
    """Texels along the side of a face of the environment's cubemap."""
    ssim_share: float = 0.2
    """SSIM's share of the photometric loss; all else is the mean absolute difference."""
    base_color_smooth_weight: float = 1.0
    """Weight of changes of base colour where the photograph does not change."""
    roughness_smooth_weight: float = 0.5
    """The same of roughness."""
    light_smooth_weight: float = 1.0
    """The same of the light that arrives."""
    white_weight: float = 0.01
    """Weight of the colour of the light that arrives: it should be grey."""
    sky_weight: float = 0.01
    """Weight of the mean absolute difference between neighbours in the cubemap."""
    backend: FitBackend = "cpu"
    """Device of the fit: ``cpu``, or ``cuda``, a GPU with gsplat's kernels (extra ``gpu``). Two fits
    differ by rounding there."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.iterations < 2 or self.surfels < 2 or self.sky_size < 1:
            raise ValueError(
                "expected 2 or more iterations and surfels and sky_size of 1 or more, "
                f"got {self.iterations}, {self.surfels} and {self.sky_size}"
            )
        if not 0 < self.geometry_share < 1 or not 0 <= self.fill <= 1 or not 0 <= self.ssim_share <= 1:
            raise ValueError(
                "expected geometry_share in (0, 1), fill and ssim_share in [0, 1], "
                f"got {self.geometry_share}, {self.fill} and {self.ssim_share}"
            )
        smooth = self.base_color_smooth_weight, self.roughness_smooth_weight, self.light_smooth_weight
        weights = (*smooth, self.white_weight, self.sky_weight)
        if not all(weight >= 0 for weight in weights):
            raise ValueError(f"expected weights of 0 or more, got {weights}")

    @property
    def geometry_steps(self) -> int:
        """Steps of the first stage."""
        return min(max(1, round(self.geometry_share * self.iterations)), self.iterations - 1)

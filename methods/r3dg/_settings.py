# SPDX-License-Identifier: Apache-2.0
"""Settings of ``r3dg``."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class R3dgSettings:
    """Settings of ``r3dg``; times are shares of ``iterations``, so that a budget of any size fits.

    Weights are those of the paper's code for mean absolute differences in the range of a display, as far as
    it has such a term; *inferred* says where it has another form.
    """

    iterations: int = 1500
    """Of both stages (paper: 50 000)."""
    surfels: int = 5000
    """No more than these."""
    fill: float = 0.75
    """Share of ``surfels`` that begin where stereo finds depth, as in ``2dgs``."""
    geometry_share: float = 0.6
    """Of the budget: the first stage, surfels with view-dependent colours (paper: 30 000 of 50 000)."""
    sky_size: int = 16
    """Texels along the side of a face of the environment's cubemap."""
    ssim_share: float = 0.2
    """Of the photometric loss; all else is the mean absolute difference."""
    smooth_weight: float = 0.01
    """Of changes of base colour and roughness where the photograph does not change (inferred)."""
    white_weight: float = 0.01
    """Of the colour of the incident light that each surfel has for itself: such light should be grey."""
    sky_weight: float = 0.01
    """Of the mean absolute difference between neighbours in the cubemap."""

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
        weights = (self.smooth_weight, self.white_weight, self.sky_weight)
        if not all(weight >= 0 for weight in weights):
            raise ValueError(f"expected weights of 0 or more, got {weights}")

    @property
    def geometry_steps(self) -> int:
        """Steps of the first stage."""
        return min(max(1, round(self.geometry_share * self.iterations)), self.iterations - 1)

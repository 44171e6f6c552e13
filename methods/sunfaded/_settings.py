# SPDX-License-Identifier: Apache-2.0
"""Settings of ``sunfaded``: where paper and code differ the paper's, but for schedule, space and SSIM."""

from dataclasses import dataclass
from typing import Literal

from graycard.methods.splat import FitBackend

Space = Literal["linear", "srgb"]
Weight = Literal["log_minmax", "linear_max", "none"]
LightMap = Literal["nearest", "bilinear"]
Schedule = Literal["short", "paper", "release_40k"]
GeometryPrior = Literal["albedo", "lit", "release", "none"]
Shading = Literal["image", "surfel"]


@dataclass(frozen=True, slots=True)
class SunFadedSettings:
    """Settings of ``sunfaded``; times are shares of ``iterations``, so that a budget of any size fits."""

    iterations: int = 2000
    surfels: int = 5000
    """No more than these."""
    fill: float = 0.75
    """Share of ``surfels`` that begin where stereo finds depth; 0: on the sparse points alone, as in the
    paper."""
    space: Space = "linear"
    """In which light multiplies albedo. ``srgb`` is the paper's: it works on pictures as they are displayed,
    where a product of light and albedo holds only roughly. Losses are in display space in both."""
    first_albedo: float = 0.4
    """Albedo of all surfels in all channels, to begin with. 0: the colours of the photographs, as in the
    released code; the paper says nothing. Those are lit, and where the lamp always shines they would stay."""
    weight: Weight = "log_minmax"
    """Weighting: how brightly lit a pixel is, for the first stage: ``log_minmax``, the blurred logarithm
    from 0 at the picture's darkest to 1 at its brightest place (paper; of the picture in ``space``, for a
    power, as the encoding of a display nearly is, drops out of it); ``linear_max``, the blurred picture,
    as displayed, over its largest value (released code); ``none``: all pixels count alike."""
    beta: float = 10.0
    """Falloff: how fast the weight of a pixel falls with it."""
    least_weight: float = 0.05
    """Share of a view's largest weight below which pixels are left out of the first stage. Paper and released
    code leave out none. But Adam divides a gradient by its size: surfels that only lit pixels show move as
    fast as those in the dark, however small the weight, and take light for paint."""
    blur: float = 0.1
    """Standard deviation of that blur, of the picture's width (inferred: the paper names none; the released
    code has 100 pixels of the photograph as it was taken)."""
    unlit_weight: float = 1.0
    """Weight of the loss of the first stage (released code: 5)."""
    light_map: LightMap = "bilinear"
    """The lamp is asked at the middle of each tile. ``bilinear``: pixels have what lies between the middles
    around them (released code); ``nearest``: all pixels of a tile have the light of its middle (paper)."""
    tile: float = 1 / 64
    """Side of a tile, of the picture's width: 16 pixels of 1024."""
    shading: Shading = "image"
    """``image``: shade what is drawn; ``surfel``: shade each surfel and draw that (an ablation)."""
    ambient: bool = True
    """True if there is light that does not move with the camera."""
    schedule: Schedule = "short"
    """``paper``: 25, 25, 25, 12.5 and 12.5 % for the five stages, of 40,000 steps there. ``short``: 1, 7,
    72, 10 and 10 %, for a budget of some thousands, in which surfels have to find their places while the lamp
    is known. ``release_40k``: as ``paper``, but the ambient light moves beside the lamp in the second
    stage, surfels are still added while opacities are fitted, and in the last stage everything moves at every
    other step, the lamp too."""
    geometry_prior: GeometryPrior = "albedo"
    """Depth and normals that a prior tells from the photographs, then, in the third stage, anew from the
    ``albedo`` (paper); or from the photographs in both (``lit``); or, of these, depth in the first stage
    alone and normals to the end (``release``: what the released code does); or not at all (``none``). A fit
    without a source of priors goes without them."""
    depth_weight: float = 0.001
    """Weight of 1 - Pearson's correlation of drawn depth and the prior's."""
    normal_weight: float = 0.01
    """Weight of normals that are not those of the depth: half of it for drawn ones, half for the prior's."""
    distortion_weight: float = 0.01
    """Weight of the spread of surfels along rays."""
    geometry_start: float = 0.075
    """Start: when normals and distortion begin to count."""
    cover_weight: float = 0.05
    """Weight of what shines through all surfels: photographs of rooms show surfaces everywhere. Not in the
    paper, whose captures have many more views."""
    albedo_weight: float = 0.0
    """Weight of the variance of albedo over the surfels, while it moves: of two explanations of a bright
    place the one with more light and less paint is taken. Not in the paper."""
    clearing: float = 0.5
    """Share of the depth that a camera sees before which no surfel stays: by stereo where it is sure (not
    asked with ``fill = 0``), else by a prior's depth, scaled by the sparse points, else by the nearest of
    these. 0: surfels may be anywhere. Not in the paper, whose captures have many more views."""
    ssim_share: float = 0.2
    """SSIM's share of the loss with light; the rest is the mean absolute difference. 0.2 as in the
    released code and in ``2dgs``; of the paper we know only that it compares pictures with the light on."""
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
        shares = (
            self.fill, self.first_albedo, self.least_weight, self.geometry_start, self.ssim_share,
            self.clearing,
        )  # fmt: skip
        if not all(0 <= share <= 1 for share in shares):
            raise ValueError(
                "expected fill, first_albedo, least_weight, geometry_start, ssim_share and clearing in "
                f"[0, 1], got {shares}"
            )
        if not (0 < self.tile <= 1 and 0 < self.blur <= 1):
            raise ValueError(f"expected tile and blur in (0, 1] of the width, got {self.tile}, {self.blur}")
        weights = (
            self.beta, self.unlit_weight, self.depth_weight, self.normal_weight,
            self.distortion_weight, self.cover_weight, self.albedo_weight,
        )  # fmt: skip
        if not all(weight >= 0 for weight in weights):
            raise ValueError(f"expected beta and weights of 0 or more, got {weights}")

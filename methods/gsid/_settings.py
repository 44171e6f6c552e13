# SPDX-License-Identifier: Apache-2.0
"""Settings of ``gsid``. The paper's code was never published: what it leaves open is marked *inferred*."""

from dataclasses import dataclass
from typing import Literal

from graycard.methods.splat import FitBackend

Visibility = Literal["traced", "vector", "vector_half", "vector_relu", "none"]
Shading = Literal["deferred", "forward"]
Materials = Literal["fitted", "prior"]


@dataclass(frozen=True, slots=True)
class GsidSettings:
    """Settings of ``gsid``; times are shares of ``iterations``, so that a budget of any size fits."""

    iterations: int = 1500
    """Steps of both stages (paper: 30 000)."""
    surfels: int = 5000
    """No more than these."""
    fill: float = 0.75
    """Share of ``surfels`` that begin where stereo finds depth (inferred; the paper begins as 3DGS does)."""
    geometry_share: float = 0.45
    """Share of the budget: the first stage, surfels with view-dependent colours (paper: 20 000 of 30 000;
    lights need more of a short budget, inferred)."""
    lamps: int = 8
    """Local lamps at most (paper: 33 in all tables)."""
    lobes: int = 2
    """Spherical Gaussians a lamp (inferred; the paper says "N_SG")."""
    sky_size: int = 8
    """Texels along the side of a face of the environment's cubemap (GS-IR: 256)."""
    visibility: Visibility = "vector"
    """Visibility: what is in the way of a lamp. Of a unit vector v a surfel, drawn, and the direction w to
    the lamp: ``vector``, ``1 - max(0, v . w)^8``; ``vector_half``, ``(1 + v . w) / 2``; ``vector_relu``,
    ``max(0, v . w)``; the paper has such a vector and does not say how it is read. ``traced``: rays from
    the surfels to the lamp (not the paper's): shadows of lamps that are a little wrong are wrong, and stay
    in the albedo. ``none``: nothing is in the way."""
    occlusion: bool = True
    """True if what is in the way of the surroundings is found by rays from the surfels; else nothing is."""
    shading: Shading = "deferred"
    """Light is found for pixels, as in the paper, or for surfels, which are then drawn (``forward``)."""
    materials: Materials = "fitted"
    """``prior``: they stay what the prior says, averaged over views, and only light is fitted (ablation); it
    has to know base colour, roughness and metallic."""
    bounces: bool = True
    """True if light that comes by way of other surfaces is found by rays between surfels, a few times on
    the way (inferred: the paper has none, and a room has)."""
    base_color_weight: float = 0.5
    """Weight of what differs from the prior's base colour, mean absolute (paper: lambda_A)."""
    roughness_weight: float = 0.1
    """Paper: lambda_R."""
    metallic_weight: float = 0.1
    """Paper: lambda_M."""
    normal_prior_weight: float = 0.1
    """Weight of 1 - cosine between drawn normals and the prior's in the first stage (inferred)."""
    normal_weight: float = 0.1
    """Weight of drawn normals that are not those of the drawn depth, as in ``2dgs``."""
    distortion_weight: float = 100.0
    """Weight of the spread of surfels along rays, as in ``2dgs``."""
    geometry_start: float = 0.1
    """Share of the first stage after which these begin to count."""
    cover_weight: float = 0.05
    """Weight of what shines through all surfels, as in ``2dgs``."""
    matte_weight: float = 0.0
    """Weight of 1 - roughness + metallic, averaged: without a prior shine needs a reason (GS-IR)."""
    smooth_weight: float = 0.0
    """Weight of squared differences of neighbouring pixels in base colour, roughness and metallic, less
    where the photograph differs too (GS-IR: 1)."""
    lamp_weight: float = 1e-3
    """Weight of the sum of the square roots of what each lamp gives to what is seen, mean irradiance: the
    fewer the better (inferred)."""
    sky_weight: float = 1e-2
    """Weight of the mean absolute difference between neighbours in the cubemap (GS-IR)."""
    ssim_share: float = 0.2
    """Share of SSIM in the photometric loss of both stages; the rest is the mean absolute difference."""
    material_start: float = 0.0
    """Share of the second stage after which materials begin to move; before, light alone does (inferred)."""
    tile: int = 112
    """Pixels, about, along the sides of what is shaded at a step of the second stage: views are cut into
    tiles, and in each round every tile of every view has its turn once (inferred; the paper shades whole
    views, on a GPU). A step costs the same for pictures of any size."""
    geometry_rate: float = 0.1
    """Factor on the first stage's learning rates: with it scales, rotations and opacities move in the second.
    Losses between surfels, and of normals, then go on. Positions stand still, as in the paper."""
    aggregate_every: float = 0.1
    """Share of the second stage after which lamps that do next to nothing are put where light is missing,
    and rays are traced anew (inferred). With 1 all lamps stay, whatever they give."""
    aggregate_until: float = 0.7
    """Share of the second stage after which no lamp is moved so, and dim ones are left out (inferred)."""
    least_share: float = 2e-2
    """Least share of the light of all lamps in the views that a lamp must give to stay (inferred)."""
    backend: FitBackend = "cpu"
    """Device of the first stage: ``cpu``, or ``cuda``, a GPU with gsplat's kernels (extra ``gpu``);
    there two fits differ by rounding. The second stage computes on the CPU."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.iterations < 2 or self.surfels < 2:
            raise ValueError(
                f"expected 2 or more iterations and surfels, got {self.iterations} and {self.surfels}"
            )
        if self.lamps < 0 or self.lobes < 1 or self.sky_size < 1:
            raise ValueError(
                "expected lamps of 0 or more, lobes and sky_size of 1 or more, "
                f"got {self.lamps}, {self.lobes} and {self.sky_size}"
            )
        if not 0 <= self.material_start < 1:
            raise ValueError(f"expected material_start in [0, 1), got {self.material_start}")
        if not (0 < self.geometry_share < 1 and 0 < self.aggregate_every <= 1):
            raise ValueError(
                "expected geometry_share in (0, 1) and aggregate_every in (0, 1], "
                f"got {self.geometry_share} and {self.aggregate_every}"
            )
        if self.tile < 11 or self.geometry_rate < 0:
            raise ValueError(
                "expected a tile of 11 or more pixels, as the windows of SSIM have, and geometry_rate of 0 "
                f"or more, got {self.tile} and {self.geometry_rate}"
            )
        shares = (self.fill, self.ssim_share, self.geometry_start, self.aggregate_until, self.least_share)
        if not all(0 <= share <= 1 for share in shares):
            raise ValueError(
                "expected fill, ssim_share, geometry_start, aggregate_until and least_share in [0, 1], "
                f"got {shares}"
            )
        weights = (
            self.base_color_weight, self.roughness_weight, self.metallic_weight, self.normal_prior_weight,
            self.normal_weight, self.distortion_weight, self.cover_weight, self.matte_weight,
            self.smooth_weight, self.lamp_weight, self.sky_weight,
        )  # fmt: skip
        if not all(weight >= 0 for weight in weights):
            raise ValueError(f"expected weights of 0 or more, got {weights}")

    @property
    def geometry_steps(self) -> int:
        """Steps of the first stage."""
        return min(max(1, round(self.geometry_share * self.iterations)), self.iterations - 1)


@dataclass(frozen=True, slots=True)
class GsirSettings(GsidSettings):
    """Settings of ``gsir``: by default no lamps, nothing bounces, and materials are even and matte unless
    photographs say otherwise. No prior is asked.
    """

    lamps: int = 0
    visibility: Visibility = "none"
    bounces: bool = False
    matte_weight: float = 1e-3
    smooth_weight: float = 1.0

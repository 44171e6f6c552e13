# SPDX-License-Identifier: Apache-2.0
"""Settings of ``goris``."""

from dataclasses import dataclass, fields, replace
from math import inf
from typing import Literal

from graycard.methods.goris._filter import Reading
from graycard.methods.removal import RemovalSettings

Filter = Literal[Reading, "none"]
Decay = Literal["exponential", "linear"]
Traced = Literal["rough", "all"]
LARGEST_SKY = 256
"""Texels along a side of the environment map, as in the paper."""

_LATER = (
    "grow", "least_inside", "second_share", "references", "reference_choice", "holes", "hole_weight",
    "effect_mask", "least_effect", "doubtful_go", "shadow", "material_inpainting", "hole_loss", "distilled",
    "removal_density",
)  # fmt: skip
_WEIGHTS = (
    "normal_prior_weight", "smooth_weight", "sky_weight", "region_weight", "label_weight", "weights",
    "residual_weight",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class GorisSettings(RemovalSettings):
    """Settings of ``goris``: those of ``removal``, and of light transport by glossy surfaces.

    ``least_inside`` is a threshold on the learnt label here, in place of one on shares of pictures. Where the
    paper and its released code differ in ``composite``, ``filter``, ``decay`` and ``traced`` either reading
    can be had; what else differs is in the docs. ``normal_start`` and ``distortion_start`` are shares of the
    radiance-only steps.
    """

    first_light: bool = True
    """True if f0, diffuse radiance and the environment map are initialised from the photographs; only
    where a prior tells glossy surfaces."""
    flat_start: bool = True
    """True if surfels of a flat glossy surface are initialised on the plane on which its outlines in the
    views agree, with one normal for a prior, and what faces other ways is not glossy; only where priors
    tell normals and glossy surfaces."""
    radiance_share: float = 0.4
    """Share of ``iterations`` for radiance-only steps, before those with light transport (paper: 4/30; a
    short fit needs surfaces first). 1 only without ``transport``."""
    matte_in_colours: bool = True
    """True if all steps are radiance only where a prior says that nothing is glossy; False, the paper:
    they are divided there as anywhere."""
    light_density: float = 0.0
    """Share of the steps with light transport over which surfels are densified and pruned, as in the
    radiance-only ones, which then leave an eighth of the surfels to them; 0: none (paper: 8 of 26 thousand,
    and no bound on surfels)."""
    removal_density: float = 0.0
    """The same of the removal's steps, from an eighth of them on and without pruning; 0: none (paper: from
    500 to 2,000 of 4,000)."""
    transport: bool = True
    """True if glossy surfaces reflect what traced rays meet; False: all surfaces are rough."""
    composite: Reading = "release"
    """``paper``: the diffuse term has spherical harmonics where a surfel is rough, and the specular term is
    added to it; ``release``: pixels are mixed of rough and reflective ones by the region. What the paper adds
    to rough surfaces is suppressed by the region alone."""
    filter: Filter = "paper"
    """Filter: how reflections in rough surfaces are blurred in screen space; ``none``: not at all."""
    tile: int = 112
    """Pixels, about, along the sides of what is drawn at a step with light transport: views are cut into
    tiles, and in each round every tile of every view has its turn once (inferred; the paper draws whole
    views, on a GPU). A step costs about the same for pictures of any size. Blurs and losses that look at
    neighbours end with the tile, as they end with a picture. LPIPS of holes looks at whole views."""
    decay: Decay = "exponential"
    """Decay of the weight of the prior's normals; ``linear`` in the released code."""
    decay_share: float = 0.2
    """Share of ``iterations``, over which that weight decays, from the first step with light transport on."""
    traced: Traced = "rough"
    """Surfels that reflected rays meet. ``rough``, the paper: a glossy surface reflects neither another
    nor itself, where it is not quite even; ``all``, the released code."""
    near: float = 0.02
    """Offset of reflected rays, in extents of the scene: they do not meet what is nearer to their origin
    (released code: 0.1 units)."""
    traced_degree: int = 1
    """Degree of the spherical harmonics that are evaluated along reflected rays, 0 to 3."""
    sky_size: int = 32
    """Texels along the side of a face of the environment map, which reflected rays see where they meet no
    surfel (paper: 256; photographs here are small)."""
    residual_degree: int = 0
    """Degree of spherical harmonics of glossy surfels, from 1 on, that are added to what they reflect and so
    take up what light transport gets wrong; 0: none, the paper. At most 3."""
    residual_weight: float = 0.1
    """Weight of the mean absolute radiance of that residual."""
    normal_prior_weight: float = 0.5
    """Weight of the difference from the prior's normals on glossy surfaces, before it decays."""
    least_normal_prior_weight: float = 1e-3
    smooth_weight: float = 0.5
    """Weight of the edge-aware smoothness of f0, roughness and normals on glossy surfaces, by differences of
    neighbours (paper: 0.05, by Sobel's, which are eight times as large)."""
    sky_weight: float = 1e-2
    """Weight of the total variation of the logarithm of the environment map (after GS-IR): texels that few
    reflected rays see are else fitted to noise."""
    region_weight: float = 1.0
    """Weight of the difference of rendered regions from those of the prior; 0: the prior is not asked for
    glossy surfaces, and all may be."""
    region_loss: Literal["both", "paper"] = "both"
    """Difference that counts. ``both``: what is rendered rough where the prior says glossy, and glossy
    where it says rough; ``paper``: the former alone, and in a short fit rough surfaces become glossy."""
    label_weight: float = 1.0
    """Weight of the cross entropy between rendered labels and the masks of the object."""
    weights: float = 1.0
    """Factor on ``normal_prior_weight`` and ``smooth_weight``, the regularisers of glossy surfaces."""
    effect_mask: bool = True
    """True if pixels that reflect the object are masked out of the photographs, too (the paper's
    lighting-aware mask)."""
    least_effect: float = 0.02
    """Threshold of that mask on the share of unit radiance that a pixel reflects by way of the object (paper:
    0.1, but wood and stone reflect 0.04 at normal incidence)."""
    doubtful_go: bool = True
    """True if glossy surfels that photographs show mostly within the widened masks of the object are
    removed with it; False, the paper: only what is labelled as the object."""
    shadow: bool = False
    """Remove the object's shadow, too, a step beyond the paper: surfels and photographs are
    brightened by the light that the object blocked before anything is inpainted."""
    material_inpainting: bool = True
    """True if holes in glossy surfaces are inpainted as materials; False: as radiance, as anywhere else."""
    hole_loss: Literal["photometric", "lpips"] = "photometric"
    """Loss of what is inpainted as radiance. ``lpips``, the paper's equation 8: 0.2 times LPIPS of pictures
    that are black elsewhere. As in the released code it is of VGG-16 and of the hole's bounding box, in which
    materials are then averaged, too; there ``hole_weight`` is 0.01, in the paper 1. It needs the weights of
    ``graycard weights lpips``, and of no other origin, so that a fit is the same everywhere."""
    distilled: bool = False
    """True if a radiance-only scene is fitted to pictures of the result, so that no ray has to be traced
    to draw it."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        RemovalSettings.__post_init__(self)
        self._check_additions()
        for name in ("decay_share", "least_effect"):
            if not 0 < getattr(self, name) < 1:
                raise ValueError(f"expected {name} in (0, 1), got {getattr(self, name)}")
        if not 0 < self.radiance_share <= 1:
            raise ValueError(f"expected radiance_share in (0, 1], got {self.radiance_share}")
        if self.transport and self.light_steps == 0:
            raise ValueError(
                "expected steps with light transport, got none: radiance_share is "
                f"{self.radiance_share} of {self.iterations} iterations. Lower it, or set transport to False"
            )
        if not (0 <= self.traced_degree <= min(3, self.degree)) or not 1 <= self.sky_size <= LARGEST_SKY:
            raise ValueError(
                f"expected traced_degree from 0 to that of the colours ({self.degree}), and sky_size from 1 "
                f"to {LARGEST_SKY}, got {self.traced_degree} and {self.sky_size}"
            )
        if self.tile < 11:
            raise ValueError(
                f"expected a tile of 11 or more pixels, as the windows of SSIM have, got {self.tile}"
            )
        if not 0 <= self.near < 1:
            raise ValueError(f"expected near in [0, 1), got {self.near}")
        if not self.least_normal_prior_weight > 0:
            raise ValueError(
                f"expected least_normal_prior_weight above 0, got {self.least_normal_prior_weight}"
            )
        weights = {name: getattr(self, name) for name in _WEIGHTS}
        if not all(0 <= weight < inf for weight in weights.values()):
            raise ValueError(f"expected finite weights of 0 or more, got {weights}")

    def _check_additions(self) -> None:
        if self.residual_degree not in range(4):
            raise ValueError(f"expected residual_degree from 0 to 3, got {self.residual_degree}")
        densities = self.light_density, self.removal_density
        if not all(0 <= share <= 1 for share in densities):
            raise ValueError(f"expected light_density and removal_density in [0, 1], got {densities}")

    @property
    def first(self) -> "GorisSettings":
        """The same first stage, with everything later as it is by default: what its checkpoints depend on."""
        later = {part.name: part.default for part in fields(self) if part.name in _LATER}
        return replace(self, **later)  # pyright: ignore[reportArgumentType]

    @property
    def radiance_steps(self) -> int:
        """Radiance-only steps."""
        return max(1, round(self.radiance_share * self.iterations))

    @property
    def light_steps(self) -> int:
        """Steps of the first stage with light transport."""
        return self.iterations - self.radiance_steps

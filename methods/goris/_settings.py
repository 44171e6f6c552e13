# SPDX-License-Identifier: Apache-2.0
"""Settings of ``goris``."""

from dataclasses import dataclass
from math import inf
from typing import Literal

from graycard.methods.goris._filter import Reading
from graycard.methods.removal import RemovalSettings

Filter = Literal[Reading, "none"]
Decay = Literal["exponential", "linear"]
Traced = Literal["rough", "all"]
LARGEST_SKY = 64
"""Texels along a side of the surroundings: they are filtered by matrices of all texels times those of small
levels, 0.6 GB here."""


_WEIGHTS = (
    "normal_prior_weight", "smooth_weight", "sky_weight", "region_weight", "label_weight", "weights",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class GorisSettings(RemovalSettings):
    """Settings of ``goris``: those of ``removal``, and of the light that glossy surfaces send on.

    ``least_inside`` is of the label that is learnt here, in place of shares of pictures. Where the paper and
    its released code differ in ``composite``, ``filter``, ``decay`` and ``traced`` either can be had; what
    else differs is in the docs. ``normal_start`` and ``distortion_start`` are shares of the steps in colours
    alone.
    """

    first_light: bool = True
    """Whether f0, diffuse radiance and surroundings begin as photographs allow; only where a prior tells
    glossy surfaces."""
    flat_start: bool = True
    """Whether surfels of a flat glossy surface begin on the plane on which views agree about its outline, and
    what faces other ways is not glossy; only where priors tell normals and glossy surfaces."""
    radiance_share: float = 0.4
    """Of ``iterations``, in which colours alone are fitted; then light is sent on too (paper: 4/30; a short
    fit needs surfaces first). 1 only without ``transport``."""
    matte_in_colours: bool = True
    """Whether all steps are in colours alone where a prior says that nothing is glossy; False, the paper:
    they are divided there as anywhere."""
    transport: bool = True
    """Whether glossy surfaces show what a mirrored ray meets; False: all surfaces are rough."""
    composite: Reading = "release"
    """``paper``: the diffuse term has harmonics where a surfel is rough, and the glossy one is added to it;
    ``release``: pixels are mixed of what is coloured and what reflects. What the paper adds to rough surfaces
    is drawn to nothing only by the region."""
    filter: Filter = "paper"
    """How mirror images of rough surfaces are blurred on the screen; ``none``: not at all."""
    decay: Decay = "exponential"
    """Of the weight of the prior's normals; ``linear`` in the released code."""
    decay_share: float = 0.2
    """Of ``iterations``, over which that weight decays when light is sent on."""
    traced: Traced = "rough"
    """Which surfels mirrored rays meet. ``rough``, the paper: a glossy surface neither mirrors another nor
    itself, where it is not quite even; ``all``, the released code."""
    near: float = 0.02
    """Shares of the extent: mirrored rays do not meet what is nearer to where they begin (released code: they
    begin 0.1 units away)."""
    traced_degree: int = 1
    """Of the harmonics that are followed along mirrored rays, 0 to 3: what a mirrored ray meets is seen in
    its own direction."""
    sky_size: int = 16
    """Texels along the side of a face of the surroundings, of which mirrored rays that meet nothing tell
    (paper: 256; photographs here are small)."""
    normal_prior_weight: float = 0.5
    """Of the difference from the prior's normals on glossy surfaces, until it decays."""
    least_normal_prior_weight: float = 1e-3
    smooth_weight: float = 0.5
    """Of the unevenness of Fresnel term, roughness and normals on glossy surfaces but for edges of the
    photograph, as differences of neighbours (paper: 0.05, of Sobel's, which are eight times as large)."""
    sky_weight: float = 1e-2
    """Of the mean absolute difference between neighbours in the logarithm of the surroundings (after GS-IR):
    texels that few mirrored rays meet are else as bright as noise has them."""
    region_weight: float = 1.0
    """Of the difference of drawn regions from those of the prior; 0: the prior is not asked for glossy
    surfaces, and all may be."""
    region_loss: Literal["both", "paper"] = "both"
    """What counts as such a difference. ``both``: what is drawn rough where the prior says glossy, and what
    is drawn glossy where it says rough; ``paper``: the former alone, and in a short fit what is rough becomes
    glossy."""
    label_weight: float = 1.0
    """Of the cross entropy between drawn labels and the masks of the object."""
    weights: float = 1.0
    """Factor on ``normal_prior_weight`` and ``smooth_weight``, the losses that hold glossy surfaces."""
    effect_mask: bool = True
    """Whether photographs are not believed either where they show the object by reflection."""
    least_effect: float = 0.02
    """A pixel shows the object by reflection if so much of what it returns of an even light comes by way of
    the object (paper: 0.1, but wood and stone reflect 0.04 at the front)."""
    doubtful_go: bool = True
    """Whether glossy surfels that photographs show mostly next to the object go with it; False, the paper:
    only what is the object's."""
    material_inpainting: bool = True
    """Whether holes in glossy surfaces are filled in as materials; False: in colours, as anywhere else."""
    distilled: bool = False
    """Whether colours that change with the view are fitted to what is left, so that no ray has to be traced
    any more."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        RemovalSettings.__post_init__(self)
        for name in ("decay_share", "least_effect"):
            if not 0 < getattr(self, name) < 1:
                raise ValueError(f"expected {name} in (0, 1), got {getattr(self, name)}")
        if not 0 < self.radiance_share <= 1:
            raise ValueError(f"expected radiance_share in (0, 1], got {self.radiance_share}")
        if self.transport and self.light_steps == 0:
            raise ValueError(
                "expected steps in which light is sent on, got none: radiance_share is "
                f"{self.radiance_share} of {self.iterations} iterations. Lower it, or set transport to False"
            )
        if not (0 <= self.traced_degree <= min(3, self.degree)) or not 1 <= self.sky_size <= LARGEST_SKY:
            raise ValueError(
                f"expected traced_degree from 0 to that of the colours ({self.degree}), and sky_size from 1 "
                f"to {LARGEST_SKY}, got {self.traced_degree} and {self.sky_size}"
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

    @property
    def radiance_steps(self) -> int:
        """Steps in which colours alone are fitted."""
        return max(1, round(self.radiance_share * self.iterations))

    @property
    def light_steps(self) -> int:
        """Steps of the first stage in which light is sent on."""
        return self.iterations - self.radiance_steps

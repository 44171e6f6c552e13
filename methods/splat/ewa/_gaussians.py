# SPDX-License-Identifier: Apache-2.0
"""3D Gaussians, the maps that drawing them gives, and the constants that back ends share.

The constants are those of gsplat 1.5 (``RasterizeToPixels3DGSFwd.cu``), which differ from those of surfels:
an alpha is cut at 0.999, and the Gaussian that would bring the transmittance to 1e-4 or below is not drawn.
The code of INRIA cuts alpha at 0.99.
"""

from dataclasses import dataclass
from typing import ClassVar

import torch

from graycard.methods.splat._maps import FeatureMaps
from graycard.methods.splat._surfels import Primitives

DILATION = 0.3
"""Squared pixels that are added to the variance of each picture, so that none falls between pixels."""
BEYOND_VIEW = 0.3
"""Half the field of view, times this, is how far outside of the image the projection still changes."""
ELLIPSOID_ALPHA_MAX = 0.999
ELLIPSOID_TRANSMITTANCE_MIN = 1e-4


@dataclass(frozen=True, eq=False)
class Gaussians(Primitives):
    """N Gaussian ellipsoids, as 3D Gaussian Splatting has them (Kerbl et al. 2023).

    ``scales`` has shape ``(N, 3)``. All tensors share one floating dtype and one device.

    Raises:
        ValueError: A shape, dtype, device or value is not as stated in :class:`Primitives`.
    """

    NAME: ClassVar[str] = "Gaussian"
    AXES: ClassVar[int] = 3


@dataclass(frozen=True)
class GaussianMaps(FeatureMaps):
    """The maps of :class:`FeatureMaps`, and depth of the centres, for an ellipsoid has no surface."""

    depth: torch.Tensor
    """Expected z-depth, sum of w z over sum of w, shape ``(H, W)``, metres; 0 where alpha is 0."""
    median_depth: torch.Tensor
    """z-depth of the last Gaussian before which the transmittance is above one half, shape ``(H, W)``,
    metres; 0 where alpha is 0."""

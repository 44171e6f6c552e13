# SPDX-License-Identifier: Apache-2.0
"""Results of rasterising, and the constants that every back end shares."""

from dataclasses import dataclass

import torch

ALPHA_MIN = 1 / 255
"""A surfel with less alpha at a pixel is not there: what bounds its footprint."""
ALPHA_MAX = 0.99
"""Nothing is quite opaque, so that what lies behind still has a gradient (Huang et al. 2024)."""
TRANSMITTANCE_MIN = 1.001e-4
"""Behind this little transmittance nothing is drawn. Two surfels of ``ALPHA_MAX`` leave 1e-4 but for their
rounding; this is a little more, so that they end the ray in any precision."""
NEAR = 0.01
"""Metres of z-depth: what is nearer, or behind the camera, is not drawn."""
NDC_NEAR, NDC_FAR = 0.2, 100.0
"""Metres: the planes between which distortion maps depth to [0, 1], as 2D Gaussian Splatting has them."""


@dataclass(frozen=True)
class FeatureMaps:
    """Images of surfels, in the dtype of the surfels; w is the share of a pixel that a surfel covers.

    No background is added and nothing is divided out but where stated: over a background B the image
    is ``features + (1 - alpha) * B``.
    """

    features: torch.Tensor
    """Sum of w times features, shape ``(H, W, C)``."""
    alpha: torch.Tensor
    """Sum of w, shape ``(H, W)``, in [0, 1)."""


@dataclass(frozen=True)
class Maps(FeatureMaps):
    """Maps that :class:`FeatureMaps` holds, and the geometry that was drawn."""

    depth: torch.Tensor
    """Expected z-depth, sum of w z over sum of w, shape ``(H, W)``, metres; 0 where alpha is 0."""
    median_depth: torch.Tensor
    """z-depth of the last surfel before which the transmittance is above one half, shape ``(H, W)``,
    metres; 0 where alpha is 0."""
    normal: torch.Tensor
    """Sum of w times the normal that faces the camera, shape ``(H, W, 3)``, world; not unit length."""
    distortion: torch.Tensor
    """Sum over pairs of w_i w_j (m_i - m_j)^2, each pair once, shape ``(H, W)``, m being depth mapped by
    :func:`ndc_depth`."""


def ndc_depth(z: torch.Tensor) -> torch.Tensor:
    """Depth in normalised device coordinates: 0 at ``NDC_NEAR``, 1 at ``NDC_FAR``, any shape, from metres."""
    return NDC_FAR / (NDC_FAR - NDC_NEAR) * (1 - NDC_NEAR / z)

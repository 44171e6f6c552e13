# SPDX-License-Identifier: Apache-2.0
"""The specification: every surfel against every pixel in plain PyTorch, gradients by autograd.

The equations are those of 2D Gaussian Splatting (Huang et al. 2024, section 4), written as geometry.
The memory is that of a few arrays of (surfels x pixels): for tests, not for fits.
"""

from dataclasses import dataclass

import torch

from graycard import Camera
from graycard.methods.splat._geometry import CameraSurfels, box_centres, see
from graycard.methods.splat._maps import (
    ALPHA_MAX,
    ALPHA_MIN,
    NEAR,
    TRANSMITTANCE_MIN,
    FeatureMaps,
    Maps,
    ndc_depth,
)
from graycard.methods.splat._surfels import Primitives, Surfels, check_finite


@dataclass(frozen=True)
class _Hits:
    """Surfels, nearest centre first, against pixels in row-major order."""

    alpha: torch.Tensor
    """Shape ``(N, P)``: 0, or from ALPHA_MIN to ALPHA_MAX."""
    depth: torch.Tensor
    """Shape ``(N, P)``, metres."""


def rasterize_reference(
    surfels: Surfels,
    camera: Camera,
    features: torch.Tensor | None = None,
    offsets: torch.Tensor | None = None,
) -> Maps:
    """Draw surfels in the order of their centres' depth, in the dtype of the surfels (float64 is meant).

    Args:
        surfels: N surfels.
        camera: The pinhole camera.
        features: shape ``(N, C)``, instead of the surfels' own.
        offsets: shape ``(N, 2)``, pixels: moves the picture of each surfel on the image.

    Returns:
        The maps, differentiable in every tensor of the surfels, in the features and in the offsets.

    Raises:
        ValueError: Features or offsets of another shape or dtype, or not finite.
    """
    features = checked_features(surfels, features)
    seen, hits, order = _look(surfels, camera, offsets)
    to_world = torch.tensor(camera.camera_to_world[:3, :3], dtype=features.dtype)
    maps = _composite(hits, features[order], seen.normals @ to_world.T)
    return Maps(**_as_images(maps, camera))


def rasterize_features_reference(
    surfels: Surfels,
    camera: Camera,
    features: torch.Tensor | None = None,
    offsets: torch.Tensor | None = None,
) -> FeatureMaps:
    """Return the features and alpha of :func:`rasterize_reference`; arguments and errors are as there."""
    features = checked_features(surfels, features)
    _seen, hits, order = _look(surfels, camera, offsets)
    _before, weight = _weights(hits)
    maps = {"features": weight.T @ features[order], "alpha": weight.sum(dim=0)}
    return FeatureMaps(**_as_images(maps, camera))


def checked_features(surfels: Primitives, features: torch.Tensor | None) -> torch.Tensor:
    """Return the features to draw, after a look at them.

    Raises:
        ValueError: They do not fit the surfels, or are not finite.
    """
    if features is None:
        return surfels.features
    _check("features", features, surfels, None)
    return features


def checked_offsets(surfels: Surfels, offsets: torch.Tensor | None) -> torch.Tensor | None:
    """Return the offsets, after a look at them.

    Raises:
        ValueError: They do not fit the surfels, or are not finite.
    """
    if offsets is not None:
        _check("offsets", offsets, surfels, 2)
    return offsets


def _check(name: str, values: object, surfels: Primitives, width: int | None) -> None:
    """Refuse what does not go with the surfels, a row each; any number of columns where ``width`` is None."""
    count, dtype = len(surfels), surfels.centres.dtype
    wanted = f"expected {name} of shape ({count}, {width or 'C'}) in {dtype}, got"
    if not isinstance(values, torch.Tensor):
        raise ValueError(f"{wanted} a {type(values).__name__}")
    shape = tuple(values.shape)
    if len(shape) != 2 or shape[0] != count or width not in (None, shape[1]) or values.dtype != dtype:
        raise ValueError(f"{wanted} {shape} in {values.dtype}")
    check_finite(name, values, surfels.NAME)


def _look(
    surfels: Surfels, camera: Camera, offsets: torch.Tensor | None
) -> tuple[CameraSurfels, _Hits, torch.Tensor]:
    """Return the surfels in drawing order, what they hit, and the order."""
    offsets = checked_offsets(surfels, offsets)
    offsets = torch.zeros_like(surfels.centres[:, :2]) if offsets is None else offsets
    seen = see(surfels, camera)
    order = _drawing_order(seen)
    seen = CameraSurfels(seen.centres[order], seen.axes[order], seen.normals[order], seen.scales[order])
    return seen, _intersect(seen, surfels.opacities[order], offsets[order], camera), order


def _as_images(maps: dict[str, torch.Tensor], camera: Camera) -> dict[str, torch.Tensor]:
    """Pixels from one axis to two."""
    sizes = (camera.height, camera.width)
    return {name: value.reshape(*sizes, *value.shape[1:]) for name, value in maps.items()}


def _drawing_order(seen: CameraSurfels) -> torch.Tensor:
    """Return indices of the surfels in front of the camera, nearest centre first, equals as they came."""
    z = seen.centres[:, 2]
    order = torch.argsort(z, stable=True)
    return order[z[order] > NEAR]


def _intersect(seen: CameraSurfels, opacities: torch.Tensor, offsets: torch.Tensor, camera: Camera) -> _Hits:
    """Alpha and depth of each surfel at each pixel.

    The pixel's ray meets the disc's plane at ``(u, v)`` standard deviations from its centre. The
    Gaussian of ``u^2 + v^2`` competes with a low-pass, a Gaussian of variance one half of a squared pixel
    around the centre of the projected disc's box: the larger one counts, with the centre's depth
    where it is the low-pass. Where the plane is met behind the near plane, or nowhere, the low-pass does.
    A picture that is moved is what a pixel that lies as far the other way sees.
    """
    pixels = pixel_centres(camera, seen.centres.dtype) - offsets[:, None]
    to_rays = torch.linalg.inv(torch.tensor(camera.K, dtype=pixels.dtype)).T
    rays = torch.nn.functional.pad(pixels, (0, 1), value=1.0) @ to_rays
    slope = torch.einsum("nk,npk->np", seen.normals, rays)
    height = (seen.normals * seen.centres).sum(dim=1, keepdim=True)
    met = (slope < 0) & (height <= NEAR * slope)
    z_met = height / torch.where(met, slope, -1.0)
    offset = z_met[..., None] * rays - seen.centres[:, None]
    uv = torch.einsum("nak,npk->npa", seen.axes, offset) / seen.scales[:, None]
    disc = torch.where(met, (uv**2).sum(dim=2), torch.inf)
    low_pass = 2 * ((pixels - box_centres(seen, camera)[:, None]) ** 2).sum(dim=2)
    exponent = 0.5 * torch.minimum(disc, low_pass)
    alpha = (opacities[:, None] * torch.exp(-exponent)).clamp(max=ALPHA_MAX)
    depth = torch.where(disc <= low_pass, z_met, seen.centres[:, 2:])
    return _Hits(torch.where(alpha >= ALPHA_MIN, alpha, 0.0), depth)


def _composite(hits: _Hits, features: torch.Tensor, normals: torch.Tensor) -> dict[str, torch.Tensor]:
    """Return the fields of :class:`Maps` with the pixels still in one axis."""
    before, weight = _weights(hits)
    alpha = weight.sum(dim=0)
    covered = torch.where(alpha > 0, alpha, 1.0)
    return {
        "features": weight.T @ features,
        "alpha": alpha,
        "depth": (weight * hits.depth).sum(dim=0) / covered,
        "median_depth": last_of_half(hits.depth, before, weight),
        "normal": weight.T @ normals,
        "distortion": _distortion(weight, hits.depth),
    }


def _weights(hits: _Hits) -> tuple[torch.Tensor, torch.Tensor]:
    """Transmittance before each surfel at each pixel, and the share of the pixel that it covers."""
    before = torch.cumprod(torch.nn.functional.pad(1 - hits.alpha, (0, 0, 1, 0), value=1.0), dim=0)[:-1]
    return before, torch.where(before > TRANSMITTANCE_MIN, before * hits.alpha, 0.0)


def last_of_half(depth: torch.Tensor, before: torch.Tensor, weight: torch.Tensor) -> torch.Tensor:
    """Depth of the last surfel of each pixel that is drawn while more than half of the light passes.

    Args:
        depth: shape ``(N, P)``, nearest surfel first.
        before: Transmittance before each surfel, in the same shape.
        weight: What each covers, in the same shape.
    """
    eligible = (weight > 0) & (before > 0.5)
    rank = torch.arange(1, len(weight) + 1)[:, None] * eligible
    last = torch.nn.functional.pad(rank, (0, 0, 1, 0)).argmax(dim=0)  # 0: none; else rank
    return torch.nn.functional.pad(depth, (0, 0, 1, 0)).gather(0, last[None])[0]


def _distortion(weight: torch.Tensor, depth: torch.Tensor) -> torch.Tensor:
    """Return the sum over pairs, as total weight times the weighted square deviation from the mean.

    Equal to ``sum w * sum w m^2 - (sum w m)^2``, which would lose digits where depths are close.
    """
    m = torch.where(weight > 0, ndc_depth(torch.where(weight > 0, depth, 1.0)), 0.0)
    total = weight.sum(dim=0)
    mean = (weight * m).sum(dim=0) / torch.where(total > 0, total, 1.0)
    return total * (weight * (m - mean) ** 2).sum(dim=0)


def pixel_centres(camera: Camera, dtype: torch.dtype) -> torch.Tensor:
    """Image coordinates ``(x, y)`` of shape ``(P, 2)``, row-major, at +0.5."""
    y, x = torch.meshgrid(torch.arange(camera.height), torch.arange(camera.width), indexing="ij")
    return torch.stack([x, y], dim=-1).reshape(-1, 2).to(dtype) + 0.5

# SPDX-License-Identifier: Apache-2.0
"""The GPU back end: gsplat's kernels for 2D Gaussian Splatting (Ye et al. 2024), held to the contract."""

from importlib.util import find_spec

import torch

from graycard import Camera, MethodError
from graycard.methods.splat._maps import ALPHA_MAX, FeatureMaps, Maps
from graycard.methods.splat._surfels import Surfels
from graycard.methods.splat.cuda._footprints import TILE, Footprints, Kernels, footprints
from graycard.methods.splat.cuda._maps import draw_pairs
from graycard.methods.splat.reference._rasterize import checked_features, checked_offsets

CHANNELS = (1, 2, 3, 4, 8, 16, 32)
"""Numbers of channels for which gsplat's kernels are compiled and fit into shared memory."""


def rasterize_cuda(
    surfels: Surfels,
    camera: Camera,
    features: torch.Tensor | None = None,
    offsets: torch.Tensor | None = None,
) -> Maps:
    """All maps, as the reference defines them: gsplat finds the pairs, PyTorch sums them up.

    Args:
        surfels: N surfels on a CUDA device.
        camera: The pinhole camera.
        features: shape ``(N, C)``, instead of the surfels' own.
        offsets: shape ``(N, 2)``, pixels, by which each surfel's picture is moved.

    Returns:
        The maps, in the dtype and on the device of the surfels. Sums on a GPU have no fixed order: runs
        differ by rounding.

    Raises:
        MethodError: There is no gsplat, or no GPU that it can use.
        ValueError: Features of another shape, or surfels elsewhere.
    """
    kernels = gsplat_kernels()
    _check_device(surfels)
    return draw_maps(kernels, surfels, camera, features, offsets)


def rasterize_features_cuda(
    surfels: Surfels,
    camera: Camera,
    features: torch.Tensor | None = None,
    offsets: torch.Tensor | None = None,
) -> FeatureMaps:
    """Features and alpha by gsplat's own kernel; arguments and errors as for :func:`rasterize_cuda`.

    It differs from the reference in four places:

    - an opacity above ``ALPHA_MAX`` is drawn as ``ALPHA_MAX`` over the whole disc, and keeps its gradient;
    - a pixel ends before the surfel that brings the transmittance to 1e-4, not after: less than 0.01 of it;
    - planes that are met behind the camera count, for discs that reach there;
    - discs that are seen edge-on lose digits, most of all in their gradients: gsplat takes float32 from the
      corner of the image.
    """
    kernels = gsplat_kernels()
    _check_device(surfels)
    return draw_features(kernels, surfels, camera, features, offsets)


def gsplat_kernels() -> Kernels:
    """Return the public functions of gsplat, compiled when first used on a machine.

    Raises:
        MethodError: gsplat is not installed, or there is no GPU, or gsplat finds no compiler for it.
    """
    if find_spec("gsplat") is None:
        raise MethodError(
            "expected gsplat for the back end 'cuda', found none: pip install 'graycard[gpu]', or take 'cpu'"
        )
    if not torch.cuda.is_available():
        raise MethodError(
            f"expected a CUDA device for the back end 'cuda', but PyTorch {torch.__version__} sees none: "
            "install a PyTorch that is built for the GPU of this machine, or take 'cpu'"
        )
    import gsplat
    from gsplat.cuda import _backend

    if _backend._C is None:
        raise MethodError(
            "expected gsplat to have its kernels, but it has none and found no CUDA toolkit to compile them: "
            "install the toolkit of PyTorch's CUDA version (nvcc) and set CUDA_HOME, or take 'cpu'"
        )
    return Kernels(
        gsplat.isect_tiles,
        gsplat.isect_offset_encode,
        gsplat.rasterize_to_pixels_2dgs,
        gsplat.rasterize_to_indices_in_range_2dgs,
    )


def draw_maps(
    kernels: Kernels,
    surfels: Surfels,
    camera: Camera,
    features: torch.Tensor | None = None,
    offsets: torch.Tensor | None = None,
) -> Maps:
    """:func:`rasterize_cuda` with kernels that are given, on the surfels' device."""
    features = checked_features(surfels, features)
    drawn = footprints(kernels, surfels, camera, _float64_offsets(surfels, offsets))
    maps = draw_pairs(kernels, drawn, camera, surfels.opacities[drawn.kept], features[drawn.kept])
    return Maps(**{name: value.to(features.dtype) for name, value in maps.items()})


def draw_features(
    kernels: Kernels,
    surfels: Surfels,
    camera: Camera,
    features: torch.Tensor | None = None,
    offsets: torch.Tensor | None = None,
) -> FeatureMaps:
    """:func:`rasterize_features_cuda` with kernels that are given, on the surfels' device."""
    features = checked_features(surfels, features)
    drawn = footprints(kernels, surfels, camera, _float64_offsets(surfels, offsets))
    opacities, features = _capped(surfels.opacities[drawn.kept]), features[drawn.kept]
    if len(drawn.kept) == 0:
        image = features.new_zeros(camera.height, camera.width, features.shape[1]) + features.sum()
        return FeatureMaps(image, image.new_zeros(camera.height, camera.width) + opacities.sum())
    images, alpha = [], features.new_zeros(camera.height, camera.width)
    for chunk in features.split(CHANNELS[-1], dim=1):
        image, alpha = _draw(kernels, drawn, camera, opacities, chunk)
        images.append(image)
    return FeatureMaps(torch.cat(images, dim=2).to(features.dtype), alpha.to(features.dtype))


def _draw(
    kernels: Kernels, drawn: Footprints, camera: Camera, opacities: torch.Tensor, features: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """One pass of gsplat's kernel, with at most 32 channels."""
    wanted = features.shape[1]
    padding = next(count for count in CHANNELS if count >= wanted) - wanted
    channels = torch.nn.functional.pad(features, (0, padding))  # gsplat would pad with what memory holds
    boxes = drawn.boxes[None].float()
    image, alpha, *_ = kernels.rasterize_to_pixels_2dgs(
        boxes,
        drawn.to_image[None].float(),
        channels[None].float(),
        opacities[None].float(),
        drawn.normals[None].float(),
        torch.zeros_like(boxes),  # takes gsplat's estimate of the gradient that offsets have exactly
        camera.width,
        camera.height,
        TILE,
        drawn.tile_starts,
        drawn.listed,
    )
    return image[0, :, :, :wanted], alpha[0, :, :, 0]


def _capped(opacities: torch.Tensor) -> torch.Tensor:
    """At most ALPHA_MAX, with the gradient of what was given: else opaque surfels could never fade."""
    over = (opacities.detach() - ALPHA_MAX).clamp(min=0)
    return opacities - over


def _float64_offsets(surfels: Surfels, offsets: torch.Tensor | None) -> torch.Tensor:
    offsets = checked_offsets(surfels, offsets)
    zeros = surfels.centres.new_zeros(len(surfels), 2, dtype=torch.float64)
    return zeros if offsets is None else offsets.double()


def _check_device(surfels: Surfels) -> None:
    if surfels.centres.device.type != "cuda":
        raise ValueError(f"expected surfels on a CUDA device, got them on {surfels.centres.device}")

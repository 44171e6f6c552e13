# SPDX-License-Identifier: Apache-2.0
"""3D Gaussians drawn by gsplat's own PyTorch code, on the CPU.

Projection (``_fully_fused_projection``), harmonics (``_spherical_harmonics``) and compositing
(``accumulate``) are functions of gsplat 1.5.3, ``gsplat/cuda/_torch_impl.py``. Its list of pairs comes from a
kernel for GPUs: here it is made by that kernel's rules, ``RasterizeToPixels3DGSFwd.cu``. Alpha is 1/255 or
more, the nearest come first, and the Gaussian that would bring the transmittance to
1e-4 or below ends a pixel and is left out.
"""

import torch

from graycard import Camera
from graycard.benchmarks.speed._gsplat import nerfacc_on_cpu
from graycard.methods.splat import Gaussians


def drawn_by_gsplat(
    gaussians: Gaussians, camera: Camera, antialiased: bool = False
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return features ``(H, W, C)``, alpha ``(H, W)`` and expected depth ``(H, W)``, 0 where nothing is."""
    from gsplat.cuda._torch_impl import _fully_fused_projection, _quat_scale_to_covar_preci, accumulate

    covariances, _ = _quat_scale_to_covar_preci(gaussians.rotations, gaussians.scales, True, False)
    assert covariances is not None
    view, K = (gaussians.centres.new_tensor(value)[None] for value in (camera.world_to_camera, camera.K))
    size = camera.width, camera.height
    radii, means, depths, conics, thinning = _fully_fused_projection(
        gaussians.centres, covariances, view, K, *size, calc_compensations=antialiased
    )
    opacities = gaussians.opacities[None] * (1 if thinning is None else thinning)
    which, pixels = _pairs(radii[0], means[0], depths[0], conics[0], opacities[0], size)
    features = torch.cat([gaussians.features, depths[0][:, None]], dim=1)
    with nerfacc_on_cpu():
        image, alpha = accumulate(
            means, conics, opacities, features[None], which, pixels, torch.zeros_like(pixels), *size
        )
    alpha = alpha[0, :, :, 0]
    return image[0, :, :, :-1], alpha, image[0, :, :, -1] / alpha.clamp(min=1e-10)


@torch.no_grad()
def _pairs(
    radii: torch.Tensor,
    means: torch.Tensor,
    depths: torch.Tensor,
    conics: torch.Tensor,
    opacities: torch.Tensor,
    size: tuple[int, int],
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return pairs of Gaussian and pixel: pixel after pixel, nearest first."""
    order = torch.argsort(depths, stable=True)
    order = order[(radii[order] > 0).all(dim=1)]
    y, x = torch.meshgrid(torch.arange(size[1]), torch.arange(size[0]), indexing="ij")
    centres = torch.stack([x, y], dim=-1).reshape(-1, 1, 2) + 0.5
    dx, dy = (centres - means[order]).unbind(dim=-1)
    a, b, c = conics[order].unbind(dim=1)
    sigma = 0.5 * (a * dx**2 + c * dy**2) + b * dx * dy
    alpha = (opacities[order] * torch.exp(-sigma)).clamp(max=0.999)
    alpha = torch.where((sigma >= 0) & (alpha >= 1 / 255), alpha, 0.0)
    after = torch.cumprod(1 - alpha, dim=1)
    pixels, places = ((alpha > 0) & (after > 1e-4)).nonzero(as_tuple=True)
    return order[places], pixels


def colours_by_gsplat(
    coefficients: torch.Tensor, centres: torch.Tensor, camera: Camera, degree: int
) -> torch.Tensor:
    """Return the colours that gsplat's ``_rasterization`` gives Gaussians, shape ``(N, 3)``."""
    from gsplat.cuda._torch_impl import _spherical_harmonics

    directions = centres - centres.new_tensor(camera.position)
    return (_spherical_harmonics(degree, directions, coefficients) + 0.5).clamp(min=0)

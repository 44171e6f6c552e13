# SPDX-License-Identifier: Apache-2.0
"""Tell whether the GPU back end can run; importing this costs nothing but PyTorch."""

from graycard.methods.splat.cuda._rasterize import gsplat_kernels as gsplat_kernels

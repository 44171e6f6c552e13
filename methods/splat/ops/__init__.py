# SPDX-License-Identifier: Apache-2.0
"""Differentiable operations on images and colours: SSIM, normals from depth, spherical harmonics."""

# SPDX-License-Identifier: Apache-2.0
"""Ellipsoids, as 3D Gaussian Splatting draws them: their footprint, and when a pixel ends."""

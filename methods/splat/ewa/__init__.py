# SPDX-License-Identifier: Apache-2.0
"""Ellipsoids, as 3D Gaussian Splatting draws them: their own footprint on the image, and when a pixel ends."""

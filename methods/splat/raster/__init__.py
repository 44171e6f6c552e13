# SPDX-License-Identifier: Apache-2.0
"""The rasteriser on the CPU: projection, tiles, and the forward and backward kernels."""

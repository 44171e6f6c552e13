# SPDX-License-Identifier: Apache-2.0
"""The ray tracer on the CPU: a bounding volume hierarchy and its kernels."""

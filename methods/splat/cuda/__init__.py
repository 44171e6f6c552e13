# SPDX-License-Identifier: Apache-2.0
"""The GPU back end, on gsplat's kernels."""

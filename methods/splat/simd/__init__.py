# SPDX-License-Identifier: Apache-2.0
"""A vector of sixteen float32 for Numba, and what is built from it."""

# SPDX-License-Identifier: Apache-2.0
"""Measures: images in, a number out."""

# SPDX-License-Identifier: Apache-2.0
"""COLMAP's sparse models, text and binary: cameras, images and points."""

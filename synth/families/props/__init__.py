# SPDX-License-Identifier: Apache-2.0
"""Shapes and textures that the scene families share."""

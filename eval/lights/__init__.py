# SPDX-License-Identifier: Apache-2.0
"""Predicted lights and environments: matching, errors, spheres lit by them."""

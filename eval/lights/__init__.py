# SPDX-License-Identifier: Apache-2.0
"""Scores of predicted lights and environments."""

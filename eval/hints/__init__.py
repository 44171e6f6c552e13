# SPDX-License-Identifier: Apache-2.0
"""Hints: mistaken conventions that a prediction looks like."""

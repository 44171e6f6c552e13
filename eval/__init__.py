# SPDX-License-Identifier: Apache-2.0
"""Predictions against truth: metrics, gauges, scores."""

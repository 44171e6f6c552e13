# SPDX-License-Identifier: Apache-2.0
"""Metrics: which layer is measured, in which space, with which gauge."""

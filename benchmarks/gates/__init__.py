# SPDX-License-Identifier: Apache-2.0
"""The gate: a run against a baseline, its summary for people and for CI, and its history over commits."""

# SPDX-License-Identifier: Apache-2.0
"""Verbs that run a suite, on this machine or on many, and plan larger ones."""

# SPDX-License-Identifier: Apache-2.0
"""Kinds of metric: each way of computing a score, behind one interface."""

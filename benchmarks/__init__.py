# SPDX-License-Identifier: Apache-2.0
"""Suites, the runner, the gate."""

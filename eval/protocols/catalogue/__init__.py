# SPDX-License-Identifier: Apache-2.0
"""Protocols of published code, each as data with its source."""

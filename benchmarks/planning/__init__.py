# SPDX-License-Identifier: Apache-2.0
"""The plan of a run: its fits with their addresses, and parts of it for job arrays."""

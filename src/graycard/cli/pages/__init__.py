# SPDX-License-Identifier: Apache-2.0
"""The verbs that make pages, summaries and figures of runs."""

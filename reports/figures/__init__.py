# SPDX-License-Identifier: Apache-2.0
"""Figures for papers: photograph, truth and rows side by side, with errors and scores, as SVG or PDF."""

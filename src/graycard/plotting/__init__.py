# SPDX-License-Identifier: Apache-2.0
"""Plots and figures as SVG and PDF, drawn by matplotlib, which is optional."""

from graycard.plotting._figure import COLOURS as COLOURS
from graycard.plotting._figure import check_plotting as check_plotting
from graycard.plotting._figure import new_figure as new_figure
from graycard.plotting._figure import pdf_of as pdf_of
from graycard.plotting._figure import svg_of as svg_of

# SPDX-License-Identifier: Apache-2.0
"""From a run to a figure in a file."""

from pathlib import Path

from graycard import GraycardError
from graycard.io import write_bytes
from graycard.plotting import check_plotting, pdf_of, svg_of
from graycard.reports.figures._content import FigureContent, FigureSpec, figure_content
from graycard.reports.figures._draw import drawn

WIDTH_MM = 180.0
"""Both columns of a page of most journals."""


def write_figure(run: Path, spec: FigureSpec, out: Path, width_mm: float = WIDTH_MM) -> FigureContent:
    """Write a figure of one view of a run as SVG or PDF: words are text, pictures keep each pixel.

    All light is shown at the exposure of the scene. Errors of one layer share a scale, and so do numbers.

    Args:
        run: The run folder, with its scenes and predictions.
        spec: What is shown.
        out: A file that ends in .svg or .pdf.
        width_mm: Width of the figure.

    Returns:
        What was drawn.

    Raises:
        GraycardError: matplotlib is not installed, or the name or the width is not one of those.
        UnknownNameError: The run has no such scene, row, view or layer.
        RecordError: No rows or no layers are named, or the run is damaged.
        DatasetError: The folder of the scene is gone or damaged.
        OutputError: The file cannot be written.
    """
    form = Path(out).suffix.lower()
    if form not in (".svg", ".pdf"):
        raise GraycardError(f"expected a figure with a name that ends in .svg or .pdf, got {out}. Rename it")
    if not 30 <= width_mm <= 1000:
        raise GraycardError(f"expected a width of 30 to 1000 mm, got {width_mm:g}")
    check_plotting()
    content = figure_content(Path(run), spec)
    with drawn(content, width_mm) as figure:
        data = svg_of(figure).encode() if form == ".svg" else pdf_of(figure)
    write_bytes(Path(out), data)
    return content

# SPDX-License-Identifier: Apache-2.0
"""Figures of matplotlib in one style, as SVG text and as PDF."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from io import BytesIO, StringIO
from typing import TYPE_CHECKING, Any, Literal

from graycard._errors import GraycardError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = ("#4477aa", "#66ccee", "#228833", "#ccbb44", "#ee6677", "#aa3377", "#bbbbbb")
"""Paul Tol's bright scheme, which the colour-blind can tell apart."""
_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none", "svg.hashsalt": "graycard", "pdf.fonttype": 42, "font.size": 8
}  # fmt: skip
"""Text stays text, fonts of a PDF are TrueType as journals ask, and equal runs give equal pictures."""


def check_plotting() -> None:
    """Refuse to plot without matplotlib.

    Raises:
        GraycardError: It is not installed.
    """
    if find_spec("matplotlib") is None:
        raise GraycardError(
            "expected matplotlib for a picture, got none. Run `pip install 'graycard[figures]'`"
        )


@contextmanager
def new_figure(
    width: float, height: float, layout: Literal["constrained"] | None = "constrained"
) -> Iterator["Figure"]:
    """Hand out an empty figure in the style of all pictures; draw and write it in the block.

    Args:
        width: Inches.
        height: Inches.
        layout: ``constrained`` places axes so that no text is cut off; with None the caller places them.

    Raises:
        GraycardError: matplotlib is not installed.
    """
    check_plotting()
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(_STYLE):
        yield Figure(figsize=(width, height), layout=layout)


def svg_of(figure: "Figure") -> str:
    """Return a figure as SVG text without a date."""
    drawn = StringIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None})
    return drawn.getvalue()


def pdf_of(figure: "Figure") -> bytes:
    """Return a figure as PDF without a date."""
    drawn = BytesIO()
    figure.savefig(drawn, format="pdf", metadata={"CreationDate": None})
    return drawn.getvalue()

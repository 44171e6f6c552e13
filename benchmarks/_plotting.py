# SPDX-License-Identifier: Apache-2.0
"""Pictures of measurements as SVG text, drawn by matplotlib, which is optional."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from io import StringIO
from typing import TYPE_CHECKING, Any

from graycard import GraycardError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = ("#4477aa", "#66ccee", "#228833", "#ccbb44", "#ee6677", "#aa3377", "#bbbbbb")
"""Paul Tol's bright scheme, which the colour-blind can tell apart."""
_STYLE: dict[Any, Any] = {"svg.fonttype": "none", "svg.hashsalt": "graycard", "font.size": 8}
"""Text stays text, and equal runs give equal pictures."""


def check_plotting() -> None:
    """Refuse to plot without matplotlib.

    Raises:
        GraycardError: It is not installed.
    """
    if find_spec("matplotlib") is None:
        raise GraycardError("expected matplotlib for a picture, got none. Run `pip install matplotlib`")


@contextmanager
def new_figure(width: float, height: float) -> Iterator["Figure"]:
    """Hand out an empty figure in the style of all pictures, inches; draw and write it in the block.

    Raises:
        GraycardError: matplotlib is not installed.
    """
    check_plotting()
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(_STYLE):
        yield Figure(figsize=(width, height), layout="constrained")


def svg_of(figure: "Figure") -> str:
    """Return a figure as SVG text without a date."""
    drawn = StringIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None})
    return drawn.getvalue()

# SPDX-License-Identifier: Apache-2.0
"""The verb that draws a figure of a run for a paper."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from graycard.cli._options import optional
from graycard.cli._terminal import OK, Terminal


@dataclass(frozen=True)
class FigureCommand:
    """Draw the truth and rows of a run side by side, with errors and scores, as SVG or PDF for a paper."""

    run_folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The run folder, with its scenes and predictions; a published one has no pictures."""
    scene: Annotated[str, tyro.conf.arg(metavar="SCENE")]
    """A scene of the run, or TRACK/SCENE."""
    rows: Annotated[tuple[str, ...], tyro.conf.arg(metavar="ROW ...")]
    """Rows of the run, a column each, in this order."""
    out: Annotated[Path, tyro.conf.arg(metavar="FILE")]
    """Write to this file, which ends in .svg or .pdf."""
    layers: Annotated[tuple[str, ...], tyro.conf.arg(metavar="LAYER ...")] = ("radiance",)
    """Layers that are shown, from the top down, as radiance base_color normal depth."""
    view: Annotated[str, optional("VIEW")] = ""
    """The view; the first held-out one by default. A training view has its photograph beside the truth."""
    errors: bool = True
    """Draw maps of errors below the pictures of each layer."""
    width: Annotated[float, tyro.conf.arg(metavar="MM")] = 180.0
    """Width of the figure, millimetres."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Draw, and say what a caption has to say."""
        from graycard.reports import FigureSpec, write_figure

        spec = FigureSpec(self.scene, self.rows, self.layers, self.view, self.errors)
        content = write_figure(self.run_folder, spec, self.out, self.width)
        for note in content.notes:
            terminal.out.print(note)
        terminal.out.print(f"figure: {self.out.resolve()}, view {content.view}")
        return OK

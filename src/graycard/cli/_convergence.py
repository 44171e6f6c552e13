# SPDX-License-Identifier: Apache-2.0
"""The verb that shows whether methods have converged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.table import Table

from graycard._errors import GraycardError
from graycard.cli._options import Json, optional
from graycard.cli._terminal import OK, Terminal, new_table, write_optional_json
from graycard.io import write_bytes
from graycard.records import MetricRecord, read_run

if TYPE_CHECKING:
    from graycard.benchmarks.convergence import Curve, Gain


@dataclass(frozen=True)
class ConvergenceCommand:
    """Show scores over steps and surfels, and from which budget on a doubling gains next to nothing."""

    run_folder: Annotated[Path, tyro.conf.Positional]
    """The run folder: of `graycard bench convergence-dark`, or of any suite whose rows differ in a budget
    alone."""
    json: Json = None
    """Also write the curves to this file."""
    plot: Annotated[Path | None, optional("FILE.svg")] = None
    """Also draw them."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Show a table for each curve.

        Raises:
            GraycardError: The run has no curve, or a picture cannot be drawn.
        """
        from graycard.benchmarks.convergence import convergence_plot, curves_of
        from graycard.plotting import check_plotting

        if self.plot is not None:
            check_plotting()
            if self.plot.suffix.lower() != ".svg":
                raise GraycardError(
                    f"expected --plot with a name that ends in .svg, got {self.plot}. Rename it"
                )
        record = read_run(self.run_folder)
        curves, metrics = curves_of(record), {metric.id: metric for metric in record.metrics}
        for curve in curves:
            terminal.out.print(_title(curve))
            terminal.out.print(_table(curve, metrics))
        write_optional_json(self.json, curves)
        if self.plot is not None:
            write_bytes(self.plot, convergence_plot(curves, record.metrics).encode())
        for curve in curves:
            terminal.out.print(f"convergence: {curve.track} {curve.method}: {_conclusion(curve)}")
        return OK


def _title(curve: Curve) -> str:
    fixed = "".join(f", {value} {name}" for name, value in curve.fixed.items())
    scenes = max(len(found) for point in curve.points for found in point.scores.values())
    return f"{curve.track}: {curve.method} over {curve.axis}{fixed}; mean of {scenes} scenes"


def _table(curve: Curve, metrics: Mapping[str, MetricRecord]) -> Table:
    """Return a row for each budget: means over scenes, and after each that converges its gain a doubling."""
    from graycard.benchmarks.convergence import ENOUGH, WATCHED

    shown = [m for m in WATCHED if any(point.mean(m) is not None for point in curve.points)]
    heads = [head for m in shown for head in ((m, "gain a doubling") if m in ENOUGH else (m,))]
    table = new_table(curve.axis, *heads, "fit s")
    for point in curve.points:
        cells = []
        for name in shown:
            mean, metric = point.mean(name), metrics.get(name)
            unit = f" {metric.unit}" if metric and metric.unit not in ("", "1") else ""
            cells.append("" if mean is None else f"{mean:.4g}{unit}")
            if name in ENOUGH:
                gain = next((g for g in curve.gains(name) if g.end == point.budget), None)
                cells.append("" if gain is None else _signed(gain))
        table.add_row(str(point.budget), *cells, f"{point.wall_s:.0f}")
    return table


def _signed(gain: Gain) -> str:
    error = f" ± {gain.error:.2f}" if gain.scenes > 1 else ""
    return f"{gain.mean:+.2f}{error}"


def _conclusion(curve: Curve) -> str:
    """Say where a curve has converged, or with which slope it has not."""
    from graycard.benchmarks.convergence import ENOUGH

    if (budget := curve.converged_at) is not None:
        return f"converged from {budget} {curve.axis} on"
    slopes = [f"{_signed(gain)} dB in {name}" for name in ENOUGH if (gain := curve.slope(name)) is not None]
    last = curve.points[-1].budget
    return f"not converged at {last} {curve.axis}; the last doubling gains {', '.join(slopes)}"

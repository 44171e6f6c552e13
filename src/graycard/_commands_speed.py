# SPDX-License-Identifier: Apache-2.0
"""The verb that measures what the machinery costs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from graycard._errors import GraycardError
from graycard._files import write_bytes
from graycard._screen import OK, Json, Screen, new_table, write_optional_json

Parts = tuple[Literal["stages", "scaling", "peers", "losses"], ...]


@dataclass(frozen=True)
class Speed:
    """Measure what the machinery costs, beside a peer in the same run."""

    what: Annotated[Literal["truth", "engine"], tyro.conf.Positional]
    """truth: light split by source and lobe, beside Mitsuba's path tracer. engine: surfels, stage by stage,
    beside the machine's peak and other implementations."""
    repeats: int = 5
    """How often each is timed; medians count."""
    parts: Parts = ()
    """engine: measure these only."""
    workloads: tuple[str, ...] = ()
    """engine: stages and peers on these workloads only (A to E)."""
    quick: bool = False
    """engine: everything once, on next to nothing, to see that it works."""
    json: Json = None
    """Also write the figures to this file."""
    plot: Annotated[Path | None, tyro.conf.arg(metavar="FILE.svg")] = None
    """engine: also draw them."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """Time one or the other."""
        return self._engine(screen) if self.what == "engine" else self._truth(screen)

    def _truth(self, screen: Screen) -> int:
        from graycard.benchmarks.speed import measure_truth

        if self.plot or self.parts or self.workloads or self.quick:
            raise GraycardError(
                "expected --repeats and --json only with `graycard speed truth`, got an option of "
                "`graycard speed engine`. Leave it out"
            )
        with screen.progress() as progress:
            costs = measure_truth(repeats=self.repeats, progress=progress)
        table = new_table("track", "family", "lights", "path s", "separated s", "ratio", "CPU ratio")
        for c in costs:
            figures = f"{c.path_s:.3f}", f"{c.separated_s:.3f}", f"{c.ratio:.2f}", f"{c.cpu_ratio:.2f}"
            table.add_row(c.track, c.family, str(c.lights), *figures)
        screen.out.print(table)
        write_optional_json(self.json, costs)
        worst = max(costs, key=lambda cost: cost.ratio)
        screen.out.print(
            f"speed: the separated truth takes at most {worst.ratio:.2f} times as long as a plain picture "
            f"({worst.family}; in processor time {worst.cpu_ratio:.2f})"
        )
        return OK

    def _engine(self, screen: Screen) -> int:
        from graycard.benchmarks.speed import disturbed_note, engine_plot, engine_tables, measure_engine

        if self.plot is not None and self.plot.suffix.lower() != ".svg":
            raise GraycardError(f"expected --plot with a name that ends in .svg, got {self.plot}. Rename it")
        with screen.progress() as progress:
            speed = measure_engine(self._plan(), progress)
        for table in engine_tables(speed):
            screen.out.print(table.title)
            shown = new_table(*table.heads)
            for row in table.rows:
                shown.add_row(*row)
            screen.out.print(shown)
        for line in speed.left_out:
            screen.out.print(f"left out: {line}")
        screen.advise(disturbed_note(speed))
        write_optional_json(self.json, speed)
        if self.plot is not None:
            write_bytes(self.plot, engine_plot(speed).encode())
        peak = speed.peaks[-1]
        screen.out.print(
            f"speed: {len(speed.engine)} workloads, {len(speed.peers)} peers; the machine's peak is "
            f"{peak.gflops:.0f} GFLOP/s with {peak.threads} threads"
        )
        return OK

    def _plan(self) -> Any:
        """What is to be measured.

        Raises:
            UnknownNameError: There is no such workload.
        """
        from graycard.benchmarks.speed import speed_plan

        return speed_plan(self.parts, self.workloads, self.repeats, self.quick)

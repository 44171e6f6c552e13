# SPDX-License-Identifier: Apache-2.0
"""The verb that measures what the machinery costs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from graycard._errors import GraycardError
from graycard.cli._options import Json, optional
from graycard.cli._terminal import OK, Terminal, new_table, write_optional_json
from graycard.io import write_bytes

Parts = tuple[Literal["stages", "scaling", "peers", "losses", "step", "tracer"], ...]


@dataclass(frozen=True)
class SpeedCommand:
    """Measure what the machinery costs, beside a peer in the same run."""

    what: Annotated[Literal["truth", "engine", "score", "steps", "records"], tyro.conf.Positional]
    """truth: light split by source and lobe, beside Mitsuba's path tracer.
    engine: surfels, stage by stage, beside the machine's peak and other implementations.
    score: one view with all its layers, on one core.
    steps: a step of the second stages by the size of the pictures, on one core.
    records: verbs that read a run record, on a made-up run of 40 rows and 40 scenes."""
    repeats: int = 5
    """Number of timings, of which medians count; of steps eight times as many, of records one."""
    parts: Annotated[Parts, tyro.conf.arg(help_behavior_hint="")] = ()
    """engine: measure these only."""
    workloads: Annotated[tuple[str, ...], optional("WORKLOAD ...")] = ()
    """engine: stages, peers and the tracer on these workloads only (A to E)."""
    quick: bool = False
    """All but truth: everything once, on next to nothing, to see that it works."""
    json: Json = None
    """Also write the figures to this file."""
    plot: Annotated[Path | None, optional("FILE.svg")] = None
    """engine: also draw them."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Time the renderer, the engine, the scoring or the work on records."""
        if self.repeats < 1:
            raise GraycardError(f"expected --repeats of 1 or more, got {self.repeats}")
        if self.what == "engine":
            return self._engine(terminal)
        self._refuse_options(*("quick",) if self.what == "truth" else ())
        measures = {
            "truth": self._truth, "score": self._score, "steps": self._steps, "records": self._records,
        }  # fmt: skip
        return measures[self.what](terminal)

    def _refuse_options(self, *others: str) -> None:
        """Refuse what only the engine takes, and ``others``.

        Raises:
            GraycardError: One was given.
        """
        given = [f"--{name}" for name in ("plot", "parts", "workloads", *others) if getattr(self, name)]
        if given:
            raise GraycardError(
                f"expected no {' or '.join(given)} with `graycard speed {self.what}`: options of "
                "`graycard speed engine`. Leave it out"
            )

    def _score(self, terminal: Terminal) -> int:
        from graycard.benchmarks.speed import measure_scoring

        size, repeats = (64, 1) if self.quick else (512, self.repeats)
        with terminal.progress("measuring the scoring") as progress:
            costs = measure_scoring(size, repeats, progress)
        table = new_table("track", "family", "pixels", "scores", "sheet s", "view s", "of it reading", "MiB")
        for c in costs:
            figures = str(c.pixels), str(c.scores), *(f"{s:.2f}" for s in (c.seconds, c.view_s, c.reading_s))
            table.add_row(c.track, c.family, *figures, f"{c.peak_mib:.0f}")
        terminal.out.print(table)
        write_optional_json(self.json, costs)
        worst = max(costs, key=lambda cost: cost.view_s)
        peak = max(cost.peak_mib for cost in costs)
        terminal.out.print(
            f"speed: a view of {size} x {size} takes at most {worst.view_s:.2f} s on one core "
            f"({worst.family}) and {peak:.0f} MiB, from files to scores"
        )
        return OK

    def _steps(self, terminal: Terminal) -> int:
        from graycard.benchmarks.speed import growth, measure_second_stages

        sizes, steps, surfels = ((16, 32), 2, 100) if self.quick else ((112, 256), 8 * self.repeats, 5000)
        with terminal.progress("measuring second stages of methods") as progress:
            costs = measure_second_stages(sizes, steps, surfels, progress)
        table = new_table("method", "pixels", "ms a step", "least", *costs[0].parts)
        for c in costs:
            shares = (f"{100 * share:.0f} %" for share in c.parts.values())
            table.add_row(c.method, f"{c.size} x {c.size}", f"{c.ms:.1f}", f"{c.least_ms:.1f}", *shares)
        terminal.out.print(table)
        write_optional_json(self.json, costs)
        worst, ratio = max(growth(costs).items(), key=lambda pair: pair[1])
        terminal.out.print(
            f"speed: a step of a second stage takes at most {ratio:.2f} times as long with pictures of "
            f"{sizes[1]} x {sizes[1]} as with those of {sizes[0]} x {sizes[0]} ({worst})"
        )
        return OK

    def _records(self, terminal: Terminal) -> int:
        from graycard.benchmarks.speed import measure_records

        rows, scenes = (2, 6) if self.quick else (40, 40)
        with terminal.progress("measuring verbs on large records") as progress:
            costs = measure_records(rows, scenes, progress)
        table = new_table("verb", "CPU s", "peak MiB")
        for c in costs:
            table.add_row(c.verb, f"{c.seconds:.1f}", f"{c.peak_mib:.0f}")
        terminal.out.print(table)
        write_optional_json(self.json, costs)
        worst, peak = max(costs, key=lambda cost: cost.seconds), max(cost.peak_mib for cost in costs)
        terminal.out.print(
            f"speed: a run of {rows} rows and {scenes} scenes, {worst.record_mib:.1f} MiB of run.json, takes "
            f"at most {worst.seconds:.1f} s ({worst.verb}) and {peak:.0f} MiB"
        )
        return OK

    def _truth(self, terminal: Terminal) -> int:
        from graycard.benchmarks.speed import measure_truth

        with terminal.progress("measuring the rendering of truth") as progress:
            costs = measure_truth(repeats=self.repeats, progress=progress)
        table = new_table("track", "family", "lights", "path s", "separated s", "ratio", "CPU ratio")
        for c in costs:
            figures = f"{c.path_s:.3f}", f"{c.separated_s:.3f}", f"{c.ratio:.2f}", f"{c.cpu_ratio:.2f}"
            table.add_row(c.track, c.family, str(c.lights), *figures)
        terminal.out.print(table)
        write_optional_json(self.json, costs)
        worst = max(costs, key=lambda cost: cost.ratio)
        terminal.out.print(
            f"speed: the separated truth takes at most {worst.ratio:.2f} times as long as a plain picture "
            f"({worst.family}; in processor time {worst.cpu_ratio:.2f})"
        )
        return OK

    def _engine(self, terminal: Terminal) -> int:
        from graycard.benchmarks.speed import disturbed_note, engine_plot, engine_tables, measure_engine
        from graycard.plotting import check_plotting

        if self.plot is not None:
            check_plotting()
        if self.plot is not None and self.plot.suffix.lower() != ".svg":
            raise GraycardError(f"expected --plot with a name that ends in .svg, got {self.plot}. Rename it")
        with terminal.progress("measuring the surfel engine") as progress:
            speed = measure_engine(self._plan(), progress)
        for table in engine_tables(speed):
            terminal.out.print(table.title)
            shown = new_table(*table.heads)
            for row in table.rows:
                shown.add_row(*row)
            terminal.out.print(shown)
        for line in speed.left_out:
            terminal.out.print(f"left out: {line}")
        terminal.advise(disturbed_note(speed))
        write_optional_json(self.json, speed)
        if self.plot is not None:
            write_bytes(self.plot, engine_plot(speed).encode())
        peak = speed.peaks[-1]
        terminal.out.print(
            f"speed: {len(speed.engine)} workloads, {len(speed.peers)} peers; the machine's peak is "
            f"{peak.gflops:.0f} GFLOP/s with {peak.threads} threads"
        )
        return OK

    def _plan(self) -> Any:
        """Return the plan of a measurement.

        Raises:
            UnknownNameError: There is no such workload.
        """
        from graycard.benchmarks.speed import speed_plan

        return speed_plan(self.parts, self.workloads, self.repeats, self.quick)

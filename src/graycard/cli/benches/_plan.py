# SPDX-License-Identifier: Apache-2.0
"""The verb that says what a large run would take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.table import Table

from graycard._errors import GraycardError
from graycard.cli._options import Json, optional
from graycard.cli._terminal import OK, Terminal, new_table, write_optional_json
from graycard.records import is_published, read_run

if TYPE_CHECKING:
    from graycard.benchmarks.planning import Outlook


@dataclass(frozen=True)
class PlanCommand:
    """Say what a large run would take: hours, disk and price, from the costs that a small run measured.
    Scenes and fits are taken to cost what they do in the mean of the run, at its sizes and steps.
    """

    run_folder: Annotated[Path, tyro.conf.Positional]
    """The run folder of `graycard bench`, with its scenes and jobs."""
    scenes: Annotated[int, optional("N")] = 1000
    """Scenes of each track."""
    methods: Annotated[int, optional("N")] = 50
    """Rows on each scene."""
    rows: Annotated[tuple[str, ...], optional("ROW ...")] = ()
    """Count these rows of the run alone, as those that fit something; all by default."""
    cores: Annotated[int, optional("N")] = 64
    """Cores that work at the same time."""
    efficiency: Annotated[float, optional("SHARE")] = 0.84
    """Share of their time in which they work; the default was measured with two workers of one machine."""
    price: Annotated[float | None, optional("FLOAT")] = None
    """Price of one core hour; the price of the run is in the same currency."""
    json: Json = None
    """Also write the plan to this file."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Show a row for each track, and the sum.

        Raises:
            GraycardError: The run measured no costs or has no such row, or a number is out of its range.
        """
        from graycard.benchmarks.planning import measured_costs, outlook

        if is_published(self.run_folder):
            raise GraycardError(
                f"expected a run with its jobs and scenes, got a published one, {self.run_folder}. Run its "
                "suite, or a part of it"
            )
        record = read_run(self.run_folder)
        try:
            found = [
                outlook(cost, self.scenes, self.methods, self.cores, self.efficiency, self.price)
                for cost in measured_costs(record, self.run_folder, self.rows)
            ]
        except ValueError as error:
            raise GraycardError(str(error)) from error
        terminal.out.print(_means(found))
        terminal.out.print()
        terminal.out.print(_rows(found))
        terminal.out.print()
        terminal.out.print(_plan(found))
        write_optional_json(self.json, found)
        total = _rounded(sum(plan.hours for plan in found))
        disk = _rounded(sum(plan.disk_gb for plan in found))
        price = "" if self.price is None else f", price {_rounded(sum(plan.price or 0 for plan in found))}"
        terminal.out.print(
            f"plan: {self.scenes} scenes x {self.methods} methods on {len(found)} tracks: "
            f"{total} h on {self.cores} cores, {disk} GB{price}"
        )
        return OK


def _rounded(number: float) -> str:
    """Return a number with two digits below 10, and without digits behind the point above."""
    return f"{number:,.0f}" if number >= 10 else f"{number:.2g}"


def _means(found: Sequence[Outlook]) -> Table:
    """Return what was measured, the mean of each track."""
    heads = "render a scene", "fit", "score", "scene", "predictions", "memory of a fit"
    table = new_table("measured", *heads)
    for cost in (plan.measured for plan in found):
        table.add_row(
            f"{cost.track} ({cost.scenes} scenes, {cost.fits} of {cost.all_fits} fits)",
            *(f"{seconds:,.1f} CPU s" for seconds in (cost.rendering_s, cost.fit_s, cost.scoring_s)),
            *(f"{size / 1e6:,.1f} MB" for size in (cost.scene_bytes, cost.job_bytes)),
            f"{cost.peak_mib:,.0f} MiB",
        )
    return table


def _rows(found: Sequence[Outlook]) -> Table:
    """Return the CPU time of a fit of each row, dearest first."""
    table = new_table("mean of rows", "fit")
    for cost in (plan.measured for plan in found):
        for row, seconds in sorted(cost.row_s.items(), key=lambda of: -of[1]):
            table.add_row(f"{cost.track} {row}", f"{seconds:,.1f} CPU s")
    return table


def _plan(found: Sequence[Outlook]) -> Table:
    """Return what the large run takes."""
    table = new_table("planned", "rendering", "fits", "scoring", "together", "time", "disk", "price")
    for plan in found:
        parts = plan.rendering_h, plan.fits_h, plan.scoring_h, plan.cpu_h
        price = "" if plan.price is None else _rounded(plan.price)
        hours = (f"{_rounded(hours)} CPU h" for hours in parts)
        table.add_row(
            plan.measured.track, *hours, f"{_rounded(plan.hours)} h", f"{_rounded(plan.disk_gb)} GB", price
        )
    return table

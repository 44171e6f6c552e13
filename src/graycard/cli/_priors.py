# SPDX-License-Identifier: Apache-2.0
"""The verbs that train graycard's own network and measure how wrong priors are."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from graycard._errors import GraycardError
from graycard.cli._options import Json, optional
from graycard.cli._terminal import OK, Terminal, new_table, write_optional_json
from graycard.dataset import capture_folders
from graycard.io import write_bytes

if TYPE_CHECKING:
    from graycard.benchmarks.training import PriorErrors


@dataclass(frozen=True)
class TrainPriorCommand:
    """Train the network of `--priors pretrained:own` anew: render small views of scenes of its own seeds,
    then fit its weights. Cut off, the same command goes on; views are kept. Use the weights by
    `--priors pretrained:FOLDER/own.safetensors`.
    """

    out: Annotated[Path, tyro.conf.arg(metavar="FOLDER")]
    """Write own.safetensors (weights), own.json (record with curves) and views/ to this folder."""
    scenes: int = 117
    """Scenes to train on, five views each."""
    validation: int = 12
    """Scenes of the curves."""
    first_seed: Annotated[int | None, optional("INT")] = None
    """First seed of the scenes to train on; 100000 by default. Seeds that judge are refused."""
    steps: int = 1500
    """Steps of eight views each."""
    seed: int = 0
    """Seed of weights and batches."""
    bf16: bool = True
    """Compute in bfloat16: twice as fast on processors that have it, slow on others."""
    minutes: Annotated[float | None, optional("MINUTES")] = None
    """Stop the fit after this time; no limit by default."""
    plot: Annotated[Path | None, optional("FILE.svg")] = None
    """Draw the curves to this file, too."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Render what is missing, then fit.

        Raises:
            GraycardError: Seeds are not of the range that trains.
        """
        from graycard.benchmarks.training import (
            TRAINING,
            VALIDATION,
            TrainSettings,
            ViewSettings,
            check_seeds,
            read_views,
            render_views,
            train,
            training_plot,
        )
        from graycard.plotting import check_plotting

        if self.plot is not None:
            check_plotting()
        first = TRAINING.start if self.first_seed is None else self.first_seed
        training = range(first, first + self.scenes)
        validation = range(VALIDATION.start, VALIDATION.start + self.validation)
        try:
            check_seeds(training, TRAINING)
            check_seeds(validation, VALIDATION)
            settings = TrainSettings(steps=self.steps, seed=self.seed, bf16=self.bf16)
        except ValueError as error:
            raise GraycardError(str(error)) from error
        views, seconds = self.out / "views", float("inf") if self.minutes is None else 60 * self.minutes
        with terminal.progress(f"pictures of {len(training) + len(validation)} training scenes") as progress:
            render_views([*training, *validation], ViewSettings(), views, progress)
            shown = read_views(training, views), read_views(validation, views)
            record = train(*shown, settings, self.out, progress, seconds)
        if self.plot is not None:
            write_bytes(self.plot, training_plot(record).encode())
        step = 0 if record.last is None else record.last.step
        stopped = "" if step == self.steps else f" (stopped at step {step}); the same command goes on"
        terminal.out.print(
            f"train-prior: {self.out / 'own.safetensors'}, {record.parameters} weights{stopped}"
        )
        return OK


@dataclass(frozen=True)
class PriorErrorsCommand:
    """Measure how wrong priors are on rendered scenes, beside the oracle's severities."""

    data: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="SCENE|DATASET ...")]
    """Scenes, or datasets of which all scenes count."""
    priors: Annotated[tuple[str, ...], optional("SOURCE ...")] = field(default=())
    """Sources as in `graycard fit --priors`, or `flat`, which looks at nothing, or `constant`, the best value
    that is one all over a view; by default these, classical, graycard's own network and the oracle's six
    severities."""
    views: int = 4
    """Views of each scene."""
    json: Json = None
    """Write the errors to this file, too."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Show a row for each track, image and source.

        Raises:
            GraycardError: There is no scene, or a source is none.
        """
        from graycard.benchmarks.training import SOURCES, UNITS, check_sources, measure_priors

        scenes = [scene for place in self.data for scene in capture_folders(place)]
        if self.views < 1 or not scenes:
            raise GraycardError(f"expected 1 or more views and scenes, got {self.views} and {len(scenes)}")
        sources = self.priors or SOURCES
        check_sources(sources)
        with terminal.progress(f"priors on {len(scenes)} scenes") as progress:
            found = measure_priors(scenes, sources, self.views, progress)
        heads = [f"{kind} {unit}" for kind, units in UNITS.items() for unit in units]
        table = new_table("track", "shown", "source", *heads)
        for row in found:
            table.add_row(row.track, row.shown, row.source, *_cells(row))
        terminal.out.print(table)
        write_optional_json(self.json, found)
        terminal.out.print(f"prior-errors: {len(sources)} sources on {len(scenes)} scenes")
        return OK


def _cells(row: PriorErrors) -> list[str]:
    """Return the errors of a row as text; empty where the source does not answer."""
    from graycard.benchmarks.training import UNITS

    cells = []
    for kind, units in UNITS.items():
        values = row.errors.get(kind)
        texts = [""] * len(units) if values is None else [f"{value:.3g}" for value in values]
        cells += texts
    return cells

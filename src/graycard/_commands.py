# SPDX-License-Identifier: Apache-2.0
"""The verbs of the command line: each is a dataclass of its options, and says its result in one line.

Stages are imported inside the verbs: ``graycard methods`` must not wait for a renderer.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from graycard._commands_runs import Bench, Fit, Gate, Methods, Report
from graycard._commands_scenes import Export, Import, Look, Render, Scenes, Verify
from graycard._commands_scores import ScoreCommand
from graycard._screen import OK, Json, Screen, new_table, write_optional_json


@dataclass(frozen=True)
class Doctor:
    """Say what is here (renderer, GPU, weights, disk) and what to do for the rest."""

    json: Json = None
    """Also write the findings to this file."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """Look around."""
        from graycard.benchmarks import findings

        found = findings(Path.cwd())
        table = new_table("", "found", "what to do")
        for item in found:
            table.add_row(item.name, item.found, item.advice)
        screen.out.print(table)
        write_optional_json(self.json, found)
        advised = sum(bool(item.advice) for item in found)
        screen.out.print(f"doctor: {len(found)} things looked at, {advised} could be better")
        return OK


@dataclass(frozen=True)
class Speed:
    """Measure what the machinery costs, beside a peer in the same run."""

    what: Annotated[Literal["truth"], tyro.conf.Positional]
    """truth: light split by source and lobe, beside Mitsuba's path tracer."""
    repeats: int = 5
    """How often each is timed; medians count."""
    json: Json = None
    """Also write the figures to this file."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """Time both, in turns."""
        from graycard.benchmarks.speed import measure_truth

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


COMMANDS: dict[str, type[Any]] = {
    "doctor": Doctor,
    "scenes": Scenes,
    "methods": Methods,
    "render": Render,
    "verify": Verify,
    "fit": Fit,
    "score": ScoreCommand,
    "bench": Bench,
    "gate": Gate,
    "report": Report,
    "look": Look,
    "export": Export,
    "import": Import,
    "speed": Speed,
}
"""Verb by verb, in the order of ``--help``."""

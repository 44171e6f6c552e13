# SPDX-License-Identifier: Apache-2.0
"""The verbs of the command line: each is a dataclass of its options, and says its result in one line.

Stages are imported inside the verbs: ``graycard methods`` must not wait for a renderer.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from graycard.cli._checks import CheckResult, Compare
from graycard.cli._claims import Claims
from graycard.cli._runs import Bench, Fit, Gate, Methods, Publish, Report
from graycard.cli._scenes import Bounds, Export, Import, Look, Render, Scenes, Verify
from graycard.cli._scores import ScoreCommand
from graycard.cli._screen import OK, Json, Screen, new_table, write_optional_json
from graycard.cli._speed import Speed


@dataclass(frozen=True)
class Doctor:
    """Say what is here (renderer, GPU, weights, disk) and what to do for the rest."""

    json: Json = None
    """Also write the findings to this file."""
    warm: bool = False
    """Also compile the kernels of the surfel engine, which the first fit would else do."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """Look around."""
        if self.warm:
            _warm(screen)
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


def _warm(screen: Screen) -> None:
    """Compile all kernels that the cache lacks, and say how many jobs that were."""
    from graycard.methods.splat import warm_kernels  # PyTorch takes long to import

    with screen.progress() as progress:
        compiled = warm_kernels(progress=progress)
    screen.out.print(f"kernels: {len(compiled)} jobs compiled" if compiled else "kernels: nothing to compile")


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
    "compare": Compare,
    "claims": Claims,
    "check-result": CheckResult,
    "report": Report,
    "publish": Publish,
    "bounds": Bounds,
    "look": Look,
    "export": Export,
    "import": Import,
    "speed": Speed,
}
"""Verb by verb, in the order of ``--help``."""

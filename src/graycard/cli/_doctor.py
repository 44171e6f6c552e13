# SPDX-License-Identifier: Apache-2.0
"""The verb that looks at this machine."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from graycard.cli._options import Json
from graycard.cli._terminal import OK, Terminal, new_table, write_optional_json


@dataclass(frozen=True)
class DoctorCommand:
    """Show the renderer, processor, GPU, weights and disk of this machine, and say what could be better."""

    json: Json = None
    """Also write the findings to this file."""
    warm: bool = False
    """Also compile the kernels of the surfel engine, which the first fit would else do."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Examine the machine."""
        if self.warm:
            _warm(terminal)
        from graycard.benchmarks import findings

        found = findings(Path.cwd())
        table = new_table("", "found", "what to do")
        for item in found:
            table.add_row(item.name, item.found, item.advice)
        terminal.out.print(table)
        write_optional_json(self.json, found)
        advised = sum(bool(item.advice) for item in found)
        terminal.out.print(f"doctor: {len(found)} things looked at, {advised} could be better")
        return OK


def _warm(terminal: Terminal) -> None:
    """Compile all kernels that the cache lacks, and say how many jobs that were."""
    from graycard.methods.splat import warm_kernels  # PyTorch takes long to import

    with terminal.progress() as progress:
        compiled = warm_kernels(progress=progress)
    terminal.out.print(
        f"kernels: {len(compiled)} jobs compiled" if compiled else "kernels: nothing to compile"
    )

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

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Examine the machine."""
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

# SPDX-License-Identifier: Apache-2.0
"""The verb that looks at this machine, and mends what it can."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from graycard._errors import GraycardError
from graycard._missing import missing_package
from graycard.cli._options import Json, optional
from graycard.cli._terminal import FAILED, OK, Terminal, new_table, write_optional_json

RUNS = "runs"
"""Folder in which runs are by default."""


@dataclass(frozen=True)
class DoctorCommand:
    """Show the packages, renderer, processor, GPU, weights and disk of this machine, and say what could be
    better.
    """

    json: Json = None
    """Also write the findings to this file."""
    warm: bool = False
    """Also compile the kernels of the surfel engine, which the first fit would else do."""
    mend: bool = False
    """Mend what can be: compile kernels, fetch weights, remove what killed processes left in runs. It prints
    the command for all else."""
    folders: Annotated[tuple[Path, ...], optional("FOLDER ...")] = ()
    """With --mend: runs and datasets to clear up; those below runs/ by default."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Examine the machine; what could not be mended makes the exit code 1."""
        failed = 0
        if self.folders and not self.mend:
            raise GraycardError("expected --folders with --mend, got it alone. Add --mend, or leave it out")
        if self.mend:
            failed = sum(not _mended(terminal, name, work) for name, work in self._works(terminal))
        elif self.warm:
            terminal.out.print(f"kernels: {_warm(terminal)}")
        from graycard.benchmarks import findings

        found = findings(Path.cwd())
        table = new_table("", "found", "what to do")
        for item in found:
            table.add_row(item.name, item.found, item.advice)
        terminal.out.print(table)
        write_optional_json(self.json, found)
        advised = sum(bool(item.advice) for item in found)
        terminal.out.print(f"doctor: {len(found)} things looked at, {advised} could be better")
        return FAILED if failed else OK

    def _works(self, terminal: Terminal) -> Iterator[tuple[str, Callable[[], str]]]:
        """Yield what can be mended, with the work that does it and says what it has done."""
        from graycard.networks import SETS

        yield "kernels", lambda: _warm(terminal)
        for one in SETS:
            yield f"weights {one.name}", lambda one=one: _fetch(terminal, one.name)
        yield "leftovers", lambda: _clear(self.folders or tuple(sorted(Path(RUNS).glob("*/"))))


def _mended(terminal: Terminal, name: str, work: Callable[[], str]) -> bool:
    """Do one thing, and say what was done or why it could not be."""
    try:
        terminal.out.print(f"mend {name}: {work()}")
    except GraycardError as cause:
        terminal.err.print(f"failed: {name}: {cause}")
        return False
    except ModuleNotFoundError as cause:
        if (missing := missing_package(cause)) is None:
            raise
        terminal.err.print(f"failed: {name}: {missing}")
        return False
    return True


def _warm(terminal: Terminal) -> str:
    """Compile all kernels that the cache lacks, and say how many jobs that were."""
    from graycard.methods.splat import warm_kernels  # PyTorch takes long to import

    with terminal.progress("looking for kernels to compile") as progress:
        compiled = warm_kernels(progress=progress)
    return f"{len(compiled)} jobs compiled" if compiled else "nothing to compile"


def _fetch(terminal: Terminal, name: str) -> str:
    from graycard.networks import fetch_weights, find_set, state_of

    if state_of(find_set(name)) == "fetched":
        return "are here"
    with terminal.progress(f"weights {name}") as progress:
        files = fetch_weights(name, None, progress)
    return f"fetched, {sum(path.stat().st_size for path in files) / 1e6:.0f} MB"


def _clear(folders: tuple[Path, ...]) -> str:
    """Remove partial files and locks that no process holds."""
    from graycard.io import remove_leftovers

    for folder in folders:
        if not folder.is_dir():
            raise GraycardError(f"expected a folder of a run or dataset, got nothing at {folder}")
    removed = [path for folder in folders for path in remove_leftovers(folder)]
    return f"{len(removed)} removed in {len(folders)} folder{'s' * (len(folders) != 1)}"

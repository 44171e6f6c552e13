# SPDX-License-Identifier: Apache-2.0
"""The verb that holds the scores of a run against expected ones."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from graycard._errors import GraycardError
from graycard.cli._options import Json, optional
from graycard.cli._terminal import OK, Terminal, write_optional_json
from graycard.records import RunRecord, read_run

if TYPE_CHECKING:
    from graycard.benchmarks import Baseline, GateVerdict


@dataclass(frozen=True)
class GateCommand:
    """Fail if a run is worse than a baseline (1), or measured less than it expects (2). For continuous
    integration, `graycard report RUN --summary` tells the same to people.
    """

    run_folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The run folder."""
    baseline: Annotated[str, tyro.conf.arg(metavar="FILE|SUITE")]
    """The expected scores with their tolerances: a file, or the suite of one that comes with graycard."""
    rows: Annotated[tuple[str, ...], optional("ROW ...")] = ()
    """Watch these rows only, as of your own method; all by default."""
    tolerance: Annotated[float, tyro.conf.arg(metavar="FACTOR")] = 1.0
    """Multiply all tolerances, as by 2 where machines differ."""
    write: bool = False
    """Write the baseline from the run instead of comparing."""
    annotate: bool = False
    """Also print what failed as ::error commands, by which GitHub Actions marks the commit."""
    history: Annotated[Path | None, optional("FOLDER")] = None
    """Add the scores to gate-history.json in this folder; its README.md has a sparkline for each metric."""
    commit: Annotated[str, optional("NAME")] = ""
    """With --history: the commit; that of the repository around the working directory by default."""
    json: Json = None
    """Also write the verdict to this file."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Compare, or write the baseline."""
        from graycard.benchmarks import find_baseline, judge, make_baseline, read_baseline, write_baseline

        self._refuse_idle()
        run = read_run(self.run_folder)
        if self.write:
            made = make_baseline(run, self.rows)
            write_baseline(Path(self.baseline), made)
            terminal.out.print(f"gate: wrote {len(made.scores)} expected scores to {self.baseline}")
            return OK
        baseline = read_baseline(find_baseline(self.baseline))
        verdict = judge(run, baseline, self.rows, self.tolerance)
        for label in ("worse", "missing", "better"):
            for change in getattr(verdict, label):
                terminal.out.print(f"{label}: {change}")
        self._tell(terminal, run, baseline, verdict)
        terminal.out.print(f"gate: {verdict.says}")
        return verdict.exit_code

    def _refuse_idle(self) -> None:
        """Refuse options that would do nothing.

        Raises:
            GraycardError: There is one.
        """
        compare = {
            "--tolerance": self.tolerance != 1, "--annotate": self.annotate, "--history": self.history,
            "--json": self.json,
        }  # fmt: skip
        if self.write and (idle := [option for option, given in compare.items() if given]):
            raise GraycardError(
                f"expected --write alone, as nothing is compared then, got {idle[0]} as well. Leave one out"
            )
        if self.commit and self.history is None:
            raise GraycardError("expected --commit with --history, got it alone. Name the folder, too")

    def _tell(self, terminal: Terminal, run: RunRecord, baseline: Baseline, verdict: GateVerdict) -> None:
        """Write the verdict in each form that was asked for."""
        from graycard.benchmarks import add_entry, annotations, commit_at, entry_of

        write_optional_json(self.json, verdict)
        if self.annotate:
            for line in annotations(verdict):
                terminal.out.print(line)
        if self.history is not None:
            watched = self.rows or {expected.method for expected in baseline.scores}
            entry = entry_of(run, watched, verdict, self.commit or commit_at(Path.cwd()))
            terminal.out.print(f"history: {add_entry(self.history, entry)}")

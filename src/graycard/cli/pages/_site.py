# SPDX-License-Identifier: Apache-2.0
"""The verb that makes the site of a ledger."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from graycard._errors import GraycardError
from graycard.cli._terminal import OK, Terminal


@dataclass(frozen=True)
class SiteCommand:
    """Make static pages of published runs: claims with their history, leaderboards, scenes and methods."""

    published: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="PUBLISHED ...")]
    """Folders of `graycard publish`, or folders that hold such. A history of verdicts beside them is told.
    What lies beside them and is none is left out, and named if it may be a damaged one."""
    out: Annotated[Path, tyro.conf.arg(metavar="FOLDER")]
    """Write to this folder, new or empty; pages that an earlier call made there are replaced."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Write the pages."""
        from graycard.eval.statistics import Question, compare_first_look
        from graycard.reports import beside_runs, headline_ids, write_site

        if not self.published:
            raise GraycardError("expected published folders, got none. Name some, as reports/published")
        files = write_site(
            self.published,
            self.out,
            lambda record: compare_first_look(record, Question(headline_ids(record))),
        )
        if beside := beside_runs(self.published):
            names = ", ".join(place.name for place in beside)
            terminal.err.print(f"left out, as they are no published runs: {names}")
        size = sum(file.stat().st_size for file in files) / 2**20
        terminal.out.print(f"site: {files[-1].resolve()} ({len(files)} files, {size:.1f} MiB)")
        return OK

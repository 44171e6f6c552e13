# SPDX-License-Identifier: Apache-2.0
"""The verb that shows a run: as one HTML file, or in brief as Markdown, JUnit XML or JSON."""

from __future__ import annotations

import io
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from graycard._errors import GraycardError, OutputError, RecordError
from graycard.cli._options import optional
from graycard.cli._terminal import OK, Terminal
from graycard.cli.adoption._captures import report_captured
from graycard.io import write_bytes
from graycard.records import RunRecord, is_published_run, read_run

if TYPE_CHECKING:
    from graycard.benchmarks import Change
    from graycard.reports import GateSummary

Form = Literal["md", "junit", "json"]


@dataclass(frozen=True)
class ReportCommand:
    """Write the report of a run, or of predictions of an imported capture, as one HTML file that opens
    offline; or the summary of a run for pull requests and continuous integration.
    """

    run_folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN|SCENE")]
    """The run folder; or an imported capture, DATASET/<track>/<scene>."""
    out: Annotated[Path | None, optional("FILE")] = None
    """Write to this file; RUN/report/index.html or SCENE/report/index.html by default. A published run,
    whose pictures are kept, needs it.
    A summary is printed by default."""
    one_file: bool = False
    """Write one file however large; else the scenes of a report above 15 MB have files beside it."""
    predictions: Annotated[tuple[str, ...], optional("NAME=FOLDER ...")] = ()
    """With SCENE: predictions that are held against its photographs, a column each."""
    summary: Annotated[Form | None, optional("md|junit|json")] = None
    """Write this instead of the page. md fits a comment of a pull request. junit has a test case for each
    job, for each score of --baseline, and for each claim. json is for programs.
    The exit code is 0 whatever the run says: `graycard gate` fails."""
    baseline: Annotated[str | None, optional("FILE|SUITE")] = None
    """With --summary: also hold the scores against these, as `graycard gate` does."""
    rows: Annotated[tuple[str, ...], optional("ROW ...")] = ()
    """With --baseline: watch these rows only."""
    tolerance: Annotated[float, tyro.conf.arg(metavar="FACTOR")] = 1.0
    """With --baseline: multiply all tolerances."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Write the report; claims that are not of this run are told, and warned of."""
        from graycard.dataset import is_scene
        from graycard.reports import ledger_of_run

        if self.baseline is None and (self.rows or self.tolerance != 1):
            raise GraycardError("expected --baseline with --rows or --tolerance, got none. Name the baseline")
        _refuse_published(self.out)
        if self.summary is not None:
            return self._summarise(self.summary, terminal)
        if self.baseline is not None:
            raise GraycardError("expected --baseline with --summary md, junit or json, got none of them")
        if is_scene(self.run_folder):
            return report_captured(terminal, self.run_folder, self.predictions, self.out)
        if self.predictions:
            raise GraycardError(
                f"expected --predictions with an imported capture, got {self.run_folder}. Rows of a run come "
                "from `graycard bench SUITE --predictions`"
            )
        path = self._written()
        try:
            ledger_of_run(self.run_folder)
        except RecordError as fault:
            terminal.err.print(f"claims: {fault}")
        terminal.out.print(f"report: {path.resolve()}")
        return OK

    def _written(self) -> Path:
        """Write the report, and say what to do where the run cannot be written to."""
        from graycard.eval.statistics import compare_first_look
        from graycard.reports import is_published, write_report

        record = comparison = None
        if is_published(self.run_folder):
            if self.out is None:
                raise OutputError(
                    f"expected --out FILE with {self.run_folder}, got none: what is published stays as it is"
                )
            record = read_run(self.run_folder)
            comparison = compare_first_look(record)
        try:
            return write_report(
                self.run_folder, out=self.out, one_file=self.one_file, comparison=comparison, record=record
            )
        except OutputError as cause:
            if self.out is not None:
                raise
            raise OutputError(f"{cause}; --out FILE writes the report elsewhere") from cause

    def _summarise(self, form: Form, terminal: Terminal) -> int:
        """Write or print a summary, and warn of what is not told in it.

        Raises:
            GraycardError: The folder is no run, or the baseline is of another suite.
        """
        from graycard.eval.statistics import Question, compare_first_look
        from graycard.reports import headline_ids, summarise, summary_text

        if self.predictions:
            raise GraycardError(
                "expected --summary of a run, without --predictions, got both. Leave out one of them"
            )
        record = read_run(self.run_folder)
        comparison = compare_first_look(record, Question(headline_ids(record)))
        gate = (
            None if self.baseline is None else gate_summary(record, self.baseline, self.rows, self.tolerance)
        )
        summary = summarise(self.run_folder, record, comparison, gate)
        for warning in summary.warnings:
            terminal.err.print(warning)
        text = summary_text(summary, form)
        if self.out is None:
            if isinstance(sys.stdout, io.TextIOWrapper):
                sys.stdout.reconfigure(
                    encoding="utf-8", errors="replace"
                )  # the XML says so, and numbers have a minus
            sys.stdout.write(text)  # as it is: a console would wrap and escape it
        else:
            write_bytes(self.out, text.encode())
            terminal.out.print(f"summary: {self.out.resolve()}")
        return OK


def _refuse_published(out: Path | None) -> None:
    """Refuse to write into a published run, by whichever path.

    Raises:
        OutputError: A file is named there.
    """
    for folder in () if out is None else out.resolve().parents:
        if is_published_run(folder):
            raise OutputError(
                f"expected --out FILE outside of published runs, got {out}: what is published stays as it is"
            )


def gate_summary(
    record: RunRecord, baseline: str, rows: tuple[str, ...] = (), tolerance: float = 1.0
) -> GateSummary:
    """Return the scores of a run against a baseline.

    Args:
        record: The run.
        baseline: A file, or the suite of a baseline that comes with graycard.
        rows: Only these are watched; all of the baseline if empty.
        tolerance: Factor on all tolerances.

    Raises:
        UnknownNameError: The baseline is no file, and none of that name comes along.
        RecordError: The baseline is missing, damaged, or of another suite.
    """
    from graycard.benchmarks import find_baseline, judge, read_baseline
    from graycard.reports import GateCheck, GateStatus, GateSummary

    path = find_baseline(baseline)
    verdict = judge(record, read_baseline(path), rows, tolerance)
    groups: dict[GateStatus, tuple[Change, ...]] = {
        "worse": verdict.worse, "missing": verdict.missing, "better": verdict.better, "kept": verdict.kept
    }  # fmt: skip
    checks = (
        GateCheck(
            *change.expected.key[:5], status, change.expected.value, change.found, change.expected.tolerance,
            change.unit, change.loss, change.reason,
        )
        for status, changes in groups.items()
        for change in changes
    )  # fmt: skip
    return GateSummary(path.name, tuple(checks))

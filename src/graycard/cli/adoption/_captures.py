# SPDX-License-Identifier: Apache-2.0
"""The verbs `score` and `report` on imported captures: photographs, no truth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from graycard._errors import GraycardError
from graycard.cli._terminal import FAILED, OK, Terminal, new_table, write_optional_json
from graycard.records import PhotographSheet


def refuse_scenes(suite: str) -> None:
    """Refuse a folder of scenes in the place of a suite, and say what to run on scenes of one's own.

    Raises:
        GraycardError: It is such a folder.
    """
    if not Path(suite).is_dir():
        return
    from graycard.dataset import capture_folders

    if scenes := capture_folders(Path(suite)):
        raise GraycardError(
            f"expected a suite, got a folder of scenes, {suite}. Fit a method to one of them: `graycard fit "
            f"2dgs {scenes[0]} --out mine`; then `graycard score mine {scenes[0]}`, and for photographs of "
            f"your own `graycard report {scenes[0]} --predictions 2dgs=mine`"
        )


def score_captured(
    terminal: Terminal, predictions: Path, scene: Path, protocol: str, json: Path | None
) -> int:
    """Score by held-out photographs; a score that failed makes the exit code 1."""
    from graycard.eval import score_photographs

    sheet = score_photographs(predictions, scene, protocol)
    terminal.out.print(f"{sheet.kind}: light alone is judged, by {sheet.views} held-out photographs")
    terminal.out.print(_table(sheet))
    if sheet.lacking:
        terminal.say(f"note: held out without a photograph: {', '.join(sheet.lacking)}")
    for says in dict.fromkeys(says for score in sheet.scores for says in score.warnings):
        terminal.say(f"warning: {says}")
    write_optional_json(json, sheet)
    failed = [score for score in sheet.scores if score.status == "failed"]
    for reason in dict.fromkeys(score.reason for score in failed):
        terminal.err.print(f"failed: {reason}")
    scored = sum(score.status == "scored" for score in sheet.scores)
    terminal.out.print(
        f"score: {sheet.method} on {sheet.track}/{sheet.scene}: {scored} scored by photographs, no truth, "
        f"{len(failed)} failed; see them: graycard report {scene} --predictions {sheet.method}={predictions}"
    )
    return OK if scored and not failed else FAILED


def _table(sheet: PhotographSheet) -> Table:
    """Return a row for each score by photographs."""
    table = new_table("photographs, no truth", "score", "unit", "optimum", "as taken", "views")
    for score in sheet.scores:
        value = f"{score.value:.4g}" if score.value is not None else score.status
        taken = f"{x:.4g}" if (x := score.breakdown.get("as_taken")) is not None else ""
        counts = f"{score.scored}/{score.expected}"
        table.add_row(score.metric, value, score.unit, f"{score.optimum:g}", taken, counts)
    return table


def report_captured(terminal: Terminal, scene: Path, predictions: Sequence[str], out: Path | None) -> int:
    """Write the page of an imported capture.

    Raises:
        GraycardError: The scene has truth, or no predictions are named.
    """
    from graycard.dataset import is_imported
    from graycard.eval import score_photographs
    from graycard.reports import CaptureRow, write_capture_report

    if not is_imported(scene):
        raise GraycardError(
            f"expected a run, or an imported capture, got a scene with truth at {scene}. "
            "`graycard bench SUITE --predictions NAME=FOLDER` reports on predictions of such scenes"
        )
    named = [text.partition("=") for text in predictions]
    if not named or any(not (name and folder) for name, _, folder in named):
        raise GraycardError(
            f"expected --predictions NAME=FOLDER for the capture {scene}, got "
            f"{' '.join(predictions) or 'none'}. Make some: `graycard fit 2dgs {scene} --out mine`, then "
            "name them mine=mine"
        )
    rows = [
        CaptureRow(name, Path(folder), score_photographs(Path(folder), scene)) for name, _, folder in named
    ]
    path = write_capture_report(scene, rows, out=out)
    terminal.out.print(f"report: {path.resolve()}")
    return OK

# SPDX-License-Identifier: Apache-2.0
"""Keep the scores of a run of a suite of noise where verdicts read the noise of fits from.

``graycard bench noise-dark && python tests/helpers/fit_noise.py runs/noise-dark``. Single views and what was
not scored are left out.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path

from graycard import TRACKS
from graycard.benchmarks.claims._noise import FOLDER
from graycard.io import to_builtins, write_bytes
from graycard.records import JobResult, RunRecord, Score, read_run


def trimmed(run: RunRecord) -> RunRecord:
    """Return a run without the scores of single views, and without scores that are none."""
    return replace(run, results=tuple(map(_trimmed, run.results)))


def _trimmed(result: JobResult) -> JobResult:
    if result.sheet is None:
        return result
    scores, protocols = map(_scored, (result.sheet.scores, result.sheet.protocols))
    return replace(result, sheet=replace(result.sheet, scores=scores, protocols=protocols))


def _scored(scores: tuple[Score, ...]) -> tuple[Score, ...]:
    return tuple(replace(score, per_view={}) for score in scores if score.status == "scored")


def main(folder: str) -> None:
    """Write the trimmed record of a run folder into the package.

    Raises:
        SystemExit: The run is of another suite.
    """
    run = read_run(Path(folder))
    kind, _, name = run.suite.partition("-")
    if kind != "noise" or name.split("-")[0] not in TRACKS:
        raise SystemExit(f"expected a run of a suite noise-<track> or noise-<track>-<what>, got {run.suite}")
    data = to_builtins(trimmed(run))
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    write_bytes(FOLDER / name / "run.json", text.encode() + b"\n")


if __name__ == "__main__":
    main(sys.argv[1])

# SPDX-License-Identifier: Apache-2.0
"""Render the sealed scenes of a published run anew, verify them, and hold them against its record.

``python tests/helpers/sealed_truth.py OUT reports/published/second/dark-sealed-2 …``. Scenes follow from the
suite that the run keeps. Each has to pass what ``graycard verify`` checks. Then ``gray``, which fits nothing,
is scored on it: scores are those of the record but for rounding if the scene is the same. A processor of
another kind rounds otherwise, so hashes of the truth do not tell.

OUT/verified.jsonl has a line for each scene, and scenes that have one are not done again. It can be cut off
at any time. The exit code is 1 if any scene fails.
"""

import argparse
import json
import math
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from graycard.benchmarks import Suite, opened
from graycard.benchmarks._jobs import FitJob, run_fit, run_score
from graycard.io import from_builtins, read_json
from graycard.records import Job, JobResult, Score, read_run
from graycard.resources import usable_cores
from graycard.synth import render_scene
from graycard.synth.verify import verify_dataset

ROW = "gray"
_LEAST = 1e-2
"""Scores below it are compared by their difference, not by their ratio."""


@dataclass(frozen=True, slots=True)
class Task:
    """One scene of a run, by its number in the suite."""

    run: Path
    number: int
    out: Path
    until: float
    """Time after which it is not begun, seconds since the epoch."""


def suite_of(run: Path) -> Suite:
    """Return the suite of a published run with its sealed scenes in place of its own."""
    return opened(from_builtins(Suite, read_json(run / "suite.json")))


def verified(task: Task) -> dict[str, Any] | None:
    """Render a scene, verify it, and score ``gray`` on it; None where it is too late to begin."""
    if time.time() > task.until:
        return None
    suite, begun = suite_of(task.run), time.process_time()
    spec, here = suite.scenes[task.number], task.out / task.run.name
    # A data set of one scene alone, as `graycard verify` takes all that are there.
    dataset = here / f"{task.number:02}" / "dataset"
    scene = render_scene(spec, suite.render_of(spec), dataset, lambda *_: None, 1)
    rendered = time.process_time()
    checks = verify_dataset(dataset).checks
    counts = {status: sum(c.status == status for c in checks) for status in ("passed", "failed", "skipped")}
    off, metric, compared = _farthest(_scores_here(task, scene), _scores_there(task.run, scene.name))
    return {
        "run": task.run.name,
        "number": task.number,
        "scene": f"{spec.track}/{scene.name}",
        **counts,
        "failures": sorted({f"{c.name}: {c.reason}" for c in checks if c.status == "failed"}),
        "compared": compared,
        "farthest": metric,
        "off": off,
        "cpu_s": {"render": round(rendered - begun), "verify": round(time.process_time() - rendered)},
    }


def _scores_here(task: Task, scene: Path) -> tuple[Score, ...]:
    job = Job(scene.parent.name, scene.name, ROW, 0, {}, ROW)
    folder = task.out / task.run.name / f"{task.number:02}" / "jobs"
    fit = FitJob(job, "anew", scene, folder / ROW, 1, folder)
    outcome = run_fit(fit)
    outcome = outcome if outcome.reason else run_score(fit)
    if outcome.reason:
        raise RuntimeError(f"{scene.name}: {outcome.reason}")
    return outcome.value.scores


def _scores_there(run: Path, scene: str) -> tuple[Score, ...]:
    def is_wanted(result: JobResult) -> bool:
        return (result.job.scene, result.job.method) == (scene, ROW)

    sheet = next(filter(is_wanted, read_run(run).results)).sheet
    return sheet.scores if sheet else ()


def _farthest(ours: tuple[Score, ...], theirs: tuple[Score, ...]) -> tuple[float, str, int]:
    """Return the largest relative difference of scores, whose it is, and how many both have."""
    one, other = (dict(_finite(scores)) for scores in (ours, theirs))
    both = sorted(one.keys() & other.keys())
    off, metric = max(((_off(one[m], other[m]), m) for m in both), default=(math.inf, ""))
    return off, metric, len(both)


def _finite(scores: tuple[Score, ...]) -> Iterator[tuple[str, float]]:
    return ((s.metric, s.value) for s in scores if s.value is not None and math.isfinite(s.value))


def _off(one: float, other: float) -> float:
    return abs(one - other) / max(abs(other), _LEAST)


def _told(line: Mapping[str, Any]) -> str:
    words = f"{line['run']} {line['scene']}: {line['passed']} passed, {line['failed']} failed"
    return f"{words}, {line['skipped']} skipped; {line['compared']} scores within {line['off']:.1e}"


def main() -> int:
    """Verify the scenes that have no line yet; 1 if any fails."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path, help="folder of scenes and of verified.jsonl")
    parser.add_argument("runs", type=Path, nargs="+", help="published runs")
    parser.add_argument("--seconds", type=float, default=math.inf, help="begin no other scene after this")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    kept = given.out / "verified.jsonl"
    lines = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    done = {(line["run"], line["number"]) for line in lines}
    tasks = [
        Task(run.resolve(), number, given.out.resolve(), time.time() + given.seconds)
        for run in given.runs
        for number in range(len(suite_of(run).scenes))
        if (run.name, number) not in done
    ]
    with get_context("spawn").Pool(usable_cores(), maxtasksperchild=1) as pool, kept.open("a") as file:
        for line in filter(None, pool.imap_unordered(verified, tasks)):
            lines.append(line)
            file.write(json.dumps(line) + "\n")
            file.flush()
            sys.stdout.write("\n  ".join([_told(line), *line["failures"]]) + "\n")
            sys.stdout.flush()
    return any(line["failed"] for line in lines)


if __name__ == "__main__":
    sys.exit(main())

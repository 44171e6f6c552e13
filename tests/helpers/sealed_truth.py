# SPDX-License-Identifier: Apache-2.0
"""Render the sealed scenes of a published run anew, verify them, and hold them against its record.

``python tests/helpers/sealed_truth.py OUT reports/published/second/dark-sealed-2 …``. Scenes follow from the
suite that the run keeps. Each has to pass what ``graycard verify`` checks. Then ``gray``, which fits nothing,
is scored on it, and its scores have to be those of the record but for rounding. A processor of another kind
rounds otherwise, so hashes of the truth do not tell.

OUT/verified.jsonl has a line for each scene, or several, of which the last counts. Scenes that have passed
are not done again. It can be cut off at any time. The exit code is 1 if any scene has failed.
"""

import argparse
import json
import math
import re
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from graycard.benchmarks import Suite, opened
from graycard.benchmarks._jobs import FitJob, run_fit, run_score
from graycard.benchmarks._sources import environment
from graycard.io import from_builtins, read_json
from graycard.records import Job, JobResult, Score, read_run
from graycard.resources import usable_cores
from graycard.synth import render_scene, scene_name
from graycard.synth.verify import verify_dataset

ROW = "gray"
_CORRELATION = re.compile(r"(^|\.)leakage(\.|$)")
"""Scores that are squared correlations, from 0 to 1: of ``gray`` with light they are all but 0."""
_BY_NETWORKS = re.compile(r"(^|\.)(lpips|fid|kid)(\.|$)")
"""Scores that are missing where weights are."""
_LEAST = 1e-2
"""Scores below it are compared by their difference as a share of it."""
_OFF, _OFF_CORRELATION = 1e-2, 1e-1
"""Allowed difference of a score, as such a share. The second is 0.001 of a correlation that is all but 0."""


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
    spec = suite_of(task.run).scenes[task.number]
    line = {
        "run": task.run.name,
        "number": task.number,
        "scene": f"{spec.track}/{scene_name(spec)}",
        "commit": environment()["git_commit"],
    }
    try:
        return line | _verified(task)
    except Exception as error:  # the others go on
        failures = [f"{type(error).__name__}: {error}"]
        return line | {"passed": 0, "failed": 1, "skipped": 0, "failures": failures, "compared": 0}


def _verified(task: Task) -> dict[str, Any]:
    suite, begun = suite_of(task.run), time.process_time()
    spec, here = suite.scenes[task.number], task.out / task.run.name
    # A data set of one scene alone, as `graycard verify` takes all that are there.
    dataset = here / f"{task.number:02}" / "dataset"
    scene = render_scene(spec, suite.render_of(spec), dataset, lambda *_: None, 1)
    rendered = time.process_time()
    checks = verify_dataset(dataset).checks
    counts = {status: sum(c.status == status for c in checks) for status in ("passed", "failed", "skipped")}
    ours, theirs = (
        dict(_finite(s)) for s in (_scores_here(task, scene), _scores_there(task.run, scene.name))
    )
    others = unlike(ours, theirs)
    off, metric = farthest(ours, theirs)
    return {
        **counts,
        "failed": counts["failed"] + len(others),
        "failures": sorted({f"{c.name}: {c.reason}" for c in checks if c.status == "failed"}) + others,
        "compared": len(ours.keys() & theirs.keys()),
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


def unlike(ours: Mapping[str, float], theirs: Mapping[str, float]) -> list[str]:
    """Say which scores are not those of the record, and which are missing on either side."""
    found = [
        f"{metric}: expected {theirs[metric]:.6g}, as in the record, got {ours[metric]:.6g}"
        for metric in sorted(ours.keys() & theirs.keys())
        if _off(ours[metric], theirs[metric]) > (_OFF_CORRELATION if _CORRELATION.search(metric) else _OFF)
    ]
    lone = sorted(metric for metric in ours.keys() ^ theirs.keys() if not _BY_NETWORKS.search(metric))
    return found + [f"{metric}: expected it here and in the record, got one of both" for metric in lone]


def farthest(ours: Mapping[str, float], theirs: Mapping[str, float]) -> tuple[float, str]:
    """Return the largest difference of a score that both have, and whose it is."""
    both = sorted(ours.keys() & theirs.keys())
    return max(((_off(ours[m], theirs[m]), m) for m in both), default=(math.inf, ""))


def _finite(scores: tuple[Score, ...]) -> Iterator[tuple[str, float]]:
    return ((s.metric, s.value) for s in scores if s.value is not None and math.isfinite(s.value))


def _off(one: float, other: float) -> float:
    return abs(one - other) / max(abs(other), _LEAST)


def _told(line: Mapping[str, Any]) -> str:
    words = f"{line['run']} {line['scene']}: {line['passed']} passed, {line['failed']} failed"
    scores = f"; {line['compared']} scores within {line['off']:.1e}" if line["compared"] else ""
    return f"{words}, {line['skipped']} skipped{scores}"


def _last_lines(kept: Path) -> dict[tuple[str, int], dict[str, Any]]:
    """Return the last line of each scene, by run and number."""
    lines = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    return {(line["run"], line["number"]): line for line in lines}


def main() -> int:
    """Verify the scenes that have not passed yet; 1 if any fails."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path, help="folder of scenes and of verified.jsonl")
    parser.add_argument("runs", type=Path, nargs="+", help="published runs")
    parser.add_argument("--seconds", type=float, default=math.inf, help="begin no other scene after this")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    kept = given.out / "verified.jsonl"
    lines = _last_lines(kept)
    done = {place for place, line in lines.items() if not line["failed"]}
    tasks = [
        Task(run.resolve(), number, given.out.resolve(), time.time() + given.seconds)
        for run in given.runs
        for number in range(len(suite_of(run).scenes))
        if (run.name, number) not in done
    ]
    with get_context("spawn").Pool(usable_cores(), maxtasksperchild=1) as pool, kept.open("a") as file:
        for line in filter(None, pool.imap_unordered(verified, tasks)):
            lines[line["run"], line["number"]] = line
            file.write(json.dumps(line) + "\n")
            file.flush()
            sys.stdout.write("\n  ".join([_told(line), *line["failures"]]) + "\n")
            sys.stdout.flush()
    return any(line["failed"] for line in lines.values())


if __name__ == "__main__":
    sys.exit(main())

# SPDX-License-Identifier: Apache-2.0
"""Cost of the verbs that read the record of a run, on a made-up run, each in a process of its own."""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from graycard import Progress
from graycard.benchmarks._suites import load_suite
from graycard.benchmarks.claims import claims_of_suite, load_claims
from graycard.eval import all_metrics
from graycard.io import silent, write_json
from graycard.records import (
    RUN_FILE,
    Cost,
    Job,
    JobResult,
    MethodRecord,
    MetricRecord,
    RunRecord,
    SceneRecord,
    Score,
    ScoreSheet,
)
from graycard.synth import SceneSpec, resolved_knobs, scene_name

SUITE = "claims-dark"
"""Its rows come first, so that its claims can be judged."""
SCORES = 44
"""Scores of one job."""
VERBS = ("compare", "report", "claims", "check-result")
_FIRST_SEED = 1000
_CHILD = """
import sys, time
from graycard.cli import main
from graycard.io import peak_memory_mib
code = main()
print(time.process_time(), peak_memory_mib(), file=sys.stderr)
sys.exit(code)
"""
"""The command line in a process that tells its cost in the last line."""
_REFERENCES = ("truth", "input", "retinex")
"""Rows that are handed truth."""


@dataclass(frozen=True, slots=True)
class RecordCost:
    """One verb on one run."""

    verb: str
    rows: int
    scenes: int
    record_mib: float
    """Size of ``run.json``."""
    seconds: float
    """CPU time of all threads of the process, from its start."""
    peak_mib: float
    """Largest resident memory of the process, Python and its libraries among it."""
    exit_code: int
    """That of the verb: `check-result` finds no scenes and has 1."""


def measure_records(rows: int = 40, scenes: int = 40, progress: Progress = silent) -> list[RecordCost]:
    """Return the cost of each verb that reads a record, one after another on one run folder.

    Args:
        rows: Of the run.
        scenes: Of the run.
        progress: Told about each verb.

    Raises:
        OutputError: The folder for temporary files cannot be written to, or the disk is full.
    """
    with TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        write_json(run / RUN_FILE, made_up_run(rows, scenes))
        size = (run / RUN_FILE).stat().st_size / 2**20
        costs = []
        for number, verb in enumerate(VERBS):
            progress(number / len(VERBS), verb)
            costs.append(RecordCost(verb, rows, scenes, size, *_run_verb(verb, run)))
    return costs


def made_up_run(rows: int, scenes: int) -> RunRecord:
    """Return the record of a run that nobody made: every row has a score of every scene by each metric.

    Scores are the sum of a row's, a scene's and their own normal number; equal sizes give equal records.

    Args:
        rows: Those of the suite first, then variants of its method.
        scenes: Of the suite's families, in turn.
    """
    suite = load_suite(SUITE)
    families = list(dict.fromkeys(scene.family for scene in suite.scenes))
    specs = [SceneSpec("dark", families[i % len(families)], _FIRST_SEED + i) for i in range(scenes)]
    names = [method.row for method in suite.methods[:rows]]
    names += [f"variant-{number}" for number in range(len(names), rows)]
    metrics = _metrics()
    chance = np.random.default_rng(_FIRST_SEED)
    parts = (
        chance.standard_normal(shape)
        for shape in ((rows, 1, SCORES), (1, scenes, SCORES), (rows, scenes, SCORES))
    )
    values = sum(parts, np.zeros(()))
    results = tuple(
        _result(name, spec, metrics, values[i, j])
        for j, spec in enumerate(specs)
        for i, name in enumerate(names)
    )
    return RunRecord(
        SUITE,
        suite.version,
        tuple(map(_scene, specs)),
        tuple(_method(name) for name in names),
        metrics,
        results,
        {"python": "3", "packages": {}},
        "2026-01-01T00:00:00+00:00",
        1.0,
    )


def _metrics() -> tuple[MetricRecord, ...]:
    """Return the metrics of the suite's claims and of leaderboards, and as many others as there are
    scores.
    """
    checks = [
        check
        for name in claims_of_suite(SUITE)
        for claim in load_claims(name).claims
        for check in claim.checks
    ]
    asked = {check.quantity.metric for check in checks} | {"training_view.psnr"}
    known = all_metrics()
    chosen = sorted(known, key=lambda metric: not (metric.id in asked or metric.headline))[:SCORES]
    return tuple(metric for metric in known if metric in chosen)


def _method(name: str) -> MethodRecord:
    entry = "sunfaded" if "-" in name else name
    return MethodRecord(name, f"What {name} is.", ("radiance",) if name in _REFERENCES else (), entry)


def _scene(spec: SceneSpec) -> SceneRecord:
    name = scene_name(spec)
    return SceneRecord(
        spec.track,
        name,
        spec.family,
        spec.seed,
        f"dataset/{spec.track}/{name}",
        "0" * 64,
        f"Nothing to see (seed {spec.seed})",
        resolved_knobs(spec),
    )


def _result(row: str, spec: SceneSpec, metrics: tuple[MetricRecord, ...], values: np.ndarray) -> JobResult:
    scene = scene_name(spec)
    scores = tuple(_score(metric, float(value)) for metric, value in zip(metrics, values, strict=True))
    settings = {"iterations": 4000, "surfels": 10_000}
    return JobResult(
        Job(spec.track, scene, row, 0, settings, _method(row).entry),
        "0" * 12,
        f"jobs/{spec.track}/{scene}/{row}-0",
        "done",
        sheet=ScoreSheet(spec.track, scene, row, "0" * 64, "0" * 64, scores),
        cost=Cost(60.0, 700.0),
    )


def _score(metric: MetricRecord, normal: float) -> Score:
    centre, step = (30.0, 2.0) if metric.unit == "dB" else (0.5, 0.02)
    value = centre + step * normal
    return Score(
        metric.id,
        "graycard-1",
        "scored",
        value,
        metric.unit,
        metric.higher_is_better,
        metric.optimum,
        {"test_004": value},
        centre + 20 * step if metric.unit == "dB" else None,
        expected=1,
        scored=1,
    )


def _run_verb(verb: str, run: Path) -> tuple[float, float, int]:
    """CPU seconds of a verb in a process of its own, its peak in MiB, and its exit code."""
    done = subprocess.run([sys.executable, "-c", _CHILD, verb, str(run)], capture_output=True, text=True)
    seconds, peak = done.stderr.splitlines()[-1].split()
    return float(seconds), float(peak), done.returncode

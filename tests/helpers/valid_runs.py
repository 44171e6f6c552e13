# SPDX-License-Identifier: Apache-2.0
"""A real run folder, three methods fitted and scored on two scenes, and what it takes to break it."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from graycard.benchmarks import check_result, environment
from graycard.benchmarks._introduction import introduction_of
from graycard.benchmarks._jobs import FitJob, run_fit, run_score
from graycard.benchmarks._run_record import method_record, results_of
from graycard.benchmarks._suites import Suite, SuiteMethod
from graycard.eval import all_metrics
from graycard.eval.statistics import compare_run
from graycard.io import read_manifest, sha256, to_builtins, write_json, write_manifest
from graycard.methods import load_method, settings_of
from graycard.records import COMPARISON, Job, JobResult, RunRecord, SceneRecord, read_run
from graycard.synth import RenderSettings, SceneSpec, resolved_knobs, scene_name

METHODS = ("truth", "gray", "retinex")
SUITE = Suite(
    "tiny",
    1,
    "As small as can be",
    RenderSettings(),
    tuple(SceneSpec("dark", "corridor", seed) for seed in (1000, 1001)),
    tuple(SuiteMethod(name) for name in METHODS),
)


def fit_and_score(run: Path, scene: Path, method: str) -> JobResult:
    settings = to_builtins(settings_of(load_method(method), {}))
    job = Job("dark", scene.name, method, 0, settings, method)
    fit = FitJob(job, "hash", scene, run / "jobs" / "dark" / scene.name / f"{method}-0", 1, run / "jobs")
    return results_of([(fit, run_fit(fit))], [(fit, run_score(fit))], run)[0]


def write_valid_run(run: Path, write_tiny: Callable[..., Path]) -> Path:
    """Fit and score the suite on two tiny scenes: a whole and valid run folder."""
    scenes = [write_tiny(run / "dataset", scene=scene_name(s), test=s.seed - 998) for s in SUITE.scenes]
    for spec, scene in zip(SUITE.scenes, scenes, strict=True):
        found = {"family": spec.family, "knobs": resolved_knobs(spec), "render": SUITE.render_of(spec)}
        manifest = read_manifest(scene / "truth", "graycard-truth")
        write_manifest(
            scene / "truth", replace(manifest, settings=to_builtins(found), seeds={"scene": spec.seed})
        )
    write_json(run / "suite.json", SUITE)
    with pytest.MonkeyPatch.context() as patch:
        for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
            patch.setenv(name, "1")
        results = tuple(fit_and_score(run, scene, method) for scene in scenes for method in METHODS)
    record = RunRecord(
        "tiny",
        1,
        tuple(
            SceneRecord(
                "dark",
                s.name,
                "corridor",
                spec.seed,
                f"dataset/dark/{s.name}",
                sha256(s / "truth" / "manifest.json"),
                "",
            )
            for spec, s in zip(SUITE.scenes, scenes, strict=True)
        ),
        tuple(method_record(m, introduction_of(m)) for m in SUITE.methods),
        all_metrics(),
        results,
        environment() | {"git_commit": "0123456789ab"},
        "2026-01-01T00:00:00+00:00",
        1.0,
        sha256(run / "suite.json"),
    )
    write_json(run / "run.json", record)
    write_json(run / COMPARISON, compare_run(record))
    return run


def breaches(run: Path, rescore: bool = False) -> dict[str, list[str]]:
    """Return broken rules."""
    found: dict[str, list[str]] = {}
    for breach in check_result(run, rescore=rescore).breaches:
        found.setdefault(breach.rule, []).append(str(breach))
    return found


def change(run: Path, edit: Callable[[Any], object], *, follow: bool = True) -> None:
    """Edit the data of ``run.json``, and let everything that is made from it follow."""
    data = json.loads((run / "run.json").read_text())
    edit(data)
    (run / "run.json").write_text(json.dumps(data))
    if not follow:
        return
    record = read_run(run)
    write_json(run / COMPARISON, compare_run(record))
    for result in record.results:
        scores, done = run / result.folder / "scores.json", run / result.folder / "job.json"
        write_json(scores, {**json.loads(scores.read_text()), "sheet": result.sheet})
        said = {"job": result.job, "job_hash": result.job_hash, "cost": result.cost, "access": result.access}
        write_json(done, said)


def score_in(data: Any, method: str = "gray", metric: str = "novel_view.psnr", scene: int = 0) -> Any:
    """A score in the data of ``run.json``."""
    result = data["results"][scene * len(METHODS) + METHODS.index(method)]
    return next(s for s in result["sheet"]["scores"] if s["metric"] == metric)

# SPDX-License-Identifier: Apache-2.0
"""The fits of a run, each with its address: the hash of its spec, of what it is handed, and of its code."""

import hashlib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from graycard.benchmarks._jobs import FitJob
from graycard.benchmarks._submitted import given_for
from graycard.benchmarks._suites import Suite, SuiteMethod
from graycard.benchmarks.planning._parts import Part
from graycard.benchmarks.planning._stages import STAGES
from graycard.io import dumps, sha256, to_builtins
from graycard.methods.confined import Introduction
from graycard.methods.priors import truth_of, weights_of
from graycard.records import Job
from graycard.synth import SceneSpec


def job_hash(job: Job, sees: Sequence[str], origin: str) -> str:
    """Return the address of a job: the hash of its spec, of what the method is handed, and of its code."""
    text = dumps({"job": job, "sees": list(sees), "origin": origin})
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def plan_fits(
    suite: Suite,
    introductions: Sequence[Introduction],
    scenes: list[tuple[SceneSpec, Path]],
    donors: Mapping[Path, Path],
    run: Path,
    threads: int,
) -> list[FitJob]:
    """Return the fits of a suite: by scene, then by method, then by seed.

    Args:
        suite: Its methods and seeds.
        introductions: What each method says of itself.
        scenes: Rendered ones, with their folders.
        donors: Folders of scenes that objects come from, by those of scenes that they are put in.
        run: The run folder.
        threads: Of each fit.
    """
    plan = []
    for spec, folder in scenes:
        for method, known in zip(suite.methods, introductions, strict=True):
            if not method.runs_on(spec.track):
                continue
            donor = donors.get(folder) if method.composes else None
            given = given_for(method.predictions, spec.track, folder.name) if method.predictions else None
            sees = [
                *_seen(method, known, folder),
                *_of_guest(folder, donor),
                *([given.sha256] if given else []),
            ]
            priors = to_builtins(method.priors) if known.asks else {}
            for seed in suite.seeds:
                job = Job(spec.track, folder.name, method.row, seed, known.settings, method.entry, priors)
                name = job_hash(job, sees, known.fingerprint)
                where = run / "jobs" / spec.track / folder.name / f"{_slug(method.row)}-{seed}-{name}"
                stages = stages_folder(run, known, folder, threads)
                told = (run / "jobs", donor, stages, given)
                plan.append(FitJob(job, name, folder, where, threads, *told, command=method.command))
    return plan


def part_of_plan(suite: Suite, part: Part) -> tuple[slice, slice]:
    """Return which scenes of a suite a part needs, and which of the fits on these scenes are its own."""
    each = [len(suite.rows_on(scene.track)) * len(suite.seeds) for scene in suite.scenes]
    scene_of = [number for number, fits in enumerate(each) for _ in range(fits)]
    own = part.share(len(scene_of))
    if not own:
        return slice(0, 0), slice(0, 0)
    first, last = scene_of[own.start], scene_of[own.stop - 1]
    begin = scene_of.index(first)
    return slice(first, last + 1), slice(own.start - begin, own.stop - begin)


def stages_folder(run: Path, known: Introduction, scene: Path, threads: int) -> Path:
    """Return the folder in which fits leave stages for others.

    Those are of the same code, on the same capture, with as many threads.
    """
    code = hashlib.sha256(known.fingerprint.encode()).hexdigest()[:12]
    capture = sha256(scene / "capture" / "manifest.json")[:12]
    return run / STAGES / code / f"{capture}-{threads}"


def _seen(method: SuiteMethod, known: Introduction, scene: Path) -> list[str]:
    """Hashes of all that a method is handed: the capture, the truth if it is handed any, weights."""
    asks = known.asks
    told = bool(known.needs) or bool(truth_of(method.priors, asks))
    parts = ("capture", "truth")[: 1 + told]
    return [*(sha256(scene / part / "manifest.json") for part in parts), *weights_of(method.priors, asks)]


def _of_guest(scene: Path, donor: Path | None) -> list[str]:
    """Hashes of where an object comes from, which it is, and where it is put; none without a donor."""
    if donor is None:
        return []
    of_donor = [sha256(donor / part / "manifest.json") for part in ("capture", "truth")]
    return [*of_donor, sha256(scene / "truth" / "composition" / "composition.json")]


def _slug(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", name)

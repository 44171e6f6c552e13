# SPDX-License-Identifier: Apache-2.0
"""Hold a run against the suite that it names: scenes, seeds and settings."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from graycard import DatasetError, GraycardError, RecordError
from graycard.benchmarks._sizes import at_size, scaled
from graycard.benchmarks._suites import Suite, SuiteMethod, load_suite, suite_names
from graycard.benchmarks.validity._record import Breach, difference, place_of
from graycard.io import from_builtins, read_json, read_manifest, sha256, to_builtins
from graycard.methods.priors import PriorSpec
from graycard.records import RUN_FILE, SUITE_FILE, JobResult, RunRecord, SceneRecord
from graycard.synth import SceneSpec, resolved_knobs, scene_name, with_defaults

RULE = "suite"
COMPOSED = "composition.psnr"
"""Metric that a scene has where its truth shows an object put in."""


@dataclass(frozen=True, slots=True)
class Standard:
    """The suite that a run is held against."""

    suite: Suite | None
    """None where there is nothing to hold it against."""
    says: str
    """Suite, and how that is known."""
    breaches: tuple[Breach, ...] = ()
    """Breaches of the suite itself."""


def standard_of(run: RunRecord, folder: Path) -> Standard:
    """Return the suite of a run: the one of this name and version that comes along, else the one that it
    kept.

    A kept suite is known by its hash alone: whoever changes scenes in it has made another suite.
    """
    kept, breaches = _kept(run, folder)
    named = f"{run.suite} version {run.suite_version}"
    own = load_suite(run.suite) if run.suite in suite_names() else None
    if own is not None and own.version == run.suite_version:
        if kept is not None and _judging(kept) != _judging(own):
            what = f"expected {named} as it comes with graycard, got a suite of other content under its name"
            breaches.append(Breach(RULE, SUITE_FILE, f"{what}. Give it a name of its own"))
        return Standard(own, f"{named}, which comes with graycard", tuple(breaches))
    if kept is None:
        if not breaches:
            what = f"expected {SUITE_FILE} to hold the run against, got none. Run `graycard bench` again"
            breaches.append(Breach(RULE, SUITE_FILE, f"{what}: it fits nothing anew", unknown=True))
        return Standard(None, f"{named}, of which nothing is known", tuple(breaches))
    other = f"; this graycard has version {own.version}" if own is not None else ""
    says = f"{named}, which does not come with graycard ({SUITE_FILE}, SHA-256 {run.suite_sha256}{other})"
    return Standard(kept, says, tuple(breaches))


def _judging(suite: Suite) -> Any:
    """Return what the numbers of a suite come from: not the scenes that it sets aside."""
    return to_builtins(replace(suite, reserve=None, sealed=None, secret=None))


def _kept(run: RunRecord, folder: Path) -> tuple[Suite | None, list[Breach]]:
    """Return the suite in the run folder, if it is the one that was run."""
    path = folder / SUITE_FILE
    if not path.is_file():
        return None, []
    if (found := sha256(path)) != run.suite_sha256:
        said = f"{run.suite_sha256[:12]}…" if run.suite_sha256 else "none"
        what = f"expected the suite that was run, of SHA-256 {said} by run.json, got {found[:12]}…"
        return None, [Breach(RULE, SUITE_FILE, what)]
    try:
        suite = from_builtins(Suite, read_json(path), source=SUITE_FILE)
    except (GraycardError, ValueError) as cause:
        return None, [Breach(RULE, SUITE_FILE, str(cause), unknown=True)]
    if (suite.name, suite.version) != (run.suite, run.suite_version):
        what = f"expected suite {run.suite} version {run.suite_version}, as run.json says, got "
        return None, [Breach(RULE, SUITE_FILE, f"{what}{suite.name} version {suite.version}")]
    return suite, []


def part_of(run: RunRecord, suite: Suite | None) -> str:
    """Return what of its suite a run is, and at which size, in words; empty for all of it as it is."""
    if suite is None:
        return ""
    tracks = list(dict.fromkeys(scene.track for scene in run.scenes))
    rows, own = (
        [method.name for method in run.methods],
        [method.row for method in suite.methods if any(map(method.runs_on, tracks))],
    )
    parts = []
    if {scene.track for scene in suite.scenes} - set(tracks):
        parts.append(f"tracks {', '.join(tracks)}")
    if set(own) - set(rows):
        parts.append(f"methods {', '.join(rows)}")
    if suite.secret and not run.commitment and not run.edition:
        parts.append("without its secret scenes")
    if alone := _without_compositions(run, suite):
        parts.append(f"no object is put in by {', '.join(alone)}")
    told = [f"part of {suite.name}: {'; '.join(parts)}"] if parts else []
    return "; ".join([*told, *([f"{suite.name} at {run.departs}"] if run.departs else [])])


def _without_compositions(run: RunRecord, suite: Suite) -> list[str]:
    """Return the rows that are to put objects in, and were run without."""
    composing = {method.row for method in suite.methods if method.composes}
    alone = {
        result.job.method
        for result in run.results
        if result.job.method in composing and result.access and not result.access.donor_sha256
        for score in (result.sheet.scores if result.sheet else ())
        if score.metric == COMPOSED and score.status == "not provided"
    }
    return [method.name for method in run.methods if method.name in alone]


def suite_breaches(run: RunRecord, folder: Path, suite: Suite) -> list[Breach]:
    """Scenes, seeds and settings other than those of the suite, on the tracks and of the methods of the run.

    Tracks and methods may be left out as a whole, which :func:`part_of` says; a scene or a seed may not.
    """
    if not run.results:
        return []
    try:
        suite = at_size(suite, run.size)
    except RecordError as cause:
        return [Breach(RULE, RUN_FILE, str(cause))]
    found = [*_missing_scenes(run, suite), *_other_seeds(run, suite)]
    specs = {(spec.track, scene_name(spec)): spec for spec in _scenes(run, suite)}
    for scene in run.scenes:
        if spec := specs.get((scene.track, scene.scene)):
            found += _other_scene(scene, spec, suite, folder)
    methods = {method.row: method for method in suite.methods}
    for result in run.results:
        if method := methods.get(result.job.method):
            found += _other_method(result, method, run)
    return found


def _scenes(run: RunRecord, suite: Suite) -> tuple[SceneSpec, ...]:
    """Return the scenes that a run of a suite may have: sealed ones, or the suite's and those it added.

    Secret ones have no seeds here.
    """
    if run.edition is not None:
        return suite.sealed.drawn() if suite.sealed else ()
    if run.looks is None:
        return (*suite.scenes, *(suite.secret.drawn() if suite.secret and run.commitment else ()))
    added = {scene for look in run.looks.made[1:] for scene in look.scenes}
    return (*suite.scenes, *(s for s in suite.added if f"{s.track}/{scene_name(s)}" in added))


def _missing_scenes(run: RunRecord, suite: Suite) -> Iterator[Breach]:
    there = {(scene.track, scene.scene) for scene in run.scenes}
    tracks = {track for track, _ in there}
    wanted = {(spec.track, scene_name(spec)) for spec in _scenes(run, suite) if spec.track in tracks}
    for track, scene in sorted(wanted - there):
        yield Breach(RULE, f"{track}/{scene}", f"expected this scene, as {suite.name} has it, got none")
    for track, scene in sorted(there - wanted):
        yield Breach(RULE, f"{track}/{scene}", f"expected scenes of {suite.name}, got one that it has not")


def _other_seeds(run: RunRecord, suite: Suite) -> Iterator[Breach]:
    there = {result.job.seed for result in run.results}
    for seed in sorted(set(suite.seeds) - there):
        yield Breach(RULE, RUN_FILE, f"expected fits with seed {seed}, as {suite.name} has them, got none")
    for seed in sorted(there - set(suite.seeds)):
        what = f"expected fits with the seeds of {suite.name}, got some with seed {seed}, which it has not"
        yield Breach(RULE, RUN_FILE, what)


def _other_scene(scene: SceneRecord, spec: SceneSpec, suite: Suite, run: Path) -> Iterator[Breach]:
    """Yield differences of a scene from its spec: one of the same name may be easier."""
    try:
        settings = read_manifest(run / scene.folder / "truth", "graycard-truth").settings
    except DatasetError:
        return  # said by `hashes`
    render = suite.render_of(spec)
    wanted = {"family": spec.family, "knobs": resolved_knobs(spec), "render": render}
    found = with_defaults(settings, spec, render)
    if (place := _apart(to_builtins(wanted), to_builtins(found))) is not None:
        what = f"expected the scene that {suite.name} asks for, got another {place}"
        yield Breach(RULE, f"{scene.track}/{scene.scene}", what)


def _other_method(result: JobResult, method: SuiteMethod, run: RunRecord) -> Iterator[Breach]:
    job = result.job
    settings = {**method.settings, **scaled(method.settings, run.budget, run.size.surfels)}
    wanted: dict[str, Any] = {"entry": method.entry, "settings": settings}
    found = {"entry": job.entry, "settings": job.settings}
    if job.priors or method.priors != PriorSpec():
        wanted["priors"], found["priors"] = method.priors, job.priors
    if (place := _apart(to_builtins(wanted), to_builtins(found))) is not None:
        yield Breach(RULE, place_of(result), f"expected the method as the suite has it, got another {place}")


def _apart(wanted: Any, found: Any, where: str = "") -> str | None:
    """Return where ``found`` differs in what ``wanted`` names; more of it may be there: defaults."""
    if isinstance(wanted, Mapping) and isinstance(found, Mapping):
        places = (_apart(wanted[k], found.get(k), f"{where}.{k}".lstrip(".")) for k in wanted)
        return next((place for place in places if place is not None), None)
    return difference(wanted, found, where, tolerance=0)

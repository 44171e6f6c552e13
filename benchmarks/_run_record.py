# SPDX-License-Identifier: Apache-2.0
"""``run.json``: records of a bench, and of an earlier bench in the same folder."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from graycard import GraycardError, NewerRecordError, RecordError, open_truth
from graycard.benchmarks._introduction import Introduction
from graycard.benchmarks._jobs import FitJob, Outcome
from graycard.benchmarks._sources import hardware
from graycard.benchmarks._suites import Suite, SuiteMethod, public
from graycard.dataset import manifest_of
from graycard.io import await_file, remove_leftovers, sha256, to_builtins, writable_folder, write_json
from graycard.machines import Machines
from graycard.methods.priors import told_exactly
from graycard.records import (
    EARLIER,
    RUN_FILE,
    SUITE_FILE,
    UNSEEN,
    Edition,
    Job,
    JobResult,
    MethodRecord,
    RunRecord,
    SceneRecord,
    Size,
    departures,
    read_run,
)
from graycard.synth import SceneSpec, SecretSpec, clear_leftovers, describe, scene_name

_AS_SUITE = Size()

BEGINNING = 12
"""Digits of a hash that tell jobs apart."""


class RunError(GraycardError):
    """A bench cannot go on: a scene was not rendered, or the run folder is of another suite."""


@contextmanager
def tidied(run: Path, dataset: Path) -> Iterator[None]:
    """Remove what killed processes have left in a run and in its dataset, before the block and after it.

    Raises:
        OutputError: The run folder cannot be written to.
    """
    writable_folder(run)
    try:
        _tidy(run, dataset)
        yield
    finally:  # workers of a bench that is told to end are killed
        _tidy(run, dataset)


def _tidy(run: Path, dataset: Path) -> None:
    remove_leftovers(run)
    clear_leftovers(dataset)


def method_record(method: SuiteMethod, known: Introduction) -> MethodRecord:
    """Return a method as a suite names it, with the settings that it changes.

    A prior that answers with the truth as it is counts as truth that is handed in: the row is a reference.
    """
    changes = [f"{name} {value}" for name, value in method.settings.items()]
    changes += [f"priors: {method.priors}"] if known.asks else []
    changed = ", ".join(changes)
    exact = told_exactly(method.priors, [ask.kind for ask in known.asks])
    summary = f"{known.summary} ({changed})" if changed else known.summary
    return MethodRecord(
        name=method.row,
        summary=summary,
        sees=(*known.needs, *(f"{kind} (exact prior)" for kind in exact)),
        entry=method.entry,
        slack=method.slack,
        predictions=method.predictions,
        tracks=method.tracks,
    )


def scene_record(spec: SceneSpec, folder: Path, run: Path) -> SceneRecord:
    """Return a rendered scene, with the hash of its truth and the knobs that it was made with."""
    truth = manifest_of(open_truth(folder / "truth", check=False))
    return SceneRecord(
        track=spec.track,
        scene=folder.name,
        family=spec.family,
        seed=None if isinstance(spec, SecretSpec) else spec.seed,
        folder=_relative(folder, run),
        truth_sha256=sha256(folder / "truth" / "manifest.json"),
        title=describe(spec),
        knobs=truth.settings.get("knobs", {}),
    )


def noisy_scenes(suite: Suite, record: RunRecord, run: Path) -> list[str]:
    """Return in words which scenes are noisier than their suite allows, of those whose files are here."""
    found = []
    for scene in record.scenes:
        truth, wanted = run / scene.folder / "truth", suite.ceilings.get(scene.track, 0.0)
        ceiling = None
        with suppress(GraycardError):  # its files may be gone, as those of another machine
            ceiling = open_truth(truth, check=False).noise_ceiling if wanted else None
        if ceiling is not None and ceiling < wanted:
            found.append(
                f"{scene.track}/{scene.scene} has a noise ceiling of {ceiling:.1f} dB, not {wanted:g}"
            )
    return found


def commitment_of(suite: Suite) -> str:
    """Hash of the salt that scenes of an opened suite follow from; empty where none does."""
    opened = any(isinstance(spec, SecretSpec) for spec in suite.scenes)
    return suite.secret.commitment if suite.secret and opened else ""


def keep_suite(suite: Suite, run: Path) -> str:
    """Write the suite beside its run, without what a salt has opened in it, and give its hash."""
    write_json(run / SUITE_FILE, public(suite))
    return sha256(run / SUITE_FILE)


def results_of(
    fitted: Iterable[tuple[FitJob, Outcome]], scored: Iterable[tuple[FitJob, Outcome]], run: Path
) -> tuple[JobResult, ...]:
    """Return how each job ended."""
    scores = {job.folder: outcome for job, outcome in scored}
    return tuple(_result_of(job, outcome, scores.get(job.folder), run) for job, outcome in fitted)


def _result_of(fit: FitJob, fitted: Outcome, scored: Outcome | None, run: Path) -> JobResult:
    """End of a job: its scores and its cost, or why there are none."""
    reason = fitted.reason or (scored.reason if scored else "not scored")
    return JobResult(
        job=fit.job,
        job_hash=fit.job_hash,
        folder=_relative(fit.folder, run),
        status="failed" if reason else "done",
        reason=reason,
        sheet=scored.value if scored and not reason else None,
        cost=fitted.value.cost if fitted.value else None,
        access=fitted.value.access if fitted.value else None,
    )


def renderers(scenes: list[tuple[SceneSpec, Path]]) -> list[Any]:
    """Return the renderers that made the scenes, each once."""
    found = [manifest_of(open_truth(folder / "truth", check=False)).generator for _, folder in scenes]
    return [g for i, g in enumerate(found) if g not in found[:i]]


def check_seen(paths: Iterable[Path]) -> None:
    """Refuse to go on without what a job has written, maybe on another machine.

    Raises:
        RunError: It is not there, after a while.
    """
    for path in paths:
        await_file(path)
        if not path.exists():
            raise RunError(
                f"expected {path}, which a job has written, got none. Put run and dataset where all machines "
                "see them"
            )


def of_machines(machines: Machines | None) -> dict[str, Any]:
    """Return what is recorded of other machines: each kind of those that are there now, with its workers."""
    if machines is None:
        return {}
    found = machines.ask(hardware)
    kinds = [kind for number, kind in enumerate(found) if kind not in found[:number]]
    return {"machines": [{**kind, "workers": found.count(kind)} for kind in kinds]}


def record_before(
    run: Path, suite: Suite, budget: float = 1.0, size: Size = _AS_SUITE, edition: Edition | None = None
) -> RunRecord | None:
    """Return what an earlier bench left in this folder.

    Raises:
        RunError: It was of another suite, at another budget or size, or of another edition.
        NewerRecordError: Only a newer graycard reads it.
    """
    if not (run / RUN_FILE).is_file():
        return None
    try:
        before = read_run(run)
    except NewerRecordError:
        raise  # not damaged, and not ours to replace
    except RecordError:
        return None  # of an older format or damaged: it is written anew
    wanted = _kind(f"{suite.name!r} version {suite.version}", budget, size, edition)
    found = _kind(
        f"{before.suite!r} version {before.suite_version}", before.budget, before.size, before.edition
    )
    if wanted != found:
        raise RunError(
            f"expected {run} to be free or to hold a run of {wanted}, got one of {found}. "
            "Choose another --out"
        )
    return before


def plain_record_before(
    run: Path, suite: Suite, budget: float = 1.0, size: Size = _AS_SUITE, edition: Edition | None = None
) -> RunRecord | None:
    """Return what an earlier bench left in this folder; refuse a run that adds scenes for its claims.

    Raises:
        RunError: As of :func:`record_before`, or it adds such scenes.
    """
    before = record_before(run, suite, budget, size, edition)
    if before is not None and before.looks is not None:
        raise RunError(
            f"expected {run} to be free or to hold a run of {suite.name!r}, got one that adds scenes until "
            f"claims are decided. Go on with --until-decided --max-scenes {before.looks.most}, or choose "
            "another --out"
        )
    return before


def _kind(suite: str, budget: float, size: Size, edition: Edition | None) -> str:
    """Facts that all results of one folder share, in words."""
    terms = departures(budget, size)
    at = f" at {terms}" if terms else ""
    sealed = f" on the sealed scenes of {edition.tag}" if edition else ""
    return f"{suite}{at}{sealed}"


def joined(record: RunRecord, before: RunRecord, suite: Suite) -> RunRecord:
    """Return a record with those results of an earlier one that this one has not, on scenes that are the
    same.

    Of a row that is now another method, or of predictions in another folder, nothing is kept.

    Its time is that of both, for both were spent on the folder; unless the later one measured nothing.

    Args:
        record: Of a part of a suite.
        before: What the folder had.
        suite: The whole: scenes, methods and results come in its order, whatever was run when. Sealed scenes
            come behind its own, and then those that it does not list.
    """
    truths = {(s.track, s.scene): s.truth_sha256 for s in record.scenes}
    kept = [s for s in before.scenes if truths.get((s.track, s.scene), s.truth_sha256) == s.truth_sha256]
    same = {(s.track, s.scene) for s in kept}
    keys = {_key(r.job) for r in record.results}
    names = {m.name for m in record.methods}
    origins = {m.name: (m.entry, m.predictions) for m in (*before.methods, *record.methods)}
    others = {m.name for m in before.methods if origins[m.name] != (m.entry, m.predictions)}
    old = [
        r
        for r in before.results
        if _key(r.job) not in keys and (r.job.track, r.job.scene) in same and r.job.method not in others
    ]
    listed = (*suite.scenes, *(suite.sealed.drawn() if suite.sealed else ()))
    order = {(spec.track, scene_name(spec)): place for place, spec in enumerate(listed)}
    both = record.scenes + tuple(s for s in kept if (s.track, s.scene) not in truths)
    scenes = tuple(sorted(both, key=lambda s: order.get((s.track, s.scene), len(order))))
    methods = record.methods + tuple(m for m in before.methods if m.name not in names)
    rows = {name: place for place, name in enumerate(method.row for method in suite.methods)}
    places = [(s.track, s.scene) for s in scenes]

    def place_of(job: Job) -> tuple[int, int, int]:
        return places.index((job.track, job.scene)), rows.get(job.method, len(rows)), job.seed

    return replace(
        record,
        started=min(record.started, before.started),
        wall_s=round(record.wall_s + (before.wall_s if record.started != before.started else 0.0), 2),
        scenes=scenes,
        methods=tuple(sorted(methods, key=lambda m: rows.get(m.name, len(rows)))),
        commitment=record.commitment or before.commitment,
        results=tuple(sorted((*record.results, *old), key=lambda r: place_of(r.job))),
    )


def with_places_before(record: RunRecord, before: RunRecord) -> RunRecord:
    """Return a record that also says where its results were made that an earlier bench of the folder left.

    ``earlier`` in its environment has each such environment that differs from its own. Beginnings of the
    hashes of these results are its ``jobs``, where all places of the record before have them.

    Args:
        record: The whole, with the results that were kept or found done, and places of other machines.
        before: What the folder had.
    """
    own, last = (to_builtins(dict(one.environment)) for one in (record, before))
    of_parts: list[dict[str, Any]] = list(own.pop(EARLIER, None) or ())
    last.pop(UNSEEN, None)  # said of the record, not of the place
    places: list[dict[str, Any]] = list(last.pop(EARLIER, None) or ())
    known = {job for place in places for job in place.get("jobs", ())}
    made = [result.job_hash[:BEGINNING] for result in before.results if result.cost]
    if all("jobs" in place for place in places):
        last["jobs"] = [job for job in made if job not in known]
    places.append(last)
    there = {(_key(r.job), r.job_hash): r.cost for r in before.results if r.cost}
    kept = [r for r in record.results if r.cost and there.get((_key(r.job), r.job_hash)) == r.cost]
    stays = {result.job_hash[:BEGINNING] for result in kept}  # one that was made anew took another time
    found: list[dict[str, Any]] = []
    for place in places:
        if "jobs" not in place:  # an older record told of none
            if stays and place != own and place not in found:
                found.append(place)
            continue
        jobs = [job for job in place.pop("jobs", ()) if job in stays]
        _add(found, place, jobs, own)
    for place in of_parts:
        told = {job for other in found for job in other.get("jobs", ())}
        jobs = [job for job in place.pop("jobs", ()) if job not in told]
        _add(found, place, jobs, own)
    return replace(record, environment={**own, **({EARLIER: found} if found else {})})


def _add(found: list[dict[str, Any]], place: dict[str, Any], jobs: list[str], own: dict[str, Any]) -> None:
    """Add jobs to those of their place; of the record's own place nothing is told."""
    alike = [one for one in found if {**one, "jobs": 0} == {**place, "jobs": 0} and "jobs" in one]
    if alike:
        alike[0]["jobs"] += jobs
    elif jobs and place != own:
        found.append({**place, "jobs": jobs})


def with_places_of_fits(record: RunRecord, fitted: Iterable[tuple[FitJob, Outcome]]) -> RunRecord:
    """Return a record whose environment also says which fits other machines have made.

    Those are workers of a scheduler, and tasks of a job array whose results were found. They have the code
    of this run, or the hash of the job would be another one. ``earlier`` has each kind of machine that is
    other than the record's own, with the beginnings of the hashes of its jobs.

    Args:
        record: Of what a bench did and found.
        fitted: Its fits.
    """
    own = to_builtins(dict(record.environment))
    found: list[dict[str, Any]] = []
    for fit, outcome in fitted:
        machine = outcome.value.machine if outcome.value else None
        if machine is not None:
            _add(found, own | to_builtins(dict(machine)), [fit.job_hash[:BEGINNING]], own)
    return replace(record, environment={**own, EARLIER: found}) if found else record


def measures_nothing_new(record: RunRecord, before: RunRecord) -> bool:
    """Return whether each fit of a record is in the earlier one, by its hash and by what it took.

    That its results lay in the folder is not enough: a bench that was killed, or a part of a run, leaves
    results there which no record tells of, and the environment of the record before is not theirs.
    """
    known = {(_key(result.job), result.job_hash): result.cost for result in before.results}
    fits = [result for result in record.results if result.job.entry]
    keys = [(_key(fit.job), fit.job_hash) for fit in fits]
    return all(key in known and known[key] == fit.cost for key, fit in zip(keys, fits, strict=True))


def _key(job: Job) -> tuple[str, str, str, int]:
    return job.track, job.scene, job.method, job.seed


def _relative(path: Path, run: Path) -> str:
    """Relative to the run where it lies in it, so that a run folder can be moved."""
    path, run = path.resolve(), run.resolve()
    return path.relative_to(run).as_posix() if path.is_relative_to(run) else path.as_posix()

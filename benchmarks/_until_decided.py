# SPDX-License-Identifier: Apache-2.0
"""Run a suite, and add scenes of its reserve until claims are decided or a number of scenes is reached.

The level of each look follows from the number of scenes alone, which is planned before the first look. A run
that was cut off is gone through again from its first look: what is there is reused.
"""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from graycard import Progress
from graycard.benchmarks._run_record import RunError, measures_nothing_new, record_before
from graycard.benchmarks._runner import Bench, Measured, Terms, measure, write_run
from graycard.benchmarks._suites import Suite
from graycard.benchmarks.claims import (
    Pursued,
    claims_of_suite,
    claims_path,
    load_claims,
    made_for_others,
    pursue,
)
from graycard.eval.statistics import LEAST_SCENES, level_up_to
from graycard.io import dumps, sha256
from graycard.processes import USUAL, Limits
from graycard.records import RUN_FILE, Look, Looks, RunRecord, departures
from graycard.synth import SceneSpec

_AS_IT_IS = Terms()


@dataclass(frozen=True, slots=True)
class Plan:
    """The end of a run, fixed before its first look."""

    most: int
    """Scenes at which it ends, those of the suite included."""
    claims: tuple[str, ...] = ()
    """Names of files of claims, or paths; those that are made for the suite if empty."""


def run_until_decided(
    suite: Suite,
    run: Path,
    jobs: int,
    progress: Progress,
    plan: Plan,
    dataset: Path | None = None,
    *,
    limits: Limits = USUAL,
    terms: Terms = _AS_IT_IS,
) -> RunRecord:
    """Run a suite, add scenes until all claims that can be tested are decided, and write ``RUN/run.json``.

    Args:
        suite: What to run; its reserve has the scenes that are added, one of each kind a look.
        run: The run folder; what is there and whole is reused.
        jobs: Number of fits at a time, and of scenes where memory allows.
        progress: Called after each job.
        plan: How far it may go; the same at every call on a folder.
        dataset: Where the scenes are or go; ``RUN/dataset`` by default.
        limits: As of :func:`run_bench`.
        terms: As of :func:`run_bench`, at the budget of the suite, on scenes that are not sealed.

    Raises:
        RunError: The plan cannot be kept, or is not that which the run began with, or terms ask for other
            steps or another size than the suite.
        GraycardError: As of :func:`run_bench`, and of claims that are broken.
    """
    if departs := departures(terms.budget, terms.size):
        raise RunError(
            f"expected the suite as it is for a run until claims are decided, got one at {departs}"
        )
    names = plan.claims or tuple(claims_of_suite(suite.name))
    pursued = pursue([load_claims(name) for name in names], suite.added)
    _check_claims(suite, names, pursued)
    _check_reserve(suite, plan.most)
    files = {paper.name: claims_path(name) for paper, name in zip(pursued.papers, names, strict=True)}
    looks = Looks(plan.most, level_up_to(plan.most), {paper: sha256(file) for paper, file in files.items()})
    bench = Bench(suite, run, dataset or run / "dataset", jobs, progress, limits, suite, terms)
    before = _before(bench, looks, files)
    return _Course(bench, names, before, _batches(suite), pursued, looks).to_the_end()


def _check_claims(suite: Suite, names: Sequence[str], pursued: Pursued) -> None:
    """Refuse claims that this run cannot decide, or that it could not tell apart.

    Raises:
        RunError: There are none, they are for runs of another suite, or two papers have one name.
    """
    if not pursued.claims:
        raise RunError(
            f"expected claims to decide for suite {suite.name!r}, got none. Name some with --claims"
        )
    if others := made_for_others(suite.name, names):
        got = ", ".join(f"{name} for runs of {own!r}" for name, own in others.items())
        raise RunError(f"expected claims for runs of suite {suite.name!r}, got {got}. Mend --claims")
    papers = [paper.name for paper in pursued.papers]
    if len(set(papers)) < len(papers):
        raise RunError(f"expected claims of papers with names of their own, got {papers}. Mend --claims")


def _check_reserve(suite: Suite, wanted: int) -> None:
    """Refuse a number of scenes that a suite and its reserve do not have, or that decides nothing.

    Raises:
        RunError: It is too large or too small, or the suite has nothing to add.
    """
    scenes, added = len(suite.scenes), len(suite.added)
    least, most = max(scenes + 1, LEAST_SCENES), scenes + added
    if not added:
        raise RunError(
            f"expected suite {suite.name!r} to have scenes to add, got none: it has no [reserve]. "
            "Give it one, or leave out --until-decided"
        )
    if most < least:
        raise RunError(
            f"expected {least - scenes} or more scenes in [reserve] of suite {suite.name!r}, got {added}. "
            f"Give it more: fewer than {LEAST_SCENES} scenes in all decide nothing"
        )
    if not least <= wanted <= most:
        raise RunError(
            f"expected {least} to {most} scenes for suite {suite.name!r} and its reserve, got {wanted}. "
            "Mend --max-scenes, or give the suite a longer [reserve]"
        )


def _before(bench: Bench, looks: Looks, files: Mapping[str, Path]) -> RunRecord | None:
    """Return what the folder has of the same plan.

    Args:
        bench: The run.
        looks: As it is planned now.
        files: Of claims, by the name of the paper.

    Raises:
        RunError: It has a run of another plan, or one that cannot be read.
    """
    before = record_before(bench.run, bench.suite)
    if before is None and (bench.run / RUN_FILE).is_file():
        raise RunError(
            f"expected the plan of the run in its run.json, got one in {bench.run} that cannot be read. "
            "Put it back as it was, or choose another --out"
        )
    if before is not None and before.looks is not None:
        _refuse_other_plan(before.looks, looks, bench.run)
        planned = before.looks.claims
        changed = [str(file) for name, file in files.items() if planned[name] != looks.claims[name]]
        if before.suite_sha256 != hashlib.sha256(dumps(bench.suite).encode()).hexdigest():
            changed.append(f"the file of suite {bench.suite.name!r}")
        _refuse_changed(changed, bench.run)
    return before


def _refuse_other_plan(planned: Looks, looks: Looks, run: Path) -> None:
    """Refuse another number of scenes, or claims of other papers, than a run was planned with."""
    if planned.most != looks.most or set(planned.claims) != set(looks.claims):
        raise RunError(
            f"expected --max-scenes {planned.most} with claims {', '.join(planned.claims)}, as the run in "
            f"{run} was planned, got {looks.most} with {', '.join(looks.claims)}. A plan that changes "
            "after a look bounds no error: go on with it, or choose another --out"
        )


def _refuse_changed(files: Sequence[str], run: Path) -> None:
    """Refuse files that are not what they were when a run was planned."""
    if files:
        raise RunError(
            f"expected claims and suite as the run in {run} was planned with, got other content in "
            f"{', '.join(files)}. Rules or scenes that change after a look bound no error: "
            "undo the change, or choose another --out"
        )


def _batches(suite: Suite) -> Iterator[tuple[SceneSpec, ...]]:
    """Yield the scenes of the reserve, one of each kind at a time."""
    kinds = len(suite.reserve.scenes) if suite.reserve else 1
    for first in range(0, len(suite.added), kinds):
        yield suite.added[first : first + kinds]


@dataclass
class _Course:
    """A run on its way from look to look."""

    bench: Bench
    claims: Sequence[str]
    before: RunRecord | None
    batches: Iterator[tuple[SceneSpec, ...]]
    pursued: Pursued
    looks: Looks
    batch: Sequence[SceneSpec] = ()
    """Scenes that the next look adds."""
    all_reused: bool = True

    def to_the_end(self) -> RunRecord:
        """Look, and add scenes, until there is a reason to stop."""
        rows = tuple(method.row for method in self.bench.suite.methods)
        record = self._looked(None, self._measured(self.bench.suite), rows)
        while not self.looks.stopped:
            wanted = self.pursued.rows()
            methods = tuple(method for method in self.bench.suite.methods if method.row in wanted)
            suite = replace(
                self.bench.suite,
                scenes=tuple(self.batch),
                methods=methods,
                reserve=None,
                sealed=None,
                secret=None,
            )
            record = self._looked(record, self._measured(suite), tuple(method.row for method in methods))
        return record

    def _measured(self, suite: Suite) -> Measured:
        part = measure(replace(self.bench, suite=suite))
        self.all_reused = self.all_reused and part.all_reused
        return part

    def _looked(self, record: RunRecord | None, part: Measured, rows: tuple[str, ...]) -> RunRecord:
        """Return the record with some more scenes, judged and written."""
        found = part.record
        if record is not None:
            scenes, results = record.scenes + found.scenes, record.results + found.results
            found = replace(record, scenes=scenes, results=results)
        self.pursued = self.pursued.after(found, self.looks.level)
        added = tuple(f"{scene.track}/{scene.scene}" for scene in part.record.scenes)
        look = Look(added, rows, tuple(self.pursued.claims))
        made = (*self.looks.made, look)
        stopped, lost = self._stopped(len(found.scenes)), self.pursued.untestable
        self.looks = replace(self.looks, made=made, stopped=stopped, untestable=lost)
        found = self._timed(replace(found, looks=self.looks))
        known = self.before.looks.made if self.before and self.before.looks else ()
        if self.looks.stopped or not self.all_reused or len(made) > len(known):
            write_run(found, self.bench.run, self.claims)
        return found

    def _stopped(self, scenes: int) -> str:
        """Return why nothing more is added; empty if something is."""
        if not self.pursued.claims and self.pursued.untestable:
            return f"nothing is left to decide, but {', '.join(self.pursued.untestable)} cannot be tested"
        if not self.pursued.claims:
            return "every claim that can be tested is decided"
        if scenes >= self.looks.most:
            return f"the planned {self.looks.most} scenes are reached"
        self.batch = self._wanted(self.looks.most - scenes)
        return "" if self.batch else "the reserve has no further scene that an open claim is about"

    def _wanted(self, most: int) -> list[SceneSpec]:
        """Return the next scenes that open claims are about."""
        for batch in self.batches:
            if wanted := [spec for spec in batch if self.pursued.concerns(spec)]:
                return wanted[:most]
        return []

    def _timed(self, record: RunRecord) -> RunRecord:
        """Return the record with the time of all calls; as it was where nothing was measured anew."""
        if self.before is None:
            return replace(record, wall_s=self.bench.elapsed_s())
        if self.all_reused and measures_nothing_new(record, self.before):
            same = {"wall_s": self.before.wall_s, "environment": self.before.environment}
            return replace(record, started=self.before.started, **same)
        spent = round(self.before.wall_s + self.bench.elapsed_s(), 2)
        return replace(record, started=min(record.started, self.before.started), wall_s=spent)

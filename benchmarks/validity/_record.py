# SPDX-License-Identifier: Apache-2.0
"""Rules for a valid result that ``run.json`` alone can break."""

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from graycard import OlderRecordError, RecordError
from graycard.benchmarks._handed import GUARDS
from graycard.benchmarks._sources import PACKAGES
from graycard.eval.statistics import above_ceiling, compare_first_look
from graycard.io import to_builtins
from graycard.methods import BUILT_IN
from graycard.records import RUN_FILE, JobResult, RunRecord, Score, read_comparison

_ORIGINS = ("python", "platform", "cpu", "cores")
_SHA256 = re.compile(r"[0-9a-f]{64}")
_NO_MEAN = re.compile(r"(^|\.)(leakage|residual)(\.|$)")
"""Metrics that are correlations or ratios of sums."""
_ROUNDING = 1e-4
"""Share of a score that rounding may cost."""
_NAMED = 3
"""Files that are named, of what may be hundreds."""


@dataclass(frozen=True, slots=True)
class Breach:
    """A rule that a run breaks, or evidence that it lacks."""

    rule: str
    where: str
    what: str
    """Expectation and finding."""
    unknown: bool = False
    """True if evidence is missing, rather than against the run."""

    def __str__(self) -> str:
        """One line."""
        return f"{self.rule}: {self.where}: {self.what}"


def place_of(result: JobResult) -> str:
    """Return which fit, in words."""
    job = result.job
    return f"{job.track}/{job.scene} {job.method}, seed {job.seed}"


def scores_of(run: RunRecord) -> Iterator[tuple[JobResult, Score]]:
    """Every score with the result that it belongs to."""
    for result in run.results:
        for score in result.sheet.scores if result.sheet else ():
            yield result, score


def count_breaches(run: RunRecord) -> list[Breach]:
    """Fits, scores and views that should be there and are not."""
    if not run.results:
        return [Breach("counts", RUN_FILE, "expected fits, got none: nothing was measured", unknown=True)]
    found = [*_missing_fits(run), *_failed_fits(run)]
    by_scene: dict[tuple[str, str], list[JobResult]] = defaultdict(list)
    for result in run.results:
        by_scene[result.job.track, result.job.scene].append(result)
    for results in by_scene.values():
        found += _missing_scores([r for r in results if r.sheet])
    return found + _partly_provided(run)


def _missing_fits(run: RunRecord) -> Iterator[Breach]:
    seeds = sorted({r.job.seed for r in run.results})
    there = Counter((r.job.track, r.job.scene, r.job.method, r.job.seed) for r in run.results)
    wanted = {
        (s.track, s.scene, row, seed) for s in run.scenes for row, seed in product(run.rows_on(s), seeds)
    }
    for track, scene, method, seed in sorted(wanted | there.keys()):
        key = (track, scene, method, seed)
        expected, got = int(key in wanted), there[key]
        if expected != got:
            where = f"{track}/{scene} {method}, seed {seed}"
            yield Breach("counts", where, f"expected {expected} fit in run.json, got {got}")


def _failed_fits(run: RunRecord) -> Iterator[Breach]:
    for result in run.results:
        if result.status == "failed" or result.sheet is None:
            reason = result.reason or "no reason given"
            yield Breach("counts", place_of(result), f"expected scores, got a failure: {reason}")


def _missing_scores(results: Sequence[JobResult]) -> Iterator[Breach]:
    """Yield a breach for each score of a scene that a method lacks or has over other views than others."""
    sheets = [
        (result, {score.metric: score for score in result.sheet.scores}) for result in results if result.sheet
    ]
    metrics = dict.fromkeys(metric for _, scores in sheets for metric in scores)
    for metric in metrics:
        scored = [s[metric] for _, s in sheets if metric in s and s[metric].status == "scored"]
        views = set().union(*(score.per_view for score in scored))
        expected = max(s[metric].expected for _, s in sheets if metric in s)
        for result, scores in sheets:
            if fault := _score_fault(scores.get(metric), views, expected):
                yield Breach("counts", place_of(result), f"{metric}: {fault}")


def _score_fault(score: Score | None, views: set[str], expected: int) -> str:
    """Return what is wrong with the counts of a score; empty if nothing."""
    if score is None:
        return "expected a score, as others have on this scene, got none"
    if score.status == "failed":
        return f"expected a score, got a failure: {score.reason or 'no reason given'}"
    if score.status == "not provided":
        return ""
    if absent := sorted(views - score.per_view.keys()):
        return f"expected {len(views)} views, got none of {', '.join(absent)}"
    if views and not score.scored == score.expected == len(score.per_view):
        return (
            f"expected as many views, got {score.expected} expected, {score.scored} scored, {len(views)} kept"
        )
    if score.expected != expected:
        return f"expected {expected} to be scored, as others have on this scene, got {score.expected}"
    return ""


def _partly_provided(run: RunRecord) -> list[Breach]:
    """Metrics that a method provides on some scenes of a track and not on others."""
    states: dict[tuple[str, str, str], dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    for result, score in scores_of(run):
        states[result.job.track, result.job.method, score.metric][score.status].add(result.job.scene)
    return [
        Breach(
            "counts",
            f"{track} {method}",
            f"{metric}: expected it on all scenes or on none, got none on "
            + ", ".join(sorted(by["not provided"])),
        )
        for (track, method, metric), by in states.items()
        if by.keys() > {"not provided"}
    ]


def finite_breaches(run: RunRecord) -> list[Breach]:
    """Return values that are no finite numbers; the optimum of a privileged row may be infinite."""
    privileged = {method.name for method in run.methods if method.sees}
    found = []
    for result, score in scores_of(run):
        if score.status != "scored":
            continue
        perfect = score.optimum if result.job.method in privileged else math.nan
        named = [("the score", score.value), *score.per_view.items()]
        bad = [f"{name} is {v}" for name, v in named if v is None or not (math.isfinite(v) or v == perfect)]
        bad += [f"a factor of the gauge is {g}" for g in score.gauge or () if not math.isfinite(g)]
        if bad:
            what = f"{score.metric}: expected finite numbers, got: {', '.join(bad)}"
            found.append(Breach("finite", place_of(result), what))
    return found


def value_breaches(run: RunRecord) -> list[Breach]:
    """Return scores that do not lie among those of their views, and costs below 0.

    Means do, over views as over all pixels. Ratios of sums and correlations need not.
    """
    found = []
    for result, score in scores_of(run):
        views = [value for value in score.per_view.values() if value is not None]
        if score.status != "scored" or score.value is None or not views:
            continue
        least, most = min(views), max(views)
        room = _ROUNDING * max((abs(end) for end in (least, most) if math.isfinite(end)), default=0.0)
        if not (least - room <= score.value <= most + room or _NO_MEAN.search(score.metric)):
            what = f"expected {least:.6g} to {most:.6g}, as its views have, got {score.value:.6g}"
            found.append(Breach("values", place_of(result), f"{score.metric}: {what}"))
    for result in run.results:
        cost = result.cost
        for name, value in (("wall_s", cost.wall_s), ("cpu_s", cost.cpu_s)) if cost else ():
            if value is not None and not 0 <= value < math.inf:
                found.append(Breach("values", place_of(result), f"{name}: expected 0 or more, got {value:g}"))
    return found


def origin_breaches(run: RunRecord) -> list[Breach]:
    """Versions, hardware and commit that are missing, or a commit that the code has left."""
    found = []
    for environment in run.environments:
        packages = environment.get("packages") or {}
        found += [f"expected the version of {name}, got none" for name in PACKAGES if not packages.get(name)]
        found += [f"expected {name}, got none" for name in _ORIGINS if not environment.get(name)]
        found += [what] if (what := _code_fault(environment)) else []
    return [Breach("origin", "environment", what) for what in found]


def _code_fault(environment: Mapping[str, Any]) -> str:
    """Return what is wrong with the identity of the code, a commit or a wheel; empty if nothing."""
    commit, installed = environment.get("git_commit"), environment.get("installed")
    if isinstance(installed, Mapping) and _SHA256.fullmatch(str(installed.get("sha256"))):
        changed = installed.get("changed")
        if not isinstance(changed, Sequence):
            return "expected the files that differ from the wheel, got no list of them"
        if changed:
            named = ", ".join(map(str, changed[:_NAMED])) + ", …" * (len(changed) > _NAMED)
            return f"expected the files of the wheel, got others: {named}. Install graycard again"
        return ""
    if not commit:
        return (
            "expected the git commit of the code or the hash of its wheel, got neither. Run from a git "
            "checkout, or from an installed wheel"
        )
    if str(commit).endswith("+"):
        return f"expected the code of a commit, got {commit}: files were changed. Commit them and run again"
    return ""


def access_breaches(run: RunRecord) -> list[Breach]:
    """Fits to which truth was open, that reached for it, or were handed what their row does not declare.

    Submitted predictions are no fits: the row bears a badge instead.
    """
    declared = {method.name: set(method.sees) for method in run.methods}
    found = []
    for result in (r for r in run.results if r.status == "done" and not _is_submitted(r, run)):
        where, access = place_of(result), result.access
        if access is None or not GUARDS.fullmatch(access.guard):
            what = f"expected a record of how truth was closed, got {_evidence(result)}"
            found.append(Breach("truth", where, what, unknown=True))
            continue
        if result.job.entry.startswith("$ ") and "landlock" not in access.guard:
            what = (
                f"expected Landlock to close truth to a command, got {access.guard}, which binds no program"
            )
            found.append(Breach("truth", where, f"{what}. Fit it again on Linux 5.13 or newer", unknown=True))
        if access.refused:
            what = f"expected a fit from its capture, got an attempt to reach {', '.join(access.refused)}"
            found.append(Breach("truth", where, what))
        known = declared.get(result.job.method, set())
        if extra := sorted(name for name in access.handed if not _is_declared(name, known)):
            what = f"expected a fit that is handed what its row declares, got also {', '.join(extra)}"
            found.append(Breach("truth", where, what))
    return found


def _is_submitted(result: JobResult, run: RunRecord) -> bool:
    return not result.job.entry and result.job.method in run.submitted


def ways_of(run: RunRecord) -> dict[str, int]:
    """Return in how many fits truth was closed in which way; fits without a record of one are left out."""
    ways = (result.access.guard for result in run.results if result.access is not None)
    return dict(Counter(way for way in ways if GUARDS.fullmatch(way)))


def tellers_of(run: RunRecord) -> tuple[str, ...]:
    """Return rows with code of others that are handed truth beside other rows, which they could tell it."""
    told = [row.name for row in run.methods if row.sees and row.entry and row.entry not in BUILT_IN]
    return tuple(told) if len(run.methods) > 1 else ()


def _evidence(result: JobResult) -> str:
    """Return what a fit has of the guard's, where that is not enough, and what to do."""
    if result.access is not None:
        return f"{result.access.guard}. Fit it again"
    return "no record. Fit it again"


def _is_declared(name: str, declared: set[str]) -> bool:
    """Return whether a layer is one of those declared, or that of a light where those of all lights are."""
    stems = (layer.removesuffix("<light>") for layer in declared if layer.endswith(".<light>"))
    return name in declared or any(name.startswith(stem) for stem in stems)


def ceiling_breaches(run: RunRecord) -> list[Breach]:
    """Scores that only a prediction with the truth's own noise can have, of rows that are not handed it."""
    return [
        Breach(
            "ceiling",
            f"{a.track}/{a.scene} {a.method}, seed {a.seed}",
            f"{a.metric}: expected at most the ceiling of {a.ceiling:.2f} and a margin for chance, got "
            f"{a.value:.2f}, {a.excess:.2f} above it: the prediction holds the noise of the truth",
        )
        for a in above_ceiling(run)
        if not any("radiance" in name for name in a.handed)
    ]


def comparison_breaches(run: RunRecord, folder: Path) -> list[Breach]:
    """Return a comparison that is missing, or does not follow from the scores."""
    try:
        written = read_comparison(folder)
    except OlderRecordError as cause:
        return [Breach("comparison", "comparison.json", str(cause), unknown=True)]
    except RecordError as cause:
        return [Breach("comparison", "comparison.json", str(cause))]
    if written is None:
        what = "expected comparison.json, got none. Run `graycard bench` again: it fits nothing anew"
        return [Breach("comparison", "comparison.json", what, unknown=True)]
    where = difference(to_builtins(written), to_builtins(compare_first_look(run)))
    if where is None:
        return []
    return [
        Breach("comparison", "comparison.json", f"expected what follows from run.json, got another {where}")
    ]


def difference(one: Any, other: Any, where: str = "", tolerance: float = 1e-6) -> str | None:
    """Return where two JSON values differ, numbers by more than a share ``tolerance``; None if nowhere."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        if one.keys() != other.keys():
            return f"{where}: {', '.join(sorted(map(str, one.keys() ^ other.keys())))}"
        found = (difference(one[k], other[k], f"{where}.{k}".lstrip("."), tolerance) for k in one)
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        pairs = enumerate(zip(one, other, strict=True))
        found = (difference(a, b, f"{where}[{i}]", tolerance) for i, (a, b) in pairs)
    elif isinstance(one, float | int) and isinstance(other, float | int):
        return None if math.isclose(one, other, rel_tol=tolerance, abs_tol=1e-12) else where
    else:
        return None if one == other else where
    return next((place for place in found if place is not None), None)

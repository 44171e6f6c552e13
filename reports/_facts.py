# SPDX-License-Identifier: Apache-2.0
"""The facts of a run: where, with what, by whom and at what cost it was made."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from graycard.records import EARLIER, Edition, JobResult, RunRecord, knob_text
from graycard.reports._format import format_date, format_seconds


@dataclass(frozen=True, slots=True)
class FactGroup:
    """Facts that belong together, as pairs of name and value."""

    title: str
    facts: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class JobRow:
    """A job in the table of costs."""

    scene: str
    method: str
    seed: int
    status: str
    wall: str
    wall_s: float | None
    """The same as a number, by which rows are sorted; None where it was not measured."""
    memory: str
    job_hash: str
    predictions: str
    """SHA-256 of the predictions folder; a dash where there is none."""
    reason: str


@dataclass(frozen=True, slots=True)
class SceneHash:
    """A scene with the hash of its truth."""

    scene: str
    truth: str


def fact_groups(record: RunRecord) -> tuple[FactGroup, ...]:
    """Return the run and its environment; each mapping or list of the environment is a group of its own."""
    facts = (
        ("suite", f"{record.suite}, version {record.suite_version}"),
        *([("other than in the suite", record.departs)] if record.departs else []),
        *([("sealed scenes", _edition_words(record.edition))] if record.edition else []),
        ("started", format_date(record.started)),
        ("wall time", format_seconds(record.wall_s)),
        ("jobs", _count_jobs(record.results)),
    )
    last, *earlier = record.environments
    counted = [{**one, "jobs": len(one.get("jobs", ()))} for one in earlier]
    own = {**last, **({EARLIER: counted} if counted else {})}
    nested = {k: v for k, v in own.items() if _is_nested(v)}
    plain = tuple((k.replace("_", " "), _text(v)) for k, v in own.items() if k not in nested)
    groups = [FactGroup("Run", facts), *([FactGroup("Machine", plain)] if plain else [])]
    return tuple(
        groups + [FactGroup(k.replace("_", " ").capitalize(), flatten(v)) for k, v in nested.items()]
    )


def flatten(value: Any, prefix: str = "") -> tuple[tuple[str, str], ...]:
    """Nested mappings and lists as pairs of a path and a text."""
    if isinstance(value, Mapping):
        parts = [(f"{prefix} {str(k).replace('_', ' ')}".strip(), v) for k, v in value.items()]
    elif _is_nested(value):
        parts = [(f"{prefix} {i + 1}".strip() if len(value) > 1 else prefix, v) for i, v in enumerate(value)]
    else:
        return ((prefix or "value", _text(value)),)
    return tuple(pair for name, part in parts for pair in flatten(part, name))


def setting_text(value: str, name: str) -> str:
    """Return a setting of a scene with its unit, where it is a knob that has one; ``name`` as in a page."""
    kind, _, knob = name.partition(" ")
    return knob_text(knob.replace(" ", "_"), value) if kind == "knobs" else value


def job_rows(record: RunRecord) -> tuple[JobRow, ...]:
    """Every job with its cost and hashes, in the order of the run."""
    return tuple(_job_row(result) for result in record.results)


def scene_hashes(record: RunRecord) -> tuple[SceneHash, ...]:
    """Every scene with the hash of its truth's manifest."""
    return tuple(SceneHash(f"{s.track}/{s.scene}", s.truth_sha256) for s in record.scenes)


def _job_row(result: JobResult) -> JobRow:
    job, cost = result.job, result.cost
    return JobRow(
        scene=f"{job.track}/{job.scene}",
        method=job.method,
        seed=job.seed,
        status=result.status,
        wall=format_seconds(cost.wall_s) if cost else "–",
        wall_s=cost.wall_s if cost else None,
        memory=f"{cost.peak_memory_mib:.0f} MiB" if cost else "–",
        job_hash=result.job_hash,
        predictions=result.sheet.predictions_sha256 if result.sheet else "–",
        reason=result.reason,
    )


def _edition_words(edition: Edition) -> str:
    """Say which code and claims were fixed before sealed scenes were rendered."""
    commit = f", commit {edition.commit[:12]}" if edition.commit else ""
    return f"rendered after code and claims were fixed by {edition.tag}{commit}"


def _count_jobs(results: Sequence[JobResult]) -> str:
    failed = sum(r.status == "failed" for r in results)
    return f"{len(results)} jobs, {failed} failed" if failed else f"{len(results)} jobs, none failed"


def _is_nested(value: Any) -> bool:
    """Return true for a mapping, or a list that holds something nested; plain values are one text."""
    if isinstance(value, Mapping):
        return True
    return isinstance(value, list | tuple) and any(isinstance(v, Mapping | list | tuple) for v in value)


def _text(value: Any) -> str:
    if value is None:
        return "none"
    if isinstance(value, list | tuple):
        return ", ".join(_text(v) for v in value) or "none"
    return str(value)

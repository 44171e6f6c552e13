# SPDX-License-Identifier: Apache-2.0
"""The content of a summary: what a run found and what failed, without pictures."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from graycard import GraycardError
from graycard.records import Comparison, JobResult, Ledger, MethodStanding, MetricRecord, RunRecord
from graycard.reports._format import format_with_unit
from graycard.reports._publish import ledger_of_run
from graycard.reports._tracks import headline_of, words_of
from graycard.reports.summary._gate import GateSummary
from graycard.reports.tables._compared import Compared, compare_track
from graycard.reports.tables._summary import part_of
from graycard.reports.tables._tables import metrics_of
from graycard.reports.tables._verdicts import Kind

SUMMARY_VERSION = 1


@dataclass(frozen=True, slots=True)
class FailedScore:
    """A score that failed in a job that is done."""

    metric: str
    reason: str


@dataclass(frozen=True, slots=True)
class JobSummary:
    """One job, and how it ended."""

    track: str
    scene: str
    method: str
    seed: int
    status: str
    reason: str
    """Words of the error; empty for a job that is done."""
    scored: int
    """Number of its scores."""
    failed_scores: tuple[FailedScore, ...]
    wall_s: float | None
    """None where other code made the predictions."""
    peak_memory_mib: float | None

    @property
    def failed(self) -> bool:
        """Return true where the job or one of its scores failed."""
        return self.status == "failed" or bool(self.failed_scores)


@dataclass(frozen=True, slots=True)
class PartSummary:
    """One headline metric on one track: who is best, and how surely."""

    part: str
    """Part of a decomposition that it judges, in words."""
    metric: str
    title: str
    unit: str
    higher_is_better: bool
    best: str
    """Empty where nobody has a score of every scene."""
    mean: float | None
    interval: tuple[float, float] | None
    """95 % interval of the best row's mean over scenes."""
    kind: Kind
    verdict: str
    """In words, as ``clear lead``."""
    lead: str
    """By how much, and over whom; empty without a rival."""
    evidence: str
    tied: tuple[str, ...]
    """Rows that cannot be told from the best."""
    rows: tuple[MethodStanding, ...]
    """Every row, in the order of the run."""


@dataclass(frozen=True, slots=True)
class TrackSummary:
    """One track."""

    name: str
    scenes: int
    parts: tuple[PartSummary, ...]


@dataclass(frozen=True, slots=True)
class ClaimSummary:
    """One claim of a paper, or a question of graycard's own."""

    paper: str
    id: str
    sentence: str
    verdict: str
    why: str
    needs: str
    stability: float | None


@dataclass(frozen=True, slots=True)
class RunSummary:
    """A run in brief."""

    suite: str
    suite_version: int
    started: str
    wall_s: float
    commit: str
    """Git commit of the code; empty where none is known."""
    scenes: int
    methods: tuple[str, ...]
    submitted: tuple[str, ...]
    """Rows of predictions of other code."""
    jobs: tuple[JobSummary, ...]
    tracks: tuple[TrackSummary, ...]
    claims: tuple[ClaimSummary, ...]
    leaks: tuple[str, ...]
    """Scores better than the truth's noise allows, of rows that were handed nothing."""
    warnings: tuple[str, ...]
    """Reasons why something that the run has is not told here."""
    gate: GateSummary | None
    """None without a baseline."""
    passed: bool
    """True if there are jobs, no job and no score failed, and the gate passed where there is one."""
    format: str = "graycard-summary"
    format_version: int = SUMMARY_VERSION

    @property
    def failed_jobs(self) -> tuple[JobSummary, ...]:
        """Return the jobs that failed, or one of whose scores did."""
        return tuple(job for job in self.jobs if job.failed)


def summarise(
    run: Path, record: RunRecord, comparison: Comparison | None, gate: GateSummary | None = None
) -> RunSummary:
    """Return a run in brief.

    Args:
        run: Its folder, whose ledger is read.
        record: Of the run.
        comparison: Of its rows by the headline metrics; None for means without intervals.
        gate: Its scores against a baseline.
    """
    ledger, fault = _ledger(run)
    jobs = tuple(map(_job, record.results))
    names = dict.fromkeys([s.track for s in record.scenes] + [r.job.track for r in record.results])
    return RunSummary(
        suite=record.suite,
        suite_version=record.suite_version,
        started=record.started,
        wall_s=record.wall_s,
        commit=str(record.environment.get("git_commit") or ""),
        scenes=len(record.scenes),
        methods=tuple(method.name for method in record.methods),
        submitted=record.submitted,
        jobs=jobs,
        tracks=tuple(_track(record, comparison, name) for name in names),
        claims=_claims(ledger),
        leaks=_leaks(comparison),
        warnings=(f"claims: {fault}",) if fault else (),
        gate=gate,
        passed=bool(jobs) and not any(job.failed for job in jobs) and (gate is None or gate.passed),
    )


def headline_ids(record: RunRecord) -> tuple[str, ...]:
    """Return the metrics that a summary is about, by id."""
    tracks = dict.fromkeys(scene.track for scene in record.scenes)
    found = (metric.id for track in tracks for metric in headline_of(track, record.metrics))
    return tuple(dict.fromkeys(found))


def _ledger(run: Path) -> tuple[Ledger | None, str]:
    """Return the ledger of a run, or why it cannot be told."""
    try:
        return ledger_of_run(run), ""
    except GraycardError as fault:
        return None, str(fault)


def _job(result: JobResult) -> JobSummary:
    job, cost = result.job, result.cost
    scores = result.sheet.scores if result.sheet else ()
    return JobSummary(
        track=job.track,
        scene=job.scene,
        method=job.method,
        seed=job.seed,
        status=result.status,
        reason=result.reason,
        scored=sum(score.status == "scored" for score in scores),
        failed_scores=tuple(FailedScore(s.metric, s.reason) for s in scores if s.status == "failed"),
        wall_s=cost.wall_s if cost else None,
        peak_memory_mib=cost.peak_memory_mib if cost else None,
    )


def _track(record: RunRecord, comparison: Comparison | None, track: str) -> TrackSummary:
    results = [r for r in record.results if r.job.track == track]
    metrics = headline_of(track, metrics_of(record, results))
    compared = compare_track(comparison, record, track, metrics)
    methods = list(dict.fromkeys(r.job.method for r in results))
    return TrackSummary(
        track,
        sum(scene.track == track for scene in record.scenes),
        tuple(_part(track, metric, compared, methods) for metric in metrics),
    )


def _part(track: str, metric: MetricRecord, compared: Compared, methods: Sequence[str]) -> PartSummary:
    verdict = compared.verdicts[metric.id]
    standings = [compared.standings.get((metric.id, method)) for method in methods]
    best = compared.standings.get((metric.id, verdict.leader))
    return PartSummary(
        part=words_of(track).headline.get(metric.id, part_of(metric.group)),
        metric=metric.id,
        title=metric.title,
        unit=metric.unit,
        higher_is_better=metric.higher_is_better,
        best=verdict.leader,
        mean=best.mean if best else None,
        interval=best.interval if best else None,
        kind=verdict.kind,
        verdict=verdict.words,
        lead=verdict.lead,
        evidence=verdict.evidence,
        tied=verdict.tied,
        rows=tuple(standing for standing in standings if standing),
    )


def _claims(ledger: Ledger | None) -> tuple[ClaimSummary, ...]:
    return tuple(
        ClaimSummary(paper.title, c.id, c.sentence, c.verdict, c.suspended or c.text, c.needs, c.stability)
        for paper in (ledger.papers if ledger else ())
        for c in paper.claims
    )


def _leaks(comparison: Comparison | None) -> tuple[str, ...]:
    return tuple(
        f"{above.method} on {above.track}/{above.scene}, seed {above.seed}: {above.metric} of "
        f"{format_with_unit(above.value, above.unit)} with a ceiling of "
        f"{format_with_unit(above.ceiling, above.unit)}"
        for above in (comparison.above_ceiling if comparison else ())
        if not above.handed
    )

# SPDX-License-Identifier: Apache-2.0
"""Scores and runs on disk: every number with its protocol, its counts and its origin."""

import gc
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from graycard._errors import RecordError
from graycard.io import (
    IN_MEMORY,
    AnyPlace,
    FolderBelow,
    Label,
    Name,
    RelativePath,
    check_version,
    from_builtins,
    inside,
    read_json,
)
from graycard.records._looks import Edition, Looks
from graycard.records._size import Size, departures

RUN_FILE = "run.json"
EARLIER = "earlier"
"""Key in the environment of a record: where earlier benches of the folder, or other machines, made fits."""
UNSEEN = "files_not_looked_at"
"""Key in the environment of a published record: scenes whose files were gone when it was published."""
PUBLISHED_PAGE = "index.html"
"""The report in a published folder; a run has its own in a folder of that name."""
RECORD_VERSION = 2

HOLDS_NOISE = "the prediction holds the noise of the truth itself"
"""End of the warning of a score that is better than the truth's noise allows."""

Status = Literal["scored", "failed", "not provided"]

Invariance = Literal["global gain", "channel gain", "sign"]
"""A change of what is predicted (of a light: of its intensity) that may leave a score as it is: times one
positive factor, times one such factor for each channel, times -1. Light that surfaces receive is divided by
what albedo is multiplied by, as the photographs do not change then."""


@dataclass(frozen=True, slots=True)
class Score:
    """One number about one prediction, with all that is needed to trust it."""

    metric: Label
    """Id, as in ``albedo.psnr.channel``."""
    protocol: Label
    """Name and version of the rules (mask, gauge, colour space, pooling), as in ``graycard-1``."""
    status: Status
    value: float | None
    """None unless ``status`` is ``scored``."""
    unit: str
    higher_is_better: bool
    optimum: float
    """The value of a perfect prediction; may be infinite."""
    per_view: Mapping[RelativePath, float] = field(default_factory=dict)
    """Value by test view."""
    noise_ceiling: float | None = None
    """The best value that the truth's own noise allows; None where the truth is exact."""
    gauge: tuple[float, ...] | None = None
    """Factors applied to the prediction (R, G, B), fitted on training views; None where there is none."""
    interval: tuple[float, float] | None = None
    """95 % interval; None for a single scene, which has none."""
    expected: int = 0
    """Number of test views (or lights) that should be scored."""
    scored: int = 0
    reason: str = ""
    """Why it failed, or what is not provided."""
    warnings: tuple[str, ...] = ()
    breakdown: Mapping[str, float] = field(default_factory=dict)
    """The same number by a neighbouring rule, in the same unit: ``interior`` and ``boundary`` (pixels of
    one surface and colour, and the others), ``srgb`` or ``linear`` (the other colour space),
    ``mean_of_views`` (of PSNRs), ``debiased`` (the truth's noise taken off)."""


@dataclass(frozen=True, slots=True)
class ScoreSheet:
    """All scores of one predictions folder on one scene: what ``graycard score`` writes."""

    track: Name
    scene: Name
    method: Label
    predictions_sha256: str
    """Hash over the files of the predictions folder."""
    truth_sha256: str
    """Hash of the truth's manifest, which holds the hash of each file."""
    scores: tuple[Score, ...]
    protocols: tuple[Score, ...] = ()
    """Base colour by published protocols, one score for each that was asked for."""
    format: str = "graycard-scores"
    format_version: int = RECORD_VERSION
    warnings: tuple[str, ...] = ()
    """Oddities of the whole folder, as channels that belong to no layer; each score has its own."""
    by_metric: Mapping[str, Score] = field(
        default_factory=dict, init=False, repr=False, compare=False, metadata=IN_MEMORY
    )
    """The same scores by the id of their metric; of two with one id the first."""

    def __post_init__(self) -> None:
        found = {score.metric: score for score in reversed(self.scores)}
        object.__setattr__(self, "by_metric", found)

    def score(self, metric: str) -> Score:
        """Return the score of a metric.

        Raises:
            RecordError: The sheet has none.
        """
        if metric not in self.by_metric:
            known = [score.metric for score in self.scores]
            raise RecordError(f"expected a metric of this sheet, got {metric!r}: {known}")
        return self.by_metric[metric]


@dataclass(frozen=True, slots=True)
class Job:
    """One fit: a pure function of this record."""

    track: Name
    scene: Name
    method: Label
    """Its name in this run: the row of a table."""
    seed: int
    settings: Mapping[str, Any]
    """The method's settings, resolved."""
    entry: str = ""
    """Entry point: a name in the registry, or ``module:attribute``; two rows may share one. Empty where
    predictions of other code were submitted."""
    priors: Mapping[str, Any] = field(default_factory=dict)
    """Resolved source of priors; empty for a method that asks for none."""


@dataclass(frozen=True, slots=True)
class Cost:
    """Cost of a job."""

    wall_s: float
    peak_memory_mib: float
    """The most memory that the process of the fit held, with pages of files that are mapped, MiB."""
    counts: Mapping[str, float] = field(default_factory=dict)
    """Counts by the method itself for one held-out view, the mean over them, as ``light evaluations``."""
    cpu_s: float | None = None
    """CPU time of the fit, of its predictions, and of the fit to a scene that an object comes from, seconds,
    over all cores. None in an older record, where no system tells, and where stages were found done."""


@dataclass(frozen=True, slots=True)
class Access:
    """Access of a fit: the evidence that no truth was read."""

    guard: str
    """Way in which truth was closed to the method's process, and the version of that way."""
    capture_sha256: str
    """Hash of the manifest of the capture that was copied for the fit."""
    handed: tuple[str, ...] = ()
    """Layers of truth (and ``lights``) that were handed in as priors, sorted; empty for a fit from the
    capture alone."""
    refused: tuple[str, ...] = ()
    """Paths of truth that the method tried to open, in order, each once; it was refused them."""
    donor_sha256: str = ""
    """Hash of the manifest of the capture that an object of a composition comes from; empty without one."""
    allowed: tuple[AnyPlace, ...] = ()
    """Files and folders that it could read and change besides, as whoever ran it had asked."""


@dataclass(frozen=True, slots=True)
class JobResult:
    """End of a job."""

    job: Job
    job_hash: str
    folder: FolderBelow
    """Folder of the job, relative to the run."""
    status: Literal["done", "failed"]
    reason: str = ""
    """Why it failed."""
    sheet: ScoreSheet | None = None
    cost: Cost | None = None
    access: Access | None = None
    """Access of the fit; None in the record of a graycard that did not close the truth, and, as ``cost``,
    where predictions of other code were submitted."""


@dataclass(frozen=True, slots=True)
class SceneRecord:
    """A scene of a run."""

    track: Name
    scene: Name
    family: Name
    seed: int | None
    """None for a secret scene: its seed is in its truth, and follows from the salt of the suite."""
    folder: AnyPlace
    """``<track>/<scene>`` folder, relative to the run where it lies there; else where ``--dataset`` was."""
    truth_sha256: str
    title: str
    """One line that says what is to be seen."""
    knobs: Mapping[str, Any] = field(default_factory=dict)
    """Knobs that make it easy or hard, all of the family's; empty in the record of an older graycard."""


@dataclass(frozen=True, slots=True)
class MethodRecord:
    """A method of a run."""

    name: Label
    """The row of a table."""
    summary: str
    """One sentence."""
    sees: tuple[str, ...]
    """Names of all that it is handed beyond the capture; empty for a method that competes."""
    entry: str = ""
    """Entry point: a name in the registry, or ``module:attribute``; empty as in :class:`Job`."""
    slack: float = 1.0
    """Factor on the tolerances of a baseline that is made of this run."""
    predictions: str = ""
    """The folder from which predictions of other code were taken; empty for a method that was fitted."""
    tracks: tuple[str, ...] = ()
    """Tracks that the row runs on; all if empty."""


@dataclass(frozen=True, slots=True)
class MetricRecord:
    """Description of a metric, for the reader of a table."""

    id: Label
    title: str
    """Short, for a table head."""
    group: str
    """Group: part of the decomposition it judges, as in ``albedo``."""
    unit: str
    higher_is_better: bool
    optimum: float
    formula: str
    headline: bool
    """True if it stands in the leaderboard."""
    tolerance: float
    """By how much a score may get worse before the gate calls it a regression, in ``unit``."""
    ignores: tuple[Invariance, ...] = ()
    """The gauge groups under which the score does not change."""


@dataclass(frozen=True, slots=True)
class RunRecord:
    """A whole run: ``run.json``."""

    suite: Name
    suite_version: int
    scenes: tuple[SceneRecord, ...]
    methods: tuple[MethodRecord, ...]
    metrics: tuple[MetricRecord, ...]
    results: tuple[JobResult, ...]
    environment: Mapping[str, Any]
    """Package versions, git commit, hardware, renderer variant; of the last bench of the folder. ``earlier``
    lists those of others that made results, with ``jobs``, beginnings of their hashes."""
    started: str
    """UTC, ISO 8601."""
    wall_s: float
    suite_sha256: str = ""
    """SHA-256 of ``suite.json``, the whole suite that was run, or run a part of; empty in records from
    before it."""
    budget: float = 1.0
    """Factor on the iterations of all fits, beside what the suite asks for."""
    size: Size = field(default_factory=Size)
    """Size of pictures, views and surfels, where it is not that of the suite."""
    edition: Edition | None = None
    """Edition of a run on sealed scenes; None for any other."""
    looks: Looks | None = None
    """Looks of a run that adds scenes until claims are decided; None for any other."""
    commitment: str = ""
    """SHA-256 of the salt that secret scenes of the run follow from; empty where it has none."""
    format: str = "graycard-run"
    format_version: int = RECORD_VERSION

    def at_look(self, number: int) -> "RunRecord":
        """Return the record with the scenes of the looks up to one, counted from 0; itself without looks."""
        if self.looks is None:
            return self
        known = {scene for look in self.looks.made[: number + 1] for scene in look.scenes}
        return replace(
            self,
            scenes=tuple(s for s in self.scenes if f"{s.track}/{s.scene}" in known),
            results=tuple(r for r in self.results if f"{r.job.track}/{r.job.scene}" in known),
        )

    def rows_on(self, scene: SceneRecord) -> tuple[str, ...]:
        """Return the rows that were to be fitted on a scene.

        These are all that run on its track, but on a scene that a later look added those of that look.
        """
        made = self.looks.made if self.looks else ()
        added = (look.rows for look in made[1:] if f"{scene.track}/{scene.scene}" in look.scenes)
        own = {m.name for m in self.methods if not m.tracks or scene.track in m.tracks}
        return tuple(row for row in next(added, tuple(m.name for m in self.methods)) if row in own)

    def variants_on(self, track: str) -> frozenset[str]:
        """Rows of a track that are a method with settings of their own, while it stands there as itself."""
        names = {result.job.method for result in self.results if result.job.track == track}
        rows = [method for method in self.methods if method.name in names and not method.predictions]
        own = {method.name for method in rows}
        return frozenset(m.name for m in rows if m.entry != m.name and m.entry in own)

    @property
    def environments(self) -> tuple[Mapping[str, Any], ...]:
        """All environments in which results were made, that of the last bench first."""
        return self.environment, *(self.environment.get(EARLIER) or ())

    @property
    def departs(self) -> str:
        """Steps and size other than its suite asks for, in words; empty for none."""
        return departures(self.budget, self.size)

    @property
    def submitted(self) -> tuple[str, ...]:
        """Rows whose predictions other code has made: what that saw is not known."""
        return tuple(method.name for method in self.methods if method.predictions)


def job_folder(run: Path, result: JobResult) -> Path:
    """Return the folder of a job in a run folder.

    Raises:
        RecordError: The record names one outside of the run, or a link leads there.
    """
    return Path(run) if result.folder in ("", ".") else inside(run, result.folder, error=RecordError)


def is_published(folder: Path) -> bool:
    """Return true for a folder that `graycard publish` wrote, which is left as it is; false for a run."""
    return (Path(folder) / PUBLISHED_PAGE).is_file() and not (Path(folder) / "jobs").exists()


def is_published_run(folder: Path) -> bool:
    """Return true for a published folder with its record; false for other pages, as a site of such runs."""
    return is_published(folder) and (Path(folder) / RUN_FILE).is_file()


def read_score_sheet(path: Path) -> ScoreSheet:
    """Return the scores in a file that ``graycard score --json`` wrote.

    Raises:
        RecordError: It is missing, damaged, misspelt, or of a newer format.
    """
    return read_record(ScoreSheet, path, "graycard-scores")


def read_run(run: Path) -> RunRecord:
    """Return the record of a run folder.

    Raises:
        RecordError: It is missing, damaged, misspelt, or of a newer format.
    """
    path = Path(run) / RUN_FILE
    if not path.is_file():
        got = _runs_below(path.parent) or "none. Make one with `graycard bench`"
        raise RecordError(f"expected a run folder with run.json at {run}, got {got}")
    return read_record(RunRecord, path, "graycard-run")


def _runs_below(folder: Path) -> str:
    """Return words on a folder of run folders; empty if it holds none."""
    names = sorted(path.parent.name for path in folder.glob(f"*/{RUN_FILE}"))
    if not names:
        return ""
    listed = ", ".join(names[:9]) + ", …" * (len(names) > 9)
    return f"a folder of {len(names)} run{'s' * (len(names) > 1)}. Name one of them: {listed}"


@contextmanager
def _uncollected() -> Iterator[None]:
    """Look for no garbage meanwhile: a record has none, and looking takes as long as reading."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def read_record(cls: type[Any], path: Path, kind: str, newest: int = RECORD_VERSION) -> Any:
    """Return a record of some format from a file.

    Raises:
        RecordError: It is missing, damaged, misspelt, of another format, or of a version above ``newest``.
    """
    with _uncollected():
        data = read_json(path)
        check_version(data, newest, path)
        record = from_builtins(cls, data, RecordError, str(path))
    if record.format != kind:
        raise RecordError(f"expected {kind} in {path}, got {record.format}")
    return record

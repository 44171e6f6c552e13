# SPDX-License-Identifier: Apache-2.0
"""Check a run against all rules for a valid result."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from graycard import Progress
from graycard.benchmarks.secret._salt import Salt
from graycard.benchmarks.validity._edition import edition_breaches, sealed_breaches
from graycard.benchmarks.validity._files import (
    gauge_breaches,
    hash_breaches,
    scene_breaches,
    score_breaches,
    view_breaches,
)
from graycard.benchmarks.validity._published import held_against_history
from graycard.benchmarks.validity._record import (
    Breach,
    access_breaches,
    ceiling_breaches,
    comparison_breaches,
    count_breaches,
    finite_breaches,
    origin_breaches,
    tellers_of,
    value_breaches,
    ways_of,
)
from graycard.benchmarks.validity._secret import secret_breaches
from graycard.benchmarks.validity._suite import Standard, part_of, standard_of, suite_breaches
from graycard.benchmarks.validity._unseen import unseen_scenes
from graycard.io import silent
from graycard.processes import named, narrowed
from graycard.records import RunRecord, read_run

RULES: dict[str, str] = {
    "counts": "every method has every score of every scene with every seed, of every view",
    "suite": "scenes, seeds and settings are those of the suite, all of them on each track of the run",
    "hashes": "truth, captures, predictions and scores are the very files that were fitted and scored",
    "seeds": "the seeds of scenes are those that the scenes were made from; those of secret scenes "
    "follow from the salt that the suite is committed to (--salt)",
    "origin": "package versions, hardware and the git commit of unchanged code, or the hash of its wheel, "
    "are recorded, and of sealed scenes the tag of that commit, whose claims judge the run",
    "finite": "no score is infinite or no number, but the optimum of a row that is handed truth",
    "gauge": "gauges are those that the training views give",
    "truth": "truth was closed to every fit, and what was handed is what the method declares",
    "ceiling": "no score is better than the noise of the truth allows, but of a row that is handed it",
    "comparison": "comparison.json follows from run.json",
    "values": "the score of a scene lies among those of its views, but of ratios and correlations; no cost "
    "is below 0",
    "published": "run.json and verdicts of a published run are those that the history beside it keeps",
    "scores": "scoring the predictions again gives the same scores (only with --rescore)",
}
"""Meaning of each rule, in words."""


_WALKS: Mapping[str, Callable[[RunRecord, Path, Progress], list[Breach]]] = {
    "scenes": scene_breaches,
    "predictions": hash_breaches,
    "views": view_breaches,
    "gauges": gauge_breaches,
    "scores": score_breaches,
}
"""Checks that read many files, by what they read. Each takes long."""


@dataclass(frozen=True, slots=True)
class Validity:
    """Breaches of a run."""

    breaches: tuple[Breach, ...]
    rules: tuple[str, ...]
    """The rules that were looked at."""
    suite: str
    """Suite that the run was held against, and how that is known."""
    part: str
    """Part of the suite, in words; empty for all of it."""
    results: int
    """Number of fits that were looked at."""
    closed: Mapping[str, int] = field(default_factory=dict)
    """In how many fits truth was closed in which way: ``landlock-<version>+`` where the kernel did."""

    tellers: tuple[str, ...] = ()
    """Rows with code of others that are handed truth beside other rows."""
    submitted: tuple[str, ...] = ()
    """Rows of predictions that other code has made, and nobody watched."""
    in_history: bool = False
    """True where a history beside a published run keeps its hash and its verdicts."""
    unseen: tuple[str, ...] = ()
    """Scenes that were run elsewhere and have no file here, where these files are all that lacks."""

    @property
    def exit_code(self) -> Literal[0, 1, 2]:
        """0 valid; 1 a rule is broken; 2 none is known to be, but evidence is missing."""
        if any(not breach.unknown for breach in self.breaches):
            return 1
        return 2 if self.breaches or not self.results else 0


def check_result(
    run: Path, progress: Progress = silent, *, rescore: bool = False, salt: Salt | None = None
) -> Validity:
    """Look at every rule for a valid result.

    Args:
        run: The run folder, with the scenes where ``run.json`` says.
        progress: Called now and then.
        rescore: Also score all predictions again, which takes as long as it took the bench.
        salt: What secret scenes follow from; None where it is not opened yet.

    Raises:
        RecordError: ``run.json`` is missing, damaged, or of a newer format; or the salt is not of this suite.
    """
    record, run = read_run(run), Path(run)
    standard = standard_of(record, run)
    looks: list[Callable[[RunRecord, Path], list[Breach]]] = [
        lambda record, run: count_breaches(record),
        lambda record, run: finite_breaches(record),
        lambda record, run: value_breaches(record),
        lambda record, run: origin_breaches(record),
        lambda record, run: access_breaches(record),
        lambda record, run: ceiling_breaches(record),
        comparison_breaches,
        lambda record, run: _of_suite(record, run, standard),
        edition_breaches,
        lambda record, run: secret_breaches(record, run, standard.suite, salt),
    ]
    walks = _WALKS if rescore else {what: walk for what, walk in _WALKS.items() if what != "scores"}
    progress(0.0, "checking the record")
    changed, in_history = held_against_history(run)
    found = [*(breach for look in looks for breach in look(record, run)), *changed]
    for number, (what, walk) in enumerate(walks.items()):
        share = narrowed(progress, number / len(walks), (number + 1) / len(walks))
        found += walk(record, run, named(share, f"checking {what}"))
    rules = tuple(rule for rule in RULES if rescore or rule != "scores")
    part = part_of(record, standard.suite)
    seen = len(record.results), ways_of(record), tellers_of(record), record.submitted
    breaches = tuple(dict.fromkeys(found))
    unseen = unseen_scenes(record, run, breaches)
    return Validity(breaches, rules, standard.says, part, *seen, in_history=in_history, unseen=unseen)


def _of_suite(record: RunRecord, run: Path, standard: Standard) -> list[Breach]:
    known = suite_breaches(record, run, standard.suite) if standard.suite else []
    return [*standard.breaches, *known, *sealed_breaches(record, standard.suite)]

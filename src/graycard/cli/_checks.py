# SPDX-License-Identifier: Apache-2.0
"""The verbs that ask how far a run can be trusted, publish it, and make salts of secret scenes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro
from rich.table import Table

from graycard._errors import OutputError, RecordError
from graycard.cli._options import Json, SaltFile, optional
from graycard.cli._terminal import OK, Terminal, new_table, write_optional_json
from graycard.io import sha256, write_json
from graycard.records import (
    COMPARISON,
    RUN_FILE,
    UNSEEN,
    Comparison,
    MethodStanding,
    MetricComparison,
    MetricRecord,
    PairDifference,
    RunRecord,
    is_published,
    read_comparison,
    read_run,
)

if TYPE_CHECKING:
    from graycard.benchmarks import Salt, Validity

_Pair = tuple[MetricComparison, PairDifference]
SHOWN = 5
"""Lines of a rule that evidence is missing, of what may be hundreds alike."""


@dataclass(frozen=True)
class SaltCommand:
    """Make the salt that secret scenes of a suite follow from, or show the commitment of one. The commitment
    goes into the suite before anybody runs it, and the salt is published when all results are in.
    """

    action: Annotated[Literal["new", "show"], tyro.conf.Positional]
    """new writes 32 random bytes to a new file that its owner alone may read; show reads one."""
    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """The file of the salt: never in a run folder or a repository."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Print the commitment, never the salt."""
        from graycard.benchmarks import write_salt

        salt = write_salt(self.file) if self.action == "new" else salt_in(self.file, terminal)
        terminal.out.print(f"salt: {self.file}, commitment {salt.commitment}")
        return OK


def salt_in(path: Path, terminal: Terminal) -> Salt:
    """Return the salt in a file, and warn if others may read it.

    Raises:
        RecordError: There is none.
    """
    from graycard.benchmarks import is_exposed, read_salt

    salt = read_salt(path)
    if is_exposed(path):
        terminal.err.print(
            f"warning: others may read {path}: whoever does can render the secret scenes. Unless the salt is "
            f"opened already, run `chmod 600 {path}`"
        )
    return salt


@dataclass(frozen=True)
class CheckResultCommand:
    """Say whether a run is a valid result: 0 if so, 1 if a rule is broken, 2 if that cannot be judged."""

    run_folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The run folder, with its scenes where run.json says."""
    rescore: bool = False
    """Also score all predictions again; takes as long as it took the bench."""
    salt: SaltFile = None
    """Check that secret scenes follow from the salt in this file, and that it is the one the suite names."""
    json: Json = None
    """Also write what was found to this file."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Check every rule."""
        from graycard.benchmarks import RULES, check_result

        salt = None if self.salt is None else salt_in(self.salt, terminal)
        with terminal.progress(f"checking {self.run_folder}") as progress:
            found = check_result(self.run_folder, progress, rescore=self.rescore, salt=salt)
        is_record = is_published(self.run_folder)
        shown = [breach for breach in found.breaches if not (is_record and breach.unknown)]
        lacking = Counter[str]()
        for breach in shown:
            lacking[breach.rule] += breach.unknown
            if not breach.unknown or lacking[breach.rule] <= SHOWN:
                terminal.out.print(f"{'unknown' if breach.unknown else 'broken'}: {breach}")
        for rule, number in lacking.items():
            if number > SHOWN:
                terminal.out.print(f"unknown: {rule}: {number - SHOWN} more; --json lists them")
        for rule in dict.fromkeys(breach.rule for breach in shown):
            terminal.err.print(f"rule {rule}: {RULES[rule]}")
        write_optional_json(self.json, {"exit_code": found.exit_code, "validity": found})
        broken = sum(not breach.unknown for breach in found.breaches)
        says = {0: "valid", 1: "invalid", 2: "cannot be judged"}
        terminal.out.print(f"suite: {found.suite}")
        for way, number in found.closed.items():
            kernel = "by the kernel (Landlock)" if way.startswith("landlock") else "without Landlock"
            terminal.out.print(f"truth: closed {kernel} in {number} fits ({way})")
        for row in found.tellers:
            terminal.out.print(
                f"note: row {row!r} runs code of others and is handed truth: it could tell other rows"
            )
        for row in found.submitted:
            terminal.out.print(f"note: row {row!r} is submitted: nobody watched the code that made it")
        if is_record and found.exit_code == 2:
            unknown = list(dict.fromkeys(breach.rule for breach in found.breaches))
            says[2] = f"the records break no rule; {', '.join(unknown)} cannot be looked at again"
            terminal.out.print(
                "published: scenes and predictions are not kept. " + _vouched(self.run_folder, found)
            )
        part = f", {found.part}" if found.part else ""
        terminal.out.print(
            f"check-result: {says[found.exit_code]}{part} ({found.results} fits by {len(found.rules)} rules, "
            f"{broken} broken, {len(found.breaches) - broken} without evidence)"
        )
        return found.exit_code


def _vouched(run: Path, found: Validity) -> str:
    """Say what tells that a published record is as it was published, and what nobody looked at then."""
    unseen = read_run(run).environment.get(UNSEEN)
    but = f", but for those of {', '.join(unseen)}" if unseen else ""
    looked = f"`graycard publish` looked at them{but}"
    if found.in_history:
        return f"{looked}. The history beside it keeps a hash of run.json, which was compared"
    digest = sha256(run / RUN_FILE)
    return f"{looked}. Nothing here tells whether run.json is as it was then: compare its SHA-256, {digest}"


@dataclass(frozen=True)
class PublishCommand:
    """Keep the records and the report of a valid run, without scenes and predictions."""

    run_folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The run folder, with its scenes and predictions."""
    out: Annotated[Path, tyro.conf.arg(metavar="FOLDER")]
    """Write to this folder, new or empty. The folder above may keep a history of verdicts (history.json),
    which then grows."""
    pictures: Annotated[tuple[str, ...], optional("ROW ...")] = ()
    """Embed pictures and values of single views of these rows only; of all by default."""
    scenes: Annotated[tuple[str, ...], optional("TRACK/SCENE ...")] = ()
    """Embed pictures and values of single views of these scenes only; of all by default."""
    limit_mib: float = 20.0
    """Fail if the folder would be larger."""
    without_files: bool = False
    """Publish though scenes that an earlier bench ran elsewhere have no file here. The record names them. One
    scene has to be here, and nothing else may lack."""
    salt: SaltFile = None
    """The salt of secret scenes, which only proves that they are the right ones: it is not published."""
    json: Json = None
    """Also write what was checked and published to this file."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Publish the run, unless a rule for a valid result is broken."""
        from graycard.benchmarks import check_result
        from graycard.reports import Shown, publish_run

        salt = None if self.salt is None else salt_in(self.salt, terminal)
        with terminal.progress(f"checking {self.run_folder}") as progress:
            found = check_result(self.run_folder, progress, salt=salt)
        unseen = found.unseen if self.without_files else ()
        for breach in () if unseen else found.breaches:
            terminal.err.print(f"{'unknown' if breach.unknown else 'broken'}: {breach}")
        if found.exit_code and not unseen:
            write_optional_json(self.json, {"folder": None, "validity": found})
            absent = len(found.unseen)
            hint = f". {absent} of its scenes have no files here: see --without-files" if absent else ""
            terminal.out.print(f"publish: nothing written, the run is no valid result{hint}")
            return found.exit_code
        shown = Shown(self.pictures or None, self.scenes or None)
        size = publish_run(self.run_folder, self.out, self.limit_mib, shown, unseen)
        write_optional_json(self.json, {"folder": self.out, "mib": size, "validity": found})
        part = f", {found.part}" if found.part else ""
        told = f", without files of {', '.join(unseen)}" if unseen else ""
        terminal.out.print(f"publish: {self.out}, {size:.1f} MiB, {found.results} fits{part}{told}")
        return OK


@dataclass(frozen=True)
class CompareCommand:
    """Say which method of a run is better, by how much, and how sure that is."""

    run_folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The run folder. Its comparison.json is written anew from run.json where it says something else.
    A published folder is left as it is, and so is one that cannot be written to, with a warning."""
    metrics: Annotated[tuple[str, ...], optional("METRIC ...")] = ()
    """Compare these metrics only; those of the leaderboard by default."""
    against: Annotated[str, optional("ROW")] = ""
    """Also compare each other method with this one, chosen before its scores were seen.
    The correction is over these comparisons alone, so smaller differences are told from chance."""
    pairs: bool = False
    """Also show every two methods."""
    json: Json = None
    """Also write the comparison of all metrics to this file."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Compare the methods; no more is computed than is printed or written."""
        from graycard.eval.statistics import Question, compare_first_look

        record = read_run(self.run_folder)
        by_id = {metric.id: metric for metric in record.metrics}
        self._check_names(record)
        wanted = self.metrics or tuple(metric.id for metric in record.metrics if metric.headline)
        found = compare_first_look(record, Question(wanted, self.against, pair_intervals=self.pairs))
        shown = [table for table in found.metrics if self.metrics or _is_contested(table)]
        for table in shown:
            self._show(terminal, table, by_id[table.metric])
        self._write(record, found, terminal)
        if record.submitted:
            terminal.out.print(f"made by other code, which nobody watched: {', '.join(record.submitted)}")
        _say_skipped(terminal, [table for table in found.metrics if table not in shown])
        _say_leaks(terminal, found)
        if self.against:
            chosen = [(table, pair) for table in shown for pair in table.against]
            _say_counts(terminal, found, chosen, self.against)
        if self.pairs or not self.against:
            _say_counts(terminal, found, [(table, pair) for table in shown for pair in table.pairs])
        return OK

    def _check_names(self, record: RunRecord) -> None:
        """Refuse a metric or a row that the run has not."""
        from graycard._errors import UnknownNameError

        metrics = [metric.id for metric in record.metrics]
        for name in self.metrics:
            if name not in metrics:
                raise UnknownNameError("metric of this run", name, metrics)
        rows = [method.name for method in record.methods]
        if self.against and self.against not in rows:
            raise UnknownNameError("row of this run", self.against, rows)

    def _write(self, record: RunRecord, shown: Comparison, terminal: Terminal) -> None:
        """Write the comparison of all metrics where it lacks, is another, or is asked for.

        A run that cannot be written to is compared all the same.
        """
        from graycard.eval.statistics import Question, compare_first_look

        if not is_published(self.run_folder) and not _is_written(self.run_folder, shown):
            try:
                write_json(self.run_folder / COMPARISON, compare_first_look(record))
            except OutputError as cause:
                terminal.err.print(
                    f"warning: {COMPARISON} of the run is not up to date, and stays as it is: {cause}. "
                    "--json FILE writes the comparison elsewhere"
                )
        if self.json is not None:
            write_optional_json(self.json, compare_first_look(record, Question(against=self.against)))

    def _show(self, terminal: Terminal, table: MetricComparison, metric: MetricRecord) -> None:
        better = "higher" if metric.higher_is_better else "lower"
        terminal.out.print(
            f"\n{table.track}: {metric.title} ({metric.id}), {metric.unit}, {better} is better"
        )
        terminal.out.print(_standings(table, metric.higher_is_better))
        if table.against:
            terminal.out.print(f"against {self.against}:")
            terminal.out.print(_pairs(table, table.against))
        if self.pairs and table.pairs:
            terminal.out.print(_pairs(table, table.pairs))


def _is_written(run: Path, shown: Comparison) -> bool:
    """Return true where comparison.json says what is shown, as far as that goes; it has no chosen row."""
    from graycard.eval.statistics import RULE

    try:
        written = read_comparison(run)
    except RecordError:  # unreadable, or of another version
        return False
    return written is not None and _outline(written, shown) == replace(_outline(shown, shown), rule=RULE)


def _outline(comparison: Comparison, shown: Comparison) -> Comparison:
    """Return what two comparisons have in common if one is of all metrics: no intervals, no chosen row."""
    wanted = {(table.track, table.metric) for table in shown.metrics}
    tables = (table for table in comparison.metrics if (table.track, table.metric) in wanted)
    bare = (
        replace(table, against=(), pairs=tuple(replace(pair, interval=None) for pair in table.pairs))
        for table in tables
    )
    return replace(comparison, metrics=tuple(bare), against="")


def _is_contested(table: MetricComparison) -> bool:
    """Return true where a method that competes has a value."""
    return any(method.competes and method.mean is not None for method in table.methods)


def _say_skipped(terminal: Terminal, tables: list[MetricComparison]) -> None:
    if tables:
        names = " ".join(dict.fromkeys(table.metric for table in tables))
        terminal.out.print(
            f"skipped: {len(tables)} table{'s' * (len(tables) != 1)} in which no method that competes has a "
            f"value: --metrics {names}"
        )


def _say_leaks(terminal: Terminal, found: Comparison) -> None:
    """Say which rows know more than they were handed."""
    for above in found.above_ceiling:
        if not above.handed:
            terminal.err.print(
                f"truth has leaked: {above.track}/{above.scene} {above.method}, seed {above.seed}, "
                f"{above.metric}: {above.value:.2f} is {above.excess:.2f} above the ceiling, "
                f"{found.margins[above.unit]:g} are left to chance"
            )


def _say_counts(terminal: Terminal, found: Comparison, every: Sequence[_Pair], against: str = "") -> None:
    """Say how many of the pairs that were asked for are decided."""
    pairs = [pair for table, pair in every if _compete(table, pair)]
    few = sum(pair.scenes < found.least_scenes for pair in pairs)
    far = sum(pair.verdict == "too few scenes" for pair in pairs) - few
    tied = sum(pair.verdict == "tie" for pair in pairs)
    decided = len(pairs) - few - far - tied
    handed = len(every) - len(pairs)
    asked = f" against {against}" if against else ""
    terminal.out.print(
        f"compare{asked}: {len(pairs)} pair{'s' * (len(pairs) != 1)}, {decided} decided, {tied} tied, {few} "
        f"with fewer than the {found.least_scenes} scenes that a p below {1 - found.level:.2g} needs"
        + (f", {far} with too few for so many pairs" if far else "")
        + (f"; {handed} more with a row that is handed truth, without a verdict" if handed else "")
    )


def _compete(table: MetricComparison, pair: PairDifference) -> bool:
    """Return true where neither method is handed truth: only such pairs have a verdict to show."""
    return {pair.first, pair.second} <= {method.method for method in table.methods if method.competes}


def _standings(table: MetricComparison, higher_is_better: bool) -> Table:
    """Return the standings, the best mean first, methods without a mean last."""
    shown = new_table("rank", "method", "mean", "95 % interval", "scenes", "scene sd", "seed sd", "ceiling")
    known = [row for row in table.methods if row.mean is not None]
    known.sort(key=lambda row: row.mean or 0.0, reverse=higher_is_better)
    for row in (*known, *(row for row in table.methods if row.mean is None)):
        shown.add_row(*_cells(row))
    return shown


def _cells(row: MethodStanding) -> tuple[str, ...]:
    rank = str(row.rank) if row.rank else "" if row.competes else "is handed truth"
    counts = f"{row.scenes}/{row.expected}"
    spreads = (_number(x) for x in (row.scene_sd, row.seed_sd, row.ceiling))
    return rank, row.method, _number(row.mean), _interval(row.interval), counts, *spreads


def _pairs(table: MetricComparison, pairs: Sequence[PairDifference]) -> Table:
    shown = new_table(
        "pair", "difference", "95 % interval", "scenes", "p rank", "p mean, corrected", "verdict"
    )
    for pair in pairs:
        shown.add_row(*_pair_cells(pair, _compete(table, pair)))
    return shown


def _pair_cells(pair: PairDifference, compete: bool) -> tuple[str, ...]:
    """Return a row of the table; a pair with a row that is handed truth has no corrected p and no verdict."""
    names, difference = f"{pair.first} - {pair.second}", _number(pair.difference)
    ends = (_number(pair.p_mean_corrected), pair.verdict) if compete else ("", "is handed truth")
    return names, difference, _interval(pair.interval), str(pair.scenes), _number(pair.p_rank), *ends


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def _interval(ends: tuple[float, float] | None) -> str:
    return "" if ends is None else f"{ends[0]:.4g} to {ends[1]:.4g}"

# SPDX-License-Identifier: Apache-2.0
"""Publication of a run: its records and its report, without scenes and predictions."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from graycard import OutputError, RecordError
from graycard.io import atomic_folder, read_json, sha256, to_builtins
from graycard.records import (
    CLAIMS,
    HISTORY,
    PUBLISHED_PAGE,
    RUN_FILE,
    SUITE_FILE,
    UNSEEN,
    Ledger,
    RunRecord,
    read_ledger,
    read_run,
)
from graycard.reports._scene_section import ALL, Shown
from graycard.reports._write import report_of
from graycard.reports.history._keep import KeptHistory, continue_history


def publish_run(
    run: Path, folder: Path, limit_mib: float, shown: Shown = ALL, unseen: Sequence[str] = ()
) -> float:
    """Write a folder that says what a run found, small enough for a repository.

    The verbs that read records alone (``compare``, ``claims``, ``gate``) work on it as on the run. Where on a
    machine the scenes stood is left out. A history of verdicts in the folder above is continued.

    Args:
        run: The run folder, with its scenes and predictions, of which the report shows pictures.
        folder: A new or an empty one.
        limit_mib: MiB that it may have.
        shown: Methods and scenes whose pictures and single views the report has.
        unseen: Scenes, as ``track/scene``, whose files nobody could look at; the record then names them.

    Returns:
        Its size in MiB.

    Raises:
        RecordError: There is no ``run.json``, it is damaged, or it has no method or scene of such a name. The
            ledger is damaged, of an older format or of another run. A verdict changed and the history says no
            reason. The run has other steps or another size than its suite, beside a history of the suite.
        OutputError: It would be larger than the limit, or it cannot be written, or is in use.
    """
    run = Path(run)
    record, ledger = read_run(run), ledger_of_run(run)
    _refuse_departures(record, Path(folder).parent)
    told = {UNSEEN: list(unseen)} if unseen else {}
    page = report_of(run, shown, replace(record, environment={**record.environment, **told}))
    content = {PUBLISHED_PAGE: page, **_kept_records(run, ledger, told)}
    sizes = {name: len(data) / 2**20 for name, data in content.items()}
    whole = sum(sizes.values())
    if whole > limit_mib:
        parts = ", ".join(f"{name} {size:.1f}" for name, size in sizes.items())
        raise OutputError(
            f"expected {limit_mib:g} MiB at most, got {whole:.1f} ({parts}). Name fewer methods for "
            "--pictures or fewer scenes for --scenes, or raise --limit-mib"
        )
    kept = _continued(Path(folder), content, record.started)
    with atomic_folder(folder) as partial:
        for name, data in content.items():
            (partial / name).write_bytes(data)
    if kept:
        kept.write()
    return whole


def _refuse_departures(record: RunRecord, folder: Path) -> None:
    """Refuse a run that is not as its suite asks where a folder keeps the history of the suite's verdicts.

    Raises:
        RecordError: It is one.
    """
    if record.departs and (folder / HISTORY).is_file():
        raise RecordError(
            f"expected a run as {record.suite} asks for, as {folder} keeps the history of its verdicts, got "
            f"one at {record.departs}. Publish it elsewhere"
        )


def ledger_of_run(run: Path) -> Ledger | None:
    """Return the ledger beside a ``run.json``, of which it must be; None where claims were not judged.

    Raises:
        RecordError: It is damaged or of another format, or ``run.json`` is not the one that it was made from.
    """
    ledger = read_ledger(run)
    if ledger is None or ledger.run_sha256 == (found := sha256(Path(run) / RUN_FILE)):
        return ledger
    of = f"run.json {ledger.run_sha256[:12]}" if ledger.run_sha256 else "no run"
    raise RecordError(
        f"expected {Path(run) / CLAIMS} to be of run.json {found[:12]}, got one of {of}. "
        f"Judge the run again: graycard claims {run}"
    )


def _kept_records(run: Path, ledger: Ledger | None, told: Mapping[str, list[str]]) -> dict[str, bytes]:
    """Return the files that are kept, by name, with what is told beside the environment of the run.

    The comparison is none of them, as it follows from the run.
    """
    record = read_json(run / RUN_FILE)
    record["environment"] |= told
    record["scenes"] = [s | {"folder": f"dataset/{s['track']}/{s['scene']}"} for s in record["scenes"]]
    found = {RUN_FILE: _packed(record)}
    if (run / SUITE_FILE).is_file():
        found[SUITE_FILE] = (run / SUITE_FILE).read_bytes()  # run.json has its hash
    if ledger is not None:
        beside = hashlib.sha256(found[RUN_FILE]).hexdigest()  # the same numbers, laid out otherwise
        found[CLAIMS] = _packed(to_builtins(replace(ledger, run_sha256=beside)))
    return found


def _continued(folder: Path, content: Mapping[str, bytes], started: str) -> KeptHistory | None:
    """Return the history above a folder with the ledger to lie in it; None where there is none of either."""
    if CLAIMS not in content:
        return None
    return continue_history(folder.parent, f"{folder.name}/{CLAIMS}", json.loads(content[CLAIMS]), started)


def _packed(record: object) -> bytes:
    return json.dumps(record, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode() + b"\n"

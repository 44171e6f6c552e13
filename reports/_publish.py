# SPDX-License-Identifier: Apache-2.0
"""What of a run is kept and shown to others: its records and its report, without scenes and predictions."""

import hashlib
import json
from collections.abc import Collection, Mapping
from pathlib import Path

from graycard import OutputError
from graycard.io import atomic_folder, sha256
from graycard.records import CLAIMS, PUBLISHED_PAGE
from graycard.reports._write import report_of
from graycard.reports.history._keep import KeptHistory, continue_history

SUITE = "suite.json"
RECORDS = ("run.json", SUITE, CLAIMS)
"""Files of a run that are kept. All but the first may be missing. The comparison is none of them: it follows
from the first."""


def publish_run(run: Path, folder: Path, limit_mib: float, pictures: Collection[str] | None = None) -> float:
    """Write a folder that says what a run found, small enough for a repository.

    The verbs that read records alone (``compare``, ``claims``, ``gate``) work on it as on the run. Where on a
    machine the scenes stood is left out. A history of verdicts in the folder above is continued.

    Args:
        run: The run folder, with its scenes and predictions, of which the report shows pictures.
        folder: A new or an empty one.
        limit_mib: MiB that it may have.
        pictures: Methods whose pictures and single views the report has; None for all.

    Returns:
        Its size in MiB.

    Raises:
        RecordError: There is no ``run.json``, it is damaged, or it has no method of such a name; or a verdict
            changed and the history says no reason.
        OutputError: It would be larger than the limit, or it cannot be written, or is in use.
    """
    files = {name: Path(run) / name for name in RECORDS}
    content = {PUBLISHED_PAGE: report_of(Path(run), pictures)}
    records = {name: json.loads(path.read_bytes()) for name, path in files.items() if path.is_file()}
    records["run.json"]["scenes"] = [
        scene | {"folder": f"dataset/{scene['track']}/{scene['scene']}"}
        for scene in records["run.json"]["scenes"]
    ]
    content |= {name: _packed(record) for name, record in records.items()}
    if SUITE in records:
        content[SUITE] = files[SUITE].read_bytes()  # run.json has its hash
    if CLAIMS in records and records[CLAIMS].get("run_sha256") == sha256(files["run.json"]):
        beside = hashlib.sha256(content["run.json"]).hexdigest()  # the same numbers, laid out otherwise
        content[CLAIMS] = _packed(records[CLAIMS] | {"run_sha256": beside})
    sizes = {name: len(data) / 2**20 for name, data in content.items()}
    whole = sum(sizes.values())
    if whole > limit_mib:
        parts = ", ".join(f"{name} {size:.1f}" for name, size in sizes.items())
        raise OutputError(
            f"expected {limit_mib:g} MiB at most, got {whole:.1f} ({parts}). Name fewer methods for "
            "--pictures, or raise --limit-mib"
        )
    kept = _continued(Path(folder), content)
    with atomic_folder(folder) as partial:
        for name, data in content.items():
            (partial / name).write_bytes(data)
    if kept:
        kept.write()
    return whole


def _continued(folder: Path, content: Mapping[str, bytes]) -> KeptHistory | None:
    """Return the history above a folder with the ledger to lie in it; None where there is none of either."""
    if CLAIMS not in content:
        return None
    started = json.loads(content["run.json"]).get("started", "")
    return continue_history(folder.parent, f"{folder.name}/{CLAIMS}", json.loads(content[CLAIMS]), started)


def _packed(record: object) -> bytes:
    return json.dumps(record, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode() + b"\n"

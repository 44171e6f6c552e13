# SPDX-License-Identifier: Apache-2.0
"""From a run folder to ``RUN/report/index.html``."""

from collections.abc import Collection
from pathlib import Path

from graycard import RecordError
from graycard.io import write_bytes
from graycard.records import read_run
from graycard.reports._page import build_page
from graycard.reports._templates import render_page


def write_report(run: Path, pictures: Collection[str] | None = None, *, out: Path | None = None) -> Path:
    """Write the report of a run: one HTML file without any reference to another host or file.

    A pure function of the files of the run: the same run gives the same bytes. What is missing or
    broken (a failed job, a scene folder that is gone) is said in its place.

    Args:
        run: The run folder, with ``run.json``.
        pictures: Methods whose pictures are embedded; None for all. Tables have all in any case.
        out: The file; None for ``RUN/report/index.html``.

    Returns:
        The path of the report.

    Raises:
        RecordError: There is no ``run.json``, or it is damaged or of a newer format, or the run has no method
            of such a name.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    path = Path(run) / "report" / "index.html" if out is None else out
    write_bytes(path, report_of(Path(run), pictures))
    return path


def report_of(run: Path, pictures: Collection[str] | None = None) -> bytes:
    """The bytes of that file; arguments and errors as in :func:`write_report`."""
    record = read_run(run)
    known = [method.name for method in record.methods]
    if pictures is not None and (strange := sorted(set(pictures) - set(known))):
        raise RecordError(
            f"expected pictures of methods of the run ({', '.join(known)}), got {', '.join(strange)}. "
            "Name some of the former"
        )
    return render_page(build_page(record, run, pictures)).encode()

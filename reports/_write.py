# SPDX-License-Identifier: Apache-2.0
"""From a run folder to ``RUN/report/index.html``."""

from pathlib import Path

import graycard as gc
from graycard.reports._page import build_page
from graycard.reports._templates import render_page


def write_report(run: Path) -> Path:
    """Write the report of a run: one HTML file without any reference to another host or file.

    A pure function of the files of the run: the same run gives the same bytes. What is missing or
    broken (a failed job, a scene folder that is gone) is said in its place.

    Args:
        run: The run folder, with ``run.json``.

    Returns:
        The path of the report, ``RUN/report/index.html``.

    Raises:
        RecordError: There is no ``run.json``, or it is damaged or of a newer format.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    record = gc.read_run(Path(run))
    path = Path(run) / "report" / "index.html"
    gc.write_bytes(path, render_page(build_page(record, Path(run))).encode())
    return path

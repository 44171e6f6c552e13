# SPDX-License-Identifier: Apache-2.0
"""From a run folder to ``RUN/report/index.html``."""

from collections.abc import Collection, Sequence
from pathlib import Path

from graycard import RecordError
from graycard.io import read_text, remove, write_bytes
from graycard.records import PUBLISHED_PAGE, Comparison, RunRecord, is_published, read_run
from graycard.reports._page import Page, build_page
from graycard.reports._scene_section import ALL, Shown
from graycard.reports.history._remake import kept_of_run
from graycard.reports.parts._render import render_files, render_page

MAX_BYTES = 15_000_000
"""A larger report has its scenes in files of their own."""


def write_report(
    run: Path,
    shown: Shown = ALL,
    *,
    out: Path | None = None,
    one_file: bool = False,
    comparison: Comparison | None = None,
    record: RunRecord | None = None,
) -> Path:
    """Write the report of a run without any reference to another host.

    A pure function of the files of the run: the same run gives the same bytes. What is missing or
    broken (a failed job, a scene folder that is gone) is said in its place.

    Args:
        run: The run folder, with ``run.json``; of a published one the pictures of its page are kept.
        shown: Methods and scenes whose pictures are embedded.
        out: The file; None for ``RUN/report/index.html``.
        one_file: Write one file however large; else a report above 15 MB has its scenes in files beside it.
        comparison: Of its methods; None for that in the folder.
        record: Of the run, where it was read before; None to read it.

    Returns:
        The path of the report.

    Raises:
        RecordError: There is no ``run.json``, or it is damaged or of a newer format, or the run has no method
            or scene of such a name. The page of a published run has no pictures that can be read.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    path = Path(run) / "report" / "index.html" if out is None else out
    page = _page_of(Path(run), shown, comparison, record)
    whole = render_page(page).encode()
    folder, written = f"{path.stem}-scenes", set[Path]()
    if one_file or len(whole) <= MAX_BYTES:
        write_bytes(path, whole)
    else:
        for name, text in render_files(page, path.name, folder):
            write_bytes(path.parent / name, text.encode())
            written.add(path.parent / name)
    for old in (path.parent / folder).glob("track-*-scene-*.html"):
        if old.is_file() and old not in written:
            remove(old)  # of an earlier report, which had more scenes
    return path


def report_of(run: Path, shown: Shown = ALL, record: RunRecord | None = None) -> bytes:
    """Return the bytes of the report in one file; arguments and errors as in :func:`write_report`.

    Args:
        run: The run folder.
        shown: Methods and scenes whose pictures it has.
        record: What it tells of the run; None: what ``run.json`` does.
    """
    return render_page(_page_of(run, shown, record=record)).encode()


def _page_of(
    run: Path,
    shown: Shown,
    comparison: Comparison | None = None,
    record: RunRecord | None = None,
) -> Page:
    record = read_run(run) if record is None else record
    _check_names("methods", shown.methods, [method.name for method in record.methods])
    _check_names("scenes", shown.scenes, [f"{scene.track}/{scene.scene}" for scene in record.scenes])
    kept = kept_of_run(read_text(run / PUBLISHED_PAGE, "HTML"), record) if is_published(run) else None
    return build_page(record, run, shown, comparison, kept)


def _check_names(what: str, named: Collection[str] | None, known: Sequence[str]) -> None:
    if strange := sorted(set(named or ()) - set(known)):
        raise RecordError(
            f"expected pictures of {what} of the run ({', '.join(known)}), got {', '.join(strange)}. "
            "Name some of the former"
        )

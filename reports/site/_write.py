# SPDX-License-Identifier: Apache-2.0
"""From published runs to a folder of static pages."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from graycard import OutputError
from graycard.io import dumps, inside, read_bytes, read_json, remove, write_bytes
from graycard.reports.history._keep import HISTORY_PAGE
from graycard.reports.history._page import render_history
from graycard.reports.site._claims import SitePaper, site_papers
from graycard.reports.site._pages import site_pages
from graycard.reports.site._runs import Compare, SiteRun, site_run
from graycard.reports.site._sources import SITE, Kept, Published, histories, published_runs, tables_of

SITE_FORMAT, SITE_VERSION = "graycard-site", 1


def write_site(places: Sequence[Path], out: Path, compare: Compare) -> tuple[Path, ...]:
    """Write static pages about published runs, which open offline and ask no host for anything.

    Args:
        places: Published folders, or folders that hold such. Where a history stands beside one it is told.
        out: A new or an empty folder, or one with such pages, which are replaced.
        compare: Returns the comparison of the rows of a run by its headline metrics.

    Returns:
        The files, the first page last.

    Raises:
        RecordError: A place holds no published run, two have one name, or a record is damaged.
        OutputError: The folder holds something else, or cannot be written to.
    """
    runs = published_runs(places)
    kept = histories(runs)
    papers = site_papers(runs, tables_of(kept), kept)
    told = tuple(site_run(run, compare) for run in runs)
    old = _old_files(Path(out))
    pages = dict(_files(papers, told, kept))
    reports = {f"runs/{run.name}/index.html": run for run in runs}
    listed = sorted([*pages, *reports, SITE])
    for file in old:
        if file not in listed:
            remove(inside(Path(out), file, error=OutputError))
    for file, run in reports.items():
        write_bytes(inside(Path(out), file, error=OutputError), read_bytes(run.report))
    pages[SITE] = dumps(_for_programs(papers, told, runs, listed))
    for file in sorted(pages, key=lambda name: name == "index.html"):
        write_bytes(inside(Path(out), file, error=OutputError), pages[file].encode())
    return tuple(Path(out) / file for file in sorted(listed, key=lambda name: name == "index.html"))


def _files(
    papers: Sequence[SitePaper], runs: Sequence[SiteRun], kept: Sequence[Kept]
) -> Iterator[tuple[str, str]]:
    names = [HISTORY_PAGE if not n else f"history-{n + 1}.html" for n in range(len(kept))]
    titles = [f"History of {one.folder.name}" if len(kept) > 1 else "History" for one in kept]
    yield from site_pages(papers, runs, zip(names, titles, strict=True))
    for name, one in zip(names, kept, strict=True):
        yield name, render_history(one.history, one.reasons, "index.html")


def _old_files(out: Path) -> list[str]:
    """Return the files of a site that a folder already holds.

    Raises:
        OutputError: It holds something else.
    """
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return []
    refused = OutputError(
        f"expected a new or an empty folder, or one with pages of `graycard site`, at {out}, got one in use. "
        "Choose another"
    )
    if not (out / SITE).is_file():
        raise refused
    data = read_json(out / SITE)
    if not isinstance(data, dict) or data.get("format") != SITE_FORMAT:
        raise refused
    return [file for file in data.get("files", []) if isinstance(file, str)]


def _for_programs(
    papers: Sequence[SitePaper], runs: Sequence[SiteRun], published: Sequence[Published], files: list[str]
) -> dict[str, Any]:
    """Return what pages say of runs and claims, for programs."""
    return {
        "format": SITE_FORMAT,
        "format_version": SITE_VERSION,
        "files": files,
        "runs": [
            {"name": run.name, "suite": run.suite, "version": run.version, "pictures": run.pictures,
             "date": run.date, "commit": run.commit, "claims": one.ledger is not None}
            for run, one in zip(runs, published, strict=True)
        ],
        "papers": papers,
    }  # fmt: skip

# SPDX-License-Identifier: Apache-2.0
"""New verdicts in what is published already: the run stays, its ledger, page and history follow the rules."""

import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Final

from markupsafe import escape

from graycard import RecordError
from graycard.io import to_builtins, write_bytes, write_json
from graycard.records import CLAIMS, Ledger, read_run
from graycard.reports._claims import section_of
from graycard.reports._templates import asset, content_policy, environment
from graycard.reports.history._keep import KeptHistory, continue_history

_SECTION: Final = re.compile(r'<section class="claims".*?</section>', re.DOTALL)
_STYLE: Final = re.compile(r"(?<=<style>)(.*?)(?=</style>)", re.DOTALL)
_SCRIPT: Final = re.compile(r"<script>(.*?)</script>", re.DOTALL)
_POLICY: Final = re.compile(r'(?<=http-equiv="Content-Security-Policy" content=")[^"]*')
_OF_PAGE: Final = re.compile(r"^\.bar\.", re.MULTILINE)
"""Begin of the rules that a page has for itself, after those of all pages."""


def republish_claims(folder: Path, ledger: Ledger) -> KeptHistory | None:
    """Write new verdicts of a published run into its ledger, its page and the history above it.

    All is rendered before the first file is written, so what is refused leaves the folder as it was.

    Args:
        folder: A published folder.
        ledger: Verdicts of its run.

    Returns:
        The history as it is now; None where the folder above keeps none.

    Raises:
        RecordError: A verdict changed and the history says no reason, or the page has no section of claims or
            no style and script of a report.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    data, page = to_builtins(ledger), Path(folder) / "index.html"
    packed = json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False) + "\n"
    file = f"{Path(folder).resolve().name}/{CLAIMS}"
    kept = continue_history(Path(folder).resolve().parent, file, data, read_run(folder).started)
    old = page.read_text(encoding="utf-8")
    if not _SECTION.search(old):
        raise RecordError(f"expected a section of claims in {page}, got a page without. Publish the run anew")
    files = {
        Path(folder) / CLAIMS: packed.encode(),
        page: with_claims(old, Path(folder), ledger).encode(),
        **(kept.files() if kept else {}),
    }
    for path, content in files.items():
        write_bytes(path, content)
    return kept


def republish_tables(path: Path, ledger: Ledger) -> KeptHistory | None:
    """Write the verdicts on papers' own tables to a file, and into the history beside it.

    Raises:
        RecordError: A verdict changed and the history says no reason.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    kept = continue_history(Path(path).resolve().parent, Path(path).name, to_builtins(ledger))
    write_json(path, ledger)
    if kept:
        kept.write()
    return kept


def with_claims(page: str, run: Path, ledger: Ledger) -> str:
    """Return the published page of a run with new verdicts, and the style that they need."""
    template = environment().get_template("claims.html.j2")
    claims = template.render(page=SimpleNamespace(claims=section_of(ledger, run)))
    page = _SECTION.sub(lambda _: claims.rstrip(), page, count=1)
    found, scripts = _STYLE.search(page), _SCRIPT.search(page)
    own = _OF_PAGE.search(found[0]) if found else None
    if not (found and own and scripts):
        raise RecordError("expected a report with style and script, got a page without. Publish the run anew")
    style = asset("report.css") + found[0][own.start() :]
    page = _STYLE.sub(lambda _: style, page, count=1)
    return _POLICY.sub(lambda _: str(escape(content_policy(style, scripts[1]))), page, count=1)

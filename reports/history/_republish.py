# SPDX-License-Identifier: Apache-2.0
"""New verdicts in what is published already: run and pictures stay, ledger, page and history follow rules."""

import json
from pathlib import Path

from graycard import RecordError
from graycard.io import read_text, to_builtins, write_bytes, write_json
from graycard.records import CLAIMS, PUBLISHED_PAGE, Comparison, Ledger, read_run
from graycard.reports.history._keep import KeptHistory, continue_history
from graycard.reports.history._remake import kept_of_run, remade_page


def republish_claims(folder: Path, ledger: Ledger, comparison: Comparison) -> KeptHistory | None:
    """Write new verdicts of a published run into its ledger, its page and the history above it.

    The whole page is made anew by today's rules; only the pictures, with the scores of their scenes, stay.
    All is rendered before the first file is written, so what is refused leaves the folder as it was.

    Args:
        folder: A published folder.
        ledger: Verdicts of its run.
        comparison: Of the methods of its run.

    Returns:
        The history as it is now; None where the folder above keeps none.

    Raises:
        RecordError: A verdict changed and the history says no reason, or the page has no section of claims or
            lacks another part or is no text.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    folder = Path(folder).resolve()
    record, data, page = read_run(folder), to_builtins(ledger), folder / PUBLISHED_PAGE
    kept = continue_history(folder.parent, f"{folder.name}/{CLAIMS}", data, record.started)
    old = read_text(page, "HTML")
    if '<section class="claims"' not in old:
        raise RecordError(f"expected a section of claims in {page}, got a page without. Publish the run anew")
    packed = json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False) + "\n"
    remade = remade_page(kept_of_run(old, record), record, folder, comparison, ledger)
    files = {folder / CLAIMS: packed.encode(), page: remade.encode(), **(kept.files() if kept else {})}
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

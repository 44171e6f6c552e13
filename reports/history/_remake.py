# SPDX-License-Identifier: Apache-2.0
"""A published page made anew around its pictures: all else follows from records and today's rules."""

from dataclasses import replace
from pathlib import Path

from graycard import RecordError
from graycard.records import Comparison, Ledger, RunRecord
from graycard.reports._claims import section_of
from graycard.reports._page import build_page
from graycard.reports._scene_section import Shown
from graycard.reports.parts._kept import Kept, kept_scenes
from graycard.reports.parts._render import render_page


def kept_of_run(page: str, record: RunRecord) -> Kept:
    """Return the pictures that a published page keeps.

    Raises:
        RecordError: They cannot be read, or the page has not the scenes of the record.
    """
    kept = kept_scenes(page)
    expected = {(scene.track, scene.scene) for scene in record.scenes}
    if set(kept) != expected:
        raise RecordError(
            f"expected a page with the {len(expected)} scenes of run.json, got "
            f"{len(expected & set(kept))} of them. "
            "Publish the run anew"
        )
    return kept


def remade_page(kept: Kept, record: RunRecord, run: Path, comparison: Comparison, ledger: Ledger) -> str:
    """Return a page with the words and tables of today around pictures of before.

    Who is best, leaderboards, rules, claims and facts follow from the records; nothing else is read.

    Args:
        kept: Pictures of the page as it was.
        record: Its run.
        run: The published folder.
        comparison: Of the run, by today's rules.
        ledger: Its verdicts.
    """
    built = build_page(record, run, Shown(methods=()), comparison, kept)
    return render_page(replace(built, claims=section_of(ledger, run)))

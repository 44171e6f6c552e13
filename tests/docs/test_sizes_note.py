# SPDX-License-Identifier: Apache-2.0
"""``docs/lab-notes/2026-11-sizes.md``: its figures are those of the published runs."""

import re
from pathlib import Path

import pytest

from docs_of_editions import claims_in
from docs_of_reference import DOCS
from docs_of_sizes import effects_block, effects_of, means_block, steps_of, views_of
from graycard.records import read_run
from published import LARGE, SECOND, SIZES
from written_blocks import told_and_wanted

PAGE = DOCS / "lab-notes" / "2026-11-sizes.md"
TRACKS = {
    "dark": ("sunfaded", SECOND / "dark-sealed-2"),
    "tabletop": ("goris", SECOND / "tabletop-sealed"),
    "multilight": ("gsid", SECOND / "multilight-sealed"),
}
"""Claims and the run that judges, by track."""
COLUMNS = {
    "20 photographs": SIZES / "dark-112",
    "20, a quarter of the steps": SIZES / "dark-20-views-quarter-steps",
    "60 photographs": SIZES / "dark-60-views",
    "20, 256 x 256": SIZES / "dark-256",
    "sealed, 60, 256 x 256": LARGE / "dark-hd",
}
"""Runs of the table of photographs, by the head of their column."""
SIZE = re.compile(r"\d+(-surfels-\d+)?")
"""Rest of the name of a folder whose run stands in the table of its track."""


def runs_of(track: str) -> list[Path]:
    """Return the published runs of a track that differ in size alone."""
    return sorted(path for path in SIZES.glob(f"{track}-*") if SIZE.fullmatch(path.name[len(track) + 1 :]))


@pytest.mark.parametrize("track", TRACKS)
def test_effects_stand_beside_those_of_the_sealed_scenes(track: str):
    paper, sealed = TRACKS[track]
    told, wanted = told_and_wanted(PAGE, track, effects_block(paper, sealed, runs_of(track)))
    assert told == wanted, "run `make docs`"


@pytest.mark.parametrize("track", TRACKS)
def test_the_ledger_of_the_sealed_scenes_tells_the_same_effects(track: str):
    paper, sealed = TRACKS[track]
    found = effects_of(paper, runs_of(track))
    told = {
        (claim.id, check.id): check.at_sizes
        for claim in claims_in(sealed).values()
        for check in claim.checks
        if check.at_sizes
    }
    assert told
    for place, at_sizes in told.items():
        assert at_sizes == pytest.approx(found[place]), place


def test_the_table_of_photographs_has_the_means_of_its_runs():
    told, wanted = told_and_wanted(PAGE, "photographs", means_block(COLUMNS))
    assert told == wanted, "run `make docs`"


@pytest.mark.parametrize(
    ("small", "large", "seen"),
    [("dark-sealed-2", "dark-hd", (200, 67)), ("tabletop-sealed", "tabletop-hd", (75, 25))],
)
def test_the_edition_tells_how_often_a_fit_sees_each_photograph(
    small: str, large: str, seen: tuple[int, int]
):
    folders = SECOND / small, LARGE / large
    assert tuple(round(steps_of(read_run(folder)) / views_of(folder)) for folder in folders) == seen
    page = (DOCS / "results" / "second.md").read_text(encoding="utf-8")
    assert f"| how often a fit sees each photograph | {seen[0]} | {seen[1]} |" in page

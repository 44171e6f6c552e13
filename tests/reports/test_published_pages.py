# SPDX-License-Identifier: Apache-2.0
"""Published pages by the rules of today: who is best, and who is tied with whom."""

import re
from collections.abc import Iterator
from functools import cache
from html import unescape
from pathlib import Path
from typing import NamedTuple

import pytest

from graycard.eval.statistics import RULE, Question, compare_run
from graycard.records import Comparison, read_run
from graycard.reports.history._keep import OWN
from opened import opened
from published import published_folders

FOLDERS = published_folders()
DATA = re.compile(r'"data:[^"]*"')
BUTTON = re.compile(r"<button [^>]*>(.*?)&nbsp;")
METHOD = re.compile(r'<span class="method">(.*?)</span>')
NOTE = re.compile(r'<span class="note(?: foot)?">tied with (.*?)(?:, p\b.*?|, n = .*?)?</span>')
TRACK = re.compile(r'<th scope="col"><a href="#track-\d+">(.*?)</a></th>')
WINNER = re.compile(
    r'class="winner"><a [^>]*>(.*?)</a>.*?<span class="verdict tied">tied with (.*?)</span>', re.DOTALL
)


class Tie(NamedTuple):
    """Two methods that a page calls tied."""

    track: str
    title: str
    first: str
    second: str


def page_of(folder: Path) -> str:
    """Return a page without its pictures, all of it opened."""
    return DATA.sub('""', opened((folder / "index.html").read_text(encoding="utf-8")))


def names(listed: str) -> list[str]:
    """Return the names of a list in words."""
    return re.split(r", | and ", unescape(listed))


def board_ties(page: str) -> Iterator[Tie]:
    """Return the ties of all leaderboards."""
    for table in re.findall(r'<table class="scores leaderboard">.*?</table>', page, re.DOTALL):
        track = re.search(r"Leaderboard of track (.*?):", table)
        titles = BUTTON.findall(table)
        assert track
        for row in re.split("<tr[^>]*>", table)[2:]:
            method = METHOD.search(row)
            for title, cell in zip(titles, row.split('<td class="number')[1:], strict=False):
                for note in NOTE.findall(cell):
                    assert method
                    yield from (
                        Tie(unescape(track[1]), unescape(title), unescape(method[1]), n) for n in names(note)
                    )


def summary_ties(page: str) -> Iterator[Tie]:
    """Return the ties of the table that says who is best."""
    table = re.search(r'<table class="verdicts">.*?</table>', page, re.DOTALL)
    assert table
    tracks = [unescape(track).lower() for track in TRACK.findall(table[0])]
    assert tracks
    for row in table[0].split('<th scope="row">')[1:]:
        title = BUTTON.search(row)
        assert title
        for track, cell in zip(tracks, row.split("<td")[1:], strict=True):
            for leader, others in WINNER.findall(cell):
                yield from (Tie(track, unescape(title[1]), unescape(leader), n) for n in names(others))


@cache
def comparison_of(folder: Path) -> Comparison:
    """Return who is better by the rules of today."""
    record = read_run(folder)
    told = {unescape(title) for title in BUTTON.findall(page_of(folder))}
    metrics = [metric.id for metric in record.metrics if metric.title in told]
    return compare_run(record, Question(metrics, pair_intervals=False))


def decided(folder: Path, ties: Iterator[Tie]) -> list[Tie]:
    """Return those ties of which the comparison says something else."""
    ids = {metric.title: metric.id for metric in read_run(folder).metrics}
    found = {(table.track, table.metric): table.pairs for table in comparison_of(folder).metrics}
    return [
        tie
        for tie in ties
        if not any(
            {pair.first, pair.second} == {tie.first, tie.second} and pair.verdict == "tie"
            for pair in found[tie.track, ids[tie.title]]
        )
    ]


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_no_page_calls_a_pair_tied_that_is_decided(folder: Path):
    page = page_of(folder)
    assert len(re.findall(r'<span class="note[ a-z]*">tied with', page)) == len(NOTE.findall(page))
    assert decided(folder, board_ties(page)) == []
    assert decided(folder, summary_ties(page)) == []


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_pages_tell_the_rule_of_today_and_not_the_one_before(folder: Path):
    page = " ".join(unescape(page_of(folder)).split())
    assert re.search(r"\bHolm", page) is None
    assert RULE in page


def test_a_wrong_tie_is_seen():
    """The leader of novel views on the dark track, and the row that everybody beats."""
    folder = OWN / "dark"
    ties = [Tie("dark", "Novel view PSNR", "gray", "sunfaded")]
    assert decided(folder, iter(ties)) == ties
    title = '<button type="button">Novel view PSNR&nbsp;</button>'
    board = (
        '<table class="scores leaderboard"><caption>Leaderboard of track dark: mean</caption><tr>'
        f'{title}</tr><tr><span class="method">gray</span><td class="number">'
        '<span class="note">tied with sunfaded</span></td></tr></table>'
    )
    assert list(board_ties(board)) == ties
    summary = (
        '<table class="verdicts"><tr><th scope="col"><a href="#track-1">Dark</a></th></tr>'
        f'<tr><th scope="row">{title}</th><td><span class="winner"><a href="#track-1">gray</a>'
        '<span class="verdict tied">tied with sunfaded</span></span></td></tr></table>'
    )
    assert list(summary_ties(summary)) == ties

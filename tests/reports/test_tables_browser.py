# SPDX-License-Identifier: Apache-2.0
"""Tables of a report in a browser: how they are sorted, searched and copied."""

import csv
from dataclasses import replace
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser

from graycard.io import write_json
from graycard.records import Cost, JobResult
from graycard.reports import write_report
from graycard.reports._priors import PriorBadge
from graycard.reports._templates import environment
from graycard.reports.tables._cells import Cell
from graycard.reports.tables._tables import MethodHead
from report_pages import CHROMIUM, SCENE, open_report, settle
from runs_of_size import write_made_up

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium or google-chrome on this machine")

CELLS = """(scroll) => {
  const { left, top } = scroll.getBoundingClientRect();
  const bodies = [...scroll.querySelector('table').tBodies];
  const rows = bodies.flatMap((body) => [...body.rows]).filter((row) => row.cells.length > 1);
  return rows.map((row) => [...row.cells].map((cell) => cell.getBoundingClientRect()).map(
    (box) => [Math.round(box.left - left + 3), Math.round(box.bottom - top - 1)]));
}"""
"""A place in the left padding of each cell of a row, just above its lower edge, pixels of what scrolls."""
ALIGN = """(scroll) => {
  scroll.style.marginTop = '0px';
  const top = scroll.getBoundingClientRect().top + window.scrollY;
  scroll.style.marginTop = `${Math.ceil(top) - top}px`;
}"""
"""Parts of pixels above a table would blur the lines of cells that stick otherwise than those of others."""
COPIED = """(row) => {
  const table = document.createElement('table');
  table.innerHTML = `<tr>${row}</tr>`;
  return [...table.rows[0].cells].map(copied);
}"""


def test_rows_are_filtered_and_variants_unfold_everywhere(
    browser: Browser, report_path: Path, heard: list[str]
) -> None:
    page = open_report(browser, report_path, heard, f"{SCENE}-scores")
    page.locator(".row-filter").fill("retin")
    rows = page.locator("table.dots").first.locator("tbody tr")
    assert [row.get_attribute("data-row") for row in rows.all() if row.is_visible()] == ["retinex"]
    heads = page.locator(f"#{SCENE}-scores thead th")
    assert len([head for head in heads.all() if head.is_visible()]) == 2
    page.locator(".row-filter").fill("")
    assert len([head for head in heads.all() if head.is_visible()]) > 2
    page.close()
    assert heard == []


def test_table_is_sorted_searched_copied_and_linked(
    browser: Browser, report_path: Path, heard: list[str]
) -> None:
    page = open_report(browser, report_path, heard, "track-1-by-scene")
    open_one = page.locator("#track-1-board")
    page.evaluate("location.hash = '#track-1-board'")
    page.wait_for_selector("body[data-opened='track-1-board']")
    table = open_one.locator("table.leaderboard")
    places = "(body) => [...body.rows].map((row) => [row.dataset.row, row.cells[0].textContent])"
    before = dict(table.locator("tbody").first.evaluate(places))
    assert sorted(before.values()) == ["1", "2", "3"]
    head = table.locator("thead th").nth(2)
    head.locator(".sort").click()
    assert head.get_attribute("aria-sort") == "descending"
    first = [row.get_attribute("data-row") for row in table.locator("tbody").first.locator("tr").all()]
    head.locator(".sort").click()
    assert [
        row.get_attribute("data-row") for row in table.locator("tbody").first.locator("tr").all()
    ] != first
    assert dict(table.locator("tbody").first.evaluate(places)) == before, "a place is of the whole table"
    first_head = table.locator("thead th").first
    first_head.locator(".sort").click()
    assert first_head.get_attribute("aria-sort") == "ascending", "the best place comes first"
    said = page.locator(".row-tools [role=status]")
    for words, expected in (("nobody", "no row has this name"), ("", "")):
        page.locator(".row-filter").fill(words)
        assert said.text_content() == expected
    open_one.locator(".find").fill("steps, light")
    assert [r.get_attribute("data-row") for r in table.locator("tbody tr").all() if r.is_visible()] == [
        "retinex"
    ]
    copies = {}
    for kind in ("markdown", "csv", "latex"):
        page.evaluate("delete document.body.dataset.copied")
        open_one.locator(f"[data-copy={kind}]").click()
        page.wait_for_selector("body[data-copied]")
        copies[kind] = page.evaluate("document.body.dataset.copied")
    assert copies["markdown"].splitlines()[0].startswith("| # | Method | Novel view PSNR")
    assert copies["csv"].splitlines()[1].split(",")[1] == "retinex"
    assert copies["latex"].count("\\\\") == len(copies["csv"].splitlines())
    assert copies["latex"].startswith("\\begin{tabular}{rlr")
    assert (
        copies["latex"].count("\\textbf{")
        == copies["markdown"].count("| **")
        == table.locator("tr[data-row=retinex] td.best").count()
        > 0
    )
    assert "<sup>a</sup> |" in copies["markdown"].splitlines()[2]
    assert "\n<sup>a</sup> significance not computed, 1 scene\n" in copies["markdown"]
    assert "\\par{\\footnotesize \\#: place among all methods with their own settings}" in copies["latex"]
    assert "<sup>" not in copies["csv"]
    link = open_one.locator("a.permalink").get_attribute("href")
    page.close()
    again = open_report(browser, report_path, heard, (link or "")[1:])
    assert again.locator(link or "").is_visible()
    again.close()
    assert heard == []


def test_what_is_not_found_leaves_no_heading_behind(
    browser: Browser, report_path: Path, heard: list[str]
) -> None:
    page = open_report(browser, report_path, heard, "track-1-all")
    part = page.locator("#track-1-all")
    groups, said = part.locator("tr.group"), part.locator(".copied").first
    seen = len([row for row in groups.all() if row.is_visible()])
    part.locator(".find").first.fill("normal error")
    assert 0 < len([row for row in groups.all() if row.is_visible()]) < seen
    assert said.text_content() == ""
    part.locator(".find").first.fill("no such metric")
    assert not any(row.is_visible() for row in part.locator("tbody tr").all())
    assert said.text_content() == "no row has this"
    part.locator(".find").first.fill("")
    assert len([row for row in groups.all() if row.is_visible()]) == seen
    page.close()
    assert heard == []


def test_help_of_a_metric_stands_beside_its_name(
    browser: Browser, report_path: Path, heard: list[str]
) -> None:
    page = open_report(browser, report_path, heard, "track-1-board")
    page.mouse.move(0, 0)  # focus scrolls the page, and a name might come to lie under the mouse
    page.locator(".leaderboard .metric button").nth(1).focus()
    tip = page.locator(".leaderboard .tip").nth(1)
    page.keyboard.press("Tab")
    page.keyboard.press("Shift+Tab")
    tip.wait_for(state="visible")
    page.keyboard.press("Escape")
    tip.wait_for(state="hidden")  # a busy browser takes a moment to hear the key
    page.close()
    assert heard == []


@pytest.mark.parametrize("width", [420, 1400])
@pytest.mark.parametrize("scrolled", [0, 60])
def test_lines_of_tables_are_the_same_below_each_cell(
    browser: Browser, report_path: Path, width: int, scrolled: int
) -> None:
    """Heads of rows stick while a narrow table is scrolled, and their lines with them."""
    page = open_report(browser, report_path, [], viewport={"width": width, "height": 900})
    for part in ("track-1-board", f"{SCENE}-scores", "facts-jobs"):
        page.evaluate(f"location.hash = '#{part}'")
        page.wait_for_selector(f"body[data-opened='{part}']")
    page.evaluate(f"document.querySelectorAll('.scroll').forEach((e) => {{ e.scrollLeft = {scrolled}; }})")
    tables = [t for t in page.locator(".scroll:has(table.scores)").all() if t.is_visible()]
    assert len(tables) >= 3
    for table in tables:
        table.evaluate(ALIGN)
        settle(page)
        picture = np.asarray(Image.open(BytesIO(table.screenshot())).convert("RGB"))
        for row in table.evaluate(CELLS):
            strips = [picture[y - 4 : y + 1, x] for x, y in row if 0 <= x < picture.shape[1]]
            assert all((strip == strips[0]).all() for strip in strips)
            assert len(strips) > 1
    page.close()


def test_times_are_sorted_as_times_and_one_head_is_marked(
    browser: Browser, tmp_path: Path, heard: list[str]
) -> None:
    record = write_made_up(tmp_path, 2, 1, metrics=2)
    costs = zip(record.results, (Cost(4.2, 10.0), Cost(75.0, 9.0)), strict=True)
    write_json(tmp_path / "run.json", replace(record, results=tuple(replace(r, cost=c) for r, c in costs)))
    page = open_report(browser, write_report(tmp_path), heard, "facts-jobs")
    heads = page.locator("#facts-jobs thead th")
    heads.nth(4).locator(".sort").click()
    times = page.locator("#facts-jobs tbody td:nth-child(5)").all_text_contents()
    assert times == ["1 min 15 s", "4.2 s"]
    heads.nth(5).locator(".sort").click()
    assert "".join(heads.locator(".sort").all_text_contents()) == "↕↕↕↕↕↓↕↕"
    page.close()
    assert heard == []


def test_copies_are_safe_for_what_reads_them(browser: Browser, report_path: Path, heard: list[str]) -> None:
    page = open_report(browser, report_path, heard)
    rows = [["=1+2", "−0.5, −3"], ["@a", "-1+cmd|' /C calc'!A0"], ["a|b<i>`", "≥ 2 ± 1"]]
    cells = [[{"text": text} for text in row] for row in rows]
    written = {
        kind: page.evaluate(f"(rows) => WRITERS.{kind}(rows, 'x')", cells)
        for kind in ("csv", "markdown", "latex")
    }
    assert [*csv.reader(StringIO(written["csv"]))] == [
        ["'=1+2", "-0.5, -3"], ["'@a", "'-1+cmd|' /C calc'!A0"], ["a|b<i>`", "≥ 2 ± 1"],
    ]  # fmt: skip
    assert written["markdown"].splitlines()[-1] == "| a\\|b\\<i\\>\\` | ≥ 2 ± 1 |"
    assert "a\\textbar{}b\\textless{}i\\textgreater{}` & $\\geq$ 2 $\\pm$ 1 \\\\" in written["latex"]
    page.close()
    assert heard == []


def test_copies_have_intervals_ties_and_priors(browser: Browser, report_path: Path, heard: list[str]) -> None:
    page = open_report(browser, report_path, heard)
    tied = {"text": "2.50 (1 of 2 scored)", "lacks": "1 of 2 scored", "notes": ["tied with one", "ö & <p>"]}
    rows = [
        [{"text": "Method"}, {"text": "PSNR ↑ dB"}],
        [
            {"text": "one", "badges": ["reference", "priors: oracle 2"], "words": ["priors: oracle 2: told"]},
            {"text": "3.50", "best": True, "low": "−1.25", "high": "4.00", "notes": ["tied with two"]},
        ],
        [{"text": "two"}, tied],
        [{"text": "three"}, {"text": "2.40", "notes": ["tied with one"]}],
    ]
    written = {
        kind: page.evaluate(f"(rows) => WRITERS.{kind}(rows, 'x')", rows)
        for kind in ("csv", "markdown", "latex")
    }
    assert [*csv.reader(StringIO(written["csv"]))] == [
        ["Method", "PSNR ↑ dB: value", "PSNR ↑ dB: low", "PSNR ↑ dB: high", "PSNR ↑ dB: note"],
        ["one", "3.50", "-1.25", "4.00", ""],
        ["two", "2.50", "", "", "1 of 2 scored"],
        ["three", "2.40", "", "", ""],
    ]
    assert written["markdown"].splitlines()[2:] == [
        "| one (reference; priors: oracle 2) | **3.50** \\[−1.25, 4.00\\]<sup>a</sup> |",
        "| two | 2.50 (1 of 2 scored)<sup>b, c</sup> |",
        "| three | 2.40<sup>b</sup> |",
        "", "<sup>a</sup> tied with two",
        "", "<sup>b</sup> tied with one",
        "", "<sup>c</sup> ö & \\<p\\>",
        "", "priors: oracle 2: told",
        "", "\\[low, high\\]: 95 % interval",
    ]  # fmt: skip
    body = written["latex"].split("\\midrule\n")[1].splitlines()
    assert body[:2] == [
        "one (reference; priors: oracle 2) & \\textbf{3.50} [$-$1.25, 4.00]\\textsuperscript{a} \\\\",
        "two & 2.50 (1 of 2 scored)\\textsuperscript{b, c} \\\\",
    ]
    assert body[4:] == [
        "\\end{tabular}",
        "\\par{\\footnotesize \\textsuperscript{a} tied with two}",
        "\\par{\\footnotesize \\textsuperscript{b} tied with one}",
        "\\par{\\footnotesize \\textsuperscript{c} ö \\& \\textless{}p\\textgreater{}}",
        "\\par{\\footnotesize priors: oracle 2: told}",
        "\\par{\\footnotesize [low, high]: 95 \\% interval}",
    ]
    page.close()
    assert heard == []


def test_cells_are_copied_with_what_the_page_says_of_them(
    browser: Browser, report_path: Path, heard: list[str]
) -> None:
    macros: Any = environment().get_template("macros.html.j2").module
    head = MethodHead("goris", "A summary.", (), True, PriorBadge("oracle 2", "answers are made wrong"))
    notes = ("tied with one", "1.00 by 1 missing light", "ceiling 9.00")
    cell = Cell("scored", "3.50", 3.5, notes, interval=("3.00", "4.00"), standing=notes[0], unpaired=notes[1])
    page = open_report(browser, report_path, heard)
    copied = page.evaluate(COPIED, f"<th>{macros.method_name(head)}</th>{macros.cell(cell)}")
    help_of = "priors: oracle 2: Told more than the photographs by priors: answers are made wrong"
    assert (copied[0]["text"], copied[0]["badges"]) == ("goris", ["submitted", "priors: oracle 2"])
    assert copied[0]["words"] == [help_of]
    assert (copied[1]["text"], copied[1]["low"], copied[1]["high"]) == ("3.50", "3.00", "4.00")
    assert copied[1]["notes"] == ["tied with one", "1.00 by 1 missing light"]
    page.close()
    assert heard == []


def test_what_nobody_provides_is_hidden_until_it_is_asked_for(
    browser: Browser, tmp_path: Path, heard: list[str]
) -> None:
    record = write_made_up(tmp_path, 2, 1, metrics=2)
    silent = record.metrics[1].id
    write_json(
        tmp_path / "run.json", replace(record, results=tuple(without(r, silent) for r in record.results))
    )
    page = open_report(browser, write_report(tmp_path), heard, "track-1-all")
    rows, button = page.locator("#track-1-all tbody.nobody tr"), page.locator("#track-1-all [data-shows]")
    assert "1 metric" in (page.locator("#track-1-all .hidden-rest").text_content() or "")
    assert [row.is_visible() for row in rows.all()] == [False, False]
    button.click()
    assert [row.is_visible() for row in rows.all()] == [True, True]
    button.click()
    assert [row.is_visible() for row in rows.all()] == [False, False]
    page.close()
    assert heard == []


def without(result: JobResult, metric: str) -> JobResult:
    """Return a result that does not provide a metric."""
    assert result.sheet is not None
    scores = tuple(
        replace(score, status="not provided", value=None, per_view={}) if score.metric == metric else score
        for score in result.sheet.scores
    )
    return replace(result, sheet=replace(result.sheet, scores=scores))

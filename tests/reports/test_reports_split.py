# SPDX-License-Identifier: Apache-2.0
"""A large report as an index with its scenes beside it, and one file where that is asked for."""

import re
from html import unescape
from pathlib import Path
from urllib.parse import unquote

import pytest
from playwright.sync_api import sync_playwright

from graycard.cli import main
from graycard.reports import write_report
from graycard.reports.parts._kept import kept_scenes
from opened import parts_of
from report_pages import CHROMIUM, open_report
from runs_of_size import write_made_up


@pytest.fixture
def small_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("graycard.reports._write.MAX_BYTES", 1000)


@pytest.mark.usefixtures("small_limit")
def test_files_together_hold_what_one_file_holds(tiny_run: Path, tmp_path: Path) -> None:
    index = write_report(tiny_run, out=tmp_path / "a" / "r.html")
    whole = write_report(tiny_run, out=tmp_path / "b.html", one_file=True).read_text()
    scenes = sorted((tmp_path / "a" / "r-scenes").iterdir())
    assert [path.name for path in scenes] == [f"track-{i}-scene-1.html" for i in (1, 2, 3)]
    parts = parts_of(index.read_text())
    assert not [name for name in parts if "scene-1" in name]
    for path in scenes:
        parts |= parts_of(path.read_text())
    assert parts == parts_of(whole)
    assert kept_scenes(whole) == {k: v for path in scenes for k, v in kept_scenes(path.read_text()).items()}


@pytest.mark.usefixtures("small_limit")
@pytest.mark.skipif(CHROMIUM is None, reason="no chromium or google-chrome on this machine")
def test_links_lead_from_the_index_into_its_scenes_and_back(tiny_run: Path, tmp_path: Path) -> None:
    index, heard = write_report(tiny_run, out=tmp_path / "r.html"), []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = open_report(browser, index, heard)
        page.locator("#track-2-scene-1 a").click()
        page.wait_for_url("**/r-scenes/track-2-scene-1.html#track-2-scene-1")
        page.locator(".viewer .panes canvas").first.wait_for()
        page.get_by_role("link", name="The whole run").click()
        page.wait_for_url("**/r.html")
        page.evaluate("location.hash = '#track-3-scene-1-lights'")
        page.wait_for_url("**/r-scenes/track-3-scene-1.html#track-3-scene-1-lights")
        page.locator("svg.plan").wait_for()
        page.go_back()
        page.locator("#track-3-scene-1 a").wait_for()
        assert page.url.endswith("/r.html"), "to go back does not lead here again"
        browser.close()
    assert heard == []


def test_the_verb_writes_one_file_where_it_is_asked_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_made_up(tmp_path, 2, 1, metrics=2)
    monkeypatch.setattr("graycard.reports._write.MAX_BYTES", 1000)
    assert main(["report", str(tmp_path), "--one-file"]) == 0
    assert [path.name for path in (tmp_path / "report").iterdir()] == ["index.html"]
    assert main(["report", str(tmp_path)]) == 0
    assert sorted(path.name for path in (tmp_path / "report").iterdir()) == ["index-scenes", "index.html"]
    assert "report: " in capsys.readouterr().out


@pytest.mark.usefixtures("small_limit")
def test_links_lead_to_files_of_any_name(tmp_path: Path) -> None:
    write_made_up(tmp_path, 2, 1, metrics=2)
    index = write_report(tmp_path, out=tmp_path / "50%20 #1?&.html")
    scene = tmp_path / "50%20 #1?&-scenes" / "track-1-scene-1.html"
    for page, wanted in ((index, scene), (scene, index)):
        links = (unescape(link) for link in re.findall(r'href="([^"]*)"', page.read_text(encoding="utf-8")))
        paths = [unquote(re.split("[?#]", link)[0]) for link in links]
        assert wanted in [(page.parent / path).resolve() for path in paths if path]


@pytest.mark.usefixtures("small_limit")
def test_scenes_of_an_earlier_report_go_and_other_files_stay(tmp_path: Path) -> None:
    write_made_up(tmp_path, 2, 3, metrics=2)
    folder = write_report(tmp_path).parent / "index-scenes"
    (folder / "mine.txt").write_text("mine")
    names = [f"track-1-scene-{number}.html" for number in (1, 2, 3)]
    assert sorted(path.name for path in folder.iterdir()) == ["mine.txt", *names]
    write_made_up(tmp_path, 2, 1, metrics=2)
    write_report(tmp_path)
    assert sorted(path.name for path in folder.iterdir()) == ["mine.txt", names[0]]
    write_report(tmp_path, one_file=True)
    assert [path.name for path in folder.iterdir()] == ["mine.txt"]

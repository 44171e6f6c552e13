# SPDX-License-Identifier: Apache-2.0
"""New verdicts in a published folder."""

import re
import shutil
from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest
from markupsafe import escape

from graycard import RecordError
from graycard.cli import main
from graycard.eval.statistics import RULE, compare_run
from graycard.io import sha256, write_json
from graycard.records import (
    CLAIMS,
    COMPARISON,
    HISTORY,
    CheckResult,
    ClaimResult,
    ClaimVerdict,
    Comparison,
    Ledger,
    PaperResult,
    VerdictHistory,
    read_history,
    read_run,
)
from graycard.reports import HISTORY_PAGE, Shown, publish_run, republish_claims, republish_tables
from graycard.reports.history._entries import rules_hash
from graycard.reports.history._keep import history_text
from graycard.reports.history._reasons import REASONS
from graycard.reports.parts._islands import pack
from graycard.reports.parts._kept import kept_scenes
from opened import opened

RULES = {"better": "the sign is certain"}
EDITION = f"""
[[editions]]
name = "first"
says = "Signs have to be certain."
words = ["contradicted", "reproduced"]
rules = ["{rules_hash(RULES)}"]
"""
REASON = """
[[reasons]]
suite = "hand"
entry = 2
claims = ["M1"]
causes = ["checks changed"]
why = "Other rows."
"""


def ledger_of(verdict: ClaimVerdict, run: Path, rival: str = "theirs") -> Ledger:
    check = CheckResult(
        "psnr", "Higher", "PSNR", "dB", f"mine − {rival}", "", verdict, "as found", decides=True
    )
    claim = ClaimResult("M1", "Mine is better.", "Table 1", verdict, f"found {verdict}", "all", (check,))
    paper = PaperResult("mine", 1, "A paper", "ab", (claim,))
    return Ledger("hand", 1, sha256(run / "run.json"), 0.95, RULES, {}, (paper,))


def comparison_of(run: Path) -> Comparison:
    return compare_run(read_run(run))


@pytest.fixture
def published(tiny_run: Path, tmp_path: Path) -> Path:
    """Return a published folder with a verdict, below a history that is empty."""
    run = tmp_path / "run"
    shutil.copytree(tiny_run, run)
    write_json(run / CLAIMS, ledger_of("contradicted", run))
    write_json(run / COMPARISON, comparison_of(run))
    folder = tmp_path / "out" / "mine"
    folder.parent.mkdir()
    (folder.parent / HISTORY).write_text(history_text(VerdictHistory(())))
    (folder.parent / REASONS).write_text(EDITION)
    publish_run(run, folder, 100, Shown(["gray"]))
    return folder


def test_ledger_page_and_history_have_the_new_verdict(published: Path):
    page = (published / "index.html").read_text()
    with pytest.raises(RecordError, match="expected a reason for each verdict that changed"):
        republish_claims(published, changed_ledger(published), comparison_of(published))
    assert (published / "index.html").read_text() == page
    (published.parent / REASONS).write_text(EDITION + REASON)
    republish_claims(published, changed_ledger(published), comparison_of(published))
    found = opened((published / "index.html").read_text())
    assert '<span class="verdict reproduced">reproduced</span>' in found
    assert '<span class="verdict contradicted">contradicted</span>\n    </header>' not in found
    assert found.count('<section class="claims"') == found.count('id="claims-title"') == 1
    assert found.split("</nav>")[0].split("</style>")[1] == page.split("</nav>")[0].split("</style>")[1]
    assert found.split("What papers claim")[0].count("sha256-") == 2
    history = read_history(published.parent)
    assert [entry.claims["M1"].verdict for entry in history.entries] == ["contradicted", "reproduced"]
    assert "Other rows." in (published.parent / HISTORY_PAGE).read_text()


def test_report_of_a_published_run_keeps_its_pictures(
    published: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    page, new = (published / "index.html").read_text(), tmp_path / "new.html"
    assert main(["report", str(published)]) == 2
    assert "expected --out FILE with" in capsys.readouterr().err
    assert main(["report", str(published), "--out", str(new)]) == 0
    assert kept_scenes(new.read_text()) == kept_scenes(page)
    assert new.read_text() == page
    assert not (published / "report").exists()


def test_no_report_is_written_into_a_published_run(published: Path, capsys: pytest.CaptureFixture[str]):
    (published.parent / "link").symlink_to(published)
    before = contents(published.parent)
    runs = published, published.parent.parent / "run"
    places = "mine/index.html", "mine/new.html", "mine/deep/new.html", "link/run.json"
    for run, place, more in product(runs, places, ((), ("--summary", "md"), ("--one-file",))):
        assert main(["report", str(run), "--out", str(published.parent / place), *more]) == 2
        assert "expected --out FILE outside of published runs, got" in capsys.readouterr().err
    assert contents(published.parent) == before


def changed_ledger(folder: Path) -> Ledger:
    """Return a ledger whose claim was read from another file."""
    ledger = ledger_of("reproduced", folder, "others")
    return replace(ledger, papers=(replace(ledger.papers[0], version=2, claims_sha256="cd"),))


def test_the_same_verdicts_leave_a_page_as_it_is(published: Path):
    page = (published / "index.html").read_bytes()
    republish_claims(published, ledger_of("contradicted", published), comparison_of(published))
    assert (published / "index.html").read_bytes() == page
    assert len(read_history(published.parent).entries) == 1


def test_words_of_earlier_rules_go_and_pictures_stay(published: Path):
    """Planted: another rule, a tie and another word, as an earlier graycard wrote them."""
    path = published / "index.html"
    page = path.read_text()
    assert str(escape(RULE)) in page
    old = page.replace(str(escape(RULE)), "Corrected by Holm's method.").replace("claims-title", "old-title")
    board = re.compile(r'(data-part="track-1-board">)[^<]*')
    path.write_text(board.sub(lambda found: found[1] + pack("Ladder"), old))
    republish_claims(published, ledger_of("contradicted", published), comparison_of(published))
    found = path.read_text()
    assert found == page
    assert kept_scenes(found) == kept_scenes(old)
    assert sum(kept.pictures is not None for kept in kept_scenes(found).values()) == 3


SCENE = re.compile(r'<script type="application/octet-stream" data-kept="track-1-scene-1">[^<]*</script>')


def test_a_page_of_another_run_or_without_its_script_is_refused(published: Path):
    path = published / "index.html"
    page = path.read_text()
    before = (published / CLAIMS).read_bytes()
    for planted, told in (
        (SCENE.sub("", page), "expected a page with the 3 scenes of run.json, got 2 of them"),
        (page.replace('data-blobs="', 'data-other="'), "whose pictures cannot be read"),
        (page.replace('data-kept="track-1-scene-1">', 'data-kept="track-1-scene-1">AAAA'), "cannot be read"),
    ):
        path.write_text(planted)
        with pytest.raises(RecordError, match=told):
            republish_claims(published, ledger_of("contradicted", published), comparison_of(published))
        assert path.read_text() == planted
        assert (published / CLAIMS).read_bytes() == before


def test_a_page_without_claims_is_refused(published: Path):
    (published / "index.html").write_text("<html></html>")
    with pytest.raises(RecordError, match="expected a section of claims in .*index.html"):
        republish_claims(published, ledger_of("contradicted", published), comparison_of(published))
    (published / "index.html").write_bytes(b'<section class="claims">\xff</section>')
    with pytest.raises(RecordError, match="expected HTML in .*index.html, got what is no text"):
        republish_claims(published, ledger_of("contradicted", published), comparison_of(published))


def test_a_page_that_is_refused_leaves_every_file_as_it_was(published: Path):
    """A section of claims is there, but scenes and style of a report are not."""
    (published / "index.html").write_text('<section class="claims">old</section>')
    (published.parent / REASONS).write_text(EDITION + REASON)
    before = contents(published.parent)
    with pytest.raises(RecordError, match="expected a page with the 3 scenes"):
        republish_claims(published, changed_ledger(published), comparison_of(published))
    assert contents(published.parent) == before


def test_a_history_that_cannot_be_shown_leaves_every_file_as_it_was(
    published: Path, monkeypatch: pytest.MonkeyPatch
):
    def broken(*_: object) -> str:
        raise RecordError("expected a history to show")

    monkeypatch.setattr("graycard.reports.history._keep.render_history", broken)
    (published.parent / REASONS).write_text(EDITION + REASON)
    before = contents(published.parent)
    with pytest.raises(RecordError, match="expected a history to show"):
        republish_claims(published, changed_ledger(published), comparison_of(published))
    assert contents(published.parent) == before


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_tables_have_the_history_beside_them(published: Path, tmp_path: Path):
    ledger = Ledger("", 0, "", 0.95, RULES, {}, ledger_of("contradicted", published).papers)
    assert republish_tables(tmp_path / "tables.json", ledger) is None
    republish_tables(published.parent / "tables.json", ledger)
    assert [entry.file for entry in read_history(published.parent).entries] == [
        "mine/claims.json",
        "tables.json",
    ]


def test_nothing_to_publish_to_is_told(capsys: pytest.CaptureFixture[str]):
    assert main(["claims", "--republish"]) == 2
    assert "expected a published folder or --json FILE with --republish" in capsys.readouterr().err

# SPDX-License-Identifier: Apache-2.0
"""The site of a ledger: graycard's own, built from what is published, and one with bad names."""

import json
import re
import shutil
import xml.etree.ElementTree as Xml
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from urllib.parse import unquote

import html5lib
import pytest

from graycard import OutputError, RecordError
from graycard.cli import main
from graycard.eval.statistics import Question, compare_run
from graycard.io import from_builtins, read_json, sha256, write_json
from graycard.records import (
    CLAIMS,
    HISTORY,
    CheckResult,
    ClaimResult,
    Comparison,
    Ledger,
    PaperResult,
    RunRecord,
    VerdictHistory,
    read_history,
    read_run,
)
from graycard.reports import headline_ids, publish_run, write_site
from graycard.reports.history._changes import TABLES
from graycard.reports.history._entries import entry_of, rules_hash
from graycard.reports.history._keep import OWN
from graycard.reports.history._reasons import REASONS
from graycard.reports.site._claims import site_papers
from graycard.reports.site._sources import published_runs
from runs_of_size import write_made_up

HOSTILE = "<script>window.broken = 1</script>"
PAGES = ("index", "claims", "leaderboards", "scenes", "methods", "submit", "history")
CLAIMS_WITH_BAD_NAMES = (HOSTILE, "S1", "S1 ", "a b", "a-b", "content", "S1--title")
RULES = {"better": "the sign is certain"}
REASONS_TEXT = f"""
[[editions]]
name = "first <b>"
says = "Signs have to be certain."
words = ["undecided", "reproduced"]
rules = ["{rules_hash(RULES)}"]

[[reasons]]
suite = "smoke"
entry = 2
claims = {json.dumps(CLAIMS_WITH_BAD_NAMES)}
causes = ["checks changed"]
why = "{HOSTILE} was asked otherwise."
"""


def compare(record: RunRecord) -> Comparison:
    return compare_run(record, Question(headline_ids(record)))


@pytest.fixture(scope="module")
def own_site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """graycard's own site."""
    out = tmp_path_factory.mktemp("own") / "site"
    assert main(["site", str(OWN), "--out", str(out)]) == 0
    return out


def publish(run: Path, folder: Path) -> None:
    """Publish a run with an empty report."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("graycard.reports._publish.report_of", lambda run, pictures, record: b"")
        publish_run(run, folder, 100)


def ledger_with(run: Path, verdict: str, asks: float) -> Ledger:
    """Return a ledger of a run whose words are markup."""
    check = CheckResult(
        "c", HOSTILE, HOSTILE, "dB", HOSTILE, "", verdict, "", decides=True,  # pyright: ignore[reportArgumentType]
        estimate=1.0, interval=(0.5, 2.0), paper=asks, scenes={"a": 1.0},
    )  # fmt: skip
    claims = tuple(
        ClaimResult(name, HOSTILE, HOSTILE, verdict, HOSTILE, "", (check,), needs=HOSTILE)  # pyright: ignore[reportArgumentType]
        for name in CLAIMS_WITH_BAD_NAMES
    )
    paper = PaperResult("p", 1, f"{HOSTILE} (2026)", "", claims)
    return Ledger("smoke", 3, sha256(run / "run.json"), 0.95, RULES, {"gray": HOSTILE}, (paper,))


@pytest.fixture(scope="module")
def hostile_site(tiny_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site of one run whose claims, rows and folder have markup in their names, and its history."""
    root = tmp_path_factory.mktemp("hostile")
    folder = root / "published" / "a & b'c #1%"
    publish(tiny_run, folder)
    ledgers = [ledger_with(folder, "undecided", 1.0), ledger_with(folder, "reproduced", 2.0)]
    write_json(folder / CLAIMS, ledgers[-1])
    file = f"{folder.name}/claims.json"
    entries = tuple(
        entry_of(json.loads(json.dumps(read_back(ledger, root))), file, f"2026-11-2{day}", started="x")
        for day, ledger in enumerate(ledgers)
    )
    write_json(folder.parent / HISTORY, VerdictHistory(entries))
    (folder.parent / REASONS).write_text(REASONS_TEXT)
    write_site([folder.parent], root / "site", compare)
    return root / "site"


def read_back(ledger: Ledger, root: Path) -> object:
    write_json(root / "ledger.json", ledger)
    return read_json(root / "ledger.json")


@cache
def parsed(path: Path) -> Xml.Element:
    """Return a page as a tree, whatever is wrong with it being an error."""
    parser = html5lib.HTMLParser(strict=True, namespaceHTMLElements=False)
    return parser.parse(path.read_text(encoding="utf-8"))


def words(element: Xml.Element) -> str:
    return " ".join("".join(element.itertext()).split())


def by_id(page: Xml.Element, name: str) -> Xml.Element:
    (found,) = (element for element in page.iter() if element.get("id") == name)
    return found


def of_class(element: Xml.Element, name: str) -> list[Xml.Element]:
    return [found for found in element.iter() if name in found.get("class", "").split()]


def published_claims() -> Iterator[tuple[str, str, ClaimResult]]:
    """Yield the name of the run, the title of the paper and the claim, of every published ledger."""
    for path in (*OWN.glob("*/claims.json"), OWN / "tables.json"):
        ledger = from_builtins(Ledger, read_json(path), RecordError, str(path))
        run = path.parent.name if path.name == CLAIMS else ""
        yield from ((run, paper.title, claim) for paper in ledger.papers for claim in paper.claims)


def test_every_published_verdict_is_on_the_site(own_site: Path):
    page = parsed(own_site / "claims.html")
    told = 0
    for run, title, claim in published_claims():
        article = by_id(page, claim.id)
        assert claim.sentence in words(article)
        by = f"by {run} (" if run else f"by the {TABLES}"
        (said,) = (words(p) for p in of_class(article, "said") if by in words(p))
        assert said.startswith(f"{claim.verdict} {by}"), claim.id
        assert title.startswith(words(next(iter(section_of(page, article).iter("h2")))))
        told += 1
    assert told == len(of_class(page, "judgement")) > 50


def section_of(page: Xml.Element, article: Xml.Element) -> Xml.Element:
    return next(section for section in page.iter("section") if article in list(section))


def test_every_verdict_that_was_ever_published_is_in_the_history_of_its_claim(own_site: Path):
    articles = of_class(parsed(own_site / "claims.html"), "site-claim")
    rows = {article.get("id"): [words(row) for row in article.iter("tr")] for article in articles}
    for entry in read_history(OWN).entries:
        for claim in entry.claims.values():
            told = ((entry.suite or TABLES) in row and claim.verdict in row for row in rows[claim.id])
            assert any(told), claim.id


def test_claims_own_questions_and_tables_are_counted_apart(own_site: Path):
    told = words(by_id(parsed(own_site / "index.html"), "content"))
    counted = r"(\d+) claims: [^;]*; (\d+) own questions: [^;]*; (\d+) table: 1 inconsistent"
    (numbers,) = re.findall(counted, told)
    goris = {claim.id: claim for _, title, claim in published_claims() if title.startswith("GOR-IS")}
    own = sum(claim.asked_by == "graycard" for claim in goris.values())
    tables = sum(claim.verdict == "inconsistent" for claim in goris.values())
    assert tuple(map(int, numbers)) == (len(goris) - own - tables, own, tables)


def test_the_overview_has_a_line_for_each_claim_and_run(own_site: Path):
    page = parsed(own_site / "index.html")
    rows = [words(row) for row in page.iter("tr")]
    for claim in {claim.id for _, _, claim in published_claims()}:
        assert sum(row.startswith(f"{claim} ") for row in rows) == 1, claim
    for path in OWN.glob("*/suite.json"):
        suite = read_json(path)
        line = next(row for row in rows if row.startswith(f"{path.parent.name} "))
        assert f"{suite['name']}, version {suite['version']}" in line
        assert f"{suite['render']['width']} × {suite['render']['height']} pixels" in line
        assert f"{len(suite['scenes'])} scenes, {len(suite['methods'])} rows" in line
    assert "112 x 112 pixels, 1,000 steps" in words(page)


def test_leaderboards_tell_who_is_best_as_compare_does(own_site: Path):
    board = by_id(parsed(own_site / "leaderboards.html"), "matte")
    record = read_run(OWN / "matte")
    views = compare(record).find("tabletop", "novel_view.psnr")
    best = max((m for m in views.methods if m.competes), key=lambda m: m.mean or 0)
    assert f"Novel view PSNR: {best.method} {best.mean:.2f} dB" in words(board)
    assert best.interval
    assert f"{best.interval[0]:.2f} to {best.interval[1]:.2f}" in words(board)
    for method in record.methods:
        assert method.name in [words(row) for row in of_class(board, "method")]


def test_variants_stand_below_their_method_and_never_lead(own_site: Path):
    board = by_id(parsed(own_site / "leaderboards.html"), "dark")
    record = read_run(OWN / "dark")
    variants = record.variants_on("dark")
    rows = [(words(of_class(row, "method")[0]), row) for row in board.iter("tr") if of_class(row, "method")]
    order = [name for name, _ in rows]
    entry = {method.name: method.entry for method in record.methods}
    assert variants == {name for name, row in rows if row.get("class") == "variant"}
    places = {name: words(next(iter(row.iter("td")))) for name, row in rows}
    assert {places[name] for name in variants} == {"–"}
    ranked = [place for name, place in places.items() if name not in variants and place != "–"]
    assert [place for n, place in enumerate(ranked, 1) if place not in (str(n), ranked[n - 2])] == []
    darkgs = words(next(row for name, row in rows if name == "darkgs"))
    assert "50.00 50.00 to 50.00 50.00 by 1 missing light" in darkgs
    assert "priors: oracle 0" in darkgs
    for name in variants:
        above = order[: order.index(name)]
        assert next(other for other in reversed(above) if other not in variants) == entry[name]
    (leaders,) = of_class(board, "leaders")
    assert not variants & {words(found) for found in of_class(leaders, "method")}


def test_rows_that_priors_told_something_say_what(own_site: Path):
    page = parsed(own_site / "methods.html")
    rows = {}
    for row in page.iter("tr"):
        cells = list(row.iter("td"))
        if cells:
            rows[words(of_class(row, "method")[0])] = words(cells[-1])
    assert rows["darkgs"] == "priors: answers are the truth itself (severity 0)"
    assert "severity 2 of 1 to 5" in rows["goris"]
    assert rows["2dgs"] == "nothing"


def test_programs_read_the_same(own_site: Path):
    found = read_json(own_site / "ledger.json")
    assert (found["format"], found["format_version"]) == ("graycard-site", 1)
    assert sorted(found["files"]) == sorted(
        str(path.relative_to(own_site)) for path in own_site.rglob("*") if path.is_file()
    )
    told = {
        (claim["id"], judgement["run"], judgement["verdict"])
        for paper in found["papers"]
        for claim in paper["claims"]
        for judgement in claim["judgements"]
    }
    assert told == {(claim.id, run, claim.verdict) for run, _, claim in published_claims()}


def test_a_paper_over_several_suites_is_one(own_site: Path):
    page = parsed(own_site / "claims.html")
    titles = [words(section) for section in page.iter("h2")]
    assert len(titles) == len({title.partition(" (")[0] for title in titles}) == 3
    runs = [words(p).split(" by ")[1].split(" ")[0] for p in of_class(by_id(page, "R3"), "said")]
    assert sorted(runs) == ["matte", "tabletop"]


def test_a_verdict_on_sealed_scenes_comes_first():
    runs = published_runs([OWN / "dark", OWN / "second" / "dark-sealed"])
    claims = {claim.id: claim for paper in site_papers(runs, (), ()) for claim in paper.claims}
    assert [one.run for one in claims["S1"].shown] == ["dark-sealed", "dark"]
    assert [one.run for one in claims["S4"].shown][-1] == "dark"


def test_of_two_runs_on_sealed_scenes_the_newer_comes_first_where_it_can_test_a_claim():
    runs = published_runs([OWN / "second" / "dark-sealed", OWN / "second" / "dark-sealed-2"])
    claims = {claim.id: claim for paper in site_papers(runs, (), ()) for claim in paper.claims}
    assert [one.run for one in claims["S8"].shown] == ["dark-sealed-2", "dark-sealed"]
    assert claims["S5"].shown[0].run == "dark-sealed"


@pytest.mark.parametrize("site", ["own_site", "hostile_site"])
@pytest.mark.parametrize("name", PAGES)
def test_pages_are_valid_and_ask_nobody(site: str, name: str, request: pytest.FixtureRequest):
    folder: Path = request.getfixturevalue(site)
    page = parsed(folder / f"{name}.html")
    ids = [str(element.get("id")) for element in page.iter() if element.get("id")]
    assert len(ids) == len({*ids})
    assert not [name for name in ids if re.search(r"\s", name)]
    (policy,) = (m.get("content") for m in page.iter("meta") if m.get("http-equiv"))
    assert str(policy).startswith("default-src 'none'; img-src data:; style-src 'sha256-")
    assert not list(page.iter("script"))
    for element in page.iter():
        assert not any(key.startswith("on") or key in ("src", "style", "action") for key in element.attrib)
    targets = {target for e in page.iter() for key in ("aria-labelledby",) if (target := e.get(key))}
    assert targets <= {*ids}


@pytest.mark.parametrize("site", ["own_site", "hostile_site"])
def test_every_link_leads_somewhere(site: str, request: pytest.FixtureRequest):
    folder: Path = request.getfixturevalue(site)
    links = {
        (name, href)
        for name in PAGES
        for link in parsed(folder / f"{name}.html").iter("a")
        if (href := link.get("href"))
    }
    for name, href in links:
        assert not re.match(r"\w+:|//", href)
        file, _, anchor = href.partition("#")
        path = folder / unquote(file or f"{name}.html")
        assert path.is_file(), href
        if anchor:
            assert unquote(anchor) in anchors(path), href
    assert any(href.startswith("runs/") and "#claim-" in href for _, href in links) or site == "hostile_site"


@cache
def anchors(path: Path) -> frozenset[str]:
    if path.parent.parent.name != "runs":
        return frozenset(str(element.get("id")) for element in parsed(path).iter())
    return frozenset(re.findall(r'\b(?:id|data-part)="([^"]+)"', path.read_text(encoding="utf-8")))


def test_hostile_names_stay_words(hostile_site: Path):
    for name in PAGES:
        text = (hostile_site / f"{name}.html").read_text(encoding="utf-8")
        assert HOSTILE not in text
    page = parsed(hostile_site / "claims.html")
    articles = of_class(page, "site-claim")
    assert sorted(str(article.get("id")) for article in articles) == [
        "S1", "S1-2", "S1-title", "a-b", "a-b-2", "content-2", "script-window.broken-1-script",
    ]  # fmt: skip
    for article in articles:
        assert HOSTILE in words(article)
        assert "changed: checks changed" in words(article)
        assert f"{HOSTILE} was asked otherwise." in words(article)
    assert HOSTILE in words(parsed(hostile_site / "leaderboards.html"))
    assert (hostile_site / "runs" / "a & b'c #1%" / "index.html").is_file()


def test_a_site_is_made_anew_and_loses_what_is_gone(tiny_run: Path, tmp_path: Path):
    for name in ("one", "two"):
        publish(tiny_run, tmp_path / "published" / name)
    write_site([tmp_path / "published"], tmp_path / "site", compare)
    (tmp_path / "site" / "CNAME").write_text("mine")
    files = write_site([tmp_path / "published" / "two"], tmp_path / "site", compare)
    assert not (tmp_path / "site" / "runs" / "one" / "index.html").exists()
    assert (tmp_path / "site" / "CNAME").read_text() == "mine"
    assert files[-1] == tmp_path / "site" / "index.html"
    assert "No published run was judged" in words(parsed(files[-1]))
    before = {path: path.read_bytes() for path in files}
    write_site([tmp_path / "published" / "two"], tmp_path / "site", compare)
    assert {path: path.read_bytes() for path in files} == before, "equal records give equal pages"


def test_a_folder_in_use_and_a_list_that_leaves_it_are_refused(tiny_run: Path, tmp_path: Path):
    publish(tiny_run, tmp_path / "published" / "one")
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "notes.txt").write_text("mine")
    with pytest.raises(OutputError, match="expected a new or an empty folder, or one with pages"):
        write_site([tmp_path / "published"], tmp_path / "site", compare)
    listed = {"format": "graycard-site", "format_version": 1, "files": ["../victim"]}
    (tmp_path / "victim").write_text("mine")
    write_json(tmp_path / "site" / "ledger.json", listed)
    with pytest.raises(OutputError, match="victim"):
        write_site([tmp_path / "published"], tmp_path / "site", compare)
    assert (tmp_path / "victim").read_text() == "mine"
    assert (tmp_path / "site" / "notes.txt").read_text() == "mine"


def test_what_is_not_published_is_refused(tiny_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    run = tmp_path / "run"
    run.mkdir()
    shutil.copy(tiny_run / "run.json", run)  # other tests write reports beside it
    with pytest.raises(
        RecordError, match="expected a published run, or a folder of such, at .*graycard publish"
    ):
        write_site([run], tmp_path / "site", compare)
    for name in ("a", "b"):
        publish(tiny_run, tmp_path / name / "same")
    with pytest.raises(RecordError, match="published runs of different names, got .*a.same, .*b.same"):
        write_site([tmp_path / "a", tmp_path / "b"], tmp_path / "site", compare)
    assert main(["site", "--out", str(tmp_path / "site")]) == 2
    assert "expected published folders, got none" in capsys.readouterr().err
    assert not (tmp_path / "site").exists()


@pytest.fixture(scope="module")
def shelf(tiny_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of two published runs, with what lies beside them, and a folder that is no run."""
    root = tmp_path_factory.mktemp("shelf")
    for name in ("one", "two"):
        publish(tiny_run, root / "published" / name)
    write_json(root / "published" / HISTORY, VerdictHistory(()))
    for name, text in ((REASONS, ""), ("history.html", "beside"), ("notes.md", "beside")):
        (root / "published" / name).write_text(text)
    (root / "other").mkdir()
    (root / "other" / "index.html").write_text("pages of something else")
    (root / "other" / "notes.txt").write_text("beside no run")
    return root


def test_two_histories_are_told_apart(shelf: Path, tmp_path: Path):
    other = tmp_path / "second"
    shutil.copytree(shelf / "published", other)
    (other / "two").rename(other / "three")
    shutil.rmtree(other / "one")
    write_site([shelf / "published", other], tmp_path / "site", lambda record: compare_run(record))
    page = (tmp_path / "site" / "index.html").read_text()
    assert re.findall(r'<a href="(history[^"]*)"[^>]*>([^<]*)<', page) == [
        ("history.html", "History of published"),
        ("history-2.html", "History of second"),
    ]


@pytest.mark.parametrize(
    ("places", "left_out"),
    [
        (["published/*"], "history.html, history.json, history.toml, notes.md"),
        (["published"], ""),
        (["published/", "published/two/"], ""),
        (["published/one", "published/two", "published/one"], ""),
        (["published/../published/two", "published/one", "published/notes.md"], "notes.md"),
    ],
)
def test_what_a_shell_makes_of_a_star_is_taken(
    shelf: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], places: list[str], left_out: str
):
    found = [str(p) for place in places for p in (sorted(shelf.glob(place)) if "*" in place else [place])]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(shelf)
        assert main(["site", *found, "--out", str(tmp_path / "site")]) == 0
    names = [run["name"] for run in read_json(tmp_path / "site" / "ledger.json")["runs"]]
    assert sorted(names) == ["one", "two"]
    told = f"left out, as they are no published runs: {left_out}\n" if left_out else ""
    assert capsys.readouterr().err == told


@pytest.mark.parametrize(
    ("lost", "told"),
    [
        (("run.json",), True),
        (("run.json", "index.html"), True),
        (("index.html",), True),
        (("run.json", "suite.json", CLAIMS), True),
        (("run.json", "index.html", "suite.json", CLAIMS), False),
        ((), False),
    ],
)
@pytest.mark.parametrize("star", [True, False])
def test_a_damaged_run_is_named(
    shelf: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    lost: tuple[str, ...],
    told: bool,
    star: bool,
):
    folder = tmp_path / "published"
    shutil.copytree(shelf / "published", folder)
    (folder / "two" / CLAIMS).write_text("{}")
    for name in lost:
        (folder / "two" / name).unlink(missing_ok=True)
    if not lost:
        shutil.rmtree(folder / "two")
    places = [str(path) for path in sorted(folder.glob("[!hn]*"))] if star else [str(folder)]
    assert main(["site", *places, "--out", str(tmp_path / "site")]) == 0
    assert [run["name"] for run in read_json(tmp_path / "site" / "ledger.json")["runs"]] == ["one"]
    err = capsys.readouterr().err
    assert err.startswith("left out, as they are no published runs: two\n") is (told or (star and bool(lost)))


def test_an_earlier_site_beside_runs_is_left_out(
    shelf: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    folder = tmp_path / "published"
    shutil.copytree(shelf / "published", folder)
    assert main(["site", str(folder), "--out", str(folder / "site")]) == 0
    before = (folder / "site" / "index.html").read_bytes()
    for places in ([folder], sorted(folder.iterdir())):
        assert main(["site", *map(str, places), "--out", str(folder / "site")]) == 0
        assert (folder / "site" / "index.html").read_bytes() == before
    assert capsys.readouterr().err.endswith("notes.md, site\n")


def test_a_folder_of_damaged_runs_alone_is_refused(shelf: Path, tmp_path: Path):
    folder = tmp_path / "published"
    shutil.copytree(shelf / "published", folder)
    for name in ("one", "two"):
        (folder / name / "run.json").unlink()
    for places in ([folder], sorted(folder.iterdir())):
        with pytest.raises(RecordError, match="expected a published run, or a folder of such"):
            write_site(places, tmp_path / "site", compare)


@pytest.mark.parametrize(
    ("places", "message"),
    [
        (["published/one", "other"], "a published run, or a folder of such, at other, got none"),
        (["published/one", "other/notes.txt"], "at other/notes.txt, got none"),
        (["published/one/run.json"], "at published/one/run.json, got none"),
        (["published/gone"], "at published/gone, got none"),
        (["published/notes.md"], "expected published runs, got none. Make one"),
    ],
)
def test_what_is_no_run_and_lies_beside_none_is_refused(
    shelf: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, places: list[str], message: str
):
    monkeypatch.chdir(shelf)
    with pytest.raises(RecordError, match=re.escape(message)):
        write_site([Path(place) for place in places], tmp_path / "site", compare)
    assert not (tmp_path / "site").exists()


def test_a_mean_that_lacks_a_scene_says_so(tmp_path: Path):
    record = write_made_up(tmp_path / "run", 5, 3, metrics=2)
    left = tuple(r for r in record.results if (r.job.method, r.job.scene) != ("row-4", "scene-2"))
    write_json(tmp_path / "run" / "run.json", replace(record, results=left))
    publish(tmp_path / "run", tmp_path / "published" / "one")
    write_site([tmp_path / "published"], tmp_path / "site", compare)
    page = parsed(tmp_path / "site" / "leaderboards.html")
    rows = {words(found[0]): words(row) for row in page.iter("tr") if (found := of_class(row, "method"))}
    assert [name for name, row in rows.items() if "run on 2 of 3 scenes" in row] == ["row-4"]

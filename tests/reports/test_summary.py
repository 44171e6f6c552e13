# SPDX-License-Identifier: Apache-2.0
"""A run in brief as Markdown, JUnit XML and JSON: one with failures, one with nothing, one with bad names."""

import io
import json
import re
import xml.etree.ElementTree as Xml
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from markdown_it import MarkdownIt
from markdown_it.token import Token

from graycard.benchmarks import make_baseline, write_baseline
from graycard.cli import main
from graycard.eval.statistics import Question, compare_run
from graycard.io import sha256, write_json
from graycard.records import (
    CLAIMS,
    AboveCeiling,
    ClaimResult,
    Ledger,
    MethodRecord,
    PaperResult,
    RunRecord,
    read_run,
)
from graycard.reports import GateCheck, GateSummary, RunSummary, headline_ids, summarise, summary_text
from graycard.reports.history._keep import OWN
from graycard.reports.summary._escape import LONGEST, code, prose
from graycard.reports.summary._markdown import LIMIT, MOST_LINES
from runs_by_hand import run_of

ROWS = {"mine": {"psnr": [30.0, 31.0]}, "theirs": {"psnr": [20.0, None]}}
HOSTILE = (
    "<img src=x onerror=alert(1)>",
    "a|b`c``d",
    "[here](http://x.example) @somebody #12",
    "www.example.org 0123456789abcdef",
    "**bold** _x_ ~~y~~ $z$ &lt; :tada:",
    "1. one",
    "# head",
    "`",
)
"""Names and messages that hosts would take for markup, mentions or links."""
SCHEMA: dict[str, tuple[set[str], set[str], set[str]]] = {
    "testsuites": (set(), {"name", "time", "tests", "failures", "errors"}, {"testsuite"}),
    "testsuite": (
        {"name", "tests", "failures", "errors"},
        {"time", "skipped", "timestamp", "group", "hostname", "id", "package", "file", "log", "url"},
        {"testsuite", "properties", "testcase", "system-out", "system-err"},
    ),
    "testcase": (
        {"name"},
        {"time", "classname", "group"},
        {"skipped", "error", "failure", "system-out", "system-err"},
    ),
    "failure": (set(), {"type", "message"}, set()),
    "error": (set(), {"type", "message"}, set()),
    "skipped": (set(), {"type", "message"}, set()),
    "system-out": (set(), set(), set()),
}
"""Required attributes, others and children by the schema junit-10.xsd of Jenkins, as far as it is used."""


def written(run: Path, record: RunRecord) -> Path:
    run.mkdir(exist_ok=True)
    write_json(run / "run.json", record)
    return run


def summary_of(run: Path, gate: GateSummary | None = None) -> RunSummary:
    record = read_run(run)
    return summarise(run, record, compare_run(record, Question(headline_ids(record))), gate)


def tokens(text: str) -> Iterator[Token]:
    """Yield all tokens of a Markdown text, those within lines too."""
    for token in MarkdownIt("commonmark").enable(["table", "strikethrough"]).parse(text):
        yield token
        yield from token.children or ()


def check_markdown(text: str) -> None:
    """Hold a Markdown text against what a comment may be: no link, no mention, no HTML but the fold."""
    assert len(text) <= LIMIT
    for token in tokens(text):
        assert token.type not in (
            "link_open",
            "image",
            "html_inline",
            "s_open",
            "fence",
            "code_block",
            "em_open",
        )
        if token.type == "html_block":
            assert token.content.strip() in ("<details><summary>Each claim</summary>", "</details>")
        if token.type == "text":
            assert not re.search(r"@|://|www\.|#\d|:tada:", token.content)
    for table in re.findall(r"(?:^\|.*\n)+", text, re.M):
        rows = [re.sub(r"\\\|", "", line).count("|") for line in table.splitlines()]
        assert len(set(rows)) == 1


def check_schema(text: str) -> Xml.Element:
    """Hold XML against the schema, and its counts against its cases."""
    root = Xml.fromstring(text)
    assert root.tag == "testsuites"
    for element in root.iter():
        required, allowed, children = SCHEMA[element.tag]
        assert required <= set(element.keys()) <= required | allowed
        assert {child.tag for child in element} <= children
        if element.tag in ("testsuites", "testsuite"):
            assert re.fullmatch(r"\d+\.\d{3}", element.get("time", "0.000"))
            cases = [*element.iter("testcase")]
            counts = {"tests": len(cases)} | {
                noun: sum(case.find(kind) is not None for case in cases)
                for noun, kind in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped"))
            }
            assert {noun: int(element.get(noun, number)) for noun, number in counts.items()} == counts
    names = [(case.get("classname"), case.get("name")) for case in root.iter("testcase")]
    assert len(set(names)) == len(names)
    return root


def case_of(root: Xml.Element, classname: str, name: str) -> Xml.Element:
    (found,) = (c for c in root.iter("testcase") if (c.get("classname"), c.get("name")) == (classname, name))
    return found


def test_a_run_with_failures(make_run: Callable[..., tuple[Path, RunRecord]]):
    """One job failed on the dark track; its name is a script."""
    run, record = make_run()
    summary = summary_of(run)
    assert not summary.passed
    (failed,) = summary.failed_jobs
    reason = "expected the worker to come back, got its death <exit code -9>"
    assert (failed.track, failed.reason) == ("dark", reason)

    text = summary_text(summary, "md")
    check_markdown(text)
    assert f"**Failed:** 1 of {len(record.results)} jobs failed." in text
    assert f"- `dark/tiny-0000` `<script>window.broken = 1</script>`, seed 0: `{reason}`" in text
    assert "| `dark` | Novel view PSNR, dB, higher is better | `retinex` | 26.02 |" in text

    root = check_schema(summary_text(summary, "junit"))
    assert root.get("tests") == str(len(record.results))
    case = case_of(root, "smoke.dark.tiny-0000", "<script>window.broken = 1</script>, seed 0")
    (failure,) = case
    assert (failure.tag, failure.get("message"), failure.text) == ("failure", reason, reason)
    assert case_of(root, "smoke.dark.tiny-0000", "gray, seed 0").get("time") == "12.500"

    found = json.loads(summary_text(summary, "json"))
    assert (found["format"], found["format_version"], found["passed"]) == ("graycard-summary", 1, False)
    part = next(p for p in found["tracks"][0]["parts"] if p["metric"] == "novel_view.psnr")
    assert (part["best"], part["kind"], round(part["mean"], 2)) == ("retinex", "too few", 26.02)
    assert [row["method"] for row in part["rows"]] == [m.name for m in record.methods]
    assert part["rows"][0]["mean"] == "inf"


def test_a_score_that_failed_is_a_failure_of_its_job(tmp_path: Path):
    summary = summary_of(written(tmp_path / "run", run_of(ROWS)))
    assert not summary.passed
    check_markdown(summary_text(summary, "md"))
    assert "**Failed:** no job failed; 1 score failed." in summary_text(summary, "md")
    root = check_schema(summary_text(summary, "junit"))
    (failure,) = case_of(root, "hand.dark.s1", "theirs, seed 0")
    assert (failure.get("message"), failure.text) == ("1 of 1 scores failed", "psnr: black")


def test_a_run_with_nothing_measured_is_not_green(tmp_path: Path):
    bare = replace(run_of({}), scenes=(), metrics=())
    summary = summary_of(written(tmp_path / "run", bare), GateSummary("base.json", ()))
    assert not summary.passed
    assert "nothing was measured; the baseline expects no score" in summary_text(summary, "md")
    check_markdown(summary_text(summary, "md"))
    root = check_schema(summary_text(summary, "junit"))
    assert (root.get("tests"), root.get("errors")) == ("2", "2")
    assert json.loads(summary_text(summary, "json"))["jobs"] == []


def test_a_run_without_failures_passes(tmp_path: Path):
    rows = {"mine": {"psnr": [30.0 + i for i in range(8)]}, "theirs": {"psnr": [20.0 + i for i in range(8)]}}
    run = written(tmp_path / "run", run_of(rows))
    summary = summary_of(run)
    assert summary.passed
    text = summary_text(summary, "md")
    assert "**Passed:** no job failed." in text
    assert "| `mine` | 33.50 |" in text
    assert "clear lead; 10.00 dB" in text
    assert "### Failures" not in text


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_names_are_shown_as_they_are(tmp_path: Path, name: str):
    record = run_of({name: {"psnr": [30.0, None]}, "theirs": {"psnr": [20.0, 21.0]}})
    failed = replace(record.results[0], status="failed", reason=name, sheet=None)
    record = replace(record, results=(failed, *record.results[1:]), environment={"git_commit": name})
    run = written(tmp_path / "run", record)
    claim = ClaimResult("S1", name, "", "undecided", name, "", needs=name)
    ledger = Ledger(
        "hand", 1, sha256(run / "run.json"), 0.95, {}, {}, (PaperResult("p", 1, name, "", (claim,)),)
    )
    write_json(run / CLAIMS, ledger)
    gate = GateSummary(
        name, (GateCheck("dark", "s0", name, 0, "psnr", "missing", 1.0, None, 0.1, "dB", 0.0, name),)
    )
    summary = summary_of(run, gate)
    text = summary_text(summary, "md")
    check_markdown(text)
    shown = [token.content for token in tokens(text) if token.type in ("code_inline", "text")]
    assert any(name.strip() in content.strip() for content in shown)
    root = check_schema(summary_text(summary, "junit"))
    assert case_of(root, "hand.dark.s0", f"{name}, seed 0").find("failure") is not None
    assert json.loads(summary_text(summary, "json"))["jobs"][0]["method"] == name


def test_control_characters_are_escapes_in_xml_and_markdown(tmp_path: Path):
    record = run_of(ROWS)
    failed = replace(record.results[0], status="failed", reason="a\x1b[31m\ufffe b\nc", sheet=None)
    run = written(tmp_path / "run", replace(record, results=(failed,)))
    root = check_schema(summary_text(summary_of(run), "junit"))
    assert case_of(root, "hand.dark.s0", "mine, seed 0")[0].text == "a\\x1b[31m\ufffd b\nc"
    assert "`a\\x1b[31m" in summary_text(summary_of(run), "md")


def test_a_long_run_fits_a_comment(tmp_path: Path):
    """Five hundred failed jobs with long words, and as many claims."""
    record = run_of({"mine": {"psnr": [1.0] * 500}})
    failed = [
        replace(r, status="failed", reason=f"{i} " + "word " * 200, sheet=None)
        for i, r in enumerate(record.results)
    ]
    run = written(tmp_path / "run", replace(record, results=tuple(failed)))
    claims = tuple(ClaimResult(f"S{i}", "says " * 60, "", "undecided", "", "") for i in range(500))
    paper = PaperResult("p", 1, "Paper", "", claims)
    write_json(run / CLAIMS, Ledger("hand", 1, sha256(run / "run.json"), 0.95, {}, {}, (paper,)))
    text = summary_text(summary_of(run), "md")
    check_markdown(text)
    assert text.count("\n- ") == MOST_LINES + 1
    assert f"- {500 - MOST_LINES} more failures" in text
    assert text.endswith("Left out, as this text would be too long: What papers claim. The report has all.\n")
    assert max(map(len, text.splitlines())) < 2 * LONGEST
    assert check_schema(summary_text(summary_of(run), "junit")).get("tests") == "1000"


def gated(folder: Path) -> tuple[Path, Path]:
    """Return a run and a baseline of a better one: two scores are worse, one is better, one is missing."""
    was = {"mine": {"psnr": [30.0, 32.0, 35.0]}, "theirs": {"psnr": [20.0, 21.0, 22.0]}}
    now = {"mine": {"psnr": [29.0, 31.9, 40.0]}, "theirs": {"psnr": [12.0, 21.0, None]}}
    write_baseline(folder / "base.json", make_baseline(run_of(was)))
    return written(folder / "run", run_of(now)), folder / "base.json"


def test_the_gate_in_each_format(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    run, baseline = gated(tmp_path)
    found = {}
    for form in ("md", "junit", "json"):
        assert main(["report", str(run), "--summary", form, "--baseline", str(baseline)]) == 0
        found[form] = capsys.readouterr().out
    check_markdown(found["md"])
    assert "6 scores held against `base.json`: 2 worse, 1 missing, 1 better" in found["md"]
    table = found["md"].split("### Against the baseline")[1].split("###")[0]
    assert re.findall(r"^\| (worse|missing) .* \| (\S+) \| (\S+) \|$", table, re.M) == [
        ("worse", "8", "0.3"),
        ("worse", "1", "0.3"),
    ]
    assert "| missing | `dark/s2` `theirs` `psnr` | 22.00 dB | black |  |  |" in table
    root = check_schema(found["junit"])
    suite = next(suite for suite in root if suite.get("name") == "hand.gate")
    assert [suite.get(noun) for noun in ("tests", "failures", "errors")] == ["6", "2", "1"]
    (worse,) = case_of(root, "hand.gate.dark.s0.theirs", "psnr, seed 0")
    assert worse.get("message") == "expected 20 dB (tolerance 0.3), got 12 dB"
    (kept,) = case_of(root, "hand.gate.dark.s1.mine", "psnr, seed 0")
    assert (kept.tag, kept.text) == ("system-out", "expected 32 dB (tolerance 0.3), got 31.9 dB")
    checks = json.loads(found["json"])["gate"]["checks"]
    assert sorted(check["status"] for check in checks) == [
        "better",
        "kept",
        "kept",
        "missing",
        "worse",
        "worse",
    ]


def test_the_summary_watches_what_the_gate_watches(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """By rows and by tolerance: the score that was 1 dB worse is allowed to be 1.2."""
    run, baseline = gated(tmp_path)
    options = ["--baseline", str(baseline), "--rows", "mine", "--tolerance", "4"]
    assert main(["report", str(run), "--summary", "json", *options]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [check["status"] for check in found["gate"]["checks"]] == ["better", "kept", "kept"]
    assert main(["report", str(run), "--summary", "md", "--baseline", "smoke"]) == 2
    assert "expected a run of suite 'smoke'" in capsys.readouterr().err
    assert main(["report", str(run), "--summary", "md", "--baseline", "smoky"]) == 2
    assert "did you mean 'smoke'" in capsys.readouterr().err


def test_a_summary_goes_to_a_file_and_says_where(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    run, _ = gated(tmp_path)
    assert main(["report", str(run), "--summary", "md", "--out", str(tmp_path / "s.md")]) == 0
    assert capsys.readouterr().out == f"summary: {tmp_path / 's.md'}\n"
    assert (tmp_path / "s.md").read_text().startswith("## graycard: `hand`, version 1\n")
    assert not (run / "report").exists()


@pytest.mark.parametrize(
    ("args", "told"),
    [
        (["--baseline", "base.json"], "expected --baseline with --summary"),
        (["--summary", "md", "--predictions", "a=b"], "expected --summary of a run, without --predictions"),
        (["--summary", "md", "--baseline", "none.json"], "none.json"),
    ],
)
def test_what_does_not_fit_is_refused(
    tmp_path: Path, args: list[str], told: str, capsys: pytest.CaptureFixture[str]
):
    run, _ = gated(tmp_path)
    assert main(["report", str(run), *args]) == 2
    assert told in capsys.readouterr().err


def test_a_ledger_of_another_run_is_not_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    run, _ = gated(tmp_path)
    write_json(run / CLAIMS, Ledger("hand", 1, "ab" * 32, 0.95, {}, {}, ()))
    assert main(["report", str(run), "--summary", "md"]) == 0
    said = capsys.readouterr()
    assert "Judge the run again" in said.err
    assert "Judge the run again" in said.out


@pytest.mark.parametrize("name", ["matte"])
def test_a_published_run_with_its_claims(name: str):
    summary = summary_of(OWN / name)
    check_markdown(summary_text(summary, "md"))
    root = check_schema(summary_text(summary, "junit"))
    (case,) = next(suite for suite in root if suite.get("name") == "claims-matte.claims")
    assert case.find("skipped") is not None
    assert str(case.get("name")).startswith("R3: ")


@pytest.mark.parametrize(
    ("text", "shown"),
    [("a|b", "`a\\|b`"), ("`", "`` ` ``"), ("a`b", "``a`b``"), ("", "` `"), ("a\n b", "`a b`")],
)
def test_code_in_markdown(text: str, shown: str):
    assert code(text) == shown


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("level with x-y (0.1 to 0.2)", "level with x-y (0.1 to 0.2)"),
        ("a_b|c", "a\\_b\\|c"),
        ("1. x", "1\\. x"),
        ("- x", "\\- x"),
        ("see @me", "`see @me`"),
        ("a 0123abc b", "`a 0123abc b`"),
    ],
)
def test_prose_in_markdown(text: str, shown: str):
    assert prose(text) == shown


def test_methods_are_told_that_nobody_watched(tmp_path: Path):
    record = run_of(ROWS)
    rows: Any = (MethodRecord("mine", "", (), predictions="/somewhere"), *record.methods[1:])
    text = summary_text(summary_of(written(tmp_path / "run", replace(record, methods=rows))), "md")
    assert "Made by other code, which nobody watched: `mine`." in text


def test_a_summary_is_utf_8_whatever_the_terminal_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    record = run_of(ROWS)
    failed = replace(record.results[0], status="failed", reason="−1 → 2", sheet=None)
    run, raw = written(tmp_path / "run", replace(record, results=(failed,))), io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding="cp1252")
    monkeypatch.setattr("sys.stdout", stream)
    assert main(["report", str(run), "--summary", "junit"]) == 0
    stream.flush()
    root = check_schema(raw.getvalue().decode())
    assert case_of(root, "hand.dark.s0", "mine, seed 0")[0].text == "−1 → 2"


@pytest.mark.parametrize(
    ("unit", "told"),
    [("dB", "52.00 dB with a ceiling of 48.50 dB"), ("1", "52.000 with a ceiling of 48.500")],
)
def test_a_leak_is_told_with_its_unit(tmp_path: Path, unit: str, told: str):
    record = run_of(ROWS)
    above = AboveCeiling("dark", "s0", "mine", 0, "psnr", 52.0, 48.5, 3.5, unit, ())
    comparison = replace(compare_run(record, Question(headline_ids(record))), above_ceiling=(above,))
    summary = summarise(written(tmp_path / "run", record), record, comparison)
    assert summary.leaks == (f"mine on dark/s0, seed 0: psnr of {told}",)
    check_markdown(summary_text(summary, "md"))

# SPDX-License-Identifier: Apache-2.0
"""The history of verdicts: what is in it, what it refuses, and that it is the published ledgers'."""

import json
import os
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from graycard import RecordError
from graycard.benchmarks import claims
from graycard.cli import main
from graycard.io import from_builtins, read_json, sha256, write_json
from graycard.records import CLAIMS, HISTORY, Ledger, LedgerEntry, VerdictHistory, read_history
from graycard.reports import HISTORY_PAGE, publish_run, verdict_changes
from graycard.reports.history._changes import changes_of, open_changes
from graycard.reports.history._entries import entry_of, rules_hash
from graycard.reports.history._keep import OWN, continue_history, history_text, read_kept
from graycard.reports.history._page import render_history, suite_histories
from graycard.reports.history._reasons import REASONS, load_reasons
from published import SECOND

ROOT = Path(__file__).parents[2]
WRITE = "GRAYCARD_WRITE_DOCS" in os.environ
RULES = {"better": "the sign is certain"}

EDITION = f"""
[[editions]]
name = "first"
says = "Signs have to be certain."
words = ["contradicted", "not supported", "reproduced"]
rules = ["{rules_hash(RULES)}"]
"""
REASON = """
[[reasons]]
suite = "mine"
entry = 2
claims = ["M1"]
causes = ["new run"]
why = "Scenes were fitted again."
"""


def check_json(verdict: str, **more: Any) -> dict[str, Any]:
    plain = {
        "id": "psnr",
        "decides": True,
        "effect_of": "mine − theirs",
        "quantity": "PSNR",
        "verdict": verdict,
        "scenes": {f"s{n}": 1.0 for n in range(8)},
        "unit": "dB",
        "mean": 1.23456789,
        "interval": [0.5, 2.0],
        "p_rank": 0.01,
        "neutral": 0.0,
        "paper": 2.0,
        "accepted": [1.0, 4.0],
    }
    return plain | more


def ledger_json(
    verdict: str,
    checks: list[dict[str, Any]] | None = None,
    *,
    rules: Mapping[str, str] = RULES,
    run: str = "ab",
    **claim: Any,
) -> dict[str, Any]:
    told = {"id": "M1", "sentence": "Mine is better.", "verdict": verdict, "text": "as claimed"}
    told |= {"checks": checks or [check_json(verdict)]} | claim
    paper = {"name": "mine", "version": 1, "claims_sha256": "cd", "claims": [told]}
    return {"suite": "mine", "suite_version": 1, "run_sha256": run, "rules": dict(rules), "papers": [paper]}


def whole_ledger(verdict: str, run: Path) -> Ledger:
    """Return the same as a run folder has it."""
    told = ledger_json(verdict, [check_json(verdict)], run=sha256(run / "run.json"), source="", rule="")
    (paper,) = told["papers"]
    (claim,) = paper["claims"]
    (check,) = claim["checks"]
    del check["mean"]
    check |= {"says": "", "rule": "", "reason": "", "estimate": 1.23456789}
    return from_builtins(Ledger, told | {"level": 0.95, "methods": {}, "papers": [paper | {"title": ""}]})


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    """Return a folder whose history has one ledger."""
    return begun(tmp_path, "reproduced")


def begun(folder: Path, verdict: str) -> Path:
    """Begin a history with one ledger in a folder, and return it."""
    entry = entry_of(ledger_json(verdict), "mine/claims.json", "2026-01-01", started="monday")
    (folder / HISTORY).write_text(history_text(VerdictHistory((entry,))))
    (folder / REASONS).write_text(EDITION)
    return folder


def add_reason(folder: Path, **changed: str) -> None:
    text = REASON
    for old, new in changed.items():
        text = text.replace(old, new)
    (folder / REASONS).write_text(EDITION + text)


def grown(folder: Path, ledger: dict[str, Any], started: str = "monday") -> VerdictHistory:
    found = continue_history(folder, "mine/claims.json", ledger, started, "2026-01-02")
    assert found is not None
    return found.history


# --- graycard's own -----------------------------------------------------------------------------------------


def test_the_last_entry_of_each_suite_is_what_is_published():
    history = read_history(OWN)
    ledgers = {p.relative_to(OWN).as_posix(): p for p in (*OWN.glob(f"*/{CLAIMS}"), OWN / "tables.json")}
    last = {entry.file: entry for entry in history.entries}
    assert last.keys() == ledgers.keys()
    for file, entry in last.items():
        run = ledgers[file].parent / "run.json"
        started = read_json(run)["started"] if entry.suite else ""
        ledger = read_json(ledgers[file])
        assert entry == entry_of(ledger, file, entry.date, started=started, commit=entry.commit)


def git(*arguments: str) -> bytes:
    return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, check=True).stdout


def has_history() -> bool:
    try:
        return git("rev-parse", "--is-shallow-repository").strip() == b"false"
    except (OSError, subprocess.CalledProcessError):
        return False


@pytest.mark.skipif(not has_history(), reason="no git, or a shallow clone: old ledgers are not here")
def test_old_entries_are_what_git_has():
    for entry in (entry for entry in read_history(OWN).entries if entry.commit):
        path = f"{entry.commit}:reports/published/{entry.file}"
        ledger = json.loads(git("show", path))
        day = git("log", "-1", "--format=%as", entry.commit).decode().strip()
        run = path.replace(CLAIMS, "run.json")
        started = json.loads(git("show", run))["started"] if entry.suite else ""
        assert entry == entry_of(ledger, entry.file, day, started=started, commit=entry.commit), path


def test_every_published_change_has_a_reason():
    history, reasons = read_history(OWN), load_reasons(OWN)
    assert not open_changes(history, reasons)
    told = {(c.suite, c.entry, c.claim) for c in changes_of(history, reasons)}
    assert {("claims-dark", 2, "S1"), ("claims-dark", 3, "S7"), ("claims-tabletop", 2, "R14")} <= told
    assert ("claims-tabletop", 2, "R4") in told  # whose verdict stayed while its checks changed


@pytest.mark.parametrize("folder", [OWN, SECOND], ids=lambda folder: folder.name)
def test_the_rules_of_today_are_those_of_the_newest_edition(folder: Path):
    """Else nothing that is judged from now on could be published."""
    reasons = load_reasons(folder)
    assert reasons.edition(rules_hash(claims.RULES)) == reasons.editions[-1]


def test_the_published_page_is_made_from_the_data():
    """``make docs`` writes it anew, as where the style of reports changed."""
    page = render_history(read_history(OWN), load_reasons(OWN))
    if WRITE:
        (OWN / HISTORY_PAGE).write_text(page, encoding="utf-8")
    assert (OWN / HISTORY_PAGE).read_text(encoding="utf-8") == page, "run `make docs`"
    assert "http://" not in page.replace("http://www.w3.org/", "")
    assert "Nobody wrote why" not in page


def test_the_history_is_shown(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    assert main(["claims", "--history", "--json", str(tmp_path / "changes.json")]) == 0
    lines = capsys.readouterr().out.splitlines()
    turned = sum(change.before != change.after for change in verdict_changes())
    assert lines[-1] == f"claims: {turned} verdicts changed, 0 without a reason"
    assert any("claims-dark 2" in line and "S1" in line for line in lines)
    assert len(read_json(tmp_path / "changes.json")["result"]) == len(verdict_changes())


# --- growing ------------------------------------------------------------------------------------------------


def test_a_folder_without_a_history_keeps_none(tmp_path: Path):
    assert continue_history(tmp_path, "mine/claims.json", ledger_json("reproduced")) is None


def test_the_same_ledger_is_no_new_entry(kept: Path):
    assert len(grown(kept, ledger_json("reproduced")).entries) == 1


def test_other_words_for_the_same_verdict_are_no_new_entry(tmp_path: Path):
    first = ledger_json(
        "not testable here", [check_json("not testable here", decides=False)], text="no row mine"
    )
    entry = entry_of(first, "mine/claims.json", "2026-01-01", started="monday")
    (tmp_path / HISTORY).write_text(history_text(VerdictHistory((entry,))))
    (tmp_path / REASONS).write_text(EDITION)
    again = ledger_json(
        "not testable here", [check_json("not testable here", decides=False)], text="mine is lacking"
    )
    assert (
        entry_of(again, "mine/claims.json", "2026-01-02", started="monday").claims["M1"].text
        == "mine is lacking"
    )
    assert len(grown(tmp_path, again).entries) == 1


def test_an_earlier_ledger_is_no_new_entry_when_another_of_its_suite_has_come(kept: Path):
    later = entry_of(
        ledger_json("contradicted", run="ef"), "other/claims.json", "2026-01-02", started="tuesday"
    )
    add_reason(kept)
    (kept / HISTORY).write_text(history_text(VerdictHistory((*read_history(kept).entries, later))))
    assert len(grown(kept, ledger_json("reproduced")).entries) == 2
    with pytest.raises(RecordError, match="expected a reason for each verdict that changed"):
        grown(kept, ledger_json("undecided"))


def test_the_same_verdict_of_another_run_is_an_entry_without_a_reason(kept: Path):
    history = grown(kept, ledger_json("reproduced", run="ef"), "tuesday")
    assert [entry.date for entry in history.entries] == ["2026-01-01", "2026-01-02"]


def test_a_verdict_that_changed_without_a_reason_is_refused(kept: Path):
    message = r"got none for M1 reproduced → contradicted \(new run\) in mine, entry 2\. Write into .*history"
    with pytest.raises(RecordError, match=message):
        grown(kept, ledger_json("contradicted", run="ef"), "tuesday")
    add_reason(kept)
    history = grown(kept, ledger_json("contradicted", run="ef"), "tuesday")
    (change,) = changes_of(history, load_reasons(kept))
    assert (change.before, change.after, change.why) == (
        "reproduced",
        "contradicted",
        "Scenes were fitted again.",
    )


def test_checks_that_changed_need_a_reason_on_the_same_fits_too(kept: Path):
    other = [check_json("undecided", effect_of="mine − others")]
    with pytest.raises(RecordError, match=r"reproduced → undecided \(checks changed\)"):
        grown(kept, ledger_json("undecided", other))


@pytest.mark.parametrize("is_written", [False, True])
def test_rows_that_were_added_are_the_cause_where_a_claim_could_not_be_tested(
    is_written: bool, tmp_path: Path
):
    begun(tmp_path, "not testable here")
    if is_written:
        add_reason(tmp_path, **{"new run": "rows added"})
    (change,) = changes_of(grown(tmp_path, ledger_json("reproduced", run="ef")), load_reasons(tmp_path))
    assert change.causes == ("rows added",)


@pytest.mark.parametrize("is_written", [False, True])
def test_noise_that_was_measured_is_the_cause_where_fits_and_checks_are_the_same(
    is_written: bool, kept: Path
):
    if is_written:
        add_reason(kept, **{"new run": "noise measured"})
    (change,) = changes_of(grown(kept, ledger_json("undecided", stability=0.5)), load_reasons(kept))
    assert change.causes == ("noise measured",)


@pytest.mark.parametrize("again", [{"run": "ef"}, {"stability": None}])
def test_noise_is_no_cause_where_fits_are_others_or_it_is_as_it_was(kept: Path, again: dict[str, Any]):
    add_reason(kept, **{"new run": "noise measured"})
    told: dict[str, Any] = {"stability": 0.5, **again}
    with pytest.raises(RecordError, match="got noise measured for 'M1'"):
        grown(kept, ledger_json("undecided", **told))


@pytest.mark.parametrize("started", ["monday", "tuesday"])
def test_rows_are_not_added_to_what_was_tested_or_to_another_run(kept: Path, started: str):
    add_reason(kept, **{"new run": "rows added"})
    with pytest.raises(RecordError, match="got rows added for 'M1'"):
        grown(kept, ledger_json("contradicted", run="ef"), started)


def test_what_cannot_be_tested_any_more_says_why_itself(kept: Path):
    other = [check_json("not testable here", interval=None, scenes={}, effect_of="mine − others")]
    history = grown(kept, ledger_json("not testable here", other, text="the run has no row others"))
    (change,) = changes_of(history, load_reasons(kept))
    assert change.why.endswith("asked otherwise: psnr; the run has no row others.")


def test_rules_that_nobody_wrote_down_are_refused(kept: Path):
    rules = {"better": "the whole interval"}
    with pytest.raises(RecordError, match=f"got rules '{rules_hash(rules)}' that none lists"):
        grown(kept, ledger_json("undecided", rules=rules))


def test_new_rules_explain_themselves_from_the_numbers(kept: Path):
    rules = {"better": "the whole interval"}
    text = EDITION.replace(rules_hash(RULES), rules_hash(rules)).replace('"first"', '"second"')
    (kept / REASONS).write_text(EDITION + text)
    changed = [check_json("undecided", interval=[-0.9, 1.4], estimate=0.2)]
    history = grown(kept, ledger_json("undecided", changed, rules=rules))
    (change,) = changes_of(history, load_reasons(kept))
    assert change.causes == ("rules changed",)
    assert change.why == (
        "reproduced → undecided: psnr: the interval −0.9 to 1.4 dB holds both zero and the claimed "
        "size, 1 to 4 dB."
    )
    (shown,) = suite_histories(history, load_reasons(kept))
    assert [column.title for column in shown.columns] == ["Entry 1", "Entry 2"]
    assert [cell.mark for cell in shown.rows[0].cells] == ["", "changed"]


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"new run": "rules changed"}, r"allow \(new run, method changed\), got rules changed for 'M1'"),
        ({"M1": "M9"}, "expected claims that both ledgers judge, got 'M9'"),
        ({"entry = 2": "entry = 3"}, "expected an entry from 2 to 2 of the suite"),
        ({"new run": "weather"}, "weather"),
        ({"Scenes were fitted again.": " "}, "expected claims, causes and why"),
    ],
)
def test_reasons_that_the_ledgers_deny_are_refused(kept: Path, changed: dict[str, str], message: str):
    add_reason(kept, **changed)
    with pytest.raises(RecordError, match=message):
        grown(kept, ledger_json("contradicted", run="ef"), "tuesday")


def test_reasons_for_a_ledger_to_come_change_nothing_yet(kept: Path):
    add_reason(kept)
    assert verdict_changes(kept) == ()
    history, reasons = read_kept(kept)
    assert "Scenes were fitted again." not in render_history(history, reasons)


def test_reasons_that_are_no_toml_are_refused(kept: Path):
    (kept / REASONS).write_text("[[")
    with pytest.raises(RecordError, match="expected TOML in .*history.toml"):
        load_reasons(kept)


def test_what_is_no_ledger_is_refused():
    with pytest.raises(RecordError, match="expected a ledger in mine.json, got one without 'suite'"):
        entry_of({}, "mine.json", "2026-01-01")


def test_numbers_of_both_formats_of_ledgers_are_kept():
    old = entry_of(ledger_json("reproduced"), "f", "2026-01-01").claims["M1"]
    assert (old.checks[0].estimate, old.asked_by, old.checks[0].scenes) == (1.23457, "paper", 8)
    told = {"asked_by": "graycard", "stability": 0.812345678, "suspended": "not converged", "before": "holds"}
    new = ledger_json(
        "open", [check_json("undecided", estimate=-0.5), check_json("no", decides=False)], **told
    )
    kept = entry_of(new, "f", "2026-01-01").claims["M1"]
    assert (kept.asked_by, kept.stability, kept.suspended) == ("graycard", 0.812346, "not converged")
    assert [check.estimate for check in kept.checks] == [-0.5]


# --- publishing ---------------------------------------------------------------------------------------------


def test_publishing_continues_the_history_above(kept: Path, tiny_run: Path, monkeypatch: pytest.MonkeyPatch):
    """And a refusal leaves neither folder nor entry."""
    monkeypatch.setattr("graycard.reports._publish.report_of", lambda run, pictures, record: b"")
    run = kept / "run"
    shutil.copytree(tiny_run, run)
    write_json(run / CLAIMS, whole_ledger("contradicted", run))
    with pytest.raises(RecordError, match="expected a reason for each verdict that changed"):
        publish_run(run, kept / "mine", 100)
    assert not (kept / "mine").exists()
    assert len(read_history(kept).entries) == 1
    add_reason(kept)
    whole = read_json(run / "run.json")
    write_json(run / "run.json", whole | {"size": {"width": 64}})
    write_json(run / CLAIMS, whole_ledger("contradicted", run))
    with pytest.raises(RecordError, match="keeps the history of its verdicts, got one at 64 pixels wide"):
        publish_run(run, kept / "mine", 100)
    write_json(run / "run.json", whole)
    write_json(run / CLAIMS, whole_ledger("contradicted", run))
    publish_run(run, kept / "mine", 100)
    last = read_history(kept).entries[-1]
    assert isinstance(last, LedgerEntry)
    assert (last.file, last.claims["M1"].verdict, last.commit) == ("mine/claims.json", "contradicted", "")
    assert last.started == read_json(run / "run.json")["started"]
    assert "Scenes were fitted again." in (kept / HISTORY_PAGE).read_text()


def test_a_history_begins_as_the_docs_say(tmp_path: Path, tiny_run: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("graycard.reports._publish.report_of", lambda run, pictures, record: b"")
    assert '`history.json` with `{"entries": []}`' in (ROOT / "docs" / "results" / "history.md").read_text(
        encoding="utf-8"
    )
    run, there = tmp_path / "run", tmp_path / "there"
    shutil.copytree(tiny_run, run)
    there.mkdir()
    (there / HISTORY).write_text('{"entries": []}')
    parts = (OWN / REASONS).read_text(encoding="utf-8").split("[[")
    editions = "".join(f"[[{part}" for part in parts if part.startswith("editions"))
    (there / REASONS).write_text(editions, encoding="utf-8")
    newest = load_reasons(OWN).editions[-1]
    monkeypatch.setattr("graycard.reports.history._entries.rules_hash", lambda rules: newest.rules[-1])
    write_json(run / CLAIMS, whole_ledger("reproduced", run))
    publish_run(run, there / "mine", 100)
    assert [entry.file for entry in read_history(there).entries] == ["mine/claims.json"]
    assert "M1" in (there / HISTORY_PAGE).read_text()


def test_the_history_of_a_published_run_stands_above_it(
    tiny_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    assert verdict_changes(OWN / "matte") == tuple(c for c in verdict_changes() if c.suite == "claims-matte")
    assert verdict_changes(OWN / "dark") != verdict_changes(OWN / "matte")
    assert main(["claims", str(OWN / "matte"), "--history"]) == 0
    shown = capsys.readouterr().out
    assert "claims-matte" in shown
    assert "claims-dark" not in shown
    with pytest.raises(
        RecordError, match=r"expected history.json in .*, or in the folder above a published run"
    ):
        verdict_changes(tiny_run)
    shutil.copy(OWN / HISTORY, tmp_path)
    (tmp_path / "other").mkdir()
    shutil.copy(tiny_run / "run.json", tmp_path / "other")
    (tmp_path / "other" / "index.html").touch()
    with pytest.raises(
        RecordError, match=r"expected a suite of .*history.json \(claims-.*Publish its run there"
    ):
        verdict_changes(tmp_path / "other")


def test_options_that_judge_are_refused_beside_the_history(capsys: pytest.CaptureFixture[str]):
    for options in (
        ["--power"],
        ["--checks", "--republish"],
        ["--half", "x", "--twice", "y"],
        ["--claims", "gsid"],
    ):
        assert main(["claims", "--history", *options]) == 2
        named = ", ".join(sorted(option for option in options if option.startswith("--")))
        said = " ".join(capsys.readouterr().err.split())
        assert f"expected --history without {named}, got both" in said


def test_a_history_that_is_damaged_is_told(kept: Path):
    (kept / HISTORY).write_text('{"entries": 3}')
    with pytest.raises(RecordError, match="history.json"):
        read_history(kept)
    history = VerdictHistory((replace(entry_of(ledger_json("x"), "f", "d"), suite=""),))
    assert history.suites == ("",)

# SPDX-License-Identifier: Apache-2.0
"""Parts of a run that are kept and shown."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from graycard import OutputError, RecordError
from graycard.benchmarks import Validity
from graycard.cli import main
from graycard.io import read_json, sha256, to_builtins, write_json
from graycard.records import CLAIMS, HISTORY, Ledger, read_ledger, read_run
from graycard.reports import Shown, publish_run, write_report
from opened import opened
from published import published_folders


def test_records_are_those_of_the_run_and_pictures_those_asked_for(tiny_run: Path, tmp_path: Path):
    (tiny_run / "suite.json").write_text('{ "as": "it was written" }\n')
    size = publish_run(tiny_run, tmp_path / "out", 100, Shown(["gray"]))
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["index.html", "run.json", "suite.json"]
    assert sha256(tmp_path / "out" / "suite.json") == sha256(tiny_run / "suite.json")
    assert read_json(tmp_path / "out" / "run.json") == read_json(tiny_run / "run.json")
    assert read_run(tmp_path / "out") == read_run(tiny_run)
    assert size == pytest.approx(sum(p.stat().st_size for p in (tmp_path / "out").iterdir()) / 2**20)
    files = (tmp_path / "out" / "index.html", write_report(tiny_run))
    page, whole = (opened(path.read_text()) for path in files)
    assert page.count("Pictures and lights of 1 of 4 methods are embedded") == 3
    assert "methods are embedded" not in whole
    assert page.count('<section aria-label="Worst squares') == 3
    assert whole.count('<section aria-label="Worst squares') == 3 * 4
    assert page.count("Of methods whose pictures are here; run.json has those of all.") == 3
    assert "Of methods whose pictures are here" not in whole
    views = page.split("Values of single test views")[1].split("</table>")[0]
    assert views.count('class="method"') == 1
    assert views.count('scope="row"') > 3
    for text in (page, whole):  # the tables have all methods
        assert text.count('scope="row"') > 50
        assert "Reflectance changes in steps" in text


def test_scenes_that_are_not_asked_for_have_tables_alone(tiny_run: Path, tmp_path: Path):
    first, *others = (f"{scene.track}/{scene.scene}" for scene in read_run(tiny_run).scenes)
    size = publish_run(tiny_run, tmp_path / "out", 100, Shown(scenes=[first]))
    assert size < publish_run(tiny_run, tmp_path / "whole", 100) * 0.6
    again = write_report(tmp_path / "out", out=tmp_path / "again.html")
    for path in (tmp_path / "out" / "index.html", again):
        page = opened(path.read_text())
        assert page.count("This page is kept small: it has pictures of some scenes only.") == len(others)
        assert page.count('<section aria-label="Worst squares') == 4
        assert page.count("Values of single test views") == 1
        assert "No pictures of this scene" not in page
        assert page.count('scope="row"') > 50


def test_where_the_dataset_stood_is_nobodys_business(
    tiny_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("graycard.reports._publish.report_of", lambda run, shown, record: b"")
    shutil.copytree(tiny_run, tmp_path / "run")
    record = read_json(tiny_run / "run.json")
    folders = [scene["folder"] for scene in record["scenes"]]
    for scene in record["scenes"]:
        scene["folder"] = str(tiny_run / scene["folder"])
    write_json(tmp_path / "run" / "run.json", record)
    publish_run(tmp_path / "run", tmp_path / "out", 100)
    assert str(tmp_path) not in (tmp_path / "out" / "run.json").read_text()
    kept = read_json(tmp_path / "out" / "run.json")["scenes"]
    assert [scene["folder"] for scene in kept] == folders


def write_ledger(run: Path, **changed: Any) -> None:
    """Write a ledger without papers beside a run."""
    ledger = Ledger("hand", 1, sha256(run / "run.json"), 0.95, {}, {}, ())
    write_json(run / CLAIMS, to_builtins(ledger) | changed)


@pytest.fixture
def run_alone(tiny_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a run folder of its own; its report is not made."""
    monkeypatch.setattr("graycard.reports._publish.report_of", lambda run, pictures, record: b"")
    (tmp_path / "run").mkdir()
    shutil.copy(tiny_run / "run.json", tmp_path / "run")
    return tmp_path / "run"


def test_the_ledger_is_of_the_run_beside_it_as_it_was_of_the_run(run_alone: Path, tmp_path: Path):
    write_ledger(run_alone)
    publish_run(run_alone, tmp_path / "out", 100)
    kept = read_ledger(tmp_path / "out")
    assert kept is not None
    assert kept.run_sha256 == sha256(tmp_path / "out" / "run.json") != sha256(run_alone / "run.json")


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        (
            {"run_sha256": "ab" * 32},
            "to be of run.json .*, got one of run.json abababababab. Judge the run again",
        ),
        ({"run_sha256": ""}, "got one of no run. Judge the run again: graycard claims .*run"),
        ({"format_version": 1}, "got version 1, whose verdicts mean something else. Judge the run again"),
        ({"papers": 3}, "expected a Ledger with suite, .*claims.json, got: "),
    ],
)
def test_a_ledger_that_is_not_of_the_run_is_not_published(
    run_alone: Path, tmp_path: Path, changed: dict[str, Any], told: str
):
    write_ledger(run_alone, **changed)
    with pytest.raises(RecordError, match=told):
        publish_run(run_alone, tmp_path / "out", 100)
    assert not (tmp_path / "out").exists()


def test_a_ledger_that_breaks_off_is_told_and_never_a_traceback(
    run_alone: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    valid = Validity((), ("counts",), "hand", "", 1)
    monkeypatch.setattr("graycard.benchmarks.check_result", lambda run, progress, salt=None: valid)
    (run_alone / CLAIMS).write_text('{"suite": "hand", ')
    assert main(["publish", str(run_alone), "--out", str(tmp_path / "out")]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "claims.json, got text that breaks off or is none" in said
    assert "Judge the run again: graycard claims RUN" in said
    assert not (tmp_path / "out").exists()


def test_a_report_warns_of_a_ledger_of_another_run(run_alone: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["report", str(run_alone)]) == 0
    assert capsys.readouterr().err == ""
    write_ledger(run_alone, run_sha256="ab" * 32)
    assert main(["report", str(run_alone)]) == 0
    said = capsys.readouterr()
    assert "got one of run.json abababababab. Judge the run again: graycard claims" in " ".join(
        said.err.split()
    )
    assert said.out.startswith("report: ")


def test_the_whole_page_is_that_of_the_report(tiny_run: Path, tmp_path: Path):
    publish_run(tiny_run, tmp_path / "out", 100)
    assert (tmp_path / "out" / "index.html").read_bytes() == write_report(tiny_run).read_bytes()


def test_what_is_too_large_is_not_written(tiny_run: Path, tmp_path: Path):
    with pytest.raises(OutputError, match=r"expected 0\.01 MiB at most, got .*index\.html"):
        publish_run(tiny_run, tmp_path / "out", 0.01)
    assert not (tmp_path / "out").exists()


def test_a_folder_in_use_is_left_alone(tiny_run: Path, tmp_path: Path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(OutputError, match="expected a new or an empty folder"):
        publish_run(tiny_run, tmp_path, 100)
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_a_method_that_the_run_does_not_have(tiny_run: Path, tmp_path: Path):
    with pytest.raises(RecordError, match=r"expected pictures of methods of the run \(truth, .*got grey"):
        publish_run(tiny_run, tmp_path / "out", 100, Shown(["grey"]))


def test_a_scene_that_the_run_does_not_have(tiny_run: Path, tmp_path: Path):
    with pytest.raises(RecordError, match=r"expected pictures of scenes of the run \(.*got nowhere"):
        publish_run(tiny_run, tmp_path / "out", 100, Shown(scenes=["nowhere"]))


PUBLISHED = published_folders()


@pytest.mark.parametrize("folder", PUBLISHED, ids=lambda folder: folder.name)
def test_what_is_published_is_of_one_run(folder: Path):
    """Suite, record and ledger are those of each other, and say nothing of a machine's folders."""
    run, ledger = read_run(folder), read_ledger(folder)
    assert sha256(folder / "suite.json") == run.suite_sha256
    assert ledger is not None
    assert ledger.run_sha256 == sha256(folder / "run.json")
    assert [scene.folder for scene in run.scenes] == [f"dataset/{s.track}/{s.scene}" for s in run.scenes]


def test_verbs_that_read_records_leave_a_published_folder_as_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """And what evidence it lacks is told shortly."""
    folder = next(path for path in PUBLISHED if path.name == "matte")
    shutil.copytree(folder, tmp_path / "matte")
    before = {path: path.read_bytes() for path in (tmp_path / "matte").iterdir()}
    assert main(["compare", str(tmp_path / "matte")]) == 0
    assert main(["claims", str(tmp_path / "matte")]) == 0
    assert capsys.readouterr().out.strip().endswith("published one and left as it is")
    assert main(["check-result", str(tmp_path / "matte")]) == 2
    found = capsys.readouterr().out
    assert "broken:" not in found
    assert "unknown:" not in found
    assert "published: scenes and predictions are not kept." in found
    assert "check-result: the records break no rule; comparison, hashes, gauge" in found.splitlines()[-1]
    assert {path: path.read_bytes() for path in (tmp_path / "matte").iterdir()} == before


@pytest.fixture
def beside_history(tmp_path: Path) -> Path:
    """A copy of a published run beside the history of verdicts that keeps its hash."""
    source = next(path for path in PUBLISHED if path.name == "matte")
    shutil.copy(source.parent / HISTORY, tmp_path)
    return Path(shutil.copytree(source, tmp_path / "matte"))


def test_a_published_run_is_held_against_the_history_beside_it(
    beside_history: Path, capsys: pytest.CaptureFixture[str]
):
    assert main(["check-result", str(beside_history)]) == 2
    assert "The history beside it keeps a hash of run.json" in capsys.readouterr().out
    (beside_history.parent / HISTORY).unlink()
    assert main(["check-result", str(beside_history)]) == 2
    shown = capsys.readouterr().out
    assert f"is as it was then: compare its SHA-256, {sha256(beside_history / 'run.json')}" in shown


def raise_scores(folder: Path) -> None:
    data = json.loads((folder / "run.json").read_text())
    for result in data["results"]:
        for score in result["sheet"]["scores"]:
            if score["metric"] == "novel_view.psnr" and result["job"]["method"] == "goris":
                score["value"] += 1.0
                score["per_view"] = {view: value + 1.0 for view, value in score["per_view"].items()}
    (folder / "run.json").write_text(json.dumps(data))


def turn_a_verdict(folder: Path) -> None:
    data = json.loads((folder / "claims.json").read_text())
    data["papers"][0]["claims"][0]["verdict"] = "reproduced"
    (folder / "claims.json").write_text(json.dumps(data))


def damage_the_claims(folder: Path) -> None:
    (folder / "claims.json").write_text("{")


def damage_claims_and_scores(folder: Path) -> None:
    raise_scores(folder)
    damage_the_claims(folder)


def damage_the_history(folder: Path) -> None:
    (folder.parent / HISTORY).write_text("{")


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        (raise_scores, 1, "broken: published: run.json: expected the file that was published"),
        (turn_a_verdict, 1, "broken: published: claims.json: "),
        (damage_the_claims, 1, "broken: published: claims.json: expected JSON"),
        (damage_claims_and_scores, 1, "broken: published: run.json: expected the file that was published"),
        (damage_the_history, 2, "Nothing here tells whether run.json is as it was then"),
    ],
)
def test_a_published_run_that_was_changed_is_told_of(
    beside_history: Path,
    change: Callable[[Path], None],
    code: int,
    words: str,
    capsys: pytest.CaptureFixture[str],
):
    change(beside_history)
    assert main(["check-result", str(beside_history)]) == code
    assert words in capsys.readouterr().out

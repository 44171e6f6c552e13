# SPDX-License-Identifier: Apache-2.0
"""Predictions of other code as rows of a bench: taken as they are, scored, compared."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

import graycard as gc
from graycard.__main__ import main
from graycard.benchmarks import SuiteMethod, check_result, load_suite, with_predictions
from graycard.benchmarks._handed_in import take_predictions

JOB = gc.Job("dark", "tiny-0000", "official", 0, {})


@pytest.fixture
def given(tiny_run: Path, tmp_path: Path) -> Path:
    """What another program might have made: what ``retinex`` has, without a list of its files."""
    for job in tiny_run.glob("jobs/*/*/retinex-*"):
        track, scene = job.parent.parent.name, job.parent.name
        folder = tmp_path / "given" / track / scene
        shutil.copytree(job / "predictions", folder)
        index = {"method": "whatever", "track": track, "scene": scene}
        (folder / "predictions.json").write_text(json.dumps(index))
    return tmp_path / "given"


def bench_with(tiny_run: Path, run: Path, given: Path, suite: Path) -> int:
    """Bench the tiny suite and the given predictions, in a folder where all but these is at hand."""
    if not run.exists():
        shutil.copytree(tiny_run, run)
    return main(["bench", str(suite), "--out", str(run), "--predictions", f"official={given}"])


def results_of(run: Path) -> dict[str, gc.JobResult]:
    return {r.job.track: r for r in gc.read_run(run).results if r.job.method == "official"}


def test_predictions_stand_beside_the_methods(
    tiny_run: Path, tmp_path: Path, given: Path, suite_of: Callable[..., Path]
):
    run = tmp_path / "run"
    assert bench_with(tiny_run, run, given, suite_of()) == 0
    record = gc.read_run(run)
    assert [m.name for m in record.methods] == ["truth", "gray", "input", "retinex", "official"]
    rivals = {r.job.track: r for r in record.results if r.job.method == "retinex"}
    for track, result in results_of(run).items():
        assert (result.status, result.cost, result.access) == ("done", None, None)
        sheet, rival = result.sheet, rivals[track].sheet
        assert sheet is not None
        assert rival is not None
        assert sheet.method == "official"
        assert sheet.scores == rival.scores, "they are the very same predictions"
    assert len(results_of(run)) == 3
    assert "official" in (run / "report" / "index.html").read_text()
    comparison = gc.read_comparison(run)
    assert comparison
    assert "official" in {m.method for m in comparison.find("dark", "albedo.psnr.channel").methods}
    assert gc.open_predictions(run / results_of(run)["dark"].folder / "predictions").is_whole()
    validity = check_result(run)
    assert {b.rule for b in validity.breaches if b.unknown} == {"truth"}
    assert all("predictions of other code" in b.what for b in validity.breaches if b.rule == "truth")
    assert {b.rule for b in validity.breaches if not b.unknown} <= {"origin"}, "the checkout is under work"


def test_they_are_taken_anew_when_they_change_and_missed_where_they_are_not(
    tiny_run: Path,
    tmp_path: Path,
    given: Path,
    suite_of: Callable[..., Path],
    capsys: pytest.CaptureFixture[str],
):
    run, suite = tmp_path / "run", suite_of()
    assert bench_with(tiny_run, run, given, suite) == 0
    before = results_of(run)
    assert bench_with(tiny_run, run, given, suite) == 0
    assert results_of(run) == before, "nothing has changed"
    (folder,) = given.glob("dark/*")
    for path in folder.glob("views/*.exr"):
        layers = gc.read_layers(path)
        gc.write_layers(path, layers | {"base_color": layers["base_color"] ** 2})
    shutil.rmtree(given / "tabletop")
    capsys.readouterr()
    assert bench_with(tiny_run, run, given, suite) == 1
    after = results_of(run)
    assert after["dark"].job_hash != before["dark"].job_hash
    assert after["dark"].sheet != before["dark"].sheet
    assert after["multilight"] == before["multilight"]
    assert after["tabletop"].status == "failed"
    assert "expected a predictions folder with predictions.json" in after["tabletop"].reason
    assert "tabletop" in capsys.readouterr().err


def write_given(folder: Path, **index: object) -> Path:
    folder.mkdir(parents=True)
    (folder / "lights.json").write_text("[]")
    (folder / "predictions.json").write_text(
        json.dumps({"method": "m", "track": JOB.track, "scene": JOB.scene} | index)
    )
    return folder


def test_a_copy_is_whole_and_replaces_what_was_there(tmp_path: Path):
    folder = tmp_path / "predictions"
    (folder / "views").mkdir(parents=True)
    (folder / "views" / "old.exr").write_text("")
    given = write_given(tmp_path / "given")
    (given / ".partial").write_text("")
    take_predictions(given, folder, JOB)
    assert sorted(p.name for p in folder.iterdir()) == ["lights.json", "predictions.json"]
    found = gc.open_predictions(folder)
    assert found.method == "official"
    assert found.is_whole()


@pytest.mark.parametrize(
    ("index", "message"),
    [
        ({"scene": "other"}, "expected predictions of dark/tiny-0000 in .*, got those of dark/other"),
        ({"files": {"lights.json": "0" * 64}}, "expected the files that .* lists"),
        ({"sceen": 1}, "sceen"),
    ],
)
def test_what_is_not_of_this_scene_is_refused(tmp_path: Path, index: dict[str, object], message: str):
    given = write_given(tmp_path / "given", **index)
    with pytest.raises(gc.PredictionError, match=message):
        take_predictions(given, tmp_path / "predictions", JOB)
    assert not (tmp_path / "predictions").exists()


def test_a_full_disk_is_no_fault_of_the_predictions(tmp_path: Path, small_disk: Path):
    given = write_given(tmp_path / "given")
    (given / "lights.json").write_bytes(bytes(400_000))
    with pytest.raises(gc.OutputError, match="full disk"):
        take_predictions(given, small_disk / "predictions", JOB)


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("mine", "expected predictions as NAME=FOLDER, got 'mine'"),
        ("=folder", "expected predictions as NAME=FOLDER"),
        ("gray=folder", "expected a name of their own for predictions that are handed in, got 'gray'"),
        ("mine=nowhere", "expected a folder with predictions of other code, .* at nowhere, got nothing"),
        ("mine=README", "at README, got a file"),
    ],
)
def test_rows_that_cannot_be_are_met_before_any_work(
    row: str,
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    monkeypatch.chdir(tmp_path)
    Path("README").write_text("")
    assert main(["bench", "demo", "--predictions", row]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert re.search(message, said), said
    assert not any(tmp_path.rglob("*.exr"))


def test_a_suite_takes_predictions_of_one_seed_and_without_settings(suite_of: Callable[..., Path]):
    suite = load_suite(str(suite_of()))
    assert with_predictions(suite, ["a=x", "b=y"]).methods[-2:] == (
        SuiteMethod("a", predictions="x"),
        SuiteMethod("b", predictions="y"),
    )
    with pytest.raises(gc.RecordError, match=r"each once .* got \[.*'a', 'a'\]"):
        with_predictions(suite, ["a=x", "a=y"])
    path = suite_of()
    text = path.read_text() + '[[methods]]\nname = "a"\npredictions = "x"\n'
    path.write_text(text)
    assert load_suite(str(path)).methods[-1] == SuiteMethod("a", predictions="x")
    path.write_text(text + "settings = { steps = 3 }\n")
    with pytest.raises(gc.RecordError, match="expected no settings, priors or compositions of a"):
        load_suite(str(path))
    path.write_text("seeds = [0, 1]\n" + text)
    with pytest.raises(gc.RecordError, match="expected one seed in suite 'tiny', as predictions of a"):
        load_suite(str(path))

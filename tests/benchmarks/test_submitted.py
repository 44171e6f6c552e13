# SPDX-License-Identifier: Apache-2.0
"""Predictions of other code as rows of a bench: taken as they are, scored, compared."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from graycard import OutputError, PredictionError, RecordError, open_predictions
from graycard.benchmarks import SuiteMethod, check_result, load_suite, with_predictions
from graycard.benchmarks._submitted import Given, given_for, take_predictions
from graycard.cli import main
from graycard.io import read_layers, write_layers
from graycard.records import Job, JobResult, read_comparison, read_run
from valid_runs import change

JOB = Job("dark", "tiny-0000", "official", 0, {})


@pytest.fixture
def given(tiny_run: Path, tmp_path: Path) -> Path:
    """Predictions that another program might have made: those of ``retinex`` without a list of files."""
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


def results_of(run: Path) -> dict[str, JobResult]:
    return {r.job.track: r for r in read_run(run).results if r.job.method == "official"}


@pytest.mark.usefixtures("here")
def test_predictions_stand_beside_the_methods(
    tiny_run: Path,
    tmp_path: Path,
    given: Path,
    suite_of: Callable[..., Path],
    capsys: pytest.CaptureFixture[str],
):
    run = tmp_path / "run"
    assert bench_with(tiny_run, run, given, suite_of()) == 0
    record = read_run(run)
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
    page = (run / "report" / "index.html").read_text()
    assert '<span class="badge">submitted</span>' in page
    assert "Made by other code and submitted: official" in page
    comparison = read_comparison(run)
    assert comparison
    assert "official" in {m.method for m in comparison.find("dark", "albedo.psnr.channel").methods}
    assert open_predictions(run / results_of(run)["dark"].folder / "predictions").is_whole()
    validity = check_result(run)
    assert validity.submitted == ("official",)
    assert {b.rule for b in validity.breaches} <= {"origin"}, "the checkout is under work"
    capsys.readouterr()
    main(["check-result", str(run)])
    assert "note: row 'official' is submitted" in capsys.readouterr().out
    change(run, lambda data: data["environment"].update(git_commit="0123456789ab"))
    assert main(["publish", str(run), "--out", str(tmp_path / "published")]) == 0
    assert '<span class="badge">submitted</span>' in (tmp_path / "published" / "index.html").read_text()


@pytest.mark.usefixtures("here")
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
    kept = [run / before["dark"].folder / name for name in ("job.json", "scores.json")]
    times = [path.stat().st_mtime_ns for path in kept]
    assert bench_with(tiny_run, run, given, suite) == 0
    assert results_of(run) == before
    assert [path.stat().st_mtime_ns for path in kept] == times, "nothing has changed"
    (folder,) = given.glob("dark/*")
    for path in folder.glob("views/*.exr"):
        layers = read_layers(path)
        write_layers(path, layers | {"base_color": layers["base_color"] ** 2})
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


@pytest.mark.usefixtures("here")
def test_a_row_goes_when_it_is_left_out_and_the_rest_is_as_it_was(
    tiny_run: Path, tmp_path: Path, given: Path, suite_of: Callable[..., Path]
):
    run, suite = tmp_path / "run", suite_of()
    assert bench_with(tiny_run, run, given, suite) == 0
    before, record = read_run(tiny_run), read_run(run)
    assert (record.environment, record.started) == (before.environment, before.started), "nothing was fitted"
    assert main(["bench", str(suite), "--out", str(run), "--tracks", "dark", "--methods", "gray"]) == 0
    assert len(results_of(run)) == 3, "a part of a suite leaves the others as they are"
    assert main(["bench", str(suite), "--out", str(run)]) == 0
    assert read_run(run) == before


def write_given(folder: Path, **index: object) -> Path:
    folder.mkdir(parents=True)
    (folder / "lights.json").write_text("[]")
    (folder / "predictions.json").write_text(
        json.dumps({"method": "m", "track": JOB.track, "scene": JOB.scene} | index)
    )
    return folder


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Return the place of the job's scene in a folder with predictions of many."""
    return tmp_path / "given" / JOB.track / JOB.scene


def given_at(place: Path) -> Given:
    return given_for(str(place.parents[1]), JOB.track, JOB.scene)


def test_a_copy_is_whole_and_replaces_what_was_there(place: Path, tmp_path: Path):
    folder = tmp_path / "predictions"
    (folder / "views").mkdir(parents=True)
    (folder / "views" / "old.exr").write_text("")
    (write_given(place) / ".partial").write_text("")
    take_predictions(given_at(place), folder, JOB)
    assert sorted(p.name for p in folder.iterdir()) == ["lights.json", "predictions.json"]
    found = open_predictions(folder)
    assert found.method == "official"
    assert found.is_whole()


def test_a_link_to_a_whole_scene_is_followed(place: Path, tmp_path: Path):
    place.parent.mkdir(parents=True)
    place.symlink_to(write_given(tmp_path / "elsewhere"))
    take_predictions(given_at(place), tmp_path / "predictions", JOB)
    assert open_predictions(tmp_path / "predictions").lights() == ()


@pytest.mark.parametrize(
    ("index", "message"),
    [
        ({"scene": "other"}, "expected predictions of dark/tiny-0000 in .*, got those of dark/other"),
        ({"files": {"lights.json": "0" * 64}}, "expected lights.json in .* with SHA-256 000000000000…"),
        ({"files": {"views/a.exr": "0" * 64}}, "expected views/a.exr in .*, got none"),
        ({"sceen": 1}, "sceen"),
    ],
)
def test_what_is_not_of_this_scene_is_refused(
    place: Path, tmp_path: Path, index: dict[str, object], message: str
):
    write_given(place, **index)
    with pytest.raises(PredictionError, match=message):
        take_predictions(given_at(place), tmp_path / "predictions", JOB)
    assert not (tmp_path / "predictions").exists()


def test_a_linked_part_is_refused_and_not_left_out(place: Path, tmp_path: Path):
    (tmp_path / "views").mkdir()
    (write_given(place) / "views").symlink_to(tmp_path / "views")
    with pytest.raises(PredictionError, match="got a link to a folder, views"):
        take_predictions(given_at(place), tmp_path / "predictions", JOB)


def test_what_changes_while_the_bench_runs_is_not_taken_for_what_was_there(place: Path, tmp_path: Path):
    given = given_at(write_given(place))
    (place / "lights.json").write_text("[ ]")
    with pytest.raises(PredictionError, match="to stay as it was when the bench began"):
        take_predictions(given, tmp_path / "predictions", JOB)
    assert not (tmp_path / "predictions" / "predictions.json").exists()


def test_what_cannot_be_read_is_a_fault_of_the_predictions(
    place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def unreadable(path: Path) -> str:
        raise PermissionError(13, "Permission denied", str(path))

    write_given(place)
    monkeypatch.setattr("graycard.io._files.sha256", unreadable)
    assert given_at(place).sha256 == "", "the job of this scene says why"
    with pytest.raises(PredictionError, match=r"lights.json, got: Permission denied"):
        take_predictions(given_at(place), tmp_path / "predictions", JOB)


def test_a_full_disk_is_no_fault_of_the_predictions(place: Path, small_disk: Path):
    (write_given(place) / "lights.json").write_bytes(bytes(400_000))
    with pytest.raises(OutputError, match="disk is full"):
        take_predictions(given_at(place), small_disk / "predictions", JOB)


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("mine", "expected predictions as NAME=FOLDER, got 'mine'"),
        ("=folder", "expected predictions as NAME=FOLDER"),
        ("gray=folder", "expected a name of their own for submitted predictions, got 'gray'"),
        ("mine=nowhere", r"/nowhere, as dark/corridor-\d+/predictions.json, got nothing"),
        ("mine=README", "/README, as .*, got a file"),
        ("mine=.", "got a folder of README"),
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
    for row in ("a=y", "retinex=y"):
        with pytest.raises(RecordError, match=f"expected a name of their own .* got '{row[:-2]}'"):
            with_predictions(suite, ["a=x", row])
    path = suite_of()
    text = path.read_text() + '[[methods]]\nname = "a"\npredictions = "x"\n'
    path.write_text(text)
    assert load_suite(str(path)).methods[-1] == SuiteMethod("a", predictions="x")
    path.write_text(text + "settings = { steps = 3 }\n")
    with pytest.raises(RecordError, match="got settings, a label, priors or compositions as well"):
        load_suite(str(path))
    path.write_text("seeds = [0, 1]\n" + text)
    with pytest.raises(RecordError, match="expected one seed in suite 'tiny', which has submitted"):
        load_suite(str(path))

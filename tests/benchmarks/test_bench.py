# SPDX-License-Identifier: Apache-2.0
"""The whole pipeline on real scenes: what it says, what it reuses, what it survives."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import pytest

from graycard.benchmarks import _jobs, _runner, check_result
from graycard.benchmarks._jobs import FitJob, find_scores, run_fit, run_score
from graycard.benchmarks._submitted import Given
from graycard.benchmarks.planning._plan import job_hash
from graycard.cli import main
from graycard.io import file_lock, read_json, sha256, write_json
from graycard.processes import Outcome
from graycard.records import Job, ScoreSheet, read_comparison, read_run
from layer_references import write_random_weights

TRACKS = ("dark", "tabletop", "multilight")


def sheets(run: Path) -> dict[tuple[str, str], ScoreSheet | None]:
    return {(r.job.track, r.job.method): r.sheet for r in read_run(run).results}


def dark_sheets(run: Path) -> dict[tuple[str, str], ScoreSheet | None]:
    return {key: sheet for key, sheet in sheets(run).items() if key[0] == "dark"}


def stamps(run: Path) -> dict[str, int]:
    kept = [
        *run.glob("dataset/*/*/truth/views/*.exr"),
        *run.glob("jobs/**/*.exr"),
        *run.glob("jobs/**/scores.json"),
    ]
    return {str(path): path.stat().st_mtime_ns for path in kept}


def test_every_job_is_there(tiny_run: Path):
    record = read_run(tiny_run)
    assert [s.track for s in record.scenes] == list(TRACKS)
    assert [m.name for m in record.methods] == ["truth", "gray", "input", "retinex"]
    assert len(record.results) == 12
    assert all(r.status == "done" and r.cost and r.cost.peak_memory_mib > 1 for r in record.results)
    assert record.environment["packages"]["mitsuba"]
    assert re.fullmatch(r"\d+ \((pip|system|environment)\)|None", str(record.environment["llvm"]))
    assert record.environment["renderer"][0]["variant"] in ("llvm_ad_rgb", "scalar_rgb")


def test_a_bench_compares_and_its_result_is_valid(tiny_run: Path):
    """All but the commit, which a checkout under work does not have."""
    found = read_comparison(tiny_run)
    assert found
    assert {pair.verdict for table in found.metrics for pair in table.pairs} <= {"too few scenes"}
    assert {m.method for m in found.find("dark", "albedo.psnr.channel").methods} == {
        "truth", "gray", "input", "retinex"
    }  # fmt: skip
    breaches = check_result(tiny_run, rescore=True).breaches
    assert {(breach.rule, breach.unknown) for breach in breaches} <= {("origin", False)}, breaches
    record = read_run(tiny_run)
    assert all(len(r.sheet.protocols) > 10 for r in record.results if r.sheet)
    assert all(not r.access.refused for r in record.results if r.access)
    sees = {m.name: bool(m.sees) for m in record.methods}
    assert all(r.access and bool(r.access.handed) is sees[r.job.method] for r in record.results)


def test_truth_scores_the_optimum_of_every_metric(tiny_run: Path):
    for track in TRACKS:
        sheet = sheets(tiny_run)[track, "truth"]
        assert sheet
        assert {s.metric: s.value for s in sheet.scores} == {s.metric: s.optimum for s in sheet.scores}
    found = {t: {s.metric for s in sheets(tiny_run)[t, "truth"].scores} for t in TRACKS}  # pyright: ignore
    assert {"counterfactual.psnr", "counterfactual.residual.footprint"} < found["tabletop"]
    assert {"relighting.psnr", "composition.psnr"} < found["multilight"]


@pytest.mark.parametrize("method", ["gray", "input", "retinex"])
@pytest.mark.parametrize("track", TRACKS)
def test_the_others_are_finite_and_worse(tiny_run: Path, track: str, method: str):
    sheet = sheets(tiny_run)[track, method]
    assert sheet
    scored = [s for s in sheet.scores if s.status == "scored"]
    assert {"albedo.psnr.raw", "albedo.psnr.scalar", "albedo.psnr.channel"} <= {s.metric for s in scored}
    for score in scored:
        assert score.value is not None
        assert abs(score.value) < 1e6
        assert score.value < score.optimum if score.higher_is_better else score.value > score.optimum
    assert all(s.status == "not provided" for s in sheet.scores if s not in scored)


def test_again_it_reuses_everything(tiny_run: Path, capsys: pytest.CaptureFixture[str]):
    before, scores, record = stamps(tiny_run), sheets(tiny_run), read_run(tiny_run)
    assert main(["bench", str(tiny_run.parent / "tiny.toml"), "--out", str(tiny_run)]) == 0
    assert stamps(tiny_run) == before
    assert sheets(tiny_run) == scores
    assert read_run(tiny_run) == record, "nothing was measured anew, so nothing is said anew"
    last = capsys.readouterr().out.strip().splitlines()[-1]
    assert last.startswith("bench: 12 jobs, 0 failures")
    assert last.endswith(str(tiny_run / "report" / "index.html"))


def test_a_fit_on_the_cpu_or_of_other_code_uses_no_gpu(tmp_path: Path):
    def fit(**settings: str) -> FitJob:
        return FitJob(Job("dark", "a", "2dgs", 0, settings, "2dgs"), "hash", tmp_path, tmp_path, 1)

    assert fit(backend="cuda").may_use_gpu
    assert fit().may_use_gpu, "nobody knows what a method without back ends uses"
    assert not fit(backend="cpu").may_use_gpu
    assert not replace(fit(), given=Given(tmp_path, "")).may_use_gpu


@pytest.mark.parametrize("step", [run_fit, run_score])
def test_a_worker_that_fails_where_another_has_done_the_job_leaves_no_log(
    write_tiny: Callable[..., Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    step: Callable[[FitJob], Outcome],
):
    """A worker that lost its scheduler may break while it waits for the one that was given its job."""
    scene, folder = write_tiny(tmp_path / "dataset"), tmp_path / "jobs/dark/tiny/gray"
    fit = FitJob(Job("dark", scene.name, "gray", 0, {}, "gray"), "hash", scene, folder, 1, tmp_path / "jobs")

    def break_off(job: FitJob) -> NoReturn:
        raise RuntimeError("nobody listens")

    if step is run_score:
        assert not run_fit(fit).reason
    with monkeypatch.context() as patch:
        patch.setattr(_jobs, "_lock", break_off)
        assert "nobody listens" in step(fit).reason
    assert (folder / "error.txt").is_file()
    done = step(fit)
    assert not (folder / "error.txt").exists(), "what failed before is done now"
    monkeypatch.setattr(_jobs, "_lock", break_off)
    again = step(fit)
    assert (again.reused, again.value) == (True, done.value)
    assert not (folder / "error.txt").exists()


def test_scores_that_another_worker_has_just_made_are_kept(write_tiny: Callable[..., Path], tmp_path: Path):
    """A worker that has lost its scheduler goes on, while another has been given the job."""
    scene, folder = write_tiny(tmp_path / "dataset"), tmp_path / "jobs/dark/tiny/gray"
    fit = FitJob(Job("dark", scene.name, "gray", 0, {}, "gray"), "hash", scene, folder, 1, tmp_path / "jobs")
    assert not run_fit(fit).reason
    first, scores = run_score(fit), folder / "scores.json"
    made = scores.read_bytes()
    scores.unlink()
    with ThreadPoolExecutor(1) as pool:
        with file_lock(folder / ".lock", lambda _: None):
            second = pool.submit(run_score, fit)
            time.sleep(0.3)
            assert not second.done(), "it waits for the lock"
            scores.write_bytes(made)
        outcome = second.result(60)
    assert (first.reused, outcome.reused) == (False, True)
    assert outcome.value == first.value


def test_scores_are_made_anew_when_weights_arrive_or_are_mended(
    write_tiny: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    scene, folder = write_tiny(tmp_path / "dataset"), tmp_path / "jobs/dark/tiny/gray"
    job = Job("dark", scene.name, "gray", 0, {}, "gray")
    fit = FitJob(job, "hash", scene, folder, 1, tmp_path / "jobs")

    def status() -> str:
        found = find_scores(fit)
        assert found
        return {s.metric: s.status for s in found.value.scores}.get("novel_view.lpips.vgg", "none")

    monkeypatch.setenv("GRAYCARD_WEIGHTS", str(tmp_path / "none"))
    monkeypatch.delenv("GRAYCARD_LPIPS", raising=False)
    assert not run_fit(fit).reason
    assert not run_score(fit).reason
    assert status() == "none", "what was lacking is lacking still"
    monkeypatch.setenv("GRAYCARD_LPIPS", str(tmp_path / "weights"))
    write_random_weights(tmp_path / "weights")
    assert find_scores(fit) is None, "weights have arrived"
    good = (tmp_path / "weights" / "vgg.safetensors").read_bytes()
    (tmp_path / "weights" / "vgg.safetensors").write_bytes(b"damaged")
    assert not run_score(fit).reason
    assert find_scores(fit) is None, "a metric that failed is tried again"
    (tmp_path / "weights" / "vgg.safetensors").write_bytes(good)
    assert not run_score(fit).reason
    assert status() == "scored"
    monkeypatch.delenv("GRAYCARD_LPIPS")
    assert status() == "scored", "what was scored stays where weights are gone"


def test_killed_while_rendering_and_while_fitting_it_ends_the_same(
    tiny_run: Path, tmp_path: Path, suite_of: Callable[..., Path]
):
    suite, run = suite_of(tracks=("dark",)), tmp_path / "run"
    command = [sys.executable, "-m", "graycard", "bench", str(suite), "--out", str(run), "--jobs", "1"]
    kill_when(command, lambda: any(run.glob("dataset/*/.*/**/*.exr")))
    assert not (run / "run.json").exists()
    kill_when(command, lambda: any(run.glob("jobs/*/*/*/predictions/views/*.exr")))
    assert not (run / "run.json").exists()
    assert main(command[3:]) == 0
    assert sheets(run) == dark_sheets(tiny_run)


def kill_when(command: list[str], seen: Callable[[], bool]) -> None:
    """Start a command in a process group of its own and SIGKILL the whole group once ``seen`` says so."""
    with subprocess.Popen(
        command, start_new_session=True, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL
    ) as process:
        deadline = time.monotonic() + 120
        while not seen():
            assert process.poll() is None, "it ended before it could be killed"
            assert time.monotonic() < deadline
            time.sleep(0.002)
        os.killpg(process.pid, signal.SIGKILL)


@pytest.mark.usefixtures("here")
def test_a_damaged_prediction_is_made_again(tiny_run: Path, tmp_path: Path, suite_of: Callable[..., Path]):
    run, dataset = tmp_path / "run", tiny_run / "dataset"
    command = ["bench", str(suite_of(tracks=("dark",))), "--out", str(run), "--dataset", str(dataset)]
    assert main(command) == 0
    scores = sheets(run)
    for path in run.glob("jobs/dark/*/gray*/predictions/views/test*.exr"):
        path.write_bytes(b"damaged")
    for path in run.glob("jobs/dark/*/retinex*/predictions/views/test*.exr"):
        path.unlink()
    (next(run.glob("jobs/dark/*/input*")) / "scores.json").write_text("[]")
    (next(run.glob("jobs/dark/*/truth*")) / "job.json").write_text("{")
    assert main(command) == 0
    assert sheets(run) == scores


def test_an_oracle_is_made_again_when_the_truth_changes(make_scene: Callable[..., Path], tmp_path: Path):
    scene = make_scene()
    job = Job("dark", scene.name, "truth", 0, {}, "truth")
    before = job_hash(job, [sha256(scene / p / "manifest.json") for p in ("capture", "truth")], "code")
    assert job_hash(job, [sha256(scene / "capture" / "manifest.json"), "other"], "code") != before
    assert job_hash(job, ["other"], "other code") != before


def test_two_benches_at_once_do_the_work_once(tiny_run: Path, tmp_path: Path, suite_of: Callable[..., Path]):
    run = tmp_path / "run"
    options = [str(suite_of(tracks=("dark",))), "--out", str(run), "--dataset", str(tiny_run / "dataset")]
    command = [sys.executable, "-m", "graycard", "bench", *options, "--jobs", "1"]
    both = [subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL) for _ in range(2)]
    assert [process.wait(120) for process in both] == [0, 0]
    assert sheets(run) == dark_sheets(tiny_run)


@pytest.mark.usefixtures("here")
def test_a_part_of_a_suite_joins_what_is_there(tiny_run: Path, tmp_path: Path, suite_of: Callable[..., Path]):
    run = tmp_path / "run"
    command = ["bench", str(suite_of()), "--out", str(run), "--dataset", str(tiny_run / "dataset")]
    assert main([*command, "--tracks", "dark", "--methods", "truth", "gray"]) == 0
    first = read_run(run).wall_s
    assert main([*command, "--tracks", "dark", "tabletop", "--methods", "input"]) == 0
    assert read_run(run).wall_s > first, "the time of both parts"
    assert set(sheets(run)) == {("dark", "truth"), ("dark", "gray"), ("dark", "input"), ("tabletop", "input")}
    record = read_run(run)
    assert [s.track for s in record.scenes] == ["dark", "tabletop"]
    assert [m.name for m in record.methods] == ["truth", "gray", "input"], "the suite's order"
    assert [r.job.method for r in record.results] == ["truth", "gray", "input", "input"]
    assert (run / "report" / "index.html").is_file()


@pytest.mark.usefixtures("here")
def test_two_parts_of_a_suite_at_once_lose_nothing(
    tiny_run: Path, tmp_path: Path, suite_of: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
):
    """One ends while the other, which began in an empty folder, is at work."""
    run = tmp_path / "run"
    command = ["bench", str(suite_of()), "--out", str(run), "--dataset", str(tiny_run / "dataset")]
    command += ["--methods", "gray", "--tracks"]
    measure, other = _runner.measure, ["dark"]

    def measured(bench: _runner.Bench) -> _runner.Measured:
        found = measure(bench)
        while other:
            assert main([*command, other.pop()]) == 0
        return found

    monkeypatch.setattr(_runner, "measure", measured)
    assert main([*command, "tabletop"]) == 0
    assert set(sheets(run)) == {("dark", "gray"), ("tabletop", "gray")}
    assert [scene.track for scene in read_run(run).scenes] == ["dark", "tabletop"], "the suite's order"


def test_a_record_of_a_newer_graycard_is_left_alone(
    tiny_run: Path, tmp_path: Path, suite_of: Callable[..., Path], capsys: pytest.CaptureFixture[str]
):
    run = tmp_path / "run"
    run.mkdir()
    newer = json.dumps(read_json(tiny_run / "run.json") | {"format_version": 99})
    (run / "run.json").write_text(newer)
    assert main(["bench", str(suite_of()), "--out", str(run)]) == 2
    assert "got version 99. Install a newer graycard" in capsys.readouterr().err
    assert (run / "run.json").read_text() == newer


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("told", [True, False])
def test_an_environment_is_kept_for_what_its_record_tells(
    tiny_run: Path,
    tmp_path: Path,
    suite_of: Callable[..., Path],
    told: bool,
    monkeypatch: pytest.MonkeyPatch,
):
    """A bench that was killed leaves results that no record tells of: the record before is not theirs."""
    monkeypatch.setattr("graycard.benchmarks._runner.Bench.elapsed_s", lambda bench: 7.0)
    run = tmp_path / "run"
    command = ["bench", str(suite_of()), "--out", str(run), "--dataset", str(tiny_run / "dataset")]
    command += ["--tracks", "dark", "--methods", "gray", "input"]
    assert main(command) == 0
    record = json.loads((run / "run.json").read_text())
    record["environment"]["git_commit"] = "before"
    record["wall_s"] = 1000.0
    record["started"] = "2025" + record["started"][4:]  # of another bench, for certain
    if not told:
        record["results"][0]["job_hash"] = "of other code"
    (run / "run.json").write_text(json.dumps(record))
    made = stamps(run)
    assert main(command) == 0
    assert stamps(run) == made, "nothing is made again"
    after = read_run(run)
    assert (after.environment["git_commit"] == "before") is told
    assert after.wall_s == (1000.0 if told else 1007.0)


def test_a_run_of_another_suite_is_left_alone(
    tiny_run: Path, tmp_path: Path, suite_of: Callable[..., Path], capsys: pytest.CaptureFixture[str]
):
    other = suite_of()
    other.write_text(other.read_text().replace('name = "tiny"', 'name = "other"'))
    assert main(["bench", str(other), "--out", str(tiny_run)]) == 2
    assert "to hold a run of 'other' version 1, got one of 'tiny' version 1" in capsys.readouterr().err


@pytest.mark.usefixtures("here")
def test_variants_of_a_method_have_rows_of_their_own(
    tiny_run: Path, tmp_path: Path, suite_of: Callable[..., Path]
):
    suite, run = suite_of(tracks=("dark",)), tmp_path / "run"
    suite.write_text(
        suite.read_text()
        + '[[methods]]\nname = "gray"\nlabel = "gray-light"\nsettings = {reflectance = 0.6}\n'
    )
    command = [
        "bench",
        str(suite),
        "--out",
        str(run),
        "--dataset",
        str(tiny_run / "dataset"),
        "--methods",
        "gray",
        "gray-light",
    ]
    assert main(command) == 0
    values = {r.job.method: r.sheet.score("albedo.psnr.raw").value for r in read_run(run).results if r.sheet}
    assert set(values) == {"gray", "gray-light"}
    assert values["gray"] != values["gray-light"]
    assert main(["gate", str(run), "--baseline", str(tmp_path / "b.json"), "--write"]) == 0
    assert main(["gate", str(run), "--baseline", str(tmp_path / "b.json")]) == 0


def test_gate_passes_the_run_that_made_the_baseline(
    tiny_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    baseline = str(tmp_path / "base.json")
    assert main(["gate", str(tiny_run), "--baseline", baseline, "--write"]) == 0
    assert main(["gate", str(tiny_run), "--baseline", baseline]) == 0
    assert "gate: passed" in capsys.readouterr().out.splitlines()[-1]


@pytest.mark.usefixtures("here")
def test_gate_names_what_got_worse(
    tiny_run: Path, tmp_path: Path, suite_of: Callable[..., Path], capsys: pytest.CaptureFixture[str]
):
    baseline, run = str(tmp_path / "base.json"), tmp_path / "worse"
    assert main(["gate", str(tiny_run), "--baseline", baseline, "--write"]) == 0
    shutil.copytree(tiny_run, run)  # all but ``gray`` is there
    worse = suite_of(reflectance=0.95)
    assert main(["bench", str(worse), "--out", str(run)]) == 0
    assert main(["gate", str(run), "--baseline", baseline, "--json", str(tmp_path / "v.json")]) == 1
    out = capsys.readouterr().out
    good, bad = (sheets(r)["dark", "gray"].score("albedo.psnr.raw").value for r in (tiny_run, run))  # pyright: ignore
    assert f"gray albedo.psnr.raw: expected {good:.4g} dB" in out
    assert f"got {bad:.4g}" in out
    assert "accuracy dropped" in out.splitlines()[-1]
    assert read_json(tmp_path / "v.json")["result"]["worse"]


@pytest.mark.usefixtures("here")
def test_gate_fails_when_less_was_measured(
    tiny_run: Path, tmp_path: Path, suite_of: Callable[..., Path], capsys: pytest.CaptureFixture[str]
):
    baseline, run = str(tmp_path / "base.json"), tmp_path / "fewer"
    assert main(["gate", str(tiny_run), "--baseline", baseline, "--write"]) == 0
    command = ["bench", str(suite_of()), "--out", str(run), "--dataset", str(tiny_run / "dataset")]
    assert main([*command, "--tracks", "dark", "--methods", "truth", "gray"]) == 0
    assert main(["gate", str(run), "--baseline", baseline]) == 2
    assert "missing: dark/corridor-1000 input albedo.psnr.raw" in capsys.readouterr().out


BROKEN = """
import os
from graycard import GraycardError, OutputError
from graycard.methods import NoSettings
class Raises:
    summary, needs, settings_type = "Raises in fit", (), NoSettings
    def fit(self, capture, priors, settings, seed, progress): raise RuntimeError("no convergence")
    def load(self, folder): ...
class Exits(Raises):
    summary = "Ends the program"
    def fit(self, capture, priors, settings, seed, progress): raise SystemExit(0)
class Hangs(Raises):
    summary = "Never ends"
    def fit(self, capture, priors, settings, seed, progress):
        while True: pass
class Dies(Raises):
    summary = "Takes its process down"
    def fit(self, capture, priors, settings, seed, progress): os._exit(9)
class CannotWrite(Raises):
    summary = "Has no room for its own files"
    def fit(self, capture, priors, settings, seed, progress): raise OutputError("no room for a checkpoint")
class Interrupts(Raises):
    summary = "Raises what Ctrl+C raises"
    def fit(self, capture, priors, settings, seed, progress): raise KeyboardInterrupt
class Speechless(GraycardError):
    def __str__(self): raise RuntimeError("no words")
class CannotSay(Raises):
    summary = "Raises what has no words"
    def fit(self, capture, priors, settings, seed, progress): raise Speechless
class NoText(Raises):
    summary = "Raises words that are no text"
    def fit(self, capture, priors, settings, seed, progress): raise ValueError("file " + chr(0xDCFF))
"""


@pytest.fixture
def broken_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    (tmp_path / "broken_methods.py").write_text(BROKEN)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    yield "broken_methods"
    sys.modules.pop("broken_methods", None)


BREAKS = {
    "Raises": "RuntimeError: no convergence (traceback in error.txt)",
    "Exits": "failed with SystemExit: 0",
    "CannotWrite": "failed with OutputError: no room for a checkpoint",
    "Interrupts": "KeyboardInterrupt",
    "CannotSay": "(it cannot say what)",
    "NoText": "failed with ValueError: file ?",
}


@pytest.mark.parametrize("name", BREAKS)
def test_whatever_a_method_raises_fails_its_job(
    make_scene: Callable[..., Path], tmp_path: Path, broken_module: str, name: str
):
    scene, method = make_scene(), f"{broken_module}:{name}"
    job = Job("dark", scene.name, method, 0, {}, method)
    outcome = run_fit(FitJob(job, "hash", scene, tmp_path / "job", 1))
    assert BREAKS[name] in outcome.reason
    assert not outcome.fatal
    log = tmp_path / "job" / "error.txt"
    assert log.is_file() == ("error.txt" in outcome.reason)
    write_json(tmp_path / "record.json", outcome.reason)


def test_where_the_run_cannot_be_written_it_ends(make_scene: Callable[..., Path], tmp_path: Path):
    scene = make_scene()
    (tmp_path / "job").mkdir()
    (tmp_path / "job" / "predictions").write_text("in the way")
    job = Job("dark", scene.name, "gray", 0, {}, "gray")
    assert run_fit(FitJob(job, "hash", scene, tmp_path / "job", 1)).fatal


def test_a_method_that_breaks_fails_alone(
    tiny_run: Path,
    tmp_path: Path,
    suite_of: Callable[..., Path],
    broken_module: str,
    capsys: pytest.CaptureFixture[str],
):
    run = tmp_path / "run"
    command = [
        "bench",
        str(suite_of(tracks=("dark",))),
        "--out",
        str(run),
        "--dataset",
        str(tiny_run / "dataset"),
    ]
    methods = [f"{broken_module}:{name}" for name in ("Raises", "Dies", "CannotWrite", "Hangs", "NoText")]
    assert main([*command, "--methods", *methods, "gray", "--timeout", "12"]) == 1
    raised, died, unwritten, hung, no_text, gray = read_run(run).results
    assert {r.status for r in (raised, died, unwritten, hung, no_text)} == {"failed"}
    assert gray.status == "done"
    assert BREAKS["Raises"] in raised.reason
    assert BREAKS["CannotWrite"] in unwritten.reason
    assert "expected an end within 12 s, got none" in hung.reason
    assert "no convergence" in (run / raised.folder / "error.txt").read_text()
    assert "ended by its own code, exit code 9" in died.reason
    assert "no convergence" in capsys.readouterr().err
    assert (run / "report" / "index.html").is_file()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["demoo"], "expected a suite that exists, got 'demoo' (did you mean 'demo'?)"),
        (["demo", "--jobs", "0"], "expected 1 or more jobs at a time, got 0"),
        (["demo", "--tracks", "darkk"], "expected a track that exists, got 'darkk' (did you mean 'dark'?)"),
        (
            ["demo", "--methods", "trutth"],
            "expected a method that exists, got 'trutth' (did you mean 'truth'?)",
        ),
        (
            ["demo", "--out", "/proc/graycard"],
            "expected an output folder that can be written to, got /proc/graycard",
        ),
    ],
)
def test_bad_options_are_met_before_any_work(
    options: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    monkeypatch.chdir(tmp_path)
    assert main(["bench", *options]) == 2
    assert message in capsys.readouterr().err
    assert not any(tmp_path.rglob("*.exr"))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("samples = 16", "sample = 16", "sample"),
        ("samples = 16", "samples = 17", "samples"),
        ('track = "dark"', 'track = "drak"', "did you mean 'dark'"),
        ('family = "corridor"', 'family = "coridor"', "did you mean 'dark/corridor'"),
        ("reflectance", "reflektance", "did you mean 'reflectance'"),
        ("[render]", "[render", "expected TOML"),
        ('name = "input"', 'name = "gray"', "each once"),
        ("version = 1", "version = 1\nseeds = []", "expected seeds in suite 'tiny'"),
    ],
)
def test_bad_suites(
    old: str,
    new: str,
    message: str,
    tmp_path: Path,
    suite_of: Callable[..., Path],
    capsys: pytest.CaptureFixture[str],
):
    path = suite_of(tracks=("dark",))
    path.write_text(path.read_text().replace(old, new))
    assert main(["bench", str(path), "--out", str(tmp_path / "run")]) == 2
    assert message in capsys.readouterr().err


def test_a_suite_without_scenes_on_a_track(
    tmp_path: Path, suite_of: Callable[..., Path], capsys: pytest.CaptureFixture[str]
):
    suite = str(suite_of(tracks=("dark",)))
    assert main(["bench", suite, "--tracks", "tabletop", "--out", str(tmp_path / "run")]) == 2
    assert "expected suite 'tiny' to have scenes on tabletop, got none" in capsys.readouterr().err


def test_a_full_disk_ends_the_bench_and_loses_nothing(
    tiny_run: Path, small_disk: Path, suite_of: Callable[..., Path], capsys: pytest.CaptureFixture[str]
):
    run = small_disk / "run"
    command = ["bench", str(suite_of(tracks=("dark",))), "--out", str(run)]
    command += ["--dataset", str(tiny_run / "dataset")]
    assert main(command) == 2
    assert "Free some space" in capsys.readouterr().err
    assert not (run / "run.json").exists()
    subprocess.run(["mount", "-o", "remount,size=64m", str(small_disk)], check=True)
    assert main(command) == 0
    assert sheets(run) == dark_sheets(tiny_run)

# SPDX-License-Identifier: Apache-2.0
"""Commands in the place of methods: run confined, recorded, resumed, ended, and read as any predictions."""

import errno
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command_scripts import MEAN, TRIES, WAITS, fresh_python, write_script
from graycard import GraycardError, MethodError, PredictionError, RecordError, open_capture, open_predictions
from graycard.benchmarks import SuiteMethod, check_result, load_suite
from graycard.benchmarks._handed import OPAQUE, copied_capture
from graycard.benchmarks._introduction import introduction_of
from graycard.benchmarks._jobs import FitJob, run_fit
from graycard.benchmarks.commands._code import (
    MOST,
    _known_sha256,
    check_reads,
    code_of,
    hashes_of_reads,
    interpreter_of,
)
from graycard.benchmarks.commands._command import Command
from graycard.benchmarks.commands._fit import LOG, CommandSpec, fit_command, introduction_of_command
from graycard.benchmarks.commands._handing import hand_over
from graycard.cli import main
from graycard.io import sha256, silent, write_layers
from graycard.methods.confined import Ran
from graycard.methods.confined._program import run_program
from graycard.processes import landlock_version
from graycard.records import Job, JobResult, read_run

needs_landlock = pytest.mark.skipif(not landlock_version(), reason="needs Landlock")
ROW = """
[[methods]]
name = "theirs"
run = "python infer.py {{capture}} {{out}} {{gain}}"
settings = {{ gain = {gain} }}
python = "{python}"
folder = "{folder}"
input = "arrays"
maps = ["base_color=albedo/{{view}}.npy:linear"]
versions = {{ theirs = "commit 1f2e3d" }}
{more}
"""


@pytest.fixture(scope="module")
def python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fresh_python(tmp_path_factory.mktemp("venv") / "theirs")


def command_of(folder: Path, text: str, **changes: Any) -> Command:
    write_script(folder / "code", text)
    return replace(Command(run="python infer.py {capture} {out}", folder=str(folder / "code")), **changes)


def fitted(command: Command, scene: Path, folder: Path, **changes: Any) -> Path:
    spec = replace(CommandSpec(command, "theirs", {}, 0, scene), **changes)
    fit_command(spec, folder / "job" / "predictions", silent)
    return folder / "job" / "predictions"


def results_of(run: Path) -> dict[str, JobResult]:
    return {r.job.method: r for r in read_run(run).results if r.job.track == "dark"}


def test_a_command_is_a_row_beside_the_methods(
    tiny_run: Path, tmp_path: Path, python: Path, suite_of: Callable[..., Path],
    capsys: pytest.CaptureFixture[str],
):  # fmt: skip
    run, suite = tmp_path / "run", suite_of()
    shutil.copytree(tiny_run, run)
    folder, plain = write_script(tmp_path / "code", MEAN), suite.read_text()
    row = {"python": python, "folder": folder, "more": ""}
    suite.write_text(plain + ROW.format(gain=0.5, **row))
    bench = ["bench", str(suite), "--out", str(run), "--tracks", "dark"]
    assert main(bench) == 0
    first = results_of(run)["theirs"]
    assert first.status == "done"
    assert first.sheet is not None
    assert first.sheet.score("albedo.psnr.channel").status == "scored"
    told = first.job.settings["command"]
    assert told["versions"] == {"theirs": "commit 1f2e3d"}
    assert len(told["files"]["infer.py"]) == 64
    assert told["python_version"].startswith(f"{sys.version_info[0]}.")
    assert first.job.entry == "$ python infer.py {capture} {out} {gain}"
    assert first.cost is not None
    assert first.cost.peak_memory_mib > 1
    assert first.cost.cpu_s is not None, "`graycard plan` counts on it"
    predictions = run / first.folder / "predictions"
    assert open_predictions(predictions).is_whole()
    assert open_predictions(predictions).scene == first.job.scene
    assert "half way" in (predictions.parent / LOG).read_text()
    assert "theirs" in (run / "report" / "index.html").read_text()
    assert not [b for b in check_result(run).breaches if b.rule in ("truth", "hashes", "suite")]
    times = (predictions.parent / "job.json").stat().st_mtime_ns
    assert main(bench) == 0
    assert (predictions.parent / "job.json").stat().st_mtime_ns == times, "nothing has changed"
    (folder / "infer.py").write_text(MEAN.replace("sys.argv[3])", "sys.argv[3]) / 2"))
    assert main(bench) == 0
    assert results_of(run)["theirs"].job_hash != first.job_hash, "its script has changed"
    (folder / "infer.py").write_text("import no_such_module")
    capsys.readouterr()
    assert main(bench) == 1
    assert "ModuleNotFoundError: No module named 'no_such_module'" in capsys.readouterr().err


@needs_landlock
def test_a_command_sees_its_capture_and_nothing_else(
    make_scene: Callable[..., Path], tmp_path: Path, python: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("SECRET_TOKEN", "do not tell")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    scene, jobs = make_scene(), tmp_path / "jobs"
    jobs.mkdir()
    places = [scene, scene / "truth", scene / "capture", jobs, tmp_path, Path.home(), Path("/tmp")]
    command = command_of(tmp_path, TRIES, python=str(python), environment={"LEVEL": "3"})
    write_script(tmp_path / "code", json.dumps(list(map(str, places))), "places.json")
    command = replace(command, code=("places.json",))
    with pytest.raises(MethodError, match="ended with exit code 7"):
        fitted(command, scene, tmp_path)
    told = json.loads((tmp_path / "job" / LOG).read_text().partition("stdout\n")[2])
    assert told["done"] == ["listed its capture", "wrote to out"]
    assert told["scene"] == OPAQUE
    assert told["variables"]["LEVEL"] == "3"
    assert not {"SECRET_TOKEN", "PYTHONPATH"} & {*told["variables"]}
    assert not [*tmp_path.rglob("left-behind")]


FAILS = {
    "words": ("import sys\nprint('so far')\nsys.exit('no such weights')", "no such weights"),
    "signal": ("import os\nos.abort()", r"ended with exit code -6"),
    "nothing": ("", r"views/<view>.exr in {out} for each of the 5 views of capture.json, got none"),
    "link": ("import os, sys\nos.symlink('/etc/passwd', sys.argv[2] + '/views')", "got views"),
    "other": ("import sys\nopen(sys.argv[2] + '/x.png', 'w')", r"views/, and lights.json or others"),
}


@pytest.mark.parametrize("fault", FAILS)
def test_a_command_that_fails_says_why(
    fault: str, make_scene: Callable[..., Path], tmp_path: Path, python: Path
):
    text, words = FAILS[fault]
    with pytest.raises((MethodError, PredictionError), match=words):
        fitted(command_of(tmp_path, text, python=str(python)), make_scene(), tmp_path)


def test_a_command_that_takes_too_long_is_killed(make_scene: Callable[..., Path], tmp_path: Path):
    command = command_of(tmp_path, WAITS, timeout=1.0)
    with pytest.raises(
        MethodError, match=r"did not end within 1 s. Its standard output ends with:\n  started"
    ):
        fitted(command, make_scene(), tmp_path)


def test_setup_runs_before_and_its_files_are_there(make_scene: Callable[..., Path], tmp_path: Path):
    text = "import built\nraise SystemExit(f'built {built.X}')"
    command = command_of(tmp_path, text, setup="python make.py")
    write_script(tmp_path / "code", "open('built.py', 'w').write('X = 5')", "make.py")
    with pytest.raises(MethodError, match="built 5"):
        fitted(command, make_scene(), tmp_path)
    assert not (tmp_path / "code" / "built.py").exists(), "a copy is run"


@pytest.mark.parametrize("kind", ["graycard", "arrays", "nerfstudio", "colmap", "colmap-binary", "blender"])
def test_what_is_handed_over_does_not_name_the_scene(
    kind: Any, make_scene: Callable[..., Path], tmp_path: Path
):
    scene = make_scene(track="tabletop", scene="known-by-name")
    with copied_capture(scene / "capture", tmp_path / "a" / "capture") as capture:
        handed = hand_over(Command(run="x {out}", input=kind), capture, tmp_path)
    texts = [path.read_bytes() for path in handed.rglob("*") if path.is_file()]
    assert texts
    assert not [text for text in texts if b"known-by-name" in text]
    assert open_capture(scene / "capture").scene == "known-by-name"


@pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc")
def test_a_command_ends_with_ctrl_c_and_leaves_nothing(
    tiny_run: Path, tmp_path: Path, suite_of: Callable[..., Path]
):
    run, suite = tmp_path / "run", suite_of(tracks=("dark",))
    shutil.copytree(tiny_run, run)
    folder = write_script(tmp_path / "code", WAITS)
    row = ROW.format(gain=1, python=sys.executable, folder=folder, more="")
    suite.write_text(suite.read_text() + row)
    command = [sys.executable, "-m", "graycard", "bench", str(suite), "--out", str(run)]
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    environment = {**os.environ, "TMPDIR": str(temporary)}
    before = {path.relative_to(run) for path in run.rglob("*")}
    bench = subprocess.Popen(
        command, env=environment, stderr=subprocess.PIPE, text=True, preexec_fn=_hear_interrupts
    )
    patience = time.monotonic() + 120
    while not any(temporary.rglob("begun")):
        assert time.monotonic() < patience
        assert bench.poll() is None, bench.communicate()
        time.sleep(0.1)
    assert _sleepers(str(temporary)) >= 2
    bench.send_signal(signal.SIGINT)
    _, said = bench.communicate(timeout=60)
    assert (bench.returncode, "stopped" in said) == (130, True), said
    assert _sleepers(str(temporary)) == 0
    assert not [*temporary.iterdir()]
    left = {path.relative_to(run) for path in run.rglob("*") if path.is_file()} - before
    assert not [path for path in left if path.name not in (".lock", "suite.json")]


def _hear_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def _sleepers(mark: str) -> int:
    """Count processes that wait, or run the script, with a folder in their environment."""
    found = 0
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            said, variables = (entry / "cmdline").read_bytes(), (entry / "environ").read_bytes()
        except OSError:
            continue
        found += mark.encode() in variables and (b"sleep(600)" in said or b"infer.py" in said)
    return found


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "placeholder": ({"run": "python x.py {capture} {out} {steps}"}, r"got {steps}"),
    "nowhere": ({"run": "python x.py {capture}"}, r"expected {out} in the command"),
    "quotes": ({"run": "python 'x.py {out}"}, "No closing quotation"),
    "taken": ({"settings": {"seed": 3}}, "other than seed"),
    "recorded": ({"settings": {"command": 3}}, "other than command"),
    "variable": ({"environment": {"A B": "x"}}, "environment variables"),
    "preload": ({"environment": {"LD_PRELOAD": "x"}}, "environment variables"),
    "mark": ({"environment": {"GRAYCARD_WORKER": "x"}}, "environment variables"),
    "timeout": ({"timeout": 0.0}, "timeout above 0"),
    "setup": ({"setup": "python x.py {capture}"}, r"got {capture}"),
    "blank": ({"setup": " "}, "which is blank"),
    "layout": ({"layout": "no-such"}, "layout"),
    "map": ({"maps": ("base_color",)}, "expected LAYER=PATTERN"),
    "label": ({"label": "b"}, "a command has none"),
    "both": ({"predictions": "p"}, "a command has none"),
    "built-in": ({"name": "gray"}, "name of their own"),
    "alone": ({"run": "", "python": "x"}, "expected `run`"),
}


@pytest.mark.parametrize("fault", WRONG)
def test_rows_that_cannot_be_run_are_refused(fault: str):
    changes, words = WRONG[fault]
    with pytest.raises((ValueError, GraycardError), match=words):
        SuiteMethod(**{"name": "theirs", "run": "python x.py {capture} {out}", **changes})


def test_a_suite_says_what_is_wrong_with_a_command(tmp_path: Path, suite_of: Callable[..., Path]):
    suite = suite_of()
    suite.write_text(suite.read_text() + '[[methods]]\nname = "a"\nrun = "b"\n')
    with pytest.raises(RecordError, match="expected {out}"):
        load_suite(str(suite))


MISSING = {
    "script": ({}, "expected infer.py in"),
    "folder": ({"folder": "no-such-folder"}, "expected a folder of code"),
    "interpreter": ({"python": "no/such/python"}, "expected an interpreter"),
    "code": ({"run": "true {out}", "code": ("models",)}, "expected code models"),
    "outside": ({"run": "true {out}", "code": ("../x",)}, r"\.\."),
    "weights": ({"run": "true {out}", "reads": ("no-weights",)}, "expected a file or folder"),
}


@pytest.mark.parametrize("fault", MISSING)
def test_what_is_missing_is_said_before_any_work(fault: str, tmp_path: Path):
    changes, words = MISSING[fault]
    row: dict[str, Any] = {"run": "python infer.py {capture} {out}", "folder": str(tmp_path), **changes}
    with pytest.raises(GraycardError, match=words):
        introduction_of(SuiteMethod("theirs", **row))


def test_code_is_copied_and_hashed_without_what_is_none(tmp_path: Path):
    for name in (
        "infer.py",
        "net/a.py",
        "net/__pycache__/a.pyc",
        "net/.git/b",
        "net/env/pyvenv.cfg",
        "c.txt",
    ):
        path = tmp_path / "code" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    (tmp_path / "code" / "net" / "link").symlink_to("/etc/passwd")
    command = Command(run="python infer.py {out}", folder=str(tmp_path / "code"), code=("net",))
    code = code_of(command)
    assert sorted(code.files) == ["infer.py", "net/a.py"]
    assert code.named == ("infer.py",)
    code.copy(tmp_path / "copy")
    assert (tmp_path / "copy" / "net" / "a.py").read_text() == "net/a.py"


def test_an_interpreter_of_the_system_opens_nothing_else(tmp_path: Path, python: Path):
    assert python.parent.parent in interpreter_of(Command(run="x", python=str(python))).readable
    for folder in interpreter_of(Command(run="x", python=shutil.which("python3") or sys.executable)).readable:
        assert folder not in (Path("/"), Path.home())
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "python").symlink_to(sys.executable)
    found = interpreter_of(Command(run="x", python=str(tmp_path / "bin" / "python")))
    assert tmp_path not in found.readable, "it is no environment"


def test_the_script_of_the_guide_works(make_scene: Callable[..., Path], tmp_path: Path):
    page = (Path(__file__).parents[2] / "docs" / "how-to" / "run-official-code.md").read_text()
    (script,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    command = command_of(tmp_path, script, input="arrays", maps=("base_color=albedo/{view}.npy:linear",))
    predictions = fitted(command, make_scene(), tmp_path)
    found = open_predictions(predictions)
    assert found.scene == "tiny-0000"
    assert (found.layers("test_001")["base_color"] > 0).all()


LINKS = """
import os, sys
for name in ("stderr.txt", "more.txt"):
    os.path.exists(f"../printed/{name}") and os.remove(f"../printed/{name}")
    os.symlink(sys.argv[3], f"../printed/{name}")
os.remove("../printed/stdout.txt")
os.mkfifo("../printed/stdout.txt")
sys.exit(7)
"""
"""It puts links in the place of what it printed, and a pipe, which has no end."""
MOVES = """
import os, sys
os.rename("../printed", "../elsewhere")
os.symlink(sys.argv[3], "../printed")
sys.exit(7)
"""
"""It puts a link in the place of the folder of what it printed."""


@pytest.mark.parametrize("text", [LINKS, MOVES])
def test_a_command_cannot_have_other_files_read_by_links(
    text: str, make_scene: Callable[..., Path], tmp_path: Path
):
    secrets = write_script(tmp_path / "secrets", "do not tell", "stderr.txt")
    for name in ("stdout.txt", "more.txt"):
        write_script(secrets, "do not tell", name)
    command = command_of(tmp_path, text, run="python infer.py {capture} {out} {target}")
    target = secrets if text == MOVES else secrets / "stderr.txt"
    with pytest.raises(MethodError):
        fitted(command, make_scene(), tmp_path, settings={"target": str(target)})
    log = tmp_path / "job" / LOG
    assert not log.exists() or "do not tell" not in log.read_text()


def test_outputs_are_taken_to_another_file_system(
    make_scene: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Temporary files often lie in memory, a run on a disk: no file can be renamed from one to the other."""

    def refuse(source: Any, target: Any, **_: Any) -> None:
        raise OSError(errno.EXDEV, os.strerror(errno.EXDEV), str(source))

    scene = make_scene()
    views = write_script(tmp_path / "made", "", "unused").parent / "made" / "views"
    for view in open_capture(scene / "capture").views:
        shape = view.camera.height, view.camera.width, 3
        write_layers(views / f"{view.name}.exr", {"base_color": np.full(shape, 0.5, np.float32)})
    text = "import shutil, sys\nshutil.copytree('views', sys.argv[2] + '/views')"
    command = command_of(tmp_path, text, code=("views",))
    shutil.copytree(views, tmp_path / "code" / "views")
    monkeypatch.setattr(os, "rename", refuse)
    found = open_predictions(fitted(command, scene, tmp_path))
    assert found.is_whole()
    assert (found.layers("test_001")["base_color"] == 0.5).all()


def test_code_that_has_changed_since_the_bench_began_is_not_run(
    make_scene: Callable[..., Path], tmp_path: Path
):
    scene, command = make_scene(), command_of(tmp_path, "import sys\nsys.exit('it ran')")
    known = introduction_of_command(command, {})
    job = Job("dark", scene.name, "theirs", 0, known.settings, f"$ {command.run}")
    fit = FitJob(job, "hash", scene, tmp_path / "job", 1, command=command)
    assert "it ran" in run_fit(fit).reason
    write_script(tmp_path / "code", "import sys\nsys.exit('another ran')")
    said = run_fit(fit).reason
    assert "as it was when the bench began, got another" in said
    assert "another ran" not in said


READS_WEIGHTS = "import sys\nsys.exit('it read ' + open(sys.argv[3]).read())"


def test_what_a_command_reads_is_what_it_was_when_the_bench_began(
    make_scene: Callable[..., Path], tmp_path: Path
):
    scene, weights = make_scene(), tmp_path / "weights"
    weights.write_text("first")
    run = "python infer.py {capture} {out} {weights}"
    command = command_of(tmp_path, READS_WEIGHTS, run=run, reads=(str(weights),))
    known = introduction_of_command(command, {"weights": str(weights)})
    job = Job("dark", scene.name, "theirs", 0, known.settings, f"$ {command.run}")
    fit = FitJob(job, "hash", scene, tmp_path / "run" / "jobs" / "a", 1, command=command)
    assert "it read first" in run_fit(fit).reason
    weights.write_text("other")
    said = run_fit(fit).reason
    assert f"expected {weights} as it was when the bench began, got another" in said
    assert "it read" not in said
    weights.unlink()
    assert f"expected a file or folder at {weights}, got none" in run_fit(fit).reason


def test_what_a_command_reads_may_not_change_while_it_runs(
    make_scene: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    weights = tmp_path / "weights"
    weights.write_text("first")
    known = {str(weights): hashes_of_reads(Command(run="x", reads=(str(weights),)))[str(weights)]}

    def done(course: Any, process: Any) -> Ran:
        weights.write_text("other")
        return Ran(0, 1.0, 1.0, 1.0, "", "")

    monkeypatch.setattr("graycard.benchmarks.commands._fit._Course.done", done)
    command = command_of(tmp_path, "", reads=(str(weights),))
    with pytest.raises(MethodError, match="as it was when the bench began"):
        fitted(command, make_scene(), tmp_path, reads_sha256=known)


def test_large_files_are_hashed_again_where_they_have_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    folder = write_script(tmp_path / "reads", "1", "weights")
    write_script(folder, "1", "others")
    hour = time.time() - 3600
    for path in folder.iterdir():
        os.utime(path, (hour, hour))
    monkeypatch.setattr("time.time", lambda now=time.time: now() + 60)  # what was made now has settled
    hashed: list[str] = []

    def counted(path: Path) -> str:
        hashed.append(path.name)
        return sha256(path)

    monkeypatch.setattr("graycard.benchmarks.commands._code.sha256", counted)
    command = Command(run="true {out}", reads=(str(folder),))
    before = hashes_of_reads(command)
    assert hashes_of_reads(command) == before
    assert sorted(hashed) == ["others", "weights"], "once each"
    (folder / "weights").write_text("2")
    os.utime(folder / "weights", (hour, hour))
    assert hashes_of_reads(command) != before, "as large and as old as it was"
    assert hashed[2:] == ["weights"]


def test_a_folder_around_the_run_may_grow(tmp_path: Path):
    command = Command(run="true {out}", reads=(str(tmp_path),))
    known = hashes_of_reads(command)
    write_script(tmp_path / "run", "more", "log")
    check_reads(command, known, tmp_path / "run" / "jobs" / "a")
    with pytest.raises(MethodError, match="as it was"):
        check_reads(command, known, tmp_path.parent / "elsewhere")


AROUND: dict[str, Callable[[Path], tuple[Path, Path]]] = {
    "link": lambda folder: (folder / "link", folder / "data" / "run" / "a"),
    "link-to-the-run": lambda folder: (folder / "data", folder / "link" / "run" / "a"),
    "up": lambda folder: (folder / "data" / "run" / "..", folder / "data" / "run" / "a"),
    "run-up": lambda folder: (folder / "data", folder / "other" / ".." / "data" / "run" / "a"),
}


@pytest.mark.parametrize("path", AROUND)
def test_a_folder_around_the_run_is_known_by_any_path(path: str, tmp_path: Path):
    (tmp_path / "data" / "run").mkdir(parents=True)
    (tmp_path / "other").mkdir()
    (tmp_path / "link").symlink_to("data")
    reads, job = AROUND[path](tmp_path)
    command = Command(run="true {out}", reads=(str(reads),))
    known = hashes_of_reads(command)
    write_script(tmp_path / "data" / "run", "more", "log")
    check_reads(command, known, job)
    with pytest.raises(MethodError, match="as it was"):
        check_reads(command, known, tmp_path / "other" / ".." / "elsewhere")


def test_each_of_very_many_files_is_hashed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for number in range(150):
        (tmp_path / f"file-{number}").write_text("")
        (tmp_path / f"link-{number}").symlink_to(".")
    monkeypatch.setattr("time.time", lambda now=time.time: now() + 60)  # what was made now has settled
    hashed: list[Path] = []
    monkeypatch.setattr(
        "graycard.benchmarks.commands._code.sha256", lambda path: hashed.append(path) or "hash"
    )
    paths = [tmp_path / f"link-{a}" / f"file-{b}" for a in range(150) for b in range(150)]
    assert len(paths) > MOST
    for _ in range(2):
        assert {_known_sha256(path) for path in paths} == {"hash"}
    assert hashed == paths, "the second walk finds all"


READS: dict[str, Callable[[Path], object]] = {
    "file": lambda folder: (folder / "weights").write_text("2"),
    "hidden": lambda folder: (folder / ".cache" / "weights").write_text("2"),
    "link": lambda folder: ((folder / "last").unlink(), (folder / "last").symlink_to("weights")),
    "more": lambda folder: (folder / "more").write_text(""),
}


@pytest.mark.parametrize("change", READS)
def test_all_that_a_command_may_read_is_hashed(change: str, tmp_path: Path):
    folder = tmp_path / "reads"
    for name in ("weights", ".cache/weights", ".git/index", "__pycache__/a.pyc", "env/pyvenv.cfg"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("1")
    (folder / "last").symlink_to(".cache/weights")
    command = Command(run="true {out}", reads=(str(folder),))
    before = hashes_of_reads(command)
    for name in (".git/index", "__pycache__/a.pyc", "env/more"):
        (folder / name).write_text("2")
    assert hashes_of_reads(command) == before
    READS[change](folder)
    assert hashes_of_reads(command) != before


def test_a_program_costs_what_it_takes_itself(tmp_path: Path):
    def ran(text: str) -> Ran:
        return run_program([sys.executable, "-c", text], tmp_path, tmp_path, {}, None, lambda line: None)

    busy, idle = ran("sum(range(20_000_000))"), ran("")
    assert 0 < idle.cpu_s < busy.cpu_s
    assert (busy.code, idle.code, ran("import os; os.abort()").code) == (0, 0, -6)

# SPDX-License-Identifier: Apache-2.0
"""Truth is closed while a method's code runs, by whatever way it is reached for."""

import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from graycard.benchmarks._guard import GUARD, Guard, _Hook, closed, copied_capture

from graycard import (
    DatasetError,
    MethodError,
    OutputError,
    Predictions,
    UnknownNameError,
    open_capture,
    open_truth,
)
from graycard.benchmarks import FitSpec, SuiteMethod, fit_scene, load_for
from graycard.benchmarks._introduction import Meeting, introduce, introduction_of, meet
from graycard.benchmarks._jobs import FitJob, find_fit, run_fit
from graycard.dataset import manifest_of
from graycard.io import read_layers, sha256, silent, write_json, write_layers, write_manifest
from graycard.methods import fingerprint
from graycard.predictions import finish_predictions
from graycard.records import Access, Cost, Job


@pytest.fixture
def scene(make_scene: Callable[..., Path]) -> Path:
    return make_scene()


@pytest.fixture
def guard(scene: Path) -> Guard:
    return Guard(scene.parents[1])


def test_what_is_wrong_in_the_copy_is_said_of_the_users_own_folder(make_scene: Callable[..., Path]):
    """The copy is gone by the time that somebody reads of it."""
    folder = make_scene(track="tabletop") / "capture"
    capture = open_capture(folder)
    view = capture.train[0]
    path = folder / "masks" / "target" / f"{view.name}.exr"
    ids = np.full((view.camera.height, view.camera.width), 2, np.uint32)
    write_layers(path, {"object_id": ids})
    write_manifest(folder, manifest_of(capture))
    with pytest.raises(DatasetError) as caught, copied_capture(folder) as copy:
        copy.target_mask(view)
    assert f"or 0 in {path}, got 2" in str(caught.value)
    assert str(copy.root) not in str(caught.value)
    with pytest.raises(UnknownNameError, match="did you mean"), copied_capture(folder) as copy:
        copy.view(view.name[:-1])


def through_a_link(scene: Path) -> None:
    link = scene.parents[2] / "innocent"
    link.symlink_to(scene)
    (link / "truth" / "truth.json").read_text()


def in_a_thread(scene: Path) -> None:
    errors: list[BaseException] = []

    def work() -> None:
        try:
            (scene / "truth" / "lights.json").read_bytes()
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    raise errors[0]


def by_a_relative_path(scene: Path) -> None:
    """As a method does that is started in the run folder."""
    here = os.getcwd()
    os.chdir(scene.parents[2])
    try:
        subprocess.run(["cat", (scene / "truth" / "truth.json").relative_to(scene.parents[2])], check=True)
    finally:
        os.chdir(here)


def by_a_program_through_a_link(scene: Path) -> None:
    link = scene.parents[2] / "innocent"
    link.symlink_to(scene)
    os.system(f"cat <{link}/truth/truth.json")


WAYS: dict[str, Callable[[Path], object]] = {
    "open": lambda scene: (scene / "truth" / "truth.json").read_text(),
    "bytes": lambda scene: os.open(os.fsencode(scene / "truth" / "truth.json"), os.O_RDONLY),
    "os.open": lambda scene: os.open(scene / "truth" / "truth.json", os.O_RDONLY),
    "listing": lambda scene: list((scene / "truth").iterdir()),
    "scandir": lambda scene: next(os.scandir(scene / "truth" / "views")),
    "dots": lambda scene: (scene / "capture" / ".." / "truth" / "truth.json").read_text(),
    "link": through_a_link,
    "hard link": lambda scene: os.link(scene / "truth" / "truth.json", scene.parents[2] / "mine.json"),
    "rename": lambda scene: os.rename(scene / "truth", scene / "mine"),
    "rename of the scene": lambda scene: os.rename(scene, scene.parents[2] / "mine"),
    "chdir": lambda scene: os.chdir(scene / "truth"),
    "our reader": lambda scene: read_layers(scene / "truth" / "views" / "test_001.exr"),
    "our door": lambda scene: open_truth(scene / "truth"),
    "another program": lambda scene: subprocess.run(["cat", str(scene / "truth" / "truth.json")], check=True),
    "a shell": lambda scene: os.system(f"cat {scene}/truth/truth.json"),
    "a relative path": by_a_relative_path,
    "a program in a folder": lambda scene: subprocess.run(["cat", "truth/truth.json"], cwd=scene, check=True),
    "a program through a link": by_a_program_through_a_link,
    "a thread": in_a_thread,
    "another scene": lambda scene: (scene.parents[1] / "tabletop" / "other" / "truth" / "x").read_text(),
}


@pytest.mark.parametrize("way", WAYS)
def test_every_way_to_the_truth_is_closed(scene: Path, guard: Guard, way: str):
    with closed(guard), pytest.raises(MethodError, match="truth is closed while a method runs"):
        WAYS[way](scene)
    assert len(guard.refused) == 1
    assert (scene / "truth" / "truth.json").is_file()
    open_truth(scene / "truth")  # open again


def test_all_else_is_open(scene: Path, guard: Guard, tmp_path: Path):
    (tmp_path / "truth").mkdir()
    with closed(guard):
        open_capture(scene / "capture")
        (tmp_path / "truth" / "mine.txt").write_text("a folder may bear that name elsewhere")
        list(scene.iterdir())
        subprocess.run([sys.executable, "-c", ""], check=True)
        with open(os.open(tmp_path / "x", os.O_CREAT | os.O_RDONLY)) as file:
            assert file.read() == ""
    assert guard.refused == []


def test_predictions_of_others_are_closed_and_its_own_are_not(scene: Path, tmp_path: Path):
    jobs = tmp_path / "run" / "jobs"
    own, other = jobs / "dark" / "s" / "mine-0", jobs / "dark" / "s" / "truth-0"
    for folder in (own, other):
        folder.mkdir(parents=True)
        (folder / "predictions.json").write_text("{}")
    guard = Guard(scene.parents[1], jobs, own)
    with closed(guard):
        assert (own / "predictions.json").read_text() == "{}"
        with pytest.raises(MethodError, match="truth-0"):
            (other / "predictions.json").read_text()
        with pytest.raises(MethodError, match=r"subprocess.Popen"):
            subprocess.run(["ls", str(jobs)], check=True)


def test_what_is_tried_twice_is_named_once(scene: Path, guard: Guard):
    for _ in range(2):
        with closed(guard), pytest.raises(MethodError):
            (scene / "truth" / "truth.json").read_text()
    assert guard.refused == [str(scene / "truth" / "truth.json")]


PEEPERS = """
from pathlib import Path
import numpy as np
from graycard import GraycardError, open_truth
from graycard.methods import NoSettings
from graycard.methods._gray import GrayMethod
LOG = []
class Peeps(GrayMethod):
    summary = "Looks beside its capture, and at the dataset if it is told where"
    def fit(self, capture, priors, settings, seed, progress):
        LOG.append(sorted(p.name for p in capture.root.parent.iterdir()))
        try:
            open_truth(Path(SCENE) / "truth")
        except GraycardError as error:
            LOG.append(str(error))
        return super().fit(capture, priors, settings, seed, progress)
class Insists(GrayMethod):
    summary = "Cannot do without"
    def fit(self, capture, priors, settings, seed, progress):
        return open(Path(SCENE) / "truth" / "truth.json")
"""


@pytest.fixture
def peepers(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    (tmp_path / "peepers.py").write_text(f"SCENE = {str(scene)!r}\n{PEEPERS}")
    monkeypatch.syspath_prepend(tmp_path)
    yield "peepers"
    sys.modules.pop("peepers", None)


def test_a_method_that_looks_is_refused_and_it_is_recorded(scene: Path, tmp_path: Path, peepers: str):
    fitted = fit_scene(FitSpec(f"{peepers}:Peeps", {}, 0, scene), tmp_path / "p", silent)
    beside, words = sys.modules[peepers].LOG
    assert beside == ["capture"], "there is nothing beside the copy"
    assert "truth is closed while a method runs" in words
    assert fitted.access.guard == GUARD
    assert fitted.access.handed == ()
    assert fitted.access.refused == (str(scene / "truth" / "manifest.json"),)
    assert fitted.access.capture_sha256 == sha256(scene / "capture" / "manifest.json")


def test_a_module_that_looks_while_it_is_imported_is_refused(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "early.py").write_text(f"open({str(scene / 'truth' / 'truth.json')!r})\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(MethodError, match="to import, got MethodError: expected a method to keep to its"):
        fit_scene(FitSpec("early:Method", {}, 0, scene), tmp_path / "p", silent)


STRANGERS = """
from pathlib import Path
from graycard.methods import Ask
from graycard.methods._gray import GrayMethod
if "early" in Path(__file__).stem:
    open(TRUTH)
class Words(str):
    pass
class Method(GrayMethod):
    summary = Words("Comes from elsewhere")
    asks = (Ask("depth", ("train",), optional=True),)
"""


@pytest.fixture
def strangers(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two modules that a bench is not to import: one is harmless, one reads truth when it is imported."""
    for name in ("stranger", "stranger_early"):
        truth = str(scene / "truth" / "truth.json")
        (tmp_path / f"{name}.py").write_text(f"TRUTH = {truth!r}\n{STRANGERS}")
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.usefixtures("strangers")
def test_a_bench_does_not_import_methods_of_others(scene: Path, tmp_path: Path):
    methods = [SuiteMethod("gray"), SuiteMethod("stranger:Method", {"reflectance": 0.5})]
    gray, stranger = introduce(methods, scene.parents[1], tmp_path / "jobs", 1)
    assert "stranger" not in sys.modules
    assert gray == introduction_of(methods[0])
    assert (stranger.summary, stranger.needs) == ("Comes from elsewhere", ())
    assert type(stranger.summary) is str, "an object of the module would bring the module with it"
    assert stranger.settings == {"reflectance": 0.5}
    assert [ask.kind for ask in stranger.asks] == ["depth"]
    assert stranger.fingerprint == fingerprint("stranger:Method", with_priors=True)


def test_what_a_worker_says_is_text(scene: Path, tmp_path: Path):
    outcome = meet(Meeting(SuiteMethod("retinex"), scene.parents[1], tmp_path / "jobs"))
    assert isinstance(outcome.value, str)
    assert '"summary"' in outcome.value


@pytest.mark.usefixtures("strangers")
@pytest.mark.parametrize(
    ("method", "words"),
    [
        (SuiteMethod("stranger_early:Method"), "got MethodError: expected a method to keep to its capture"),
        (SuiteMethod("stranger:Method", {"reflektance": 1}), "did you mean 'reflectance'"),
        (SuiteMethod("stranger:Nothing"), "expected method 'stranger:Nothing' .* to import"),
    ],
)
def test_whom_a_bench_does_not_admit(scene: Path, tmp_path: Path, method: SuiteMethod, words: str):
    with pytest.raises(MethodError, match=words):
        introduce([method], scene.parents[1], tmp_path / "jobs", 1)
    assert not any(name.startswith("stranger") for name in sys.modules)


@pytest.mark.usefixtures("strangers")
def test_a_fit_by_hand_imports_while_truth_is_closed(scene: Path):
    with pytest.raises(MethodError, match="to import, got MethodError: expected a method to keep to its"):
        load_for("stranger_early:Method", scene)
    sys.modules.pop("stranger_early", None)


@pytest.mark.parametrize(
    ("event", "arguments", "named"),
    [
        ("open", ("{truth}/truth.json", "r", 0), "{truth}/truth.json"),
        ("open", ("{truth}/../truth/truth.json", "r", 0), "{truth}/truth.json"),
        ("os.listdir", ("{truth}",), "{truth}"),
        ("os.rename", ("/innocent", "{truth}/mine", -1, -1), "{truth}/mine"),
        ("graycard.read", ("{truth}/views/test_001.exr",), "{truth}/views/test_001.exr"),
        ("subprocess.Popen", ("cat", ["cat", "{truth}/truth.json"], None, None), None),
        ("os.system", (b"cat {truth}/truth.json",), None),
        ("open", (b"{truth}/truth.json", "r", 0), "{truth}/truth.json"),
    ],
)
def test_what_the_hook_makes_of_an_event(
    scene: Path, guard: Guard, event: str, arguments: tuple[object, ...], named: str | None
):
    def real(value: object) -> object:
        match value:
            case str():
                return value.replace("{truth}", str(scene / "truth"))
            case bytes():
                return value.replace(b"{truth}", os.fsencode(scene / "truth"))
            case list():
                return [real(v) for v in value]
            case _:
                return value

    hook = _Hook()
    hook.guard = guard
    with pytest.raises(MethodError, match="truth is closed while a method runs"):
        hook(event, tuple(real(a) for a in arguments))
    (refused,) = guard.refused
    assert refused == real(named) if named else refused.startswith(event)


@pytest.mark.parametrize(
    ("event", "arguments"),
    [
        ("open", (3, "r", 0)),
        ("open", (None, "r", 0)),
        ("open", ("{scene}/capture/capture.json", "r", 0)),
        ("os.listdir", (None,)),
        ("os.rename", ("/a", "/b", -1, -1)),
        ("subprocess.Popen", ("ls", ["ls", "/"], None, None)),
        ("import", ("{scene}/truth/truth.json",)),
        ("os.remove", ("{scene}/truth/truth.json", -1)),
    ],
)
def test_what_the_hook_lets_pass(scene: Path, guard: Guard, event: str, arguments: tuple[object, ...]):
    hook = _Hook()
    real = tuple(a.replace("{scene}", str(scene)) if isinstance(a, str) else a for a in arguments)
    hook("open", (str(scene / "truth" / "truth.json"), "r", 0))  # it rests: nothing is closed
    hook.guard = guard
    hook(event, real)
    assert guard.refused == []


def test_a_method_that_cannot_do_without_fails_its_job(
    scene: Path, tmp_path: Path, peepers: str, monkeypatch: pytest.MonkeyPatch
):
    for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        monkeypatch.setenv(name, "1")
    job = Job("dark", scene.name, "insists", 0, {}, f"{peepers}:Insists")
    outcome = run_fit(
        FitJob(job, "hash", scene, tmp_path / "run" / "jobs" / "a", 1, tmp_path / "run" / "jobs")
    )
    assert "expected a method to keep to its capture" in outcome.reason
    assert "names it in `needs`" in outcome.reason
    assert not outcome.fatal


def test_what_a_method_needs_is_handed_and_named(scene: Path, tmp_path: Path):
    fitted = fit_scene(FitSpec("truth", {}, 0, scene), tmp_path / "p", silent, tmp_path / "saved")
    assert set(fitted.access.handed) >= {"base_color", "lights", "normal", "radiance"}
    assert fitted.access.refused == ()


def test_a_fit_of_which_access_is_not_known_is_done_again(scene: Path, tmp_path: Path):
    job = Job("dark", scene.name, "gray", 0, {}, "gray")
    fit = FitJob(job, "hash", scene, tmp_path / "job", 1)
    finish_predictions(tmp_path / "job" / "predictions", Predictions("gray", "dark", scene.name))
    done = {"job": job, "job_hash": "hash", "cost": Cost(1.0, 1.0)}
    write_json(tmp_path / "job" / "job.json", done)
    assert find_fit(fit) is None
    write_json(tmp_path / "job" / "job.json", done | {"access": Access(GUARD, "")})
    assert find_fit(fit) is not None


def test_a_damaged_capture_is_named_by_the_folder_that_is_known(scene: Path, tmp_path: Path):
    (scene / "capture" / "photographs" / "train_000.exr").write_bytes(b"damaged")
    with pytest.raises(DatasetError, match=str(scene / "capture")):
        fit_scene(FitSpec("gray", {}, 0, scene), tmp_path / "p", silent)


def test_where_the_copy_has_no_room(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def full(source: Path, target: Path) -> None:
        raise OSError(28, "No space left on device", str(target))

    monkeypatch.setattr("graycard.benchmarks._guard.shutil.copytree", full)
    with pytest.raises(OutputError, match="expected room to write"):
        fit_scene(FitSpec("gray", {}, 0, scene), tmp_path / "p", silent)

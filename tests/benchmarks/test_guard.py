# SPDX-License-Identifier: Apache-2.0
"""A fit is handed a copy of its capture, truth is closed to it, and both are recorded."""

import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from graycard import DatasetError, MethodError, OutputError, Predictions, UnknownNameError, open_capture
from graycard.benchmarks import FitSpec, SuiteMethod, ask_apart, fit_scene
from graycard.benchmarks._handed import GUARDS, OPAQUE, copied_capture, places_of
from graycard.benchmarks._introduction import Meeting, introduce, introduction_of, meet
from graycard.benchmarks._jobs import FitJob, find_fit, run_fit
from graycard.dataset import manifest_of
from graycard.io import sha256, silent, write_json, write_layers, write_manifest
from graycard.methods import _registry, fingerprint
from graycard.predictions import finish_predictions
from graycard.processes import AUDIT_HOOK, landlock_version
from graycard.processes._guard import Guard
from graycard.records import Access, Cost, Job


@pytest.fixture
def scene(make_scene: Callable[..., Path]) -> Path:
    return make_scene()


@pytest.fixture
def guard(scene: Path) -> Guard:
    return Guard([str(scene.parent)])


def test_what_is_wrong_in_the_copy_is_said_of_the_users_own_folder(
    make_scene: Callable[..., Path], tmp_path: Path
):
    """The copy is gone by the time that somebody reads of it."""
    folder = make_scene(track="tabletop") / "capture"
    capture = open_capture(folder)
    view = capture.train[0]
    path = folder / "masks" / "target" / f"{view.name}.exr"
    ids = np.full((view.camera.height, view.camera.width), 2, np.uint32)
    write_layers(path, {"object_id": ids})
    write_manifest(folder, manifest_of(capture))
    with pytest.raises(DatasetError) as caught, copied_capture(folder, tmp_path / "a") as copy:
        copy.target_mask(view)
    assert f"or 0 in {path}, got 2" in str(caught.value)
    assert str(copy.root) not in str(caught.value)
    with (
        pytest.raises(UnknownNameError, match="did you mean"),
        copied_capture(folder, tmp_path / "b") as copy,
    ):
        copy.view(view.name[:-1])


def test_the_copy_does_not_tell_its_scene(scene: Path, tmp_path: Path):
    with copied_capture(scene / "capture", tmp_path / "copy") as capture:
        handed = open_capture(tmp_path / "copy")
        assert (handed.scene, capture.scene) == (OPAQUE, scene.name)
        texts = [path.read_text() for path in (tmp_path / "copy").glob("*.json")]
    assert len(texts) == 2
    assert not any(scene.name in text for text in texts)
    assert handed.views[0].camera.digest == capture.views[0].camera.digest


WORDS = """
import os
from pathlib import Path
from graycard import GraycardError, open_truth
from graycard.methods import Ask
from graycard.methods._gray import GrayMethod
SCENE = Path(os.environ.get("SCENE", "/nowhere/a/b"))
if "early" in Path(__file__).stem:
    open(SCENE / "truth" / "truth.json")
class Words(str):
    pass
class Method(GrayMethod):
    summary = Words("Comes from elsewhere")
    asks = (Ask("depth", ("train",), optional=True),)
class Peeps(GrayMethod):
    summary = "Looks beside its capture, and at the dataset if it is told where, and goes on"
    def fit(self, capture, priors, settings, seed, progress):
        assert sorted(p.name for p in capture.root.parent.iterdir()) == ["capture"]
        assert capture.scene not in str(SCENE)
        for _ in range(2):
            try:
                open_truth(SCENE / "truth")
            except GraycardError as error:
                assert "truth is closed while a method runs" in str(error)
        if (child := os.fork()) == 0:
            try:
                (SCENE / "truth" / "lights.json").read_text()
            finally:
                os._exit(0)
        os.waitpid(child, 0)
        return super().fit(capture, priors, settings, seed, progress)
class Insists(GrayMethod):
    summary = "Cannot do without"
    def fit(self, capture, priors, settings, seed, progress):
        return open(SCENE / "truth" / "truth.json")
class Needy(GrayMethod):
    summary = "Reads truth where it says what it needs"
    @property
    def needs(self):
        return tuple((SCENE / "truth" / "truth.json").read_text()[:0])
class Walks(GrayMethod):
    summary = "Looks for truth among what it is handed"
    def fit(self, capture, priors, settings, seed, progress):
        assert set(priors.models) == {"depth"}
        held = priors.models["depth"]
        assert not any(hasattr(held, name) for name in ("truth", "spec", "images"))
        assert priors.layers == {}
        return super().fit(capture, priors, settings, seed, progress)
    asks = (Ask("depth", ("photograph",)),)
class Ends(GrayMethod):
    summary = "Ends its process"
    def fit(self, capture, priors, settings, seed, progress):
        os._exit(0)
"""


@pytest.fixture(autouse=True)
def strangers(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two modules that a bench is not to import: one is harmless, one reads truth when it is imported."""
    code = tmp_path / "code"
    code.mkdir()
    for name in ("stranger", "stranger_early"):
        (code / f"{name}.py").write_text(WORDS)
    (code / "stranger_renders.py").write_text(f"{WORDS}\ndef render():\n    import graycard.synth\n")
    monkeypatch.syspath_prepend(code)
    monkeypatch.setenv("SCENE", str(scene))
    monkeypatch.setenv("GRAYCARD_PASS", "SCENE")


def test_a_method_that_looks_is_refused_and_it_is_recorded(scene: Path, tmp_path: Path):
    fitted = fit_scene(FitSpec("stranger:Peeps", {}, 0, scene), tmp_path / "p", silent)
    assert GUARDS.fullmatch(fitted.access.guard)
    assert fitted.access.handed == ()
    truth = scene / "truth"
    assert fitted.access.refused == (str(truth / "manifest.json"), str(truth / "lights.json"))
    assert fitted.access.capture_sha256 == sha256(scene / "capture" / "manifest.json")


@pytest.mark.parametrize(
    ("method", "words"),
    [
        ("stranger_early:Method", "cannot be imported: MethodError: the method tried to reach"),
        ("stranger:Needy", "truth is closed while a method runs"),
        ("stranger:Ends", "exit code 0"),
        ("stranger:Nothing", "method 'stranger:Nothing' .* cannot be imported"),
    ],
)
def test_a_fit_that_fails(scene: Path, tmp_path: Path, method: str, words: str):
    with pytest.raises(MethodError, match=words):
        fit_scene(FitSpec(method, {}, 0, scene), tmp_path / "p", silent)
    assert "stranger" not in sys.modules


def test_a_prior_answers_from_elsewhere(scene: Path, tmp_path: Path):
    from graycard.methods.priors import PriorSpec

    spec = FitSpec("stranger:Walks", {}, 0, scene, priors=PriorSpec("oracle", 2))
    assert fit_scene(spec, tmp_path / "p", silent).access.handed == ()


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


@pytest.mark.parametrize(
    ("method", "words"),
    [
        (SuiteMethod("stranger_early:Method"), "MethodError: the method tried to reach .*: truth is closed"),
        (SuiteMethod("stranger:Method", {"reflektance": 1}), "did you mean 'reflectance'"),
        (SuiteMethod("stranger:Nothing"), "method 'stranger:Nothing' .* cannot be imported"),
    ],
)
def test_whom_a_bench_does_not_admit(scene: Path, tmp_path: Path, method: SuiteMethod, words: str):
    outcome = meet(Meeting(method, scene.parents[1], tmp_path / "jobs"))
    assert outcome.value is None
    with pytest.raises(MethodError, match=words):
        raise MethodError(outcome.reason)
    assert not any(name.startswith("stranger") for name in sys.modules)


def test_code_that_a_fit_may_not_run_counts_as_elsewhere(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)  # packages of the folder of work are open
    name = "stranger_renders:Method"
    outcome = meet(Meeting(SuiteMethod(name), scene.parents[1], tmp_path / "jobs"))
    assert outcome.reason == ""
    assert outcome.value.fingerprint == fingerprint(name, with_priors=True)


def test_code_that_cannot_be_read_is_an_error_in_words(monkeypatch: pytest.MonkeyPatch):
    def refuse(*_: object) -> str:
        raise PermissionError(13, "Permission denied", "/closed/code.py")

    monkeypatch.setattr(_registry, "code_hash", refuse)
    with pytest.raises(MethodError, match="imports /closed/code.py, which no fit may read"):
        fingerprint("gray")


def test_settings_of_a_fit_by_hand_are_asked_apart(scene: Path):
    asked = {"method": "stranger:Method", "args": ["--reflectance", "0.5"]}
    told = ask_apart("stranger:Method", scene, "graycard.cli._runs:told_settings", told=asked)
    assert told["settings"] == {"reflectance": 0.5}
    assert told["exit"] is None
    asked["args"] = ["--reflectance", "much"]
    with pytest.raises(MethodError, match="expected a number after --reflectance, got 'much'"):
        ask_apart("stranger:Method", scene, "graycard.cli._runs:told_settings", told=asked)
    asked["args"] = ["--reflectance"]
    told = ask_apart("stranger:Method", scene, "graycard.cli._runs:told_settings", told=asked)
    assert told["exit"] == 2
    asked["method"] = "stranger_early:Method"
    with pytest.raises(MethodError, match="cannot be imported: MethodError: the method tried to reach"):
        ask_apart("stranger_early:Method", scene, "graycard.cli._runs:told_settings", told=asked)
    assert "stranger" not in sys.modules


@pytest.mark.parametrize(
    ("event", "arguments", "named"),
    [
        ("open", ("{truth}/truth.json", "r", 0), "{truth}/truth.json"),
        ("open", ("{truth}/../truth/truth.json", "r", 0), "{truth}/truth.json"),
        ("open", (b"{truth}/truth.json", "r", 0), "{truth}/truth.json"),
        ("open", ("{scene}/capture/capture.json", "r", 0), "{scene}/capture/capture.json"),
        ("os.listdir", ("{truth}",), "{truth}"),
        ("os.remove", ("{truth}/truth.json", -1), "{truth}/truth.json"),
        ("os.rmdir", ("{scene}/..", -1), "{dataset}"),
        ("os.truncate", ("{truth}/truth.json", 0), "{truth}/truth.json"),
        ("os.rename", ("/innocent", "{truth}/mine", -1, -1), "{truth}/mine"),
        ("os.rename", ("{scene}", "/mine", -1, -1), "{scene}"),
        ("os.rename", ("{dataset}/..", "/mine", -1, -1), "{root}"),
        ("graycard.read", ("{truth}/views/test_001.exr",), "{truth}/views/test_001.exr"),
        ("subprocess.Popen", ("cat", ["cat", "{truth}/truth.json"], None, None), None),
        ("subprocess.Popen", ("cat", ["cat", "truth/truth.json"], "{scene}", None), None),
        ("os.system", (b"cat {truth}/truth.json",), None),
        ("import", ("graycard.synth.families", None, None, None, None), "graycard.synth.families"),
    ],
)
def test_what_the_hook_refuses(
    scene: Path, guard: Guard, event: str, arguments: tuple[object, ...], named: str | None
):
    places = {
        "truth": scene / "truth", "scene": scene, "dataset": scene.parent, "root": scene.parents[1],
    }  # fmt: skip

    def real(value: object) -> object:
        match value:
            case str():
                return value.format(**places)
            case bytes():
                return os.fsencode(value.decode().format(**places))
            case list():
                return [real(v) for v in value]
            case _:
                return value

    for _ in range(2):
        with pytest.raises(MethodError, match="truth is closed while a method runs"):
            guard(event, tuple(real(a) for a in arguments))
    (refused,) = guard.refused
    assert refused == real(named) if named else refused.startswith(event)


@pytest.mark.parametrize(
    ("event", "arguments"),
    [
        ("open", (3, "r", 0)),
        ("open", (None, "r", 0)),
        ("open", ("{root}/capture/capture.json", "r", 0)),
        ("open", ("{scene}-stages/x", "r", 0)),
        ("os.listdir", (None,)),
        ("os.rename", ("/a", "/b", -1, -1)),
        ("subprocess.Popen", ("ls", ["ls", "/"], None, None)),
        ("import", ("graycard.synthesis", None, None, None, None)),
        ("import", ("{scene}/truth/truth.json",)),
        ("os.getxattr", ("{root}/x", "user.x")),
    ],
)
def test_what_the_hook_lets_pass(scene: Path, event: str, arguments: tuple[object, ...]):
    guard = Guard([str(scene), f"{scene}-stages"], [f"{scene}-stages/x"])
    real = (a.format(scene=scene, root=scene.parents[2]) if isinstance(a, str) else a for a in arguments)
    guard(event, tuple(real))
    assert guard.refused == []


def test_a_method_that_cannot_do_without_fails_its_job(scene: Path, tmp_path: Path):
    job = Job("dark", scene.name, "insists", 0, {}, "stranger:Insists")
    outcome = run_fit(
        FitJob(job, "hash", scene, tmp_path / "run" / "jobs" / "a", 1, tmp_path / "run" / "jobs")
    )
    assert "the method tried to reach" in outcome.reason
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
    write_json(tmp_path / "job" / "job.json", done | {"access": Access(AUDIT_HOOK, "")})
    assert find_fit(fit) is not None


def test_a_damaged_capture_is_named_by_the_folder_that_is_known(scene: Path, tmp_path: Path):
    (scene / "capture" / "photographs" / "train_000.exr").write_bytes(b"damaged")
    with pytest.raises(DatasetError, match=str(scene / "capture")):
        fit_scene(FitSpec("gray", {}, 0, scene), tmp_path / "p", silent)


def test_where_the_copy_has_no_room(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def full(source: Path, target: Path) -> None:
        raise OSError(28, "No space left on device", str(target))

    monkeypatch.setattr("graycard.benchmarks._handed.shutil.copytree", full)
    with pytest.raises(OutputError, match="the disk is full"):
        fit_scene(FitSpec("gray", {}, 0, scene), tmp_path / "p", silent)


def test_no_folder_is_opened_in_which_truth_lies(scene: Path, tmp_path: Path):
    for checkpoint in (f"{scene.parents[2]}/", f"{scene}/stage.safetensors", f"{tmp_path}/x"):
        with pytest.raises(MethodError, match="expected a file or folder without scenes and results"):
            places_of(tmp_path / "scratch", [scene], {"checkpoint": checkpoint})
    places = places_of(tmp_path / "scratch", [scene], {"checkpoint": str(tmp_path / "own" / "x")})
    assert places.opened == (str(tmp_path / "own"),)


READS = """
from pathlib import Path
from graycard.methods._gray import GrayMethod
PLACE = Path(PLACE)
(PLACE / "weights").read_text()
class Method(GrayMethod):
    summary = "Has weights and a cache"
    def fit(self, capture, priors, settings, seed, progress):
        (PLACE / "cache").write_text((PLACE / "weights").read_text())
        return super().fit(capture, priors, settings, seed, progress)
"""


@pytest.mark.skipif(not landlock_version(), reason="this kernel has no Landlock")
def test_a_method_reads_its_weights_where_it_is_allowed_to(scene: Path, tmp_path: Path):
    place = tmp_path / "weights of mine"
    place.mkdir()
    (place / "weights").write_text("1")
    (tmp_path / "code" / "reads.py").write_text(READS.replace("Path(PLACE)", f"Path({str(place)!r})"))
    with pytest.raises(MethodError, match="Permission denied"):
        fit_scene(FitSpec("reads:Method", {}, 0, scene), tmp_path / "p", silent)
    fitted = fit_scene(FitSpec("reads:Method", {}, 0, scene, allowed=(place,)), tmp_path / "p", silent)
    assert fitted.access.allowed == (str(place),)
    assert (place / "cache").read_text() == "1"
    with pytest.raises(MethodError, match="expected a file or folder without scenes and results"):
        fit_scene(FitSpec("reads:Method", {}, 0, scene, allowed=(tmp_path,)), tmp_path / "p", silent)
    met = meet(Meeting(SuiteMethod("reads:Method"), scene.parents[1], tmp_path / "jobs", (place,)))
    assert met.value.summary == "Has weights and a cache"

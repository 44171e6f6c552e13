# SPDX-License-Identifier: Apache-2.0
"""The command line on small things; tests/benchmarks/test_bench.py runs the large ones."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from changed_scene import enrich
from graycard import (
    TRACKS,
    Predictions,
    Sensor,
    __version__,
    capture_folders,
    open_capture,
    open_predictions,
    open_truth,
)
from graycard.benchmarks._fit import Fitted
from graycard.benchmarks.speed import measure_truth
from graycard.cli import main
from graycard.cli._table import VERBS, find_verb
from graycard.dataset import manifest_of
from graycard.io import read_json
from graycard.predictions import finish_predictions, write_view
from graycard.records import Access, Cost, read_score_sheet
from graycard.synth import find_llvm, use_renderer
from graycard.synth.families._corridor import Corridor

ROOT = Path(__file__).parents[1]


Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module", autouse=True)
def loaded() -> None:
    """Dr.Jit looks for LLVM once a process: let it, before a test hides the library."""
    use_renderer()


def last_line(capsys: Capture) -> str:
    return capsys.readouterr().out.strip().splitlines()[-1]


def test_scenes_lists_suites_and_families(tmp_path: Path, capsys: Capture):
    assert main(["scenes", "--json", str(tmp_path / "s.json")]) == 0
    assert "demo" in capsys.readouterr().out
    found = json.loads((tmp_path / "s.json").read_text())["result"]
    assert list(found["families"]) == list(TRACKS)
    assert {suite["name"] for suite in found["suites"]} >= {"demo", "smoke"}


def test_scenes_shows_the_knobs_of_a_family(tmp_path: Path, capsys: Capture):
    assert main(["scenes", "corridor", "--json", str(tmp_path / "s.json")]) == 0
    assert last_line(capsys).startswith("scenes: corridor (dark), a dark storage corridor")
    knobs = {knob["name"]: knob for knob in json.loads((tmp_path / "s.json").read_text())["result"]["knobs"]}
    assert knobs["gloss"]["allowed"] == "0 to 1"
    assert knobs["gloss"]["meaning"].startswith("Share of the objects that are glossy")


def test_render_takes_knobs_and_says_how_noisy_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
):
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/none")
    size = ["--width", "16", "--height", "16", "--samples", "16", "--train-views", "2", "--test-views", "1"]
    out = ["--out", str(tmp_path), "--knob", "gloss=1", "light_offset=0.1"]
    assert main(["render", "dark", "--seed", "1000", *out, *size]) == 0
    scene, line = capsys.readouterr().out.strip().splitlines()
    assert line == f"render: 1 scene in {tmp_path}"
    folder, ceiling = re.fullmatch(r"(\S+) \(noise ceiling (\S+) dB\)", scene).groups()  # pyright: ignore
    truth = open_truth(Path(folder) / "truth")
    assert truth.noise_ceiling == pytest.approx(float(ceiling), abs=0.06)
    knobs = manifest_of(truth).settings["knobs"]
    assert (knobs["gloss"], knobs["light_offset"]) == (1.0, 0.1)


def test_a_suite_may_ask_for_little_noise(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture):
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/none")
    suite = tmp_path / "mine.toml"
    suite.write_text(
        'name = "mine"\nversion = 1\ntitle = "Mine"\nceilings = { dark = 90 }\n'
        "[render]\nwidth = 12\nheight = 12\ntrain_views = 2\ntest_views = 1\nsamples = 4\n"
        '[[scenes]]\ntrack = "dark"\nfamily = "corridor"\nseed = 1000\n[[methods]]\nname = "gray"\n'
    )
    assert main(["render", str(suite), "--out", str(tmp_path / "data")]) == 1
    said = capsys.readouterr()
    assert "failed: expected a noise ceiling of 90 dB" in said.err
    assert "1 noisier than its suite allows" in said.out
    suite.write_text(suite.read_text().replace("90", "1"))
    assert main(["render", str(suite), "--out", str(tmp_path / "data")]) == 0


def test_speed_compares_the_truth_with_a_plain_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
):
    if not find_llvm().usable:
        pytest.skip("the separation needs LLVM")
    monkeypatch.setattr("graycard.benchmarks.speed._truth.all_families", lambda: {"corridor": Corridor})
    monkeypatch.setattr("graycard.benchmarks.speed.measure_truth", partial(measure_truth, 32, 16))
    assert main(["speed", "truth", "--repeats", "1", "--json", str(tmp_path / "s.json")]) == 0
    assert "(corridor; in processor time" in last_line(capsys)
    (cost,) = json.loads((tmp_path / "s.json").read_text())["result"]
    assert cost["lights"] == 2
    assert 0 < cost["path_cpu_s"] < 600
    assert 0 < cost["separated_s"] < 600


@pytest.mark.slow
@pytest.mark.parametrize("rendered", [False, True])
def test_speed_measures_what_scoring_costs(
    rendered: bool,
    make_scene: Callable[..., Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Capture,
):
    monkeypatch.setattr("graycard.benchmarks.speed._score.FAMILIES", ("glossy-table",))
    if not rendered:
        scene = enrich(make_scene(track="tabletop"))
        monkeypatch.setattr("graycard.benchmarks.speed._score.render_scene", lambda *_: scene)
    assert main(["speed", "score", "--quick", "--json", str(tmp_path / "s.json")]) == 0
    assert "a view of 64 x 64 takes at most" in last_line(capsys)
    (cost,) = json.loads((tmp_path / "s.json").read_text())["result"]
    assert (cost["track"], cost["pixels"]) == ("tabletop", 4096)
    assert cost["scores"] > 40
    assert 0 < cost["reading_s"] < cost["seconds"] < 600
    assert cost["view_s"] > 0
    if rendered:  # else all is over in a tenth of a second, and a busy machine mixes the two up
        assert cost["view_s"] < cost["seconds"], "what is once a scene is not among it"
    assert 50 < cost["peak_mib"] < 8000


@pytest.mark.slow
def test_speed_measures_what_steps_cost(tmp_path: Path, capsys: Capture):
    assert main(["speed", "steps", "--quick", "--json", str(tmp_path / "s.json")]) == 0
    assert "as long with pictures of 32 x 32 as with those of 16 x 16" in last_line(capsys)
    costs = json.loads((tmp_path / "s.json").read_text())["result"]
    cases = [(cost["method"], cost["size"]) for cost in costs]
    assert cases == [("gsid", 16), ("gsid", 32), ("goris", 16), ("goris", 32)]
    for cost in costs:
        assert cost["steps"] == 2
        assert 0 < cost["least_ms"] <= cost["ms"] < 60_000
        assert sum(cost["parts"].values()) == pytest.approx(1)
        assert cost["parts"]["drawing"] > 0
    lamps, rays = ([cost["parts"][part] > 0 for cost in costs] for part in ("lamps", "tracing"))
    assert lamps == [True, True, False, False]
    assert rays == [False, False, True, True]


def test_methods_lists_and_shows(tmp_path: Path, capsys: Capture):
    assert main(["methods", "--json", str(tmp_path / "m.json")]) == 0
    assert last_line(capsys) == "methods: 19 work, 0 cannot be loaded"
    assert main(["methods", "gray", "--json", str(tmp_path / "m.json")]) == 0
    assert "--reflectance" in capsys.readouterr().out
    assert json.loads((tmp_path / "m.json").read_text())["result"]["settings"] == {"reflectance": 0.18}


@pytest.mark.parametrize("args", [["score", "\udcff", "scene"], ["fit", "gray", "s", "--out", "a\udc80"]])
def test_names_that_are_no_text_are_refused(args: list[str], capsys: pytest.CaptureFixture[str]):
    assert main(args) == 2
    assert "expected names in UTF-8" in capsys.readouterr().err


@pytest.mark.parametrize("args", [["fit", "gray", "--help"], ["fit", "gray", "somewhere", "-h"]])
def test_the_help_of_a_fit_shows_the_settings_of_the_method(args: list[str], capsys: Capture):
    assert main(args) == 0
    said = capsys.readouterr().out
    assert "--priors" in said
    assert "--reflectance" in said


def test_a_fit_that_is_told_to_end_leaves_nothing_behind(tiny_scenes: dict[str, Path], tmp_path: Path):
    """Neither its copy of the capture nor half an answer."""
    (tmp_path / "slow.py").write_text(
        "import time\n"
        "from graycard.methods._gray import GrayMethod\n"
        "class Slow(GrayMethod):\n"
        "    def fit(self, *_):\n"
        "        print('fits', flush=True)\n"
        "        time.sleep(60)\n"
    )
    (tmp_path / "copies").mkdir()
    args = ["fit", "slow:Slow", str(tiny_scenes["dark"]), "--out", str(tmp_path / "p")]
    places = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
    with subprocess.Popen(
        [sys.executable, "-m", "graycard", *args],
        env={**os.environ, "TMPDIR": str(tmp_path / "copies"), "PYTHONPATH": places},
        stderr=subprocess.PIPE,
        text=True,
    ) as fit:
        assert fit.stderr is not None
        assert "fits\n" in iter(fit.stderr.readline, ""), "behind lines on how far it is"
        assert [*(tmp_path / "copies").iterdir()]
        fit.terminate()
        assert fit.wait(30) == 143
    assert not [*(tmp_path / "copies").iterdir()]
    assert not (tmp_path / "p").exists()


def test_a_reader_that_has_seen_enough_is_no_traceback():
    """Pipes of ``graycard methods goris | head -1`` end so."""
    shown = [sys.executable, "-m", "graycard", "methods", "goris"]
    with subprocess.Popen(shown, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert "Traceback" not in process.stderr.read()


def test_what_chosen_priors_do_not_answer_is_said(
    tiny_scenes: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
):
    fitted = Fitted(Cost(1.0, 1.0), Access("guard", "hash"))
    monkeypatch.setattr("graycard.benchmarks.fit_apart", lambda *_: fitted)
    out = ["--out", str(tmp_path / "p"), "--priors", "classical"]
    assert main(["fit", "removal", str(tiny_scenes["tabletop"]), *out]) == 0
    assert "classical answers nothing of mask, which removal can ask for" in " ".join(
        capsys.readouterr().err.split()
    )


def test_fit_then_score(tiny_scenes: dict[str, Path], tmp_path: Path, capsys: Capture):
    scene, out = str(tiny_scenes["dark"]), str(tmp_path / "p")
    assert (
        main(["fit", "gray", scene, "--out", out, "--reflectance", "0.5", "--save", str(tmp_path / "d")]) == 0
    )
    assert last_line(capsys).startswith(f"fit: {out} in ")
    assert open_predictions(tmp_path / "p").layers("test_001")["base_color"][0, 0, 0] == 0.5
    assert read_json(tmp_path / "d" / "decomposition.json")["method"] == "gray"
    assert main(["score", out, scene, "--json", str(tmp_path / "s.json")]) == 0
    sheet = read_score_sheet(tmp_path / "s.json")
    counts = Counter(score.status for score in sheet.scores)
    said = f"{counts['scored']} scored, 0 failed, {counts['not provided']} not provided"
    assert last_line(capsys) == f"score: gray on dark/tiny-0000: {said}"
    absent = {score.metric.split(".")[0] for score in sheet.scores if score.status == "not provided"}
    assert absent == {"light", "depth"}
    assert sheet.score("albedo.psnr.channel").gauge


def test_methods_settings_are_checked(tiny_scenes: dict[str, Path], tmp_path: Path, capsys: Capture):
    fit = ["fit", "gray", str(tiny_scenes["dark"]), "--out", str(tmp_path / "p")]
    with pytest.raises(SystemExit, match="2"):
        main([*fit, "--reflectance", "7"])
    assert "expected a reflectance in" in capsys.readouterr().err
    assert main([*fit, "--reflectanc", "1"]) == 2
    assert "got --reflectanc 1 (did you mean --reflectance?)" in capsys.readouterr().err
    assert not (tmp_path / "p").exists()


def test_fit_never_removes_what_is_not_its_own(
    make_scene: Callable[..., Path], tmp_path: Path, capsys: Capture
):
    scene = make_scene()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("three years")
    for out in (tmp_path / "mine", scene, tmp_path):
        assert main(["fit", "gray", str(scene), "--out", str(out)]) == 2
        assert "to be free or to hold predictions, got" in capsys.readouterr().err
    assert (tmp_path / "mine" / "thesis.txt").read_text() == "three years"
    open_truth(scene / "truth")


def test_scores_are_not_cut_off_in_a_pipe(tiny_scenes: dict[str, Path], tmp_path: Path, capsys: Capture):
    assert main(["fit", "gray", str(tiny_scenes["dark"]), "--out", str(tmp_path / "p")]) == 0
    assert main(["score", str(tmp_path / "p"), str(tiny_scenes["dark"])]) == 0
    assert "albedo.psnr.channel" in capsys.readouterr().out


def test_one_prediction_by_every_protocol(tiny_scenes: dict[str, Path], tmp_path: Path, capsys: Capture):
    scene, out, scores = str(tiny_scenes["dark"]), str(tmp_path / "p"), tmp_path / "s.json"
    assert main(["fit", "input", scene, "--out", out]) == 0
    assert main(["score", out, scene, "--protocol", "all", "--json", str(scores)]) == 0
    shown = capsys.readouterr().out
    assert re.search(r"^tensoir-three-1 +[\d.]+ +dB +whole image +median ratio", shown, re.M)
    assert re.search(r"^albedo.psnr.channel +[\d.]+ +[\d.]+ *$", shown, re.M), "sRGB, and the mean of views"
    (spread,) = re.findall(
        r"^spread: one prediction has .* dB by .* and .* dB by .*, ([\d.]+) dB apart", shown, re.M
    )
    sheet = read_score_sheet(scores)
    values = [s.value or 0 for s in (*sheet.scores, *sheet.protocols) if s.metric.startswith("albedo.psnr")]
    assert float(spread) == pytest.approx(max(values) - min(values), abs=0.051)
    assert main(["score", out, scene, "--protocol", "gs-ir"]) == 0
    shown = capsys.readouterr().out
    assert "gs-ir-2" in shown
    assert "spread" not in shown
    assert shown.endswith("score: input on dark/tiny-0000: 1 scored, 0 failed, 0 not provided\n")
    assert main(["score", out, scene, "--protocol", "gsir"]) == 2
    assert "did you mean 'gs-ir'" in capsys.readouterr().err


def test_a_failed_score_is_exit_code_1(tiny_scenes: dict[str, Path], tmp_path: Path, capsys: Capture):
    scene = tiny_scenes["dark"]
    assert main(["fit", "input", str(scene), "--out", str(tmp_path)]) == 0
    write_view(tmp_path, "test_001", {"base_color": np.full((24, 28, 3), np.nan)})
    finish_predictions(tmp_path, Predictions("input", "dark", "tiny-0000"))
    assert main(["score", str(tmp_path), str(scene)]) == 1
    assert "expected finite values in base_color" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["benhc", "demo"], "expected a verb that exists, got 'benhc' (did you mean 'bench'?)"),
        (["doctor", "--jsn", "x"], "expected options of `graycard doctor`, got --jsn"),
        (["methods", "retinx"], "did you mean 'retinex'"),
        (["bench", "demo", "--pixels", "abc"], "expected a whole number after --pixels, got 'abc'"),
        (["bench", "demo", "--jobs=2.5"], "expected a whole number after --jobs, got '2.5'"),
        (["bench", "demo", "--methods"], "expected one or more values after --methods, got none"),
        (["bench", "demo", "--methods", "--json", "a"], "one or more values after --methods, got none"),
        (["claims", "runs/demo", "--sizes="], "expected one or more values after --sizes, got none"),
        (["bench", "demo", "--budget", "half"], "expected a number after --budget, got 'half'"),
        (
            ["fit", "gray", "{scene}", "--reflectance", "bright", "--out", "{tmp}/x"],
            "expected a number after --reflectance, got 'bright'",
        ),
        (["render", "drak", "--out", "x"], "did you mean 'dark'"),
        (["scenes", "corrido"], "did you mean 'corridor'"),
        (["render", "dark", "--knob", "gloss", "--out", "x"], "expected a knob as NAME=VALUE, got 'gloss'"),
        (["render", "dark", "--knob", "gloss=5", "--out", "x"], "expected gloss in [0.0, 1.0], got 5.0"),
        (["render", "dark", "--knob", "gloss=much", "--out", "x"], "expected a number, got 'much'"),
        (["render", "demo", "--knob", "gloss=1", "--out", "x"], "with a track only"),
        (["render", "dark", "--seed", "-3", "--out", "x"], "expected a seed of 0 or more, got -3"),
        (
            ["render", "demo", "--seed", "3", "--out", "x"],
            "expected --seed, --family and --knob with a track only",
        ),
        (["render", "dark", "--family", "studio", "--out", "{tmp}"], "expected a scene family that exists"),
        (["score", "nowhere", "{scene}"], "expected a predictions folder with predictions.json at nowhere"),
        (["score", "nowhere", "neverwhere"], "got nothing. Run `graycard render`"),
        (["fit", "gray", "neverwhere", "--out", "{tmp}/x"], "got nothing. Run `graycard render`"),
        (
            ["fit", "small_methods:Plain", "neverwhere", "--out", "{tmp}/x"],
            "got nothing. Run `graycard render`",
        ),
        (
            ["score", "nowhere", "data/dark/shelf-room-12"],
            "(again): graycard render dark --family shelf-room --seed 12 --out data",
        ),
        (["score", "nowhere", "data/dark/castle"], "Run `graycard render` (again)\n"),
        (["fit", "gray", "/", "--out", "{tmp}/x"], "got /. Give DATASET/<track>/<scene>"),
        (["fit", "gray", "{scene}/capture", "--out", "{tmp}/x"], "/capture. Give {scene}"),
        (["fit", "gray", "{scene}/..", "--out", "{tmp}/x"], "Give one of its scenes, as "),
        (["fit", "gray", "{scene}/../..", "--out", "{tmp}/x"], "Give one of its scenes, as "),
        (["score", "{tmp}", "{scene}/truth"], "/truth. Give {scene}"),
        (
            ["fit", "removal", "{scene}", "--priors", "oracle:2", "--out", "{tmp}/x"],
            "scenes of track dark have no such layers. Fit a scene of another track",
        ),
        (
            ["fit", "gray", "{scene}", "--out", "/proc/graycard"],
            "expected an output folder that can be written to",
        ),
        (
            ["import", "nowhere", "--track", "dark", "--scene", "x", "--out", "{tmp}/x"],
            "at nowhere, got nothing",
        ),
        (
            ["fit", "gray", "{scene}", "--out", "{tmp}/q", "--seed", "-1"],
            "a seed from 0 to 4294967295, got -1",
        ),
        (["report", "nowhere"], "expected a run folder with run.json at nowhere"),
        (["gate", "nowhere", "--baseline", "x"], "expected a run folder with run.json at nowhere"),
    ],
)
def test_what_the_user_can_mend(
    args: list[str], message: str, tiny_scenes: dict[str, Path], tmp_path: Path, capsys: Capture
):
    given = [a.format(scene=tiny_scenes["dark"], tmp=tmp_path) for a in args]
    assert main(given) == 2
    message = message.format(scene=tiny_scenes["dark"])
    assert message in capsys.readouterr().err


def test_layers_that_nobody_scores_are_no_success(
    tiny_scenes: dict[str, Path], tmp_path: Path, capsys: Capture
):
    for view in open_capture(tiny_scenes["dark"] / "capture").views:
        write_view(tmp_path, view.name, {"albedo": np.full((24, 28, 3), 0.5)})
    finish_predictions(tmp_path, Predictions("mine", "dark", "tiny-0000"))
    assert main(["score", str(tmp_path), str(tiny_scenes["dark"])]) == 1
    assert "nothing was scored" in capsys.readouterr().err


def test_names_are_not_turned_into_pictures(capsys: Capture):
    assert main(["methods", "smile:smile:"]) == 2
    assert "smile:smile:" in capsys.readouterr().err


def test_the_version(capsys: Capture):
    assert main(["--version"]) == 0
    assert last_line(capsys) == f"graycard {__version__}"


@pytest.mark.parametrize(
    ("set_by_user", "found"),
    [({}, "3000"), ({"GOMP_SPINCOUNT": "7"}, "7"), ({"OMP_WAIT_POLICY": "active"}, "None")],
)
def test_idle_threads_sleep_soon_unless_told_otherwise(set_by_user: dict[str, str], found: str):
    """OpenMP reads it when it is loaded: PyTorch and Numba must not be there before."""
    code = (
        "import os, sys; from graycard.cli import main; main(['--version']); "
        "print(os.environ.get('GOMP_SPINCOUNT'), sorted({'torch', 'numba'} & set(sys.modules)))"
    )
    kept = {name: value for name, value in os.environ.items() if "OMP" not in name}
    run = subprocess.run(
        [sys.executable, "-c", code], env=kept | set_by_user, capture_output=True, text=True, check=True
    )
    assert run.stdout.splitlines()[-1] == f"{found} []"


@pytest.mark.parametrize("what", ["truth", "engine", "score", "steps"])
def test_nothing_can_be_timed_no_time(what: str, capsys: Capture):
    assert main(["speed", what, "--repeats", "0"]) == 2
    assert "expected --repeats of 1 or more, got 0" in capsys.readouterr().err


def test_an_interrupt_is_no_traceback(monkeypatch: pytest.MonkeyPatch, capsys: Capture):
    def interrupt(*_: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(find_verb("doctor").load(), "run", interrupt)
    assert main(["doctor"]) == 130
    assert capsys.readouterr().err == "graycard: stopped; to begin again:\n  graycard doctor\n"
    monkeypatch.setattr(find_verb("bench").load(), "run", interrupt)
    assert main(["bench", "demo", "--out", "my runs"]) == 130
    way = "the same command goes on where it stopped:\n  graycard bench demo --out 'my runs'\n"
    assert capsys.readouterr().err == f"graycard: stopped; {way}"


def test_render_takes_the_faults_of_a_camera(tmp_path: Path, capsys: Capture):
    size = ["--width", "16", "--height", "16", "--train-views", "2", "--test-views", "1", "--samples", "4"]
    faults = ["--capture.bits", "8", "--capture.shot-noise", "8000", "--capture.points", "5"]
    command = ["render", "dark", "--seed", "1234", "--out", str(tmp_path), *size, *faults]
    assert main(command) == 0
    capture = open_capture(tmp_path / "dark" / "corridor-1234" / "capture")
    assert capture.sensor == Sensor(bits=8, shot_noise=8000)
    assert len(capture.points()) <= 5


def test_render_takes_size_and_samples(tmp_path: Path, capsys: Capture):
    size = ["--width", "12", "--height", "10", "--train-views", "2", "--test-views", "1", "--samples", "4"]
    command = ["render", "multilight", "--seed", "1234", "--out", str(tmp_path), *size]
    assert main(command) == 0
    assert last_line(capsys) == f"render: 1 scene in {tmp_path}"
    capture = open_capture(tmp_path / "multilight" / "studio-1234" / "capture")
    assert [(v.camera.width, v.camera.height) for v in capture.views] == [(12, 10)] * 3


@pytest.mark.parametrize("kind", ["nerfstudio", "colmap"])
def test_export_import_fit_then_no_score(
    kind: str, tiny_scenes: dict[str, Path], tmp_path: Path, capsys: Capture
):
    away, data = str(tmp_path / "away"), tmp_path / "data"
    assert main(["export", str(tiny_scenes["dark"]), "--format", kind, "--out", away]) == 0
    assert last_line(capsys) == (
        f"export: {away} as {kind}, 3 photographs, 2 held-out cameras without a photograph"
    )
    assert main(["import", away, "--track", "dark", "--scene", "mine", "--out", str(data)]) == 0
    scene = data / "dark" / "mine"
    assert last_line(capsys) == f"import: {scene}, 3 photographs, 2 views held out, no truth"
    assert not (scene / "truth").exists()
    assert main(["fit", "gray", str(scene), "--out", str(tmp_path / "p")]) == 0
    assert len(open_predictions(tmp_path / "p").view_names()) == 5
    assert main(["score", str(tmp_path / "p"), str(scene)]) == 2
    assert "expected truth or photographs of held-out views" in capsys.readouterr().err


def test_look_draws_a_sheet_a_scene(make_scene: Callable[..., Path], capsys: Capture):
    dataset = make_scene(track="tabletop").parents[1]
    assert main(["look", str(dataset)]) == 0
    assert last_line(capsys) == f"look: 1 contact sheet in {dataset / 'look'}"
    assert (dataset / "look" / "tabletop-tiny-0000.png").is_file()
    assert capture_folders(dataset) == [dataset / "tabletop" / "tiny-0000"]
    assert main(["look", str(dataset / "nowhere")]) == 2
    assert "got no whole scene there" in capsys.readouterr().err


def test_look_draws_one_scene_beside_those_of_its_dataset(
    make_scene: Callable[..., Path], capsys: Capture, monkeypatch: pytest.MonkeyPatch
):
    scene = make_scene()
    other = scene.parents[1] / "dark" / "other"
    shutil.copytree(scene, other)
    sheet = scene.parents[1] / "look" / "dark-tiny-0000.png"
    monkeypatch.chdir(scene)
    assert main(["look", "."]) == 0
    assert last_line(capsys) == f"look: 1 contact sheet in {sheet.parent}"
    assert sorted(scene.parents[1].rglob("*.png")) == [sheet]


def test_look_says_what_to_do_with_predictions(tiny_scenes: dict[str, Path], tmp_path: Path, capsys: Capture):
    out = str(tmp_path / "p")
    assert main(["fit", "gray", str(tiny_scenes["dark"]), "--out", out]) == 0
    assert main(["look", out]) == 2
    said = capsys.readouterr().err
    assert f"got predictions at {out}. Score them: `graycard score {out} DATASET/<track>/<scene>`" in said
    assert "graycard bench SUITE --predictions NAME=FOLDER" in said


def test_what_is_not_provided_is_counted_and_listed_on_demand(
    tiny_scenes: dict[str, Path], tmp_path: Path, capsys: Capture
):
    scene, out, written = str(tiny_scenes["dark"]), str(tmp_path / "p"), tmp_path / "s.json"
    assert main(["fit", "gray", scene, "--out", out]) == 0
    capsys.readouterr()
    assert main(["score", out, scene, "--json", str(written)]) == 0
    shown = capsys.readouterr().out
    sheet = read_score_sheet(written)
    absent = [score.metric for score in sheet.scores if score.status == "not provided"]
    assert len(absent) > 1
    assert f"\n{len(absent)} metrics are not provided by these predictions: --all lists them\n" in shown
    assert not any(re.search(rf"^{re.escape(name)} ", shown, re.M) for name in absent)
    assert main(["score", out, scene, "--all", "--json", str(tmp_path / "all.json")]) == 0
    shown = capsys.readouterr().out
    assert all(re.search(rf"^{re.escape(name)} +not provided ", shown, re.M) for name in absent)
    assert "--all lists them" not in shown
    assert (tmp_path / "all.json").read_bytes() == written.read_bytes()


def test_it_runs_as_a_module():
    done = subprocess.run(
        [sys.executable, "-m", "graycard", "--help"], capture_output=True, text=True, check=True
    )
    assert all(verb.name in done.stdout for verb in VERBS)

# SPDX-License-Identifier: Apache-2.0
"""A real run folder (three methods fitted and scored on two scenes), broken in one way at a time."""

import json
import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import graycard as gc
from graycard.__main__ import main
from graycard.benchmarks import check_result, environment
from graycard.benchmarks._introduction import introduction_of
from graycard.benchmarks._jobs import FitJob, run_fit, run_score
from graycard.benchmarks._run_record import method_record, result_of
from graycard.benchmarks._suites import Suite, SuiteMethod, load_suite
from graycard.eval import metrics
from graycard.eval.statistics import compare_run
from graycard.methods import load_method, settings_of
from graycard.synth import RenderSettings, SceneSpec, resolved_knobs, scene_name

METHODS = ("truth", "gray", "retinex")
SUITE = Suite(
    "tiny",
    1,
    "As small as can be",
    RenderSettings(),
    tuple(SceneSpec("dark", "corridor", seed) for seed in (1000, 1001)),
    tuple(SuiteMethod(name) for name in METHODS),
)


def fit_and_score(run: Path, scene: Path, method: str) -> gc.JobResult:
    settings = gc.encode(settings_of(load_method(method), {}))
    job = gc.Job("dark", scene.name, method, 0, settings, method)
    fit = FitJob(job, "hash", scene, run / "jobs" / "dark" / scene.name / f"{method}-0", 1, run / "jobs")
    return result_of(fit, run_fit(fit), run_score(fit), run)


@pytest.fixture(scope="module")
def made_run(tmp_path_factory: pytest.TempPathFactory, write_tiny: Callable[..., Path]) -> Path:
    """A whole and valid run; not to be changed."""
    run = tmp_path_factory.mktemp("validity") / "run"
    scenes = [write_tiny(run / "dataset", scene=scene_name(s), test=s.seed - 998) for s in SUITE.scenes]
    for spec, scene in zip(SUITE.scenes, scenes, strict=True):
        found = {"family": spec.family, "knobs": resolved_knobs(spec), "render": SUITE.render_of(spec)}
        manifest = gc.read_manifest(scene / "truth", "graycard-truth")
        gc.seal(scene / "truth", replace(manifest, settings=gc.encode(found), seeds={"scene": spec.seed}))
    gc.write_json(run / "suite.json", SUITE)
    with pytest.MonkeyPatch.context() as patch:
        for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
            patch.setenv(name, "1")
        results = tuple(fit_and_score(run, scene, method) for scene in scenes for method in METHODS)
    record = gc.RunRecord(
        "tiny",
        1,
        tuple(
            gc.SceneRecord(
                "dark",
                s.name,
                "corridor",
                spec.seed,
                f"dataset/dark/{s.name}",
                gc.sha256(s / "truth" / "manifest.json"),
                "",
            )
            for spec, s in zip(SUITE.scenes, scenes, strict=True)
        ),
        tuple(method_record(m, introduction_of(m)) for m in SUITE.methods),
        metrics(),
        results,
        environment() | {"git_commit": "0123456789ab"},
        "2026-01-01T00:00:00+00:00",
        1.0,
        gc.sha256(run / "suite.json"),
    )
    gc.write_json(run / "run.json", record)
    gc.write_json(run / gc.COMPARISON, compare_run(record))
    return run


@pytest.fixture
def run(made_run: Path, tmp_path: Path) -> Path:
    """A copy to break."""
    return Path(shutil.copytree(made_run, tmp_path / "run"))


def breaches(run: Path, rescore: bool = False) -> dict[str, list[str]]:
    """What is broken, by rule."""
    found: dict[str, list[str]] = {}
    for breach in check_result(run, rescore=rescore).breaches:
        found.setdefault(breach.rule, []).append(str(breach))
    return found


def change(run: Path, edit: Callable[[Any], object], *, follow: bool = True) -> None:
    """Edit the data of ``run.json``, and let everything that is made from it follow."""
    data = json.loads((run / "run.json").read_text())
    edit(data)
    (run / "run.json").write_text(json.dumps(data))
    if not follow:
        return
    record = gc.read_run(run)
    gc.write_json(run / gc.COMPARISON, compare_run(record))
    for result in record.results:
        scores, done = run / result.folder / "scores.json", run / result.folder / "job.json"
        gc.write_json(scores, {**json.loads(scores.read_text()), "sheet": result.sheet})
        said = {"job": result.job, "job_hash": result.job_hash, "cost": result.cost, "access": result.access}
        gc.write_json(done, said)


def score_in(data: Any, method: str = "gray", metric: str = "novel_view.psnr", scene: int = 0) -> Any:
    """A score in the data of ``run.json``."""
    result = data["results"][scene * len(METHODS) + METHODS.index(method)]
    return next(s for s in result["sheet"]["scores"] if s["metric"] == metric)


def test_an_honest_run_is_valid(made_run: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["check-result", str(made_run), "--rescore"]) == 0
    suite, last = capsys.readouterr().out.splitlines()[-2:]
    assert last == "check-result: valid (6 fits by 11 rules, 0 broken, 0 without evidence)"
    digest = gc.sha256(made_run / "suite.json")
    assert suite == f"suite: tiny version 1, which does not come with graycard (suite.json, SHA-256 {digest})"


def test_what_is_broken_is_listed(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    change(run, lambda data: data["environment"].update(git_commit=None))
    assert main(["check-result", str(run), "--json", str(tmp_path / "v.json")]) == 1
    found = capsys.readouterr()
    assert "broken: origin: environment: expected the git commit of the code, got none" in found.out
    assert "rule origin: package versions, hardware and the git commit" in found.err
    assert found.out.splitlines()[-1].startswith("check-result: invalid (6 fits by 10 rules, 1 broken")
    written = gc.read_json(tmp_path / "v.json")
    assert written["exit_code"] == 1
    assert [b["rule"] for b in written["validity"]["breaches"]] == ["origin"]


def test_a_folder_without_a_run_cannot_be_judged(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["check-result", str(tmp_path)]) == 2
    assert "expected a run folder with run.json" in capsys.readouterr().err


def test_a_run_that_measured_nothing_cannot_be_judged(run: Path):
    change(run, lambda data: data.update(results=[]))
    assert check_result(run).exit_code == 2
    assert "nothing was measured" in breaches(run)["counts"][0]


def drop_view(data: Any) -> None:
    """One method leaves its worst view out."""
    score = score_in(data)
    score["per_view"].pop("test_001")
    score.update(expected=len(score["per_view"]), scored=len(score["per_view"]))


def drop_view_everywhere(data: Any) -> None:
    for result in data["results"][: len(METHODS)]:
        for score in result["sheet"]["scores"]:
            if score["metric"].startswith("normal.") and score["status"] == "scored":
                score["per_view"].pop("test_001")
                score.update(expected=len(score["per_view"]), scored=len(score["per_view"]))


def fail(data: Any) -> None:
    data["results"][1].update(status="failed", reason="out of memory", sheet=None)


def fail_score(data: Any) -> None:
    score_in(data).update(status="failed", value=None, reason="test_001: no file", per_view={})


def withhold(data: Any) -> None:
    score_in(data, "retinex", "albedo.psnr.raw", 1).update(
        status="not provided", value=None, per_view={}, gauge=None
    )


def other_count(data: Any) -> None:
    score_in(data, "truth", "light.position").update(expected=0)


COUNTS: dict[str, tuple[Callable[[Any], object], str]] = {
    "a fit": (
        lambda data: data["results"].pop(1),
        "corridor-1000 gray, seed 0: expected 1 fit in run.json, got 0",
    ),
    "a fit twice": (
        lambda data: data["results"].append(data["results"][0]),
        "expected 1 fit in run.json, got 2",
    ),
    "a fit that failed": (fail, "expected scores, got a failure: out of memory"),
    "a fit of one more seed": (
        lambda data: data["results"].append(
            data["results"][0] | {"job": data["results"][0]["job"] | {"seed": 1}}
        ),
        "corridor-1001 truth, seed 1: expected 1 fit in run.json, got 0",
    ),
    "a score": (
        lambda data: data["results"][1]["sheet"]["scores"].pop(0),
        "novel_view.psnr: expected a score, as others have on this scene, got none",
    ),
    "a score that failed": (
        fail_score,
        "novel_view.psnr: expected a score, got a failure: test_001: no file",
    ),
    "a view of one": (drop_view, "novel_view.psnr: expected 2 views, got none of test_001"),
    "a view of all": (drop_view_everywhere, "expected 2 held-out views, got none of test_001"),
    "a count": (lambda data: score_in(data).update(scored=1), "got 2 expected, 1 scored, 2 kept"),
    "a count of lights": (other_count, "light.position: expected 1 to be scored"),
    "a hard scene": (withhold, "expected it on all scenes or on none, got none on corridor-1001"),
}


@pytest.mark.parametrize("what", COUNTS)
def test_what_is_not_there_is_missed(run: Path, what: str):
    edit, words = COUNTS[what]
    change(run, edit, follow=False)
    assert check_result(run).exit_code == 1
    assert any(words in line for line in breaches(run)["counts"]), breaches(run)


def repaint(run: Path) -> None:
    """Another prediction, with an index that fits it."""
    folder = run / "jobs/dark/corridor-1000/gray-0/predictions"
    found = gc.open_predictions(folder)
    layers = {**found.layers("test_001"), "radiance": np.full((24, 28, 3), 0.5, np.float32)}
    gc.write_view(folder, "test_001", layers)
    gc.finish_predictions(folder, replace(found, files={}), found.lights())


def other_truth(run: Path) -> None:
    """Another truth, with a manifest that fits it."""
    truth = run / "dataset/dark/corridor-1000/truth"
    gc.write_lights(truth / "lights.json", (gc.PointLight("lamp", (0, 0, 1), (1, 1, 1)),))
    gc.seal(truth, gc.read_manifest(truth, "graycard-truth"))


def other_capture(run: Path) -> None:
    capture = run / "dataset/dark/corridor-1000/capture"
    gc.write_rgb(capture / "photographs/train_000.exr", np.ones((24, 28, 3), np.float32))
    gc.seal(capture, gc.read_manifest(capture, "graycard-capture"))


def setting_in(data: Any) -> Any:
    return data["results"][1]["job"]["settings"]


def damage(path: str) -> Callable[[Path], object]:
    return lambda run: (run / "dataset/dark/corridor-1000" / path).write_bytes(b"damaged")


HASHES: dict[str, tuple[Callable[[Path], object], str]] = {
    "a prediction": (repaint, "gray, seed 0: expected predictions with SHA-256"),
    "the truth": (other_truth, "dark/corridor-1000: expected truth with SHA-256"),
    "a capture": (other_capture, "expected a fit to the capture of the run, got another capture"),
    "a true view": (damage("truth/views/test_001.exr"), "truth/views/test_001.exr: expected SHA"),
    "a photograph": (damage("capture/photographs/train_000.exr"), "capture/photographs/train_000.exr: exp"),
    "a score of run.json": (
        lambda run: change(run, lambda data: score_in(data).update(value=99.0), follow=False),
        "expected run.json to say what scores.json says, got another scores[0].value",
    ),
    "a setting of run.json": (
        lambda run: change(run, lambda data: setting_in(data).update(reflectance=0.5), follow=False),
        "expected run.json to say what job.json says, got another [0].settings.reflectance",
    ),
    "the truth of a sheet": (
        lambda run: change(run, lambda data: data["results"][1]["sheet"].update(truth_sha256="ab")),
        "expected scores by the truth of run.json, got another truth",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", HASHES)
def test_other_files_than_those_that_were_measured(run: Path, what: str):
    edit, words = HASHES[what]
    edit(run)
    assert check_result(run).exit_code == 1
    assert any(words in line for line in breaches(run)["hashes"]), breaches(run)


@pytest.mark.parametrize(
    ("gone", "rule"),
    [
        ("jobs/dark/corridor-1000/gray-0/predictions", "hashes"),
        ("jobs/dark/corridor-1000/gray-0/scores.json", "hashes"),
        ("dataset/dark/corridor-1000/truth", "hashes"),
        ("comparison.json", "comparison"),
    ],
)
def test_without_evidence_it_cannot_be_judged(run: Path, gone: str, rule: str):
    path = run / gone
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    assert check_result(run, rescore=True).exit_code == 2
    assert rule in breaches(run)


def without_scene(data: Any) -> None:
    """The hardest scene is gone without a trace."""
    data["scenes"].pop(1)
    data["results"] = [r for r in data["results"] if r["job"]["scene"] != "corridor-1001"]


def without_seed(data: Any) -> None:
    for result in data["results"]:
        result["job"]["seed"] = 5


def foreign_scene(data: Any) -> None:
    data["scenes"].append(data["scenes"][0] | {"scene": "corridor-1002"})


SUITES: dict[str, tuple[Callable[[Any], object], str]] = {
    "no hard scene": (without_scene, "dark/corridor-1001: expected this scene, as tiny has it, got none"),
    "a scene more": (foreign_scene, "dark/corridor-1002: expected scenes of tiny, got one that it has not"),
    "another seed": (without_seed, "run.json: expected fits with seed 0, as tiny has them, got none"),
    "another entry": (
        lambda data: data["results"][1]["job"].update(entry="mine:Gray"),
        "gray, seed 0: expected the method as the suite has it, got another entry",
    ),
    "another version": (
        lambda data: data.update(suite_version=2),
        "suite.json: expected suite tiny version 2, as run.json says, got tiny version 1",
    ),
    "another hash": (
        lambda data: data.update(suite_sha256="ab"),
        "suite.json: expected the suite that was run, of SHA-256 ab… by run.json, got",
    ),
}


@pytest.mark.parametrize("what", SUITES)
def test_a_run_is_of_its_suite(run: Path, what: str):
    edit, words = SUITES[what]
    change(run, edit)
    assert check_result(run).exit_code == 1
    assert any(words in line for line in breaches(run)["suite"]), breaches(run)


def keep(run: Path, suite: Suite) -> None:
    """Another suite in the run folder, with a hash that fits it."""
    gc.write_json(run / "suite.json", suite)
    named = {"suite": suite.name, "suite_version": suite.version}
    change(run, lambda data: data.update(suite_sha256=gc.sha256(run / "suite.json"), **named))


@pytest.mark.parametrize(
    ("suite", "words"),
    [
        (replace(SUITE, samples={"dark": 256}), "corridor-1001: expected the scene that tiny asks for, got"),
        (
            replace(SUITE, methods=(*SUITE.methods[:1], SuiteMethod("gray", {"reflectance": 0.5}))),
            "gray, seed 0: expected the method as the suite has it, got another settings.reflectance",
        ),
        (replace(SUITE, seeds=(0, 1)), "run.json: expected fits with seed 1, as tiny has them, got none"),
    ],
)
def test_a_scene_and_a_method_may_not_be_easier_than_those_of_the_suite(run: Path, suite: Suite, words: str):
    keep(run, suite)
    assert any(words in line for line in breaches(run)["suite"]), breaches(run)


def test_a_scene_of_other_knobs_under_the_name_of_the_suite(run: Path):
    truth = run / "dataset/dark/corridor-1000/truth"
    manifest = gc.read_manifest(truth, "graycard-truth")
    easier = {**manifest.settings, "knobs": {**manifest.settings["knobs"], "clutter": 0.0}}
    gc.seal(truth, replace(manifest, settings=easier))
    change(run, lambda data: data["scenes"][0].update(truth_sha256=gc.sha256(truth / "manifest.json")))
    (line,) = breaches(run)["suite"]
    assert "dark/corridor-1000: expected the scene that tiny asks for, got another knobs.clutter" in line
    shutil.rmtree(truth)
    assert "suite" not in breaches(run), "that it is gone is said by another rule"


def test_a_suite_that_comes_along_is_known_by_its_name(run: Path):
    """A run that says that it is of the smoke suite, and kept an easier one."""
    smoke = load_suite("smoke")
    keep(run, replace(smoke, scenes=smoke.scenes[:1]))
    found = breaches(run)["suite"]
    words = f"expected smoke version {smoke.version} as it comes with graycard, got a suite of other content"
    assert any(words in line for line in found)
    wanted = {(s.track, scene_name(s)) for s in smoke.scenes if s.track == "dark"}
    assert wanted
    for track, scene in wanted:
        assert any(f"{track}/{scene}: expected this scene, as smoke has it" in line for line in found)
    (run / "suite.json").unlink()
    assert check_result(run).suite == f"smoke version {smoke.version}, which comes with graycard"
    assert not any("other content" in line for line in breaches(run)["suite"]), "it is not needed"


def test_an_older_version_of_a_suite_is_judged_by_what_was_kept(run: Path):
    keep(run, replace(SUITE, name="smoke", version=1))
    found = check_result(run)
    assert found.exit_code == 0
    assert "smoke version 1, which does not come with graycard" in found.suite
    assert f"this graycard has version {load_suite('smoke').version}" in found.suite


def test_without_its_suite_a_run_cannot_be_judged(run: Path):
    (run / "suite.json").unlink()
    assert check_result(run).exit_code == 2
    assert "expected suite.json to hold the run against, got none" in breaches(run)["suite"][0]
    gc.write_bytes(run / "suite.json", b"[]")
    change(run, lambda data: data.update(suite_sha256=gc.sha256(run / "suite.json")))
    assert check_result(run).exit_code == 2


def test_a_part_is_named_as_what_it_is(run: Path, capsys: pytest.CaptureFixture[str]):
    more = SceneSpec("tabletop", "glossy-table", 1000), SceneSpec("multilight", "studio", 1000)
    keep(run, replace(SUITE, scenes=(*SUITE.scenes, *more), methods=(*SUITE.methods, SuiteMethod("2dgs"))))
    assert main(["check-result", str(run)]) == 0
    assert (
        capsys.readouterr()
        .out.splitlines()[-1]
        .startswith("check-result: valid, part of tiny: tracks dark; methods truth, gray, retinex (6 fits")
    )


def test_a_method_beside_those_of_the_suite_makes_no_part(run: Path):
    keep(run, replace(SUITE, methods=SUITE.methods[:2]))
    found = check_result(run)
    assert (found.exit_code, found.part) == (0, "")


def test_a_scene_of_another_seed(run: Path):
    change(run, lambda data: data["scenes"][0].update(seed=7))
    assert breaches(run) == {
        "seeds": [
            "seeds: dark/corridor-1000: expected a scene of seed 7, as run.json says, got one of seed 1000"
        ]
    }


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        ({"packages": {}}, "expected the version of numpy, got none"),
        ({"git_commit": None}, "expected the git commit of the code, got none"),
        (
            {"git_commit": "0123456789ab+"},
            "expected the code of a commit, got 0123456789ab+: files were changed",
        ),
        ({"cpu": ""}, "expected cpu, got none"),
    ],
)
def test_where_numbers_come_from_is_known(run: Path, edit: dict[str, Any], words: str):
    change(run, lambda data: data["environment"].update(edit))
    found = breaches(run)
    assert set(found) == {"origin"}
    assert any(words in line for line in found["origin"])


def not_finite(data: Any) -> None:
    score_in(data).update(value="nan")


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (not_finite, "the score is nan"),
        (lambda data: score_in(data).update(value=None), "the score is None"),
        (lambda data: score_in(data).update(value="inf", noise_ceiling=None), "the score is inf"),
        (lambda data: score_in(data)["per_view"].update(test_001="-inf"), "test_001 is -inf"),
        (
            lambda data: score_in(data, "gray", "albedo.psnr.channel").update(gauge=[1, "inf", 1]),
            "a factor of the gauge is inf",
        ),
    ],
)
def test_numbers_are_finite(run: Path, edit: Callable[[Any], object], words: str):
    change(run, edit)
    (line,) = breaches(run)["finite"]
    assert words in line
    assert check_result(run).exit_code == 1


def test_a_gauge_of_the_held_out_views(run: Path):
    change(run, lambda data: score_in(data, "gray", "albedo.psnr.channel").update(gauge=[1.0, 2.0, 3.0]))
    (line,) = breaches(run)["gauge"]
    assert "albedo.psnr.channel: expected the gauge that the training views give, " in line
    assert line.endswith("got 1 2 3")


@pytest.mark.parametrize(
    ("metric", "taken_from"),
    [
        ("albedo.psnr.channel", "albedo.psnr.scalar"),
        ("albedo.psnr.channel", None),
        ("novel_view.psnr", "albedo.psnr.channel"),
    ],
)
def test_a_gauge_that_another_metric_may_have(run: Path, metric: str, taken_from: str | None):
    def swap(data: Any) -> None:
        gauge = score_in(data, "gray", taken_from)["gauge"] if taken_from else None
        score_in(data, "gray", metric).update(gauge=gauge)

    change(run, swap)
    (line,) = breaches(run)["gauge"]
    assert f"{metric}: expected the gauge that the training views give" in line


@pytest.mark.parametrize(
    ("edit", "words", "code"),
    [
        ({"access": None}, "expected a record that truth was closed by", 2),
        ({"guard": "trust-me"}, "got trust-me", 2),
        (
            {"refused": ["/d/dark/corridor-1000/truth/lights.json"]},
            "got an attempt to reach /d/dark/corridor-1000/truth",
            1,
        ),
        ({"handed": ["normal", "radiance"]}, "got also normal, radiance", 1),
    ],
)
def test_truth_was_closed(run: Path, edit: dict[str, Any], words: str, code: int):
    def open_it(data: Any) -> None:
        result = data["results"][1]
        result.update(edit) if "access" in edit else result["access"].update(edit)

    change(run, open_it)
    assert any(words in line for line in breaches(run)["truth"])
    assert check_result(run).exit_code == code


def test_a_score_above_the_noise_of_the_truth(run: Path):
    def leak(data: Any) -> None:
        score = score_in(data)
        score.update(value=score["noise_ceiling"] + 3)

    change(run, leak)
    (line,) = breaches(run)["ceiling"]
    assert "gray, seed 0: novel_view.psnr: expected at most the ceiling of" in line
    assert "3.00 above it" in line
    (above,) = [a for a in gc.read_comparison(run).above_ceiling if not a.handed]  # pyright: ignore
    assert (above.method, above.excess) == ("gray", pytest.approx(3))


def test_a_row_that_is_handed_radiance_may_hold_its_noise(made_run: Path):
    above = gc.read_comparison(made_run).above_ceiling  # pyright: ignore[reportOptionalMemberAccess]
    assert {a.method for a in above} == {"truth"}
    assert above[0].excess == math.inf
    assert "radiance" in above[0].handed


def test_a_comparison_that_does_not_follow(run: Path):
    written = json.loads((run / gc.COMPARISON).read_text())
    written["metrics"][0]["methods"][1]["rank"] = 3
    (run / gc.COMPARISON).write_text(json.dumps(written))
    assert "got another metrics[0].methods[1].rank" in breaches(run)["comparison"][0]
    (run / gc.COMPARISON).write_text("{")
    assert "expected JSON in" in breaches(run)["comparison"][0]


def test_scores_that_the_predictions_do_not_have(run: Path):
    """Everything that is written down agrees; only scoring again tells."""
    change(run, lambda data: score_in(data, metric="novel_view.ssim").update(value=0.999))
    assert breaches(run) == {}
    (line,) = breaches(run, rescore=True)["scores"]
    assert "gray, seed 0: expected the scores of run.json, got another scores[1].value" in line

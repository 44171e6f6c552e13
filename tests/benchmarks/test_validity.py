# SPDX-License-Identifier: Apache-2.0
"""A real run folder (three methods fitted and scored on two scenes), broken in one way at a time."""

import json
import math
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import requires
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from graycard import PointLight, open_predictions
from graycard.benchmarks import check_result
from graycard.cli import main
from graycard.io import read_json, read_manifest, sha256, write_json, write_manifest, write_rgb
from graycard.lights import write_lights
from graycard.predictions import finish_predictions, write_view
from graycard.processes import AUDIT_HOOK, SECCOMP, landlock_version
from graycard.records import COMPARISON, read_comparison
from valid_runs import METHODS, breaches, change, score_in

WHEEL = {"version": "0.1.0", "sha256": "0123456789abcdef" * 4, "changed": [], "commit": ""}


def test_an_honest_run_is_valid(made_run: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["check-result", str(made_run), "--rescore"]) == 0
    suite, closed, last = capsys.readouterr().out.splitlines()[-3:]
    assert last == "check-result: valid (6 fits by 13 rules, 0 broken, 0 without evidence)"
    digest = sha256(made_run / "suite.json")
    assert suite == f"suite: tiny version 1, which does not come with graycard (suite.json, SHA-256 {digest})"
    way = f"landlock-{landlock_version()}+" if landlock_version() else ""
    assert closed.endswith((f" in 6 fits ({way}{SECCOMP}+{AUDIT_HOOK})", f" in 6 fits ({way}{AUDIT_HOOK})"))


def test_progress_says_which_files_are_checked(made_run: Path):
    heard: list[tuple[float, str]] = []
    check_result(made_run, lambda done, doing: heard.append((done, doing)), rescore=True)
    shares = [done for done, _ in heard]
    assert shares == sorted(shares)
    assert shares[-1] < 1
    told = {doing for _, doing in heard}
    assert {"checking views: 1 of 2 scenes", "checking gauges: 5 of 6 fits"} < told
    assert "checking scores: 0 of 6 fits" in told


def test_a_run_of_an_installation_without_extras_is_valid(run: Path):
    """``make bench`` installs what the project requires; extras are recorded only where they are there."""
    lines = requires("graycard") or []
    extra, required = (
        {_package(r) for r in lines if ("extra ==" in r) is wanted} for wanted in (True, False)
    )

    def leave_out_extras(data: Any) -> None:
        packages, left_out = data["environment"]["packages"], extra - required - {"graycard"}  # extra `all`
        data["environment"]["packages"] = {n: v for n, v in packages.items() if n not in left_out}

    change(run, leave_out_extras)
    assert "origin" not in breaches(run)


def _package(requirement: str) -> str:
    """Return the name in a requirement, as ``numpy`` of ``numpy>=2.0``."""
    return re.split(r"[^\w.-]", requirement, maxsplit=1)[0]


def test_what_is_broken_is_listed(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    change(run, lambda data: data["environment"].update(git_commit=None))
    assert main(["check-result", str(run), "--json", str(tmp_path / "v.json")]) == 1
    found = capsys.readouterr()
    assert (
        "broken: origin: environment: expected the git commit of the code or the hash of its wheel"
        in found.out
    )
    assert "rule origin: package versions, hardware and the git commit" in found.err
    assert found.out.splitlines()[-1].startswith("check-result: invalid (6 fits by 12 rules, 1 broken")
    written = read_json(tmp_path / "v.json")["result"]
    assert written["exit_code"] == 1
    assert [b["rule"] for b in written["validity"]["breaches"]] == ["origin"]


def test_a_row_of_others_that_is_handed_truth_is_named(run: Path, capsys: pytest.CaptureFixture[str]):
    main(["check-result", str(run)])
    assert "could tell other rows" not in capsys.readouterr().out

    def hand_over(data: Any) -> None:
        row = next(row for row in data["methods"] if row["name"] == "gray")
        row |= {"entry": "mine:Method", "sees": ["base_color"]}

    change(run, hand_over)
    main(["check-result", str(run)])
    assert "note: row 'gray' runs code of others and is handed truth" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("metric", "told"),
    [("novel_view.psnr", True), ("novel_view.ssim", True), ("albedo.leakage", False)],
)
def test_a_score_lies_among_those_of_its_views(run: Path, metric: str, told: bool):
    """Not a correlation over all views, which may be above each."""

    def raise_it(data: Any) -> None:
        score = score_in(data)
        score |= {"metric": metric, "value": max(score["per_view"].values()) + 0.01}

    change(run, raise_it, follow=False)
    found = breaches(run).get("values", [])
    assert [f"{metric}: expected " in what for what in found] == [True] * told


@pytest.mark.parametrize("name", ["wall_s", "cpu_s"])
def test_no_cost_is_below_0(run: Path, name: str):
    change(run, lambda data: data["results"][0]["cost"].update({name: -1.0}))
    (found,) = breaches(run)["values"]
    assert found.endswith(f": {name}: expected 0 or more, got -1")


def test_only_a_valid_run_is_published(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "published"
    assert main(["publish", str(run), "--out", str(out), "--pictures", METHODS[0]]) == 0
    assert capsys.readouterr().out.splitlines()[-1].endswith(" MiB, 6 fits")
    assert read_json(out / "run.json") == read_json(run / "run.json")
    change(run, lambda data: data["environment"].update(git_commit=None))
    assert main(["publish", str(run), "--out", str(tmp_path / "other")]) == 1
    found = capsys.readouterr()
    assert "broken: origin: environment: expected the git commit" in found.err
    assert found.out.splitlines()[-1] == "publish: nothing written, the run is no valid result"
    assert not (tmp_path / "other").exists()


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
    found = open_predictions(folder)
    layers = {**found.layers("test_001"), "radiance": np.full((24, 28, 3), 0.5, np.float32)}
    write_view(folder, "test_001", layers)
    finish_predictions(folder, replace(found, files={}), found.lights())


def other_truth(run: Path) -> None:
    """Another truth, with a manifest that fits it."""
    truth = run / "dataset/dark/corridor-1000/truth"
    write_lights(truth / "lights.json", (PointLight("lamp", (0, 0, 1), (1, 1, 1)),))
    write_manifest(truth, read_manifest(truth, "graycard-truth"))


def other_capture(run: Path) -> None:
    capture = run / "dataset/dark/corridor-1000/capture"
    write_rgb(capture / "photographs/train_000.exr", np.ones((24, 28, 3), np.float32))
    write_manifest(capture, read_manifest(capture, "graycard-capture"))


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


def test_a_comparison_of_an_older_format_is_no_evidence(run: Path):
    comparison = read_json(run / "comparison.json")
    write_json(run / "comparison.json", comparison | {"format_version": 0})
    assert check_result(run).exit_code == 2
    assert "of an older graycard. Run `graycard bench` again" in breaches(run)["comparison"][0]


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
        ({"git_commit": None}, "expected the git commit of the code or the hash of its wheel, got neither"),
        (
            {"git_commit": None, "installed": WHEEL | {"changed": ["eval/_x.py", "a.py", "b.py", "c.py"]}},
            "expected the files of the wheel, got others: eval/_x.py, a.py, b.py, …. Install graycard again",
        ),
        ({"installed": WHEEL | {"changed": None}}, "expected the files that differ from the wheel, got no"),
        (
            {"git_commit": None, "installed": WHEEL | {"sha256": "none"}},
            "or the hash of its wheel, got neither",
        ),
        ({"git_commit": None, "installed": [1]}, "or the hash of its wheel, got neither"),
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


def test_an_installed_wheel_vouches_for_its_code(run: Path):
    change(run, lambda data: data["environment"].update(git_commit=None, installed=WHEEL))
    assert "origin" not in breaches(run)


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


def test_gauges_that_are_all_left_out(run: Path):
    def forget(data: Any) -> None:
        for score in data["results"][1]["sheet"]["scores"]:
            score["gauge"] = None

    change(run, forget)
    assert any("albedo.ssim: expected the gauge" in line for line in breaches(run)["gauge"])


def test_a_gauge_of_two_numbers(run: Path):
    change(run, lambda data: score_in(data, "gray", "albedo.psnr.channel").update(gauge=[1.0, 2.0]))
    assert check_result(run).exit_code == 1


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
        ({"access": None}, "expected a record of how truth was closed", 2),
        ({"guard": "trust-me"}, "got trust-me", 2),
        ({"guard": "landlock-4"}, "got landlock-4", 2),
        ({"guard": f"landlock-+{AUDIT_HOOK}"}, f"got landlock-+{AUDIT_HOOK}", 2),
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


@pytest.mark.parametrize(("guard", "holds"), [(f"landlock-4+{AUDIT_HOOK}", True), (AUDIT_HOOK, False)])
def test_truth_is_closed_to_a_command_by_the_kernel_alone(run: Path, guard: str, holds: bool):
    def of_a_command(data: Any) -> None:
        result = data["results"][1]
        result["job"]["entry"] = "$ python infer.py {capture} {out}"
        result["access"]["guard"] = guard

    change(run, of_a_command)
    assert ("truth" not in breaches(run)) is holds


@pytest.mark.parametrize(
    ("guard", "says"),
    [
        (f"landlock-7+{AUDIT_HOOK}", "by the kernel (Landlock)"),
        (f"landlock-7+{SECCOMP}+{AUDIT_HOOK}", "by the kernel (Landlock)"),
        (AUDIT_HOOK, "without Landlock"),
        ("capture-copy-and-audit-hook-1", "without Landlock"),
    ],
)
def test_each_way_in_which_truth_was_closed_is_told(
    run: Path, guard: str, says: str, capsys: pytest.CaptureFixture[str]
):
    def close(data: Any) -> None:
        for result, way in zip(data["results"], [guard] * 5 + ["trust-me"], strict=True):
            result["access"]["guard"] = way

    change(run, close)
    assert main(["check-result", str(run)]) == 2
    told = [line for line in capsys.readouterr().out.splitlines() if line.startswith("truth: ")]
    assert told == [f"truth: closed {says} in 5 fits ({guard})"]


def test_a_score_above_the_noise_of_the_truth(run: Path):
    def leak(data: Any) -> None:
        score = score_in(data)
        score.update(value=score["noise_ceiling"] + 3)

    change(run, leak)
    (line,) = breaches(run)["ceiling"]
    assert "gray, seed 0: novel_view.psnr: expected at most the ceiling of" in line
    assert "3.00 above it" in line
    (above,) = [a for a in read_comparison(run).above_ceiling if not a.handed]  # pyright: ignore
    assert (above.method, above.excess) == ("gray", pytest.approx(3))


def test_a_row_that_is_handed_radiance_may_hold_its_noise(made_run: Path):
    above = read_comparison(made_run).above_ceiling  # pyright: ignore[reportOptionalMemberAccess]
    assert {a.method for a in above} == {"truth"}
    assert above[0].excess == math.inf
    assert "radiance" in above[0].handed


def test_a_comparison_that_does_not_follow(run: Path):
    written = json.loads((run / COMPARISON).read_text())
    written["metrics"][0]["methods"][1]["rank"] = 3
    (run / COMPARISON).write_text(json.dumps(written))
    assert "got another metrics[0].methods[1].rank" in breaches(run)["comparison"][0]
    (run / COMPARISON).write_text("{")
    assert "expected JSON in" in breaches(run)["comparison"][0]


def test_scores_that_the_predictions_do_not_have(run: Path):
    """Everything that is written down agrees; only scoring again tells."""

    def improve(data: Any) -> None:
        score = score_in(data, metric="novel_view.ssim")
        score |= {"value": 0.999, "per_view": dict.fromkeys(score["per_view"], 0.999)}

    change(run, improve)
    assert breaches(run) == {}
    (line,) = breaches(run, rescore=True)["scores"]
    assert "gray, seed 0: expected the scores of run.json, got another scores[1].value" in line

# SPDX-License-Identifier: Apache-2.0
"""Runs that are not what their suite asks for."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from graycard.benchmarks import check_result
from graycard.benchmarks._suites import Suite, SuiteMethod, load_suite
from graycard.cli import main
from graycard.io import read_manifest, sha256, write_bytes, write_json, write_manifest
from graycard.synth import SceneSpec, scene_name
from valid_runs import SUITE, breaches, change


def without_scene(data: Any) -> None:
    """The hardest scene is gone without a trace."""
    data["scenes"].pop(1)
    data["results"] = [r for r in data["results"] if r["job"]["scene"] != "corridor-1001"]


def without_seed(data: Any) -> None:
    for result in data["results"]:
        result["job"]["seed"] = 5


def with_a_seed_more(data: Any) -> None:
    """A second fit of each row, of which the better one might be told."""
    more = [{**result, "job": {**result["job"], "seed": 5}} for result in data["results"]]
    data["results"] += more


def foreign_scene(data: Any) -> None:
    data["scenes"].append(data["scenes"][0] | {"scene": "corridor-1002"})


SUITES: dict[str, tuple[Callable[[Any], object], str]] = {
    "no hard scene": (without_scene, "dark/corridor-1001: expected this scene, as tiny has it, got none"),
    "a scene more": (foreign_scene, "dark/corridor-1002: expected scenes of tiny, got one that it has not"),
    "another seed": (without_seed, "run.json: expected fits with seed 0, as tiny has them, got none"),
    "a seed more": (with_a_seed_more, "run.json: expected fits with the seeds of tiny, got some with seed 5"),
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
    write_json(run / "suite.json", suite)
    named = {"suite": suite.name, "suite_version": suite.version}
    change(run, lambda data: data.update(suite_sha256=sha256(run / "suite.json"), **named))


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
    manifest = read_manifest(truth, "graycard-truth")
    easier = {**manifest.settings, "knobs": {**manifest.settings["knobs"], "clutter": 0.0}}
    write_manifest(truth, replace(manifest, settings=easier))
    change(run, lambda data: data["scenes"][0].update(truth_sha256=sha256(truth / "manifest.json")))
    (line,) = breaches(run)["suite"]
    assert "dark/corridor-1000: expected the scene that tiny asks for, got another knobs.clutter" in line
    shutil.rmtree(truth)
    assert "suite" not in breaches(run), "that it is gone is said by another rule"


def test_a_scene_of_before_a_knob_was_added_is_that_of_the_suite(run: Path):
    truth = run / "dataset/dark/corridor-1000/truth"
    manifest = read_manifest(truth, "graycard-truth")
    knobs = {name: value for name, value in manifest.settings["knobs"].items() if name != "clutter"}
    render = {name: value for name, value in manifest.settings["render"].items() if name != "relighting"}
    write_manifest(truth, replace(manifest, settings={**manifest.settings, "knobs": knobs, "render": render}))
    change(run, lambda data: data["scenes"][0].update(truth_sha256=sha256(truth / "manifest.json")))
    assert "suite" not in breaches(run)


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
    write_bytes(run / "suite.json", b"[]")
    change(run, lambda data: data.update(suite_sha256=sha256(run / "suite.json")))
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

# SPDX-License-Identifier: Apache-2.0
"""Benches of some scenes: which ones, and how later ones join what an earlier one has left."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from graycard import GraycardError, UnknownNameError
from graycard.benchmarks import check_result, load_suite, narrow, opened
from graycard.benchmarks._run_record import joined, with_places_before
from graycard.cli import main
from graycard.io import read_json
from graycard.records import RunRecord, SceneRecord, read_run
from graycard.reports._facts import fact_groups
from graycard.synth import scene_name
from tiny_benches import made_without_renderer, write_reserve_suite


def test_scenes_are_named_with_or_without_their_track_and_keep_the_suites_order() -> None:
    suite = load_suite("claims-dark")
    names = [scene_name(scene) for scene in suite.scenes]
    last, first = f"dark/{names[-1]}", names[0]
    assert narrow(suite, scenes=[last, first]).scenes == (suite.scenes[0], suite.scenes[-1])
    assert narrow(suite, scenes=[first, f"dark/{first}"]).scenes == suite.scenes[:1]
    assert narrow(suite).scenes == suite.scenes


@pytest.mark.parametrize("name", ["corridr-0000", "tabletop/corridor-0000", "", "dark/", "dark"])
def test_a_scene_that_the_suite_lacks_is_refused_with_those_that_it_has(name: str) -> None:
    with pytest.raises(UnknownNameError, match=r"expected a scene that exists, got .* Known: dark/"):
        narrow(load_suite("claims-dark"), scenes=[name])


def test_a_scene_on_a_track_that_is_left_out_is_refused() -> None:
    suite = load_suite("demo")
    name = next(scene_name(scene) for scene in suite.scenes if scene.track == "dark")
    with pytest.raises(UnknownNameError, match="Known: tabletop/"):
        narrow(suite, ["tabletop"], scenes=[name])


def test_rows_that_run_on_none_of_the_scenes_are_refused() -> None:
    suite = load_suite("demo")
    idle = next(row for row in suite.methods if row.tracks and "dark" not in row.tracks)
    room = next(scene_name(scene) for scene in suite.scenes if scene.track == "dark")
    with pytest.raises(GraycardError, match="expected rows that run on dark, got"):
        narrow(suite, methods=[idle.row], scenes=[room])


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch, write_tiny: Callable[..., Path]) -> list[str]:
    return made_without_renderer(monkeypatch, write_tiny)


@pytest.fixture
def command(asked: list[str], tmp_path: Path) -> Callable[..., list[str]]:
    """``command(run, number)`` runs one scene of a suite of two into a folder."""
    path = write_reserve_suite(tmp_path)
    names = [scene_name(scene) for scene in load_suite(str(path)).scenes]

    def written(run: Path, *numbers: int) -> list[str]:
        chosen = ["--scenes", *(names[number] for number in numbers)] if numbers else []
        return ["bench", str(path), "--out", str(run), *chosen]

    return written


def scores_of(record: RunRecord) -> list[object]:
    """Return all that a record says of scores, in its order."""
    return [(result.job, result.job_hash, result.status, result.sheet) for result in record.results]


def test_scenes_run_one_after_another_are_the_whole_run(
    asked: list[str], command: Callable[..., list[str]], tmp_path: Path
) -> None:
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    assert main(command(whole)) == 0
    asked.clear()
    assert main(command(parts, 1)) == 0
    assert len(set(asked)) == 1, "the other scene is not even rendered"
    assert len(read_run(parts).scenes) == 1
    assert main(command(parts, 0)) == 0
    assert scores_of(read_run(parts)) == scores_of(read_run(whole)), "in the suite's order"
    assert read_run(parts).scenes == read_run(whole).scenes
    assert check_result(parts).breaches == check_result(whole).breaches


def test_a_record_alone_carries_earlier_scenes_to_another_machine(
    command: Callable[..., list[str]], tmp_path: Path
) -> None:
    """Scenes and predictions of the first machine are gone; the report shows what there is."""
    whole, here, there = (tmp_path / name for name in ("whole", "here", "there"))
    assert main(command(whole)) == 0
    assert main(command(here, 0)) == 0
    there.mkdir()
    record = json.loads((here / "run.json").read_text())
    record["environment"]["cpu"] = "of the first machine"
    (there / "run.json").write_text(json.dumps(record))
    shutil.rmtree(here)
    assert main(command(there, 1)) == 0
    found = read_run(there)
    assert scores_of(found) == scores_of(read_run(whole))
    assert read_json(there / "comparison.json") == read_json(whole / "comparison.json")
    assert [place["cpu"] for place in found.environment["earlier"]] == ["of the first machine"]
    assert (there / "report" / "index.html").is_file()
    told = {group.title: group.facts for group in fact_groups(found)}
    assert {("cpu", "of the first machine"), ("jobs", "5")} <= set(told["Earlier"])
    assert main(command(there, 1)) == 0
    assert [place["cpu"] for place in read_run(there).environment["earlier"]] == ["of the first machine"]


def test_places_that_tell_of_no_jobs_stay(made_run: Path) -> None:
    """Keep those of records from before places told of jobs: their own jobs are not known either."""
    valid = read_run(made_run)
    first = {**valid.environment, "cpu": "of the first machine"}
    before = replace(
        valid, environment={**valid.environment, "earlier": [first], "files_not_looked_at": ["a"]}
    )
    here = replace(valid, environment={**valid.environment, "cpu": "here"})
    found = with_places_before(here, before)
    assert found.environment == {**here.environment, "earlier": [first, dict(valid.environment)]}
    assert with_places_before(here, found).environment == found.environment
    back = with_places_before(valid, found)
    assert back.environment == {**valid.environment, "earlier": [first, dict(here.environment)]}


def test_no_environment_is_kept_of_results_that_are_all_made_anew(
    command: Callable[..., list[str]], tmp_path: Path
) -> None:
    run = tmp_path / "run"
    assert main(command(run, 0)) == 0
    record = json.loads((run / "run.json").read_text())
    record["environment"]["cpu"] = "of another machine"
    for result in record["results"]:
        result["job_hash"] = "of other code"
    (run / "run.json").write_text(json.dumps(record))
    assert main(command(run, 0)) == 0
    assert "earlier" not in read_run(run).environment


def test_a_whole_run_says_where_the_fits_were_made_that_it_found(
    command: Callable[..., list[str]], tmp_path: Path
) -> None:
    """One fit is made anew: the others are still those of the first machine, until they go, too."""
    run = tmp_path / "run"

    def earlier() -> list[tuple[str, int]]:
        found = read_run(run).environment.get("earlier", [])
        return [(place["cpu"], len(place["jobs"])) for place in found]

    assert main(command(run)) == 0
    record = json.loads((run / "run.json").read_text())
    record["environment"]["cpu"] = "of the first machine"
    (run / "run.json").write_text(json.dumps(record))
    shutil.rmtree(next(run.glob("jobs/*/*/gray-*")))
    assert main(command(run)) == 0
    assert earlier() == [("of the first machine", len(record["results"]) - 1)]
    assert main(command(run)) == 0
    assert earlier() == [("of the first machine", len(record["results"]) - 1)], "nothing was made"
    shutil.rmtree(run / "jobs")
    assert main(command(run)) == 0
    assert earlier() == []


def test_results_of_changed_code_are_no_valid_part_of_a_run(
    command: Callable[..., list[str]], tmp_path: Path
) -> None:
    run = tmp_path / "run"
    assert main(command(run, 0)) == 0
    record = json.loads((run / "run.json").read_text())
    record["environment"]["git_commit"] = "abc123+"
    (run / "run.json").write_text(json.dumps(record))
    assert main(command(run, 1)) == 0
    told = [breach.what for breach in check_result(run).breaches if breach.rule == "origin"]
    assert [what for what in told if "got abc123+" in what]


def test_no_scene_is_not_all_scenes(
    command: Callable[..., list[str]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*command(tmp_path / "run"), "--scenes"]) == 2
    assert "expected one or more values after --scenes, got none" in capsys.readouterr().err


def test_predictions_of_one_scene_do_not_stop_a_bench_of_another(
    command: Callable[..., list[str]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = tmp_path / "whole"
    assert main(command(whole)) == 0
    first, second = (scene.scene for scene in read_run(whole).scenes)
    made = next(whole.glob(f"jobs/*/{first}/gray-*/predictions"))
    shutil.copytree(made, tmp_path / "theirs" / "dark" / first)
    row = ["--methods", "gray", "--predictions", f"theirs={tmp_path / 'theirs'}"]
    main([*command(tmp_path / "run", 1), *row])
    assert "for a scene of the suite" not in capsys.readouterr().err
    assert {result.job.scene for result in read_run(tmp_path / "run").results} == {second}


def test_sealed_scenes_come_in_the_order_of_their_range() -> None:
    suite = load_suite("claims-tabletop-hd")
    specs = opened(suite).scenes

    def record(*numbers: int) -> RunRecord:
        scenes = tuple(
            SceneRecord(
                track=specs[number].track,
                scene=scene_name(specs[number]),
                family=specs[number].family,
                seed=specs[number].seed,
                folder="",
                truth_sha256=str(number),
                title="",
                knobs={},
            )
            for number in numbers
        )
        common = {"suite": suite.name, "suite_version": suite.version, "methods": (), "metrics": ()}
        times = {"started": "2026-01-01T00:00:00.000+00:00", "wall_s": 1.0}
        return RunRecord(scenes=scenes, results=(), environment={}, suite_sha256="", **common, **times)  # pyright: ignore

    both = joined(record(5, 6), joined(record(0, 3), record(4), suite), suite)
    assert [scene.truth_sha256 for scene in both.scenes] == ["0", "3", "4", "5", "6"]
    assert replace(both, scenes=()) == record()


def test_scenes_are_not_chosen_where_claims_choose_them(
    command: Callable[..., list[str]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*command(tmp_path / "run", 0), "--until-decided", "--max-scenes", "12"]) == 2
    assert "expected --until-decided without --scenes, got both" in capsys.readouterr().err

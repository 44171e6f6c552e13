# SPDX-License-Identifier: Apache-2.0
"""A run whose first scene was run on another machine, of which no file is here: how it is published."""

import re
import shutil
from pathlib import Path
from typing import Any

import pytest

from graycard.cli import main
from graycard.io import read_json
from graycard.records import COMPARISON
from opened import opened
from valid_runs import METHODS, change


def of_two_machines(run: Path, **of_first: Any) -> tuple[str, Path, Path]:
    """Say that the first scene was run elsewhere, and take its files away.

    Returns:
        Its name, where its files are now, and the folder of the other scene.
    """

    def tell(data: Any) -> None:
        place = {k: v for k, v in data["environment"].items() if k != "earlier"}
        data["environment"]["earlier"] = [{**place, "cpu": "of the first", "jobs": ["hash"], **of_first}]

    change(run, tell)
    first, other = read_json(run / "run.json")["scenes"]
    kept = run.parent / "first machine"
    shutil.move(run / first["folder"], kept / "scene")
    shutil.move(run / "jobs" / first["track"] / first["scene"], kept / "jobs")
    return f"{first['track']}/{first['scene']}", kept, run / other["folder"]


def publish(run: Path, *more: str) -> int:
    """Publish a run beside it, with few pictures."""
    return main(
        ["publish", str(run), "--out", str(run.parent / "published"), "--pictures", METHODS[0], *more]
    )


HINT = ". 1 of its scenes have no files here: see --without-files"


def test_a_run_of_two_machines_is_published_by_an_option(run: Path, capsys: pytest.CaptureFixture[str]):
    """Its record says of which scenes nobody looked at files."""
    name, _, _ = of_two_machines(run)
    out = run.parent / "published"
    assert publish(run) == 2
    assert capsys.readouterr().out.splitlines()[-1].endswith("the run is no valid result" + HINT)
    assert not out.exists()
    assert publish(run, "--without-files") == 0
    assert capsys.readouterr().out.splitlines()[-1].endswith(f" MiB, 6 fits, without files of {name}")
    told, own = read_json(out / "run.json"), read_json(run / "run.json")
    assert told["environment"].pop("files_not_looked_at") == [name]
    assert told == own
    assert re.search(rf"files not looked at.{{0,200}}{name}", opened((out / "index.html").read_text()), re.S)
    assert main(["check-result", str(out)]) == 2
    assert f"looked at them, but for those of {name}." in capsys.readouterr().out


@pytest.mark.parametrize("jobs", [[], ["other"]])
def test_files_of_what_was_run_here_have_to_be_here(
    run: Path, capsys: pytest.CaptureFixture[str], jobs: list[str]
):
    of_two_machines(run, jobs=jobs)
    assert publish(run) == 2
    assert publish(run, "--without-files") == 2
    assert HINT not in capsys.readouterr().out


def test_a_run_of_one_machine_has_all_its_files(run: Path, capsys: pytest.CaptureFixture[str]):
    of_two_machines(run)
    change(run, lambda data: data["environment"].pop("earlier"), follow=False)
    assert publish(run) == 2
    assert publish(run, "--without-files") == 2
    assert HINT not in capsys.readouterr().out


@pytest.mark.parametrize("there", ["scene", "jobs", "manifest"])
def test_a_scene_that_is_here_in_part_is_not_excused(
    run: Path, capsys: pytest.CaptureFixture[str], there: str
):
    """Or what is wrong with a file would be excused by taking the file away."""
    name, kept, _ = of_two_machines(run)
    scene = run / "dataset" / name
    if there == "manifest":
        (scene / "truth").mkdir(parents=True)
        (scene / "truth" / "manifest.json").write_text('{"format": ')
    else:
        shutil.move(kept / there, scene if there == "scene" else run / "jobs" / name)
    assert publish(run) == 2
    assert publish(run, "--without-files") == 2
    assert HINT not in capsys.readouterr().out


def test_without_files_excuses_nothing_else(run: Path, capsys: pytest.CaptureFixture[str]):
    """Neither what is broken, nor other evidence, nor files of all scenes."""
    name, kept, other = of_two_machines(run)
    record, comparison = (run / "run.json").read_bytes(), (run / COMPARISON).read_bytes()
    image = next((other / "truth" / "views").iterdir())
    content = image.read_bytes()
    image.write_bytes(content + b"more")
    assert publish(run, "--without-files") == 1
    image.write_bytes(content)
    change(run, lambda data: data["environment"].update(git_commit=None), follow=False)
    assert publish(run, "--without-files") == 1
    (run / "run.json").write_bytes(record)
    (run / COMPARISON).unlink()
    assert publish(run, "--without-files") == 2
    (run / COMPARISON).write_bytes(comparison)
    change(run, lambda data: data.update(commitment="ab" * 32), follow=False)
    assert publish(run, "--without-files") in (1, 2)
    (run / "run.json").write_bytes(record)
    shutil.move(other, kept / "other")
    shutil.move(run / "jobs", kept / "other jobs")
    assert publish(run) == 2
    assert HINT not in capsys.readouterr().out
    assert publish(run, "--without-files") == 2
    assert not (run.parent / "published").exists()
    shutil.move(kept / "other", other)
    shutil.move(kept / "other jobs", run / "jobs")
    assert publish(run, "--without-files") == 0
    assert name in capsys.readouterr().out

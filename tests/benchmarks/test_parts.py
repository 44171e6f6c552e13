# SPDX-License-Identifier: Apache-2.0
"""Parts of a run for job arrays: together they are the whole, and a last call gathers them."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from graycard import GraycardError
from graycard.benchmarks import Part, parse_part
from graycard.benchmarks._run_record import check_seen
from graycard.benchmarks._sources import hardware
from graycard.cli import main
from graycard.io import read_json, write_json
from graycard.records import read_run
from tiny_benches import made_without_renderer, write_reserve_suite


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch, write_tiny: Callable[..., Path]) -> list[str]:
    return made_without_renderer(monkeypatch, write_tiny)


@pytest.mark.parametrize(("count", "of"), [(10, 1), (10, 3), (10, 10), (3, 7), (0, 2), (1, 1)])
def test_shares_are_the_whole_in_order_and_of_equal_size(count: int, of: int) -> None:
    shares = [Part(number, of).share(count) for number in range(1, of + 1)]
    assert [place for share in shares for place in share] == list(range(count))
    assert max(map(len, shares)) - min(map(len, shares)) <= 1


def test_a_part_is_read_as_it_is_written() -> None:
    assert parse_part("3/20") == Part(3, 20)
    assert str(Part(3, 20)) == "3/20"


@pytest.mark.parametrize(
    "text", ["", "3", "0/2", "3/2", "1/0", "-1/2", "1/2/3", "1 / 2", "a/b", "1.5/2", "1/1000000000000"]
)
def test_what_is_no_part_is_refused(text: str) -> None:
    with pytest.raises(GraycardError, match="expected a part as K/N, K from 1 to N, such as 3/20, got"):
        parse_part(text)


def jobs_of(run: Path) -> set[str]:
    return {path.parent.relative_to(run).as_posix() for path in run.glob("jobs/*/*/*/scores.json")}


def test_parts_do_what_the_whole_does_and_a_last_call_reuses_it(
    asked: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two scenes with five rows: the second of three parts needs both scenes, the others one."""
    suite = str(write_reserve_suite(tmp_path))
    assert main(["bench", suite, "--out", str(tmp_path / "whole")]) == 0
    run, seen, scenes = tmp_path / "run", set(), []
    for number, count in enumerate((3, 3, 4), 1):
        asked.clear()
        told = tmp_path / f"part-{number}.json"
        assert main(["bench", suite, "--out", str(run), "--only", f"{number}/3", "--json", str(told)]) == 0
        assert read_json(told)["result"] == {"run": str(run), "jobs": count, "failed": []}
        assert len(jobs_of(run) - seen) == count
        assert f"part {number}/3, {count} jobs, 0 failures" in capsys.readouterr().out
        assert not (run / "run.json").exists()
        seen = jobs_of(run)
        scenes.append(len(asked))
    assert scenes == [1, 2, 1]
    before = {path: path.stat().st_mtime_ns for path in run.glob("jobs/*/*/*/*.json")}
    assert main(["bench", suite, "--out", str(run)]) == 0
    assert {path: path.stat().st_mtime_ns for path in run.glob("jobs/*/*/*/*.json")} == before
    found, wanted = read_run(run), read_run(tmp_path / "whole")
    assert [(r.job, r.sheet) for r in found.results] == [(r.job, r.sheet) for r in wanted.results]


def test_a_record_says_which_machines_made_the_fits_of_parts(asked: list[str], tmp_path: Path) -> None:
    """Two nodes have done two of three parts; the last one, and what is made anew, are of this machine."""
    suite, run = str(write_reserve_suite(tmp_path)), tmp_path / "run"

    def earlier() -> list[tuple[str, int]]:
        found = read_run(run).environment.get("earlier", [])
        return [(place["cpu"], len(place["jobs"])) for place in found]

    def do_part(number: int, cpu: str) -> None:
        """Do a part, and say that what it made was made by another processor."""
        before = jobs_of(run)
        assert main(["bench", suite, "--out", str(run), "--only", f"{number}/3"]) == 0
        for job in jobs_of(run) - before:
            done = read_json(run / job / "job.json")
            assert done["machine"] == hardware()
            write_json(run / job / "job.json", {**done, "machine": {**done["machine"], "cpu": cpu}})

    for number, cpu in enumerate(("of a node", "of another node", str(hardware()["cpu"])), 1):
        do_part(number, cpu)
    for _ in range(2):
        assert main(["bench", suite, "--out", str(run)]) == 0
        assert sorted(earlier()) == [("of a node", 3), ("of another node", 3)]
    first = sorted(run.glob("jobs/*/*/gray-*"))[0]
    shutil.rmtree(first / "predictions")
    for _ in range(2):
        assert main(["bench", suite, "--out", str(run)]) == 0
        assert sum(count for _, count in earlier()) == 5, "this machine has made it now"
    shutil.rmtree(first)
    do_part(1, "of a third node")
    for _ in range(2):
        assert main(["bench", suite, "--out", str(run)]) == 0
        assert dict(earlier())["of a third node"] == 1, "a part that came after a gathering"
        assert sum(count for _, count in earlier()) == 6


def test_more_parts_than_jobs_leave_some_without(
    asked: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    suite = str(write_reserve_suite(tmp_path))
    counts = []
    for number in (1, 2, 3):
        assert main(["bench", suite, "--out", str(tmp_path / "run"), "--only", f"{number}/13"]) == 0
        counts.append(len(jobs_of(tmp_path / "run")))
    assert counts == [0, 1, 2]
    said = capsys.readouterr().err
    assert said.count("is empty: the run has fewer jobs than parts") == 1
    assert "part 1/13 is empty" in said


def test_a_part_goes_not_with_scenes_that_are_added(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    suite = str(write_reserve_suite(tmp_path))
    assert main(["bench", suite, "--until-decided", "--max-scenes", "8", "--only", "1/2"]) == 2
    assert "expected --until-decided without --only" in capsys.readouterr().err


def test_what_is_no_part_ends_the_command(
    asked: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    suite = str(write_reserve_suite(tmp_path))
    assert main(["bench", suite, "--out", str(tmp_path / "run"), "--only", "4/3"]) == 2
    assert "got '4/3'. Mend --only" in capsys.readouterr().err


def test_a_run_that_other_machines_wrote_elsewhere_ends_with_words(tmp_path: Path) -> None:
    with pytest.raises(GraycardError, match="Put run and dataset where all machines see them"):
        check_seen([tmp_path / "job.json"])
    (tmp_path / "job.json").touch()
    check_seen([tmp_path / "job.json"])

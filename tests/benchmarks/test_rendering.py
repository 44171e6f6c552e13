# SPDX-License-Identifier: Apache-2.0
"""Scenes are rendered side by side, and cut into parts where workers would else be idle."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import pytest

from graycard import Progress
from graycard.benchmarks import RunError, Terms, _runner, load_suite
from graycard.benchmarks._jobs import PartJob, RenderJob, run_begin, run_part, run_render
from graycard.benchmarks.planning import _rendering
from graycard.benchmarks.planning._rendering import cut, part_size, render_scenes
from graycard.io import silent
from graycard.machines import Machines
from graycard.processes import USUAL, Outcome
from graycard.synth import RenderSettings, SceneSpec

SETTINGS = RenderSettings(20, 16, 3, 1, 16, 3)


class Workers:
    """Some workers, and the jobs that they were given."""

    def __init__(self, count: int, pictures: int = 10, fails: bool = False) -> None:
        self.count, self.pictures, self.fails = count, pictures, fails
        self.given: list[tuple[Callable[..., Outcome], list[Any]]] = []
        self.at_a_time: list[int] = []

    def jobs_at_a_time(self) -> int:
        return self.count

    def run_all(
        self,
        work: Callable[..., Outcome],
        jobs: Sequence[Any],
        at_a_time: int,
        progress: Progress,
        *_: object,
    ) -> list[Outcome]:
        self.given.append((work, list(jobs)))
        self.at_a_time.append(at_a_time)
        progress(0.0, "0 of 1")
        progress(1.0, "1 of 1")
        if self.fails:
            return [Outcome(reason="the disk is full") for _ in jobs]
        answers = {run_begin: tuple(range(self.pictures)), run_render: Path("scene")}
        return [Outcome(value=answers.get(work)) for _ in jobs]


def scenes(count: int, dataset: Path) -> list[RenderJob]:
    specs = [SceneSpec("dark", "corridor", seed) for seed in range(count)]
    return [RenderJob(spec, SETTINGS, dataset, 1) for spec in specs]


def render(workers: Workers, jobs: list[RenderJob], *, machines: bool = True) -> list[Path]:
    return render_scenes(jobs, workers.run_all, cast(Machines, workers) if machines else None, silent, 1)


def test_one_scene_is_rendered_by_all_workers(tmp_path: Path):
    workers = Workers(4, pictures=68)
    jobs = scenes(1, tmp_path)
    assert render(workers, jobs) == [Path("scene")]
    assert [work for work, _ in workers.given] == [run_begin, run_part, run_render]
    parts: list[PartJob] = workers.given[1][1]
    assert len(parts) == 8
    assert [number for part in parts for number in part.numbers] == list(range(68))
    assert {part.scene.spec.seed for part in parts} == {0}


@pytest.mark.parametrize(
    ("count", "told"),
    [
        (
            1,
            [
                (0.0, "beginning: 0"),
                (0.045, "beginning: 1"),
                (0.045, "parts: 0"),
                (0.9, "parts: 1"),
                (0.9, "0"),
                (1.0, "1"),
            ],
        ),
        (4, [(0.0, "0"), (1.0, "1")]),
    ],
)
def test_progress_grows_and_says_what_is_done(count: int, told: list[tuple[float, str]], tmp_path: Path):
    heard: list[tuple[float, str]] = []
    workers = Workers(4)
    jobs, machines = scenes(count, tmp_path), cast(Machines, workers)
    render_scenes(jobs, workers.run_all, machines, lambda done, what: heard.append((done, what)), 1)
    assert [(pytest.approx(done), f"{what} of 1") for done, what in told] == heard


def test_parts_of_several_scenes_are_of_one_size(tmp_path: Path):
    workers = Workers(8, pictures=30)
    render(workers, scenes(3, tmp_path))
    parts: list[PartJob] = workers.given[1][1]
    assert max(len(part.numbers) for part in parts) == part_size(90, 8) == 6
    assert {part.scene.spec.seed for part in parts} == {0, 1, 2}


def test_a_scene_more_than_workers_leaves_none_of_them_idle(tmp_path: Path):
    workers = Workers(8, pictures=30)
    render(workers, scenes(9, tmp_path))
    parts: list[PartJob] = workers.given[1][1]
    assert sorted(len(part.numbers) for part in parts) == [13] * 9 + [17] * 9
    assert len({part.scene.spec.seed for part in parts}) == 9


@pytest.mark.parametrize(("count", "machines"), [(2, True), (4, True), (5, True), (1, False), (3, False)])
def test_scenes_are_whole_jobs_where_they_are_enough_or_there_is_one_machine(
    count: int, machines: bool, tmp_path: Path
):
    workers = Workers(2)
    render(workers, scenes(count, tmp_path), machines=machines)
    assert [work for work, _ in workers.given] == [run_render]


@pytest.fixture
def memory(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """``memory(gib)`` leaves so much of the machine's."""

    def leave(gib: float) -> None:
        monkeypatch.setattr(_rendering, "free_memory", lambda: int(gib * 2**30))

    return leave


@pytest.mark.parametrize(
    ("count", "cores", "most", "at_a_time", "threads"),
    [
        (6, 2, 2, 2, [1] * 6),
        (6, 16, 16, 6, [3] * 6),
        (1, 8, 8, 1, [8]),
        (3, 2, 8, 2, [1, 1, 2]),
        (5, 8, 3, 3, [3, 3, 3, 4, 4]),
        (4, 4, 1, 1, [4] * 4),
    ],
)
def test_one_machine_renders_scenes_side_by_side(
    count: int,
    cores: int,
    most: int,
    at_a_time: int,
    threads: list[int],
    memory: Callable[[float], None],
    tmp_path: Path,
):
    """``--jobs`` is kept to, and the last scenes share all threads, too."""
    memory(1000)
    workers = Workers(1)
    jobs = [replace(job, threads=cores) for job in scenes(count, tmp_path)]
    render_scenes(jobs, workers.run_all, None, silent, most)
    assert workers.at_a_time == [at_a_time]
    assert [job.threads for job in workers.given[0][1]] == threads


@pytest.mark.parametrize(
    ("gib", "pixels", "samples", "at_a_time"),
    [(16, 112, 64, 8), (16, 512, 64, 3), (16, 512, 400, 1), (6, 112, 64, 5), (0.5, 112, 64, 1)],
)
def test_no_more_scenes_are_rendered_at_a_time_than_memory_allows(
    gib: float, pixels: int, samples: int, at_a_time: int, memory: Callable[[float], None], tmp_path: Path
):
    memory(gib)
    workers, settings = Workers(1), replace(SETTINGS, width=pixels, height=pixels, samples=samples)
    jobs = [replace(job, threads=8, settings=settings) for job in scenes(8, tmp_path)]
    render_scenes(jobs, workers.run_all, None, silent, 8)
    assert workers.at_a_time == [at_a_time]


def test_scenes_that_are_there_are_asked_once_and_leave_all_threads_to_the_one_that_is_not(
    memory: Callable[[float], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    memory(1000)
    asked: list[int] = []

    def find(job: RenderJob) -> Outcome | None:
        asked.append(job.spec.seed)
        return Outcome(reused=True, value=Path("there")) if job.spec.seed else None

    monkeypatch.setattr(_rendering, "find_rendered", find)
    workers = Workers(1)
    jobs = [replace(job, threads=4) for job in scenes(4, tmp_path)]
    render_scenes(jobs, workers.run_all, None, silent, 4)
    assert asked == [0, 1, 2, 3]
    assert workers.at_a_time == [1]
    assert workers.given[0][1][0].threads == 4


def test_a_bench_renders_as_many_at_a_time_as_jobs_says(
    memory: Callable[[float], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    memory(1000)
    workers, suite = Workers(1), load_suite("demo")
    monkeypatch.setattr(_runner, "run_all", workers.run_all)
    monkeypatch.setattr(_runner, "usable_cores", lambda: 8)
    monkeypatch.setattr(_runner, "check_seen", list)
    bench = _runner.Bench(suite, tmp_path, tmp_path / "dataset", 2, silent, USUAL, None, Terms())
    rendered = _runner._render(bench, suite.scenes)  # pyright: ignore[reportPrivateUsage]
    assert [spec for spec, _ in rendered] == list(suite.scenes)
    assert workers.at_a_time == [2]
    assert [job.threads for job in workers.given[0][1]] == [4, 4, 8]


def test_scenes_that_are_there_are_not_begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(_rendering, "find_rendered", lambda job: Outcome(reused=True, value=Path("there")))
    workers = Workers(4)
    render(workers, scenes(2, tmp_path))
    assert [work for work, _ in workers.given] == [run_render]


def test_a_scene_that_fails_is_named(tmp_path: Path):
    with pytest.raises(RunError, match="scene dark/corridor-0000: the disk is full"):
        render(Workers(4, fails=True), scenes(1, tmp_path))


@pytest.mark.parametrize(("pictures", "workers", "size"), [(68, 4, 9), (68, 2, 17), (10, 30, 4), (0, 0, 4)])
def test_a_part_is_worth_the_start_of_a_worker(pictures: int, workers: int, size: int):
    assert part_size(pictures, workers) == size


def test_cuts_lose_nothing():
    assert cut((0, 1, 2, 3, 4), 2) == [(0, 1), (2, 3), (4,)]
    assert cut((), 4) == []

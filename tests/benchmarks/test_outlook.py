# SPDX-License-Identifier: Apache-2.0
"""Large runs are planned from what a small one measured."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import fmean, median

import pytest

from graycard.benchmarks import FitSpec
from graycard.benchmarks._fit import fit_scene
from graycard.benchmarks._jobs import RenderJob, rendering_cost, run_render
from graycard.benchmarks.planning import _outlook, measured_costs, outlook
from graycard.benchmarks.planning._outlook import Measured
from graycard.cli import main
from graycard.io import silent, write_json
from graycard.records import Cost, RunRecord, job_folder, read_run
from graycard.synth import RenderSettings, SceneSpec
from without_llvm import hide_llvm

COST = Measured("dark", 2, 6, 6, 360.0, 72.0, 7.2, 50e6, 4e6, 900.0, {"a": 72.0})


def test_hours_disk_and_price_of_a_large_run():
    plan = outlook(COST, 1000, 50, cores=64, efficiency=0.9, price=0.05)
    assert plan.rendering_h == pytest.approx(100)
    assert plan.fits_h == pytest.approx(1000)
    assert plan.scoring_h == pytest.approx(100)
    assert plan.cpu_h == pytest.approx(1200)
    assert plan.hours == pytest.approx(1200 / (64 * 0.9))
    assert plan.disk_gb == pytest.approx(50 + 200)
    assert plan.price == pytest.approx(1200 / 0.9 * 0.05), "idle cores are paid as well"
    assert outlook(COST, 1000, 50, cores=64).price is None
    longest = (360 + 72 + 7.2) / 3600
    assert outlook(COST, 1, 1, cores=10_000).hours == pytest.approx(longest), "a job takes no two cores"


@pytest.mark.parametrize(
    ("numbers", "mend"),
    [
        ((0, 1, 1, 1.0, None), "1 or more scenes, got 0. Mend --scenes"),
        ((1, 0, 1, 1.0, None), "1 or more methods, got 0. Mend --methods"),
        ((1, 1, 0, 1.0, None), "1 or more cores, got 0. Mend --cores"),
        ((1, 1, 1, 0.0, None), "a share, as 0.84, got 0. Mend --efficiency"),
        ((1, 1, 1, 84.0, None), "a share, as 0.84, got 84. Mend --efficiency"),
        ((1, 1, 1, float("nan"), None), "a share, as 0.84, got nan. Mend --efficiency"),
        ((1, 1, 1, 1.0, -1.0), "a price from 0, got -1. Mend --price"),
        ((1, 1, 1, 1.0, float("inf")), "a price from 0, got inf. Mend --price"),
    ],
)
def test_numbers_out_of_range_are_refused(numbers: tuple[int, int, int, float, float | None], mend: str):
    with pytest.raises(ValueError, match=f"expected {mend}"):
        outlook(COST, *numbers)


@pytest.fixture
def run(made_run: Path, tmp_path: Path) -> Path:
    """A copy of a valid run, with the costs that a bench keeps."""
    run = Path(shutil.copytree(made_run, tmp_path / "run"))
    record = read_run(run)
    for number, scene in enumerate(record.scenes):
        path = rendering_cost(run, scene.track, scene.scene)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_json(path, {"cpu_s": 100.0 + number})
    results = []
    for number, result in enumerate(record.results):
        write_json(job_folder(run, result) / "scoring.json", {"cpu_s": 2.0})
        results.append(replace(result, cost=Cost(1.0, 500.0 + number, {}, 10.0 + number)))
    write_json(run / "run.json", replace(record, results=tuple(results)))
    return run


def bytes_below(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def test_costs_are_means_of_what_a_run_measured(run: Path):
    record = read_run(run)
    (found,) = measured_costs(record, run)
    scenes, jobs = len(record.scenes), len(record.results)
    assert (found.scenes, found.fits, found.all_fits) == (scenes, jobs, jobs)
    assert found.rendering_s == pytest.approx(100 + (scenes - 1) / 2)
    assert found.fit_s == pytest.approx(10 + (jobs - 1) / 2)
    assert found.scoring_s == pytest.approx(2)
    assert found.peak_mib == 500 + jobs - 1
    assert found.scene_bytes * scenes == pytest.approx(
        sum(bytes_below(run / s.folder) for s in record.scenes)
    )
    assert found.job_bytes * jobs == pytest.approx(
        sum(bytes_below(job_folder(run, r)) for r in record.results)
    )


def test_a_fit_that_found_stages_done_counts_by_its_wall_time(run: Path):
    record = read_run(run)
    first, *others = record.results
    assert first.cost is not None
    dear = replace(first, cost=replace(first.cost, wall_s=30.0, cpu_s=None))
    again = replace(record, results=(dear, *others))
    (found,) = measured_costs(again, run)
    known = [10.0 + number for number in range(1, len(record.results))]  # in 1 s of wall time each
    of_row = [r.cost.cpu_s for r in others if r.job.method == first.job.method and r.cost and r.cost.cpu_s]
    cores = sum(of_row) / len(of_row)
    assert (found.fits, found.all_fits) == (len(known), len(known) + 1)
    assert found.fit_s == pytest.approx((30 * cores + sum(known)) / (len(known) + 1))


def test_a_row_that_always_found_stages_done_counts_by_the_cores_of_the_others(run: Path):
    record = read_run(run)
    row = record.results[0].job.method
    results = [
        replace(r, cost=replace(r.cost, wall_s=30.0, cpu_s=None)) if r.job.method == row and r.cost else r
        for r in record.results
    ]
    (found,) = measured_costs(replace(record, results=tuple(results)), run, [row])
    others = {r.job.method: [] for r in record.results if r.job.method != row}
    for result in record.results:
        if result.job.method != row and result.cost:
            others[result.job.method].append(result.cost.cpu_s)
    assert (found.fits, found.all_fits) == (0, len(record.scenes))
    assert found.fit_s == pytest.approx(30 * median(fmean(times) for times in others.values()))


def test_rows_that_are_named_count_alone(run: Path, capsys: pytest.CaptureFixture[str]):
    record = read_run(run)
    one, *_ = (method.name for method in record.methods)
    (found,) = measured_costs(record, run, [one])
    own = [r.cost.cpu_s for r in record.results if r.job.method == one and r.cost]
    assert found.fit_s == pytest.approx(sum(filter(None, own)) / len(own))
    assert found.row_s == {one: found.fit_s}
    assert main(["plan", str(run), "--rows", one]) == 0
    assert f"dark {one}" in capsys.readouterr().out
    assert main(["plan", str(run), "--rows", one + "s"]) == 2
    assert f"(did you mean {one!r}?)" in capsys.readouterr().err


def test_scenes_that_objects_come_from_are_counted(run: Path, monkeypatch: pytest.MonkeyPatch):
    """Others that lie in the folder, as of an earlier bench, are not."""
    record = read_run(run)
    write_json(rendering_cost(run, record.scenes[0].track, "of-an-earlier-bench"), {"cpu_s": 1e4})
    (before,) = measured_costs(record, run)
    scene = run / record.scenes[0].folder
    shutil.copytree(scene, scene.with_name("donor-0000"))
    write_json(rendering_cost(run, record.scenes[0].track, "donor-0000"), {"cpu_s": 50.0})
    monkeypatch.setattr(_outlook, "_donors", lambda folders: ["donor-0000"])
    (found,) = measured_costs(record, run)
    scenes = len(record.scenes)
    assert found.scenes == scenes
    assert found.rendering_s == pytest.approx(before.rendering_s + 50 / scenes)
    assert found.scene_bytes == pytest.approx(before.scene_bytes + bytes_below(scene) / scenes)


@pytest.mark.parametrize("gone", ["scene", "job"])
def test_folders_that_are_gone_are_not_counted_as_empty(
    run: Path, gone: str, capsys: pytest.CaptureFixture[str]
):
    record = read_run(run)
    folder = run / record.scenes[0].folder if gone == "scene" else job_folder(run, record.results[0])
    shutil.rmtree(folder)
    assert main(["plan", str(run)]) == 2
    assert f"got no folder {folder}" in " ".join(capsys.readouterr().err.replace("\n", "").split())


def forget_scenes(run: Path, record: RunRecord) -> None:
    for scene in record.scenes:
        rendering_cost(run, scene.track, scene.scene).unlink()


def forget_fits(run: Path, record: RunRecord) -> None:
    results = [replace(result, cost=Cost(1.0, 1.0)) for result in record.results]
    write_json(run / "run.json", replace(record, results=tuple(results)))


def forget_scores(run: Path, record: RunRecord) -> None:
    for result in record.results:
        (job_folder(run, result) / "scoring.json").write_text("{")


@pytest.mark.parametrize(
    ("forget", "words"), [(forget_scenes, "scene"), (forget_fits, "fit"), (forget_scores, "set of scores")]
)
def test_what_was_not_measured_is_not_made_up(
    run: Path, forget: Callable[[Path, RunRecord], None], words: str, capsys: pytest.CaptureFixture[str]
):
    forget(run, read_run(run))
    assert main(["plan", str(run)]) == 2
    shown = " ".join(capsys.readouterr().err.split())
    assert f"to have measured a {words} of track dark, got none" in shown


def test_the_verb_shows_the_plan(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    told = ["--scenes", "1000", "--methods", "50", "--cores", "10", "--price", "0.1", "--efficiency", "1"]
    assert main(["plan", str(run), *told, "--json", str(tmp_path / "plan.json")]) == 0
    shown = capsys.readouterr().out
    (plan,) = json.loads((tmp_path / "plan.json").read_text())["result"]
    assert (plan["scenes"], plan["methods"]) == (1000, 50)
    assert plan["price"] == pytest.approx(plan["hours"] * 10 * 0.1)
    assert f"1000 scenes x 50 methods on 1 tracks: {plan['hours']:,.0f} h on 10 cores" in shown
    assert main(["plan", str(run), "--cores", "0"]) == 2
    assert "Mend --cores" in capsys.readouterr().err


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
def test_a_fit_tells_its_cpu_time(make_scene: Callable[..., Path], tmp_path: Path):
    cost = fit_scene(
        FitSpec("small_methods:Busy", {}, 0, make_scene()), tmp_path / "predictions", silent
    ).cost
    assert cost.cpu_s is not None
    assert cost.cpu_s >= 0.5


def test_a_scene_that_is_rendered_in_one_go_keeps_its_cost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    hide_llvm(monkeypatch)
    spec, settings = SceneSpec("dark", "corridor", 0), RenderSettings(20, 16, 3, 1, 4, 3)
    job = RenderJob(spec, settings, tmp_path / "dataset", 1, tmp_path / "run")
    assert run_render(job).reason == ""
    path = rendering_cost(tmp_path / "run", "dark", "corridor-0000")
    assert json.loads(path.read_text())["cpu_s"] > 0
    assert [found.name for found in (tmp_path / "dataset" / "dark").iterdir()] == ["corridor-0000"]
    path.unlink()
    picture = tmp_path / "dataset" / "dark" / "corridor-0000" / "truth" / "views" / "train_000.exr"
    picture.write_bytes(b"damaged")
    assert run_render(job).reason == ""
    assert not path.exists(), "one picture was missing alone"

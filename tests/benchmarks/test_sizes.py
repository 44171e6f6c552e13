# SPDX-License-Identifier: Apache-2.0
"""Runs at other sizes of pictures, numbers of views and surfels, and how effects move with them."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from claims_by_hand import against, check_of, judged
from graycard import RecordError
from graycard.benchmarks import Terms, _runner, load_suite, run_bench
from graycard.benchmarks._introduction import Introduction
from graycard.benchmarks._run_record import RunError
from graycard.benchmarks._sizes import at_size, scaled
from graycard.benchmarks.claims import Sized, read_sizes
from graycard.benchmarks.claims._fitted import Scale
from graycard.benchmarks.claims._readings import Readings
from graycard.cli import main
from graycard.cli.benches._bench import BenchCommand
from graycard.io import read_json, silent, write_json
from graycard.processes import USUAL
from graycard.records import Edition, RunRecord, Size, read_run
from runs_by_hand import run_of
from tiny_benches import made_without_renderer, write_reserve_suite
from valid_runs import breaches, change

RUN = run_of({"mine": {"psnr": [1.0, 2.0]}, "theirs": {"psnr": [0.0, 0.0]}})
RENDER = {"width": 112, "height": 84, "train_views": 20, "test_views": 5}
SMALL, LARGE = "112 x 112 pixels, 20 views", "256 x 256 pixels, 20 views"
HERE = Scale(112, 112, 20, 5, 1.0)


def test_pictures_keep_their_ratio_and_their_paths_a_pixel(tmp_path: Path) -> None:
    suite = load_suite("claims-dark")
    larger = at_size(suite, Size(width=256, train_views=40))
    assert (larger.render.width, larger.render.height, larger.render.train_views) == (256, 256, 40)
    assert [larger.render_of(s).samples for s in larger.scenes] == [
        suite.render_of(s).samples for s in suite.scenes
    ]
    wide = replace(suite, render=replace(suite.render, width=160, height=120))
    assert at_size(wide, Size(width=80)).render.height == 60
    assert at_size(suite, Size()) == suite


@pytest.mark.parametrize("size", [Size(width=2), Size(width=0), Size(width=-8), Size(train_views=1)])
def test_sizes_that_cannot_be_rendered_are_refused(size: Size) -> None:
    with pytest.raises(RecordError, match=r"expected (width|height|train_views) .* Mend --pixels or --views"):
        at_size(load_suite("claims-dark"), size)


def test_steps_and_surfels_are_multiplied_where_a_method_has_them() -> None:
    known = {"iterations": 1001, "surfels": 5000, "lamps": 8}
    assert scaled(known, 0.5) == {"iterations": 500}
    assert scaled(known, 1.0, 2.0) == {"surfels": 10000}
    assert scaled(known, 2.0, 1e-9) == {"iterations": 2002, "surfels": 1}
    assert scaled({"reflectance": 0.18}, 0.5, 2.0) == {}
    assert scaled(known, 1.0) == {}


@pytest.mark.parametrize("factor", [0.0, -1.0, float("inf"), float("nan")])
def test_a_factor_on_surfels_is_above_nothing(factor: float) -> None:
    with pytest.raises(RunError, match="expected a factor on surfels above 0"):
        Terms(size=Size(surfels=factor))


def test_sealed_scenes_stay_as_their_suite_has_them() -> None:
    with pytest.raises(RunError, match="expected sealed scenes as their suite has them, got 256 pixels wide"):
        Terms(size=Size(width=256), edition=Edition("edition-1", "c" * 40))


def test_a_run_is_made_at_its_size_and_keeps_its_suite(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = [
        Introduction("splats", (), {"iterations": 1000, "surfels": 500}, (), ""),
        Introduction("gray", (), {"reflectance": 0.18}, (), ""),
    ]
    monkeypatch.setattr(_runner, "introduce", lambda *_: known)
    suite = load_suite(str(write_reserve_suite(tmp_path)))
    suite = replace(suite, methods=suite.methods[:2])
    terms = Terms(size=Size(width=64, surfels=2.0))
    bench = _runner.Bench(suite, tmp_path, tmp_path, 1, silent, USUAL, None, terms)
    begun, found = _runner._begun(bench)
    assert (begun.suite.render.width, begun.suite.scenes, begun.whole) == (64, suite.scenes, suite)
    assert [k.settings for k in found] == [{"iterations": 1000, "surfels": 1000}, {"reflectance": 0.18}]
    assert [dict(m.settings) for m in begun.suite.methods] == [{"surfels": 1000}, {}]


def test_a_run_says_its_size_and_keeps_others_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write_tiny: Callable[..., Path]
) -> None:
    made_without_renderer(monkeypatch, write_tiny)
    suite, run = load_suite(str(write_reserve_suite(tmp_path))), tmp_path / "run"
    run_bench(suite, run, 1, silent, terms=Terms(size=Size(surfels=2.0)))
    assert read_run(run).size == Size(surfels=2.0)
    assert "suite" not in breaches(run)
    with pytest.raises(RunError, match="got one of 'tiny-reserve' version 1 at 2 times the surfels"):
        run_bench(suite, run, 1, silent)
    with pytest.raises(RunError, match="hold a run of .* at 2 times its iterations and 64 pixels wide, got"):
        run_bench(suite, run, 1, silent, terms=Terms(2.0, Size(width=64)))


def test_a_scene_of_another_size_than_the_run_says_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write_tiny: Callable[..., Path]
) -> None:
    made_without_renderer(monkeypatch, write_tiny)
    run = tmp_path / "run"
    run_bench(load_suite(str(write_reserve_suite(tmp_path))), run, 1, silent)
    assert "suite" not in breaches(run)
    change(run, lambda data: data.update(size={"width": 64}))
    told = " ".join(breaches(run)["suite"])
    assert "expected the scene that tiny-reserve asks for, got another render.width" in told


@pytest.mark.parametrize(
    ("command", "name"),
    [
        (BenchCommand("demo"), ""),
        (BenchCommand("demo", pixels=256, views=40), "-256-pixels-40-views"),
        (BenchCommand("demo", budget=0.5, surfels=2), "-budget-0.5-surfels-2"),
    ],
)
def test_each_size_has_a_folder_of_its_own(command: BenchCommand, name: str) -> None:
    assert command._kind() == name


def test_until_decided_takes_the_suite_as_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    command = [
        "bench",
        "claims-dark",
        "--until-decided",
        "--max-scenes",
        "9",
        "--pixels",
        "256",
        "--surfels",
        "2",
    ]
    assert main(command) == 2
    assert "expected --until-decided without --pixels, --surfels, got both" in capsys.readouterr().err


def write_sizes(root: Path, **runs: tuple[RunRecord, Size]) -> list[Path]:
    """Write runs with the suite that they are of, and return their folders."""
    for name, (record, size) in runs.items():
        write_json(root / name / "run.json", replace(record, size=size))
        write_json(root / name / "suite.json", {"render": RENDER})
    return [root / name for name in runs]


def test_runs_come_from_small_to_large(tmp_path: Path) -> None:
    runs = write_sizes(
        tmp_path, a=(RUN, Size(width=224)), b=(RUN, Size(surfels=2)), c=(RUN, Size()), d=(RUN, Size(None, 40))
    )
    assert [size.words for size in read_sizes(runs)] == [
        "112 x 84 pixels, 20 views",
        "112 x 84 pixels, 20 views, 2 times the surfels",
        "112 x 84 pixels, 40 views",
        "224 x 168 pixels, 20 views",
    ]
    assert read_sizes([]) == ()


@pytest.mark.parametrize(
    ("other", "size", "words"),
    [
        (RUN, Size(), "expected runs that differ in size, got two of 112 x 84 pixels, 20 views"),
        (replace(RUN, budget=2.0), Size(256), "expected a run with budget 1.0 in .* got 2.0"),
        (replace(RUN, suite_version=2), Size(256), "expected a run with suite hand version 1 in"),
        (replace(RUN, scenes=RUN.scenes[:1]), Size(256), "expected a run with scenes"),
        (replace(RUN, results=()), Size(256), r"expected a run with seeds \[0\] in .* got \[\]"),
    ],
)
def test_runs_that_differ_in_more_than_size_are_refused(
    tmp_path: Path, other: RunRecord, size: Size, words: str
) -> None:
    with pytest.raises(RecordError, match=words):
        read_sizes(write_sizes(tmp_path, a=(RUN, Size()), b=(other, size)))


def test_one_run_shows_no_change(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="expected runs at two or more sizes, got one"):
        read_sizes(write_sizes(tmp_path, a=(RUN, Size())))


@pytest.mark.parametrize("kept", [None, {}, {"render": {"width": 112}}, {"render": RENDER | {"width": "x"}}])
def test_a_run_without_its_suite_has_no_size(tmp_path: Path, kept: Mapping[str, Any] | None) -> None:
    runs = write_sizes(tmp_path, a=(RUN, Size()), b=(RUN, Size(256)))
    if kept is None:
        (runs[1] / "suite.json").unlink()
    else:
        write_json(runs[1] / "suite.json", kept)
    with pytest.raises(RecordError, match=r"expected .*"):
        read_sizes(runs)


def sizes(**means: float) -> tuple[Sized, ...]:
    """Return runs by their size, in which ``mine`` is ahead by so many dB."""
    names = {"small": SMALL, "large": LARGE}
    return tuple(Sized(names[name], Readings(against(mean))) for name, mean in means.items())


def test_a_check_is_told_at_each_size_and_a_verdict_that_turns_is_named() -> None:
    """The paper's 4 dB reach from 2 to 8: 5 dB are as claimed, 1 dB is less."""
    found = judged(against(5.0), check_of(paper=4.0), sizes=sizes(small=5.0, large=1.0), scale=HERE)
    assert found.checks[0].at_sizes == pytest.approx({SMALL: 5.0, LARGE: 1.0})
    assert found.turns == f"by estimates alone reproduced at {SMALL}, but smaller than claimed at {LARGE}"
    alone = judged(against(5.0), check_of(paper=4.0))
    assert (found.verdict, found.suspended) == (alone.verdict, alone.suspended)
    assert (alone.turns, alone.checks[0].at_sizes) == ("", {})


def test_a_verdict_that_no_size_turns_is_not_named() -> None:
    found = judged(against(5.0), check_of(paper=4.0), sizes=sizes(small=5.0, large=3.0), scale=HERE)
    assert found.turns == ""


def test_sizes_are_compared_with_that_of_the_run_and_else_with_the_smallest() -> None:
    both = sizes(small=5.0, large=-5.0)
    large = judged(against(-5.0), check_of(), sizes=both, scale=Scale(256, 256, 20, 5, 1.0))
    assert large.turns == f"by estimates alone contradicted at {LARGE}, but reproduced at {SMALL}"
    other = judged(against(-5.0), check_of(), sizes=both, scale=Scale(64, 64, 20, 5, 1.0))
    assert other.turns.startswith(f"by estimates alone reproduced at {SMALL}, but")


def test_own_questions_turn_in_their_own_words() -> None:
    both = sizes(small=5.0, large=-5.0)
    found = judged(against(5.0), check_of(), sizes=both, scale=HERE, asked_by="graycard")
    assert found.turns == f"by estimates alone holds at {SMALL}, but does not hold at {LARGE}"


def test_a_claim_that_runs_of_other_sizes_cannot_test_turns_nowhere() -> None:
    gone = Sized(LARGE, Readings(run_of({"mine": {"psnr": [1.0, 2.0]}})))
    found = judged(against(5.0), check_of(), sizes=(*sizes(small=5.0), gone), scale=HERE)
    assert (found.turns, list(found.checks[0].at_sizes)) == ("", [SMALL])


def test_the_command_line_takes_sizes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    runs = write_sizes(tmp_path, a=(RUN, Size()), b=(RUN, Size(256)))
    command = ["claims", str(runs[0]), "--any-suite", "--claims", "goris-matte"]
    assert main([*command, "--sizes", *map(str, runs)]) == 0
    assert "sizes" in read_json(runs[0] / "claims.json")["rules"]
    assert main([*command, "--sizes", str(runs[1])]) == 2
    assert "expected runs at two or more sizes, got one" in capsys.readouterr().err
    assert main(["claims", "--sizes", *map(str, runs)]) == 2
    assert "expected a run with --sizes, got none" in capsys.readouterr().err

# SPDX-License-Identifier: Apache-2.0
"""Runs at other sizes of pictures, numbers of views and surfels, and how effects move with them."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest

from claims_by_hand import LEVELS, against, check_of, course, fitted, judged
from graycard import TRACKS, RecordError
from graycard.benchmarks import (
    Plan,
    Terms,
    _runner,
    load_suite,
    run_bench,
    run_part,
    run_until_decided,
    suite_names,
)
from graycard.benchmarks._introduction import Introduction
from graycard.benchmarks._run_record import RunError
from graycard.benchmarks._sizes import at_size, scaled
from graycard.benchmarks.claims import Sized, _noise, load_claims, read_sizes
from graycard.benchmarks.claims._readings import Readings
from graycard.benchmarks.gates._gate import judge, make_baseline
from graycard.benchmarks.planning._parts import Part
from graycard.benchmarks.validity._suite import part_of
from graycard.cli import main
from graycard.cli.benches._bench import BenchCommand
from graycard.io import from_builtins, read_json, sha256, silent, to_builtins, write_json
from graycard.methods.splat import windows_of
from graycard.processes import USUAL
from graycard.records import Edition, RunRecord, Scale, Size, read_run
from graycard.reports._budgets import budget_table
from graycard.synth import scene_name
from runs_by_hand import run_of
from tiny_benches import made_without_renderer, write_reserve_suite
from valid_runs import breaches, change

RUN = run_of({"mine": {"psnr": [1.0, 2.0]}, "theirs": {"psnr": [0.0, 0.0]}})
RENDER = {"width": 112, "height": 84, "train_views": 20, "test_views": 5}
SMALL, LARGE = "112 x 112 pixels, 20 views", "256 x 256 pixels, 20 views"
WHOLE_VIEWS = ("sizes-tabletop", "sizes-multilight", "claims-tabletop-hd", "claims-multilight-hd")
"""Suites whose steps with light draw a whole view of larger pictures, too."""
IN_TILES = ("goris", "gsid", "gsir")
"""Methods whose steps with light draw a tile. The tiles of ``sunfaded`` are others: those of its light."""
MAIN_CLAIMS = [
    ("dark", "sunfaded", "S1 S2 S6 S13 S14"),
    ("tabletop", "goris", "R1 R14 R15"),
    ("multilight", "gsid", "G1 G2 G3 G4 G5 G6 G7 G11 G13 G14"),
]
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


@pytest.mark.parametrize(
    "size",
    [{"width": 3}, {"width": 0}, {"width": -8}, {"train_views": 1}, {"surfels": 0.0}, {"surfels": -1.0}]
    + [{"surfels": value} for value in ("inf", "nan")],
)
def test_sizes_that_are_none_are_refused_wherever_they_come_from(size: dict[str, Any]) -> None:
    numbers: dict[str, Any] = {
        name: float(value) if isinstance(value, str) else value for name, value in size.items()
    }
    with pytest.raises(ValueError, match="expected .* got"):
        Size(**numbers)
    with pytest.raises(RecordError, match="expected"):
        from_builtins(RunRecord, {**to_builtins(RUN), "size": size}, RecordError)


def test_a_wide_picture_may_get_too_low() -> None:
    suite = load_suite("claims-dark")
    wide = replace(suite, render=replace(suite.render, width=160, height=20))
    with pytest.raises(RecordError, match="expected height to be 4 or more, got 1. Mend --pixels"):
        at_size(wide, Size(width=8))


def test_pictures_beyond_all_measure_are_refused_before_anything_is_rendered() -> None:
    suite = load_suite("claims-dark")
    assert at_size(suite, Size(width=8192)).render.height == 8192
    with pytest.raises(RecordError, match=r"expected pictures of 67108864 pixels at most, got 8193x8193"):
        at_size(suite, Size(width=8193))


@pytest.mark.parametrize("suite", ["sizes-{}", "claims-{}-hd", "paper-{}"])
@pytest.mark.parametrize("track", TRACKS)
def test_rows_of_a_name_are_the_same_method_at_each_size(suite: str, track: str) -> None:
    """They may differ in the length of fits, what a GPU does alone, and the part of a view in a step."""
    budget = {"iterations", "surfels", "backend"}
    known = {method.row: method for method in load_suite(f"claims-{track}").methods}
    name = suite.format(track)
    for method in load_suite(name).methods:
        of_claims = known[method.row]
        assert (method.entry, method.priors) == (of_claims.entry, of_claims.priors), method.row
        free = budget | {"tile"} if name in WHOLE_VIEWS and method.entry in IN_TILES else budget
        kept = [{k: v for k, v in m.settings.items() if k not in free} for m in (method, of_claims)]
        assert kept[0] == kept[1], method.row


@pytest.mark.parametrize(("track", "paper", "names"), MAIN_CLAIMS)
def test_suites_of_large_scenes_have_the_rows_of_the_main_claims(track: str, paper: str, names: str) -> None:
    rows = {method.row for method in load_suite(f"claims-{track}-hd").methods}
    claims = {claim.id: claim for claim in load_claims(paper).claims}
    for name in names.split():
        wanted = {row for check in claims[name].checks if check.decides for row in check.rows}
        assert wanted <= rows, name


@pytest.mark.parametrize("width", [112, 168, 256])
@pytest.mark.parametrize("suite", WHOLE_VIEWS)
def test_a_step_draws_a_whole_view_at_each_size(suite: str, width: int) -> None:
    """Else a fit sees each pixel of larger pictures less often, and effects move with that as well."""
    rows = [m for m in load_suite(suite).methods if m.entry in IN_TILES]
    assert rows
    for method in rows:
        assert len(windows_of(width, width, method.settings["tile"])) == 1, method.row


def test_no_scene_is_sealed_in_two_suites() -> None:
    """Else the scores of the one are seen before the other is run."""
    suites = map(load_suite, suite_names())
    ranges = {suite.name: suite.sealed for suite in suites if suite.sealed is not None}
    assert len(ranges) == 11
    for (one, first), (other, second) in combinations(ranges.items(), 2):
        shared = [scene_name(spec) for spec in first.drawn() if second.holds(spec)]
        assert not shared, (one, other)


def test_steps_and_surfels_are_multiplied_where_a_method_has_them() -> None:
    known = {"iterations": 1001, "surfels": 5000, "lamps": 8}
    assert scaled(known, 0.5) == {"iterations": 500}
    assert scaled(known, 1.0, 2.0) == {"surfels": 10000}
    assert scaled(known, 2.0, 1e-9) == {"iterations": 2002, "surfels": 1}
    assert scaled({"reflectance": 0.18}, 0.5, 2.0) == {}
    assert scaled(known, 1.0) == {}


@pytest.mark.parametrize("option", [("--pixels", "2"), ("--views", "1"), ("--surfels", "0")])
def test_options_that_are_no_sizes_say_what_to_mend(
    option: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "demo", "--out", str(tmp_path / "run"), *option]) == 2
    assert f". Mend {option[0]}" in " ".join(capsys.readouterr().err.split())


def test_sealed_scenes_stay_at_the_size_of_their_suite() -> None:
    with pytest.raises(
        RunError, match="sealed scenes at the size of their suite, got 256 pixels wide. Leave"
    ):
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


def test_a_factor_on_surfels_that_no_row_has_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_runner, "introduce", lambda *_: [Introduction("gray", (), {}, (), "")])
    suite = load_suite(str(write_reserve_suite(tmp_path)))
    suite = replace(suite, methods=suite.methods[:1])
    with pytest.raises(RunError, match="expected a row with surfels for --surfels, got none"):
        run_bench(suite, tmp_path / "run", 1, silent, terms=Terms(size=Size(surfels=2.0)))


def test_a_run_says_its_size_and_keeps_others_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write_tiny: Callable[..., Path]
) -> None:
    made_without_renderer(monkeypatch, write_tiny)
    suite, run = load_suite(str(write_reserve_suite(tmp_path))), tmp_path / "run"
    size = Size(width=suite.render.width)
    run_bench(suite, run, 1, silent, terms=Terms(size=size))
    record = read_run(run)
    assert (record.size, record.departs) == (size, size.words)
    assert read_json(run / "suite.json")["render"]["width"] == suite.render.width
    assert "suite" not in breaches(run)
    assert part_of(record, suite) == f"tiny-reserve at {size.words}"
    with pytest.raises(RunError, match=f"got one of 'tiny-reserve' version 1 at {size.words}"):
        run_bench(suite, run, 1, silent)
    for call in (run_bench, partial(run_part, part=Part(1, 2))):
        with pytest.raises(RunError, match="hold a run of .* at 2 times its iterations, 64 pixels wide, got"):
            call(suite, run, 1, silent, terms=Terms(2.0, Size(width=64)))
    with pytest.raises(RunError, match="expected the suite as it is .* got one at 2 times its iterations"):
        run_until_decided(suite, run, 1, silent, Plan(9), terms=Terms(2.0))


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


def test_a_row_of_other_surfels_than_its_run_says_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write_tiny: Callable[..., Path]
) -> None:
    made_without_renderer(monkeypatch, write_tiny)
    run = tmp_path / "run"
    run_bench(load_suite(str(write_reserve_suite(tmp_path))), run, 1, silent)
    kept = read_json(run / "suite.json")
    kept["methods"][1]["settings"] = {"surfels": 100}
    write_json(run / "suite.json", kept)

    def fitted_with(surfels: int) -> list[str]:
        def edit(data: Any) -> None:
            for result in data["results"]:
                if result["job"]["method"] == "gray":
                    result["job"]["settings"]["surfels"] = surfels
            data.update(size={"surfels": 2.0}, suite_sha256=sha256(run / "suite.json"))

        change(run, edit)
        return breaches(run).get("suite", [])

    assert fitted_with(200) == []
    assert "got another settings.surfels" in fitted_with(100)[0]


def test_the_gate_compares_runs_of_one_size_alone() -> None:
    run = replace(run_of({"mine": {"psnr": [1.0, 2.0]}}), budget=0.5, size=Size(width=64))
    baseline = make_baseline(run)
    assert judge(run, baseline).exit_code == 0
    words = "expected a run of suite .* at 0.5 times its iterations, 64 pixels wide, as the baseline is, got"
    with pytest.raises(RecordError, match=words):
        judge(replace(run, size=Size()), baseline)


def test_noise_of_fits_at_one_size_is_that_of_stand_ins_at_another() -> None:
    row = _noise._Measured(Readings(fitted(RUN, rows=("mine",))), RUN.scenes)
    assert row.fitted_alike("mine", Readings(fitted(RUN, rows=("mine",))))
    for size in (Size(width=64), Size(train_views=40)):
        assert not row.fitted_alike("mine", Readings(replace(fitted(RUN, rows=("mine",)), size=size)))


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


@pytest.mark.parametrize(
    "kept", [None, {}, [], {"render": []}, {"render": {"width": 112}}, {"render": RENDER | {"width": "x"}}]
)
def test_a_run_without_its_suite_has_no_size(tmp_path: Path, kept: Any) -> None:
    runs = write_sizes(tmp_path, a=(RUN, Size()), b=(RUN, Size(256)))
    if kept is None:
        (runs[1] / "suite.json").unlink()
    else:
        write_json(runs[1] / "suite.json", kept)
    with pytest.raises(RecordError, match="expected a run with suite.json that tells pixels and views"):
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
    contradicted = f"contradicted at {LARGE} (as in this run)"
    assert other.turns == f"by estimates alone reproduced at {SMALL}, but {contradicted}"


def test_a_size_at_which_estimates_agree_with_the_run_is_marked_where_those_of_its_own_size_do_not() -> None:
    found = judged(against(-5.0), check_of(), sizes=sizes(small=5.0, large=-5.0), scale=HERE)
    contradicted = f"contradicted at {LARGE} (as in this run)"
    assert found.verdict == "contradicted"
    assert found.turns == f"by estimates alone reproduced at {SMALL}, but {contradicted}"


def test_a_course_that_goes_back_at_one_step_turns_a_verdict() -> None:
    """From the first row to the last it rises at both sizes; at the larger one it falls in between."""
    both = tuple(
        Sized(words, Readings(course(*means)))
        for words, means in ((SMALL, (0.0, 2.0, 4.0)), (LARGE, (0.0, 6.0, 4.0)))
    )
    check = check_of("monotone", LEVELS)
    found = judged(course(0.0, 2.0, 4.0), check, sizes=both, scale=HERE)
    assert found.turns == f"by estimates alone reproduced at {SMALL}, but contradicted at {LARGE}"


def test_the_paper_is_not_asked_for_other_sizes() -> None:
    found = judged(
        fitted(against(5.0), rows=("mine",)), check_of(), sizes=sizes(small=5.0, large=3.0), scale=HERE
    )
    table = budget_table(found.budget)
    assert table is not None
    assert ("other sizes", "", f"{SMALL}; {LARGE}") in table.lines


def test_own_questions_turn_in_their_own_words() -> None:
    both = sizes(small=5.0, large=-5.0)
    found = judged(against(5.0), check_of(), sizes=both, scale=HERE, asked_by="graycard")
    assert found.turns == f"by estimates alone holds at {SMALL}, but does not hold at {LARGE}"


def test_a_claim_that_runs_of_other_sizes_cannot_test_turns_nowhere() -> None:
    gone = Sized(LARGE, Readings(run_of({"mine": {"psnr": [1.0, 2.0]}})))
    found = judged(against(5.0), check_of(), sizes=(*sizes(small=5.0), gone), scale=HERE)
    assert (found.turns, list(found.checks[0].at_sizes)) == ("", [SMALL])


MINE = """
name = "mine"
version = 1
title = "A paper of mine"
track = "dark"
bound = "bound"
trivial = "gray"
[[claims]]
id = "M1"
sentence = "Mine is better."
source = "Table 1"
[[claims.checks]]
id = "psnr"
says = "PSNR is higher"
rule = "better"
rows = ["mine", "theirs"]
quantity = { metric = "psnr" }
expects = "higher"
"""


def test_the_command_line_takes_sizes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("graycard.reports.write_report", lambda run: run)
    larger = run_of({"mine": {"psnr": [1.0, 2.0]}, "theirs": {"psnr": [2.0, 3.0]}})
    runs = write_sizes(tmp_path, a=(RUN, Size()), b=(larger, Size(224)))
    (tmp_path / "mine.toml").write_text(MINE)
    command = ["claims", str(runs[0]), "--checks", "--claims", str(tmp_path / "mine.toml")]
    assert main([*command, "--sizes", *map(str, runs)]) == 0
    told = " ".join(capsys.readouterr().out.split())
    turns = "reproduced at 112 x 84 pixels, 20 views, but contradicted at 224 x 168 pixels, 20 views"
    assert f"With size: by estimates alone {turns}" in told
    assert "verdict 112 x 84 pixels, 20 views 224 x 168 pixels, 20 views" in told
    assert "undecided 1.5 dB -1 dB" in told
    assert "verdicts over sizes, by estimates alone: turn: M1" in told
    claim = read_json(runs[0] / "claims.json")["papers"][0]["claims"][0]
    assert claim["turns"] == f"by estimates alone {turns}"
    assert main([*command, "--sizes", str(runs[1])]) == 2
    assert "expected runs at two or more sizes, got one" in capsys.readouterr().err
    assert main(["claims", "--sizes", *map(str, runs)]) == 2
    assert "expected a run with --sizes, got none" in capsys.readouterr().err


def test_the_command_line_tells_which_claims_stay_and_which_nobody_can_compare(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second claim has a row that the run has, and those of other sizes lack."""
    monkeypatch.setattr("graycard.reports.write_report", lambda run: run)
    whole = run_of(
        {
            name: {"psnr": [value, value + 1.0]}
            for name, value in (("mine", 1.0), ("theirs", 0.0), ("third", 0.5))
        }
    )
    runs = write_sizes(tmp_path, a=(RUN, Size()), b=(RUN, Size(224)), judged=(whole, Size()))
    head, _, first = MINE.partition("[[claims]]")
    second = first.replace("M1", "M2").replace("theirs", "third")
    (tmp_path / "mine.toml").write_text(f"{head}[[claims]]{first}[[claims]]{second}")
    command = ["claims", str(runs[2]), "--claims", str(tmp_path / "mine.toml")]
    assert main([*command, "--sizes", *map(str, runs[:2])]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "by estimates alone: stay: M1; not compared, as rows or scenes are lacking: M2" in told


def test_runs_without_rows_of_the_claims_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = write_sizes(tmp_path, a=(RUN, Size()), b=(RUN, Size(256)))
    command = ["claims", str(runs[0]), "--any-suite", "--claims", "goris-matte"]
    assert main([*command, "--sizes", *map(str, runs)]) == 2
    assert "expected runs with rows that these claims compare, got none" in capsys.readouterr().err

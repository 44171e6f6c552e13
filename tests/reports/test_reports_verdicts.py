# SPDX-License-Identifier: Apache-2.0
"""Who is best, by how much and how surely, in words; and the same on one axis."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from graycard.io import write_json
from graycard.records import (
    COMPARISON,
    AboveCeiling,
    Comparison,
    Job,
    JobResult,
    MethodRecord,
    MethodStanding,
    MetricComparison,
    MetricRecord,
    PairDifference,
    RunRecord,
)
from graycard.reports import write_report
from graycard.reports._format import format_p
from graycard.reports.tables._cells import Cell
from graycard.reports.tables._compared import compare_track
from graycard.reports.tables._help import explain_rules, metric_head
from graycard.reports.tables._intervals import PAD, axis_of, axis_of_standings, interval_plot
from graycard.reports.tables._summary import part_of, summary_rows
from graycard.reports.tables._verdicts import LeaderVerdict, judge, judge_without_intervals
from opened import opened

UP = MetricRecord("a.up", "Up", "albedo", "dB", True, math.inf, "f", True, 0.1, ("global gain", "sign"))
DOWN = MetricRecord("n.down", "Down", "normal", "°", False, 0.0, "g", True, 0.0)
EVIDENCE = "p = 0.030 after correction for all pairs, 0.010 for this pair alone, n = 8"
SIDE = MetricRecord("a.side", "Side", "albedo", "1", False, 0.0, "h", False, 0.1)


def stands(method: str, mean: float | None, rank: int | None = 1, **more: Any) -> MethodStanding:
    given: dict[str, Any] = {"competes": True, "scenes": 8, "expected": 8, "seeds": 1, **more}
    return MethodStanding(method, mean=mean, rank=rank, **given)


def pair(first: str, second: str, verdict: Any, **more: Any) -> PairDifference:
    given: dict[str, Any] = {
        "scenes": 8, "difference": 1.0, "interval": (0.5, 2.0), "p_rank": 0.008, "p_rank_holm": 0.1,
        "p_mean": 0.01, "p_mean_corrected": 0.03, **more,
    }  # fmt: skip
    return PairDifference(first, second, verdict=verdict, **given)


def compared(metric: MetricRecord, methods: list[MethodStanding], *pairs: PairDifference) -> LeaderVerdict:
    found = MetricComparison("dark", metric.id, tuple(methods), pairs)
    return judge(metric, found, Comparison("s", 1, 0.95, 6, {"dB": 1.0}, "the rule", (found,)))


def test_clear_lead_names_the_larger_of_both_p_values() -> None:
    found = compared(UP, [stands("b", 20.0, 2), stands("a", 21.0)], pair("a", "b", "better"))
    assert found == LeaderVerdict(
        "clear",
        "clear lead",
        "a",
        "21.00",
        "1.00 dB (0.50 to 2.00) ahead of b",
        "p = 0.030 after correction for all pairs, 0.010 for this pair alone, n = 8",
    )


@pytest.mark.parametrize(
    ("chances", "told"),
    [
        ({"p_rank": 0.04}, "p = 0.040 after correction for all pairs"),  # ranks decide uncorrected
        ({"p_mean": 1e-5, "p_rank": 1e-6, "p_mean_corrected": 0.12},
         "p = 0.12 after correction for all pairs, < 0.001 for this pair alone"),
        ({"p_mean": None, "p_mean_corrected": None, "p_rank": 0.008, "p_rank_holm": 0.06},
         "p = 0.060 after correction for all pairs, 0.008 for this pair alone"),  # a mean is infinite
    ],
)  # fmt: skip
def test_p_is_told_as_it_decides_and_as_it_is_of_the_pair_alone(chances: dict[str, Any], told: str) -> None:
    tie = pair("a", "b", "tie", **chances)
    assert compared(UP, [stands("b", 20.0), stands("a", 21.0)], tie).evidence == f"{told}, n = 8"


def test_pair_without_any_test_has_its_scenes_alone() -> None:
    level = pair("a", "b", "tie", p_rank=None, p_rank_holm=None, p_mean=None, p_mean_corrected=None)
    assert compared(UP, [stands("b", 20.0), stands("a", 20.0)], level).evidence == "n = 8"


def test_where_less_is_better_a_lead_is_still_positive() -> None:
    methods = [stands("a", 4.0), stands("b", 6.0, 2)]
    worse = pair("a", "b", "better", difference=-2.0, interval=(-3.0, -1.0))
    assert compared(DOWN, methods, worse).lead == "2.00 ° (1.00 to 3.00) ahead of b"
    turned = pair("b", "a", "worse", difference=2.0, interval=(1.0, 3.0))
    assert compared(DOWN, methods, turned).lead == "2.00 ° (1.00 to 3.00) ahead of b"
    up = compared(UP, [stands("a", 6.0), stands("b", 4.0, 2)], pair("b", "a", "worse", interval=(-3.0, -1.0)))
    assert up.lead == "2.00 dB (1.00 to 3.00) ahead of b"


def test_ties_are_all_of_the_leaders_group() -> None:
    methods = [stands("a", 9.0), stands("b", 8.0), stands("c", 7.0), stands("d", 1.0, 2)]
    found = compared(UP, methods, pair("a", "b", "tie"), pair("a", "c", "tie"), pair("a", "d", "better"))
    assert (found.kind, found.words, found.tied) == ("tied", "tied with b and c", ("b", "c"))


def test_variants_of_a_method_neither_lead_nor_are_rivals() -> None:
    """They stand in the tables: who is best is asked of methods."""
    methods = [stands("a-x", 10.0), stands("a", 9.0), stands("a-y", 8.5), stands("b", 8.0, 2)]
    found = MetricComparison("dark", UP.id, tuple(methods), (pair("a", "b", "better"),))
    comparison = Comparison("s", 1, 0.95, 6, {"dB": 1.0}, "the rule", (found,))
    verdict = judge(UP, found, comparison, ("a-x", "a-y"))
    assert (verdict.kind, verdict.leader, verdict.value) == ("clear", "a", "9.00")
    assert verdict.lead == "1.00 dB (0.50 to 2.00) ahead of b"
    level = MetricComparison(  # a variant that is level with both gives both one rank
        "dark", UP.id, (methods[0], methods[1], stands("b", 8.0)), (pair("a", "b", "better"),)
    )
    assert judge(UP, level, comparison, ("a-x",)).kind == "clear"
    part = MetricComparison("dark", UP.id, (stands("a", 9.0), stands("a-x", 9.0, None, scenes=7)), ())
    assert judge(UP, part, comparison, ("a-x",)).words == "no rival"
    assert judge_without_intervals(UP, methods, ("a-x", "a-y")).leader == "a"
    assert judge_without_intervals(UP, methods).leader == "a-x"


def test_too_few_scenes_say_how_many_are_needed() -> None:
    methods = [stands("a", 9.0, scenes=2, expected=2), stands("b", 8.0, scenes=2, expected=2)]
    few = pair("a", "b", "too few scenes", interval=None, p_mean=None, p_mean_corrected=None)
    found = compared(UP, methods, few)
    assert (found.kind, found.words) == ("too few", "too few scenes to tell: 6 needed")
    assert (found.lead, found.evidence) == ("1.00 dB ahead of b", "2 scenes")


def test_a_lead_that_is_no_tie_but_needs_more_scenes_is_said_so() -> None:
    found = compared(UP, [stands("a", 21.0), stands("b", 20.0)], pair("a", "b", "too few scenes"))
    assert (found.kind, found.words) == ("too few", "too few scenes to tell: among so many pairs")


def test_a_third_that_is_not_told_from_the_leader_is_named() -> None:
    methods = [stands("a", 21.0), stands("b", 20.0), stands("c", 19.0)]
    pairs = pair("a", "b", "better"), pair("a", "c", "too few scenes"), pair("b", "c", "tie")
    found = compared(UP, methods, *pairs)
    assert (found.kind, found.words, found.tied) == ("too few", "too few scenes to tell from c", ())


def test_who_misses_a_scene_or_was_handed_truth_cannot_lead() -> None:
    methods = [
        stands("quitter", 50.0, None, scenes=7),
        stands("oracle", 60.0, None, competes=False),
        stands("a", 9.0),
    ]
    alone = compared(UP, methods)
    assert (alone.kind, alone.leader, alone.words) == ("alone", "a", "no rival with every scene")
    assert compared(UP, methods[:1]).words == "no method has every scene"
    assert compared(UP, methods[1:2]).words == "no method provides it"
    assert compared(UP, methods[2:]).words == "no rival"


def test_without_a_comparison_the_best_is_named_and_nothing_claimed() -> None:
    found = judge_without_intervals(UP, [stands("a", 9.0), stands("b", 9.0), stands("c", 1.0)])
    assert (found.kind, found.leader, found.lead) == ("open", "a", "level with b")
    assert judge_without_intervals(UP, [stands("a", 9.0)]).kind == "alone"
    assert judge_without_intervals(UP, []).kind == "nobody"


@pytest.mark.parametrize(("p", "text"), [(1e-5, "p < 0.001"), (0.0078, "p = 0.008"), (0.5, "p = 0.50")])
def test_p_values(p: float, text: str) -> None:
    assert format_p(p) == text


def test_axis_holds_means_intervals_and_ceilings_but_nothing_infinite() -> None:
    methods = [
        stands("a", 20.0, interval=(18.0, 23.0)), stands("b", 25.0, ceiling=45.0), stands("c", math.inf),
    ]  # fmt: skip
    axis = axis_of_standings(methods, "dB")
    assert axis is not None
    assert axis.ends == ("18.00", "45.00")
    assert (axis.place(18.0), axis.place(45.0)) == (100 * PAD, 100 * (1 - PAD))
    assert axis.place(31.5) == pytest.approx(50)
    assert axis.place(1e9) == axis.place(math.inf) == axis.place(45.0)
    first, second, third = (interval_plot(m, axis) for m in methods)
    assert first is not None
    assert first.interval == (axis.place(18.0), axis.place(23.0))
    assert "95 % interval 18.00 to 23.00" in first.text
    assert second is not None
    assert (second.ceiling, second.interval) == (axis.place(45.0), None)
    assert "no interval from 8 scenes" in second.text
    assert third is not None
    assert third.beyond == "high"
    assert interval_plot(stands("d", None), axis) is None
    assert axis_of([math.inf], "dB") is None
    assert axis_of_standings([stands("a", 0.0)], "dB") is None
    assert interval_plot(stands("d", 1.0), None) is None
    flat = axis_of([3.0], "dB")
    assert flat is not None
    assert flat.place(3.0) == pytest.approx(50)
    assert "seeds 0.10" in (interval_plot(stands("e", 20.0, seed_sd=0.1), axis) or first).text


def test_variants_do_not_set_the_axis_and_may_lie_beyond() -> None:
    methods = (stands("own", 5.0), stands("rival", 8.0), stands("own-far", -40.0, interval=(-60.0, 6.0)))
    heads = (
        MethodRecord("own", "", (), "own"), MethodRecord("rival", "", (), "rival"),
        MethodRecord("own-far", "", (), "own"),
    )  # fmt: skip
    results = tuple(JobResult(Job("dark", "a", m.method, 0, {}), "h", "f", "failed", "boom") for m in methods)
    record = RunRecord("s", 1, (), heads, (UP,), results, {}, "", 0)
    found = MetricComparison("dark", UP.id, methods, (pair("own", "rival", "tie"),))
    track = compare_track(Comparison("s", 1, 0.95, 6, {"dB": 1.0}, "r", (found,)), record, "dark", [UP])
    axis = track.axes[UP.id]
    assert axis is not None
    assert axis.ends == ("5.00", "8.00")
    near, far = (interval_plot(methods[i], axis) for i in (0, 2))
    assert near is not None
    assert far is not None
    assert (near.beyond, far.beyond) == ("", "low")
    assert far.interval == (axis.place(5.0), axis.place(6.0))
    assert "-40.00" in far.text.replace("\u2212", "-")


def test_cells_say_who_is_tied_with_whom() -> None:
    methods = (stands("a", 9.0), stands("b", 8.0), stands("c", 1.0, 2))
    found = MetricComparison("dark", UP.id, methods, (pair("a", "b", "tie"),))
    comparison = Comparison("s", 1, 0.95, 6, {"dB": 1.0}, "the rule", (found,))
    record = RunRecord("s", 1, (), (), (UP,), (), {}, "", 0)
    track = compare_track(comparison, record, "dark", [UP])
    cells = [track.dress(Cell("scored", "x", 1.0, ("below",)), UP.id, m.method) for m in methods]
    assert [c.notes for c in cells] == [
        (f"tied with b, {EVIDENCE}", "below"), ("tied with a", "below"), ("below",),
    ]  # fmt: skip
    assert all(c.plot for c in cells)
    failed = Cell("failed", "failed")
    assert track.dress(failed, UP.id, "a") is failed
    assert track.dress(cells[0], UP.id, "stranger") is cells[0]


def test_summary_has_a_row_for_each_part_by_its_headline_metric() -> None:
    verdict = LeaderVerdict("alone", "no rival", "a", "1")
    found = {("dark", "a.side"): verdict, ("dark", "a.up"): verdict, ("table", "n.down"): verdict}
    rows, _ = summary_rows([SIDE, UP, DOWN], found, [("dark", "t1"), ("table", "t2")])
    assert [(r.part, r.metric.id) for r in rows] == [("Albedo", "a.up"), ("Geometry (normals)", "n.down")]
    assert [[bool(c.verdict) for c in r.cells] for r in rows] == [[True, False], [False, True]]
    assert part_of("some_new_part") == "Some new part"
    (only,), _ = summary_rows([SIDE], found, [("dark", "t1")])
    assert only.metric.id == "a.side"
    depth = replace(SIDE, id="d", group="depth")
    assert len(summary_rows([UP, depth], {**found, ("dark", "d"): verdict}, [("dark", "t1")])[0]) == 1


def test_summary_has_rows_of_what_a_track_asks_and_none_that_nobody_provides() -> None:
    mirror = replace(SIDE, id="counterfactual.residual.mirror.specular", group="counterfactual")
    removal = replace(UP, id="counterfactual.psnr", group="counterfactual")
    lead, nobody = (
        LeaderVerdict("alone", "no rival", "a", "1"),
        LeaderVerdict("nobody", "no method provides it"),
    )
    found = {("tabletop", m.id): lead for m in (UP, removal, mirror)} | {("tabletop", DOWN.id): nobody}
    tracks = [("tabletop", "t1"), ("dark", "t2")]
    left_out = {("tabletop", DOWN.id)}
    rows, silent = summary_rows([removal, UP, DOWN, mirror], found, tracks, left_out)
    assert [r.part for r in rows] == ["Removal", "Removal of the reflection", "Albedo"]
    assert silent == "Down"
    elsewhere, silent = summary_rows([DOWN], {**found, ("dark", DOWN.id): lead}, tracks, left_out)
    assert [[c.verdict for c in r.cells] for r in elsewhere] == [[nobody, lead]]
    assert silent == ""


def test_help_says_what_is_ignored_and_what_counts_as_no_change() -> None:
    head = metric_head(UP)
    assert (head.ignores, head.tolerance) == ("one factor on the prediction and the sign", "0.10 dB")
    assert (metric_head(DOWN).ignores, metric_head(DOWN).tolerance) == ("", "")
    assert (
        explain_rules(["interior", "interior", "unheard_of"]) == "interior: pixels of one surface and colour"
    )


def comparison_of(record: RunRecord) -> Comparison:
    """Retinex is best on the dark track, the others' lights are all alike."""
    methods = (
        stands("retinex", 26.0, interval=(25.0, 27.0), ceiling=48.5), stands("gray", 18.4, 2),
        stands("truth", math.inf, None, competes=False),
    )  # fmt: skip
    albedo = MetricComparison("dark", "albedo.psnr.channel", methods, (pair("retinex", "gray", "better"),))
    few = pair("retinex", "gray", "too few scenes", scenes=5)
    five = tuple(replace(method, scenes=5, expected=5) for method in methods[:2])
    light = MetricComparison("dark", "light.position", five, (few,))
    leak = AboveCeiling("dark", "tiny-0000", "retinex", 0, "novel_view.psnr", 60.0, 48.5, 11.5, "dB", ())
    handed = replace(leak, method="truth", handed=("radiance",))
    return Comparison(
        record.suite, 3, 0.95, 6, {"dB": 1.0}, "A rule <in words>.", (albedo, light), (leak, handed)
    )


def test_first_screen_of_a_report(make_run: Callable[..., tuple[Path, RunRecord]]) -> None:
    run, record = make_run()
    before = opened(write_report(run).read_text(encoding="utf-8"))
    assert "significance not computed" in before
    assert "the run has no comparison.json" in before
    write_json(run / COMPARISON, comparison_of(record))
    html = opened(write_report(run).read_text(encoding="utf-8"))
    first = html[html.index('<section class="summary"') : html.index('<section class="track"')]
    for part in (
        '<a href="#track-1">retinex</a>', "clear lead", "26.00 dB", "7.60 dB (0.50 to 2.00) ahead of gray",
        EVIDENCE.replace("'", "&#39;"), "too few scenes to tell: 6 needed", "A rule &lt;in words&gt;.",
        "truth has leaked",
        "1 score of references that were handed truth",
    ):  # fmt: skip
        assert part in first, part
    assert 'aria-label="mean 26.00, 95 % interval 25.00 to 27.00, ceiling 48.50"' in html
    (run / COMPARISON).write_text("{")
    assert "No intervals and no tests of significance: expected" in opened(
        write_report(run).read_text(encoding="utf-8")
    )

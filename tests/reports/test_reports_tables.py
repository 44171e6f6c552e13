# SPDX-License-Identifier: Apache-2.0
import math
from dataclasses import replace
from typing import Any

import pytest

import graycard.eval as ge
from graycard import TRACKS, PointLight
from graycard.eval.kinds._lights import MatchedLights, _value
from graycard.eval.lights._errors import LightMatch
from graycard.eval.metrics._lights import METRICS, _position
from graycard.records import (
    HOLDS_NOISE,
    Job,
    JobResult,
    MethodRecord,
    MetricRecord,
    RunRecord,
    Score,
    ScoreSheet,
)
from graycard.reports._tracks import headline_of, words_of
from graycard.reports.opening._strips import _labels
from graycard.reports.tables._cells import Reading, pool, read_metric
from graycard.reports.tables._compared import compare_track
from graycard.reports.tables._tables import (
    Leaderboard,
    leaderboard,
    metric_rows,
    metrics_of,
    told_rows,
    view_rows,
)
from graycard.reports.tables._troubles import failures, warnings
from graycard.reports.tables._unpaired import EXTRA, MISSING, POSITION, PRICES

UP = MetricRecord("a.up", "Up", "a", "dB", True, math.inf, "f", True, 0.1)
DOWN = MetricRecord("b.down", "Down", "b", "°", False, 0.0, "g", True, 0.1)
SIDE = MetricRecord("b.side", "Side", "b", "1", False, 0.0, "h", False, 0.1)


LAMP = PointLight("lamp", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
NONE = MatchedLights((), (), (), 5.0, "", LightMatch((), (), 0, 0))


def make_score(metric: MetricRecord, value: float | str, **more: Any) -> Score:
    scored = not isinstance(value, str)
    status: Any = "scored" if scored else value
    given = value if scored else None
    return Score(
        metric.id, "p-0", status, given, metric.unit, metric.higher_is_better, metric.optimum, **more
    )


def make_result(method: str, scene: str, *scores: Score, seed: int = 0, failed: str = "") -> JobResult:
    job = Job("dark", scene, method, seed, {})
    if failed:
        return JobResult(job, "h", "f", "failed", failed)
    return JobResult(job, "h", "f", "done", sheet=ScoreSheet("dark", scene, method, "", "", scores))


def make_board(
    results: list[JobResult],
    sees: dict[str, tuple[str, ...]] | None = None,
    entries: dict[str, str] | None = None,
) -> Leaderboard:
    names = dict.fromkeys(r.job.method for r in results)
    methods = tuple(MethodRecord(n, "", (sees or {}).get(n, ()), (entries or {}).get(n, "")) for n in names)
    record = RunRecord("s", 1, (), methods, (UP, DOWN, SIDE), tuple(results), {}, "", 0)
    metrics = metrics_of(record, results)
    compared = compare_track(None, record, "dark", metrics)
    return leaderboard(record, results, headline_of("dark", metrics), compared)


def test_mean_is_over_scenes_not_over_jobs() -> None:
    readings = [Reading("one", "scored", 0.0), Reading("one", "scored", 0.0), Reading("two", "scored", 6.0)]
    assert pool(readings, "dB").value == 3.0
    assert pool(readings, "dB").complete


def test_failure_is_counted_and_never_a_number() -> None:
    readings = [Reading("a", "scored", 4.0), Reading("b", "scored", 8.0), Reading("c", "failed", reason="x")]
    cell = pool(readings, "dB")
    assert (cell.value, cell.notes, cell.complete) == (6.0, ("2 of 3 scored",), False)
    broken = pool(readings[2:], "dB")
    assert (broken.status, broken.text, broken.value, broken.reason) == ("failed", "failed", None, "x")


def test_nothing_is_a_dash_and_says_why() -> None:
    assert pool([Reading("a", "not provided")], "dB").status == "not provided"
    assert pool([], "dB").status == "not run"
    mixed = pool([Reading("a", "failed"), Reading("b", "not provided")], "dB")
    assert (mixed.status, mixed.notes) == ("failed", ("1 of 2",))


def test_infinite_mean_and_noise_ceiling() -> None:
    cell = pool([Reading("a", "scored", math.inf, 40.0), Reading("b", "scored", 30.0, 50.0)], "dB")
    assert (cell.text, cell.notes) == ("∞", ("ceiling 45.00",))
    half = pool([Reading("a", "scored", 1.0, 40.0), Reading("b", "scored", 3.0)], "dB")
    assert half.notes == ()


def test_gauge_and_interval_stand_in_detail_only() -> None:
    reading = Reading("a", "scored", 1.0, gauge=(2.0, 1.0, 0.5), interval=(0.5, 1.5))
    assert pool([reading], "1").notes == ()
    assert pool([reading], "1", detailed=True).notes == ("95 %: 0.500 to 1.500", "gauge 2 1 0.5")
    assert pool([reading, reading], "1", detailed=True).notes == ()


@pytest.mark.parametrize("value", [None, math.nan])
def test_scored_without_a_number_is_a_failure(value: float | None) -> None:
    score = replace(make_score(UP, 1.0), value=value)
    reading = read_metric(make_result("m", "a", score), UP.id)
    assert reading.status == "failed"
    assert "expected a value of a.up" in reading.reason


def test_order_follows_the_direction_of_each_metric() -> None:
    board = make_board(
        [
            make_result("worst", "a", make_score(UP, 1), make_score(DOWN, 9)),
            make_result("best", "a", make_score(UP, 3), make_score(DOWN, 1)),
            make_result("middle", "a", make_score(UP, 2), make_score(DOWN, 5)),
        ]
    )
    assert [(s.place, s.method.name) for s in board.competing] == [(1, "best"), (2, "middle"), (3, "worst")]
    assert [m.arrow for m in board.metrics] == ["↑", "↓"]
    assert [[c.best for c in s.cells] for s in board.competing] == [[True] * 2, [False] * 2, [False] * 2]


def test_reference_is_neither_ranked_nor_best() -> None:
    board = make_board(
        [
            make_result("oracle", "a", make_score(UP, math.inf), make_score(DOWN, 0)),
            make_result("honest", "a", make_score(UP, 3), make_score(DOWN, 1)),
        ],
        sees={"oracle": ("normal",)},
    )
    assert [(s.place, s.method.name) for s in board.competing] == [(1, "honest")]
    assert all(c.best for c in board.competing[0].cells)
    assert board.references[0].place is None
    assert not any(c.best for c in board.references[0].cells)


def test_failing_the_hard_scene_does_not_pay() -> None:
    easy_only = [make_result("quitter", "a", make_score(UP, 40)), make_result("quitter", "b", failed="boom")]
    both = [make_result("steady", s, make_score(UP, v)) for s, v in (("a", 40), ("b", 20))]
    board = make_board(easy_only + both)
    assert [s.method.name for s in board.competing] == ["steady", "quitter"]
    quitter = board.competing[1].cells[0]
    assert (quitter.text, quitter.notes, quitter.best) == ("40.00", ("1 of 2 scored",), False)
    assert quitter.lacks == ("1 of 2 scored",)
    assert board.competing[0].cells[0].lacks == ()


def test_equal_values_share_their_place() -> None:
    board = make_board([make_result(n, "a", make_score(UP, 5)) for n in ("x", "y")])
    assert [(s.place, s.cells[0].best) for s in board.competing] == [(1, True), (1, True)]


def test_column_of_one_method_alone_does_not_count_for_the_places() -> None:
    """Without a rival a first place is no merit, and a last one no fault."""
    board = make_board(
        [
            make_result("flat", "a", make_score(UP, 1), make_score(DOWN, 9)),
            make_result("good", "a", make_score(UP, 9), make_score(DOWN, "not provided")),
            make_result("fair", "a", make_score(UP, 5), make_score(DOWN, "not provided")),
        ]
    )
    assert [m.counts for m in board.metrics] == [True, False]
    assert [(s.place, s.method.name) for s in board.competing] == [(1, "good"), (2, "fair"), (3, "flat")]


def test_to_fail_is_no_way_out_of_a_column() -> None:
    board = make_board(
        [
            make_result("x", "a", make_score(UP, 5), make_score(DOWN, "failed", reason="r")),
            make_result("y", "a", make_score(UP, 5), make_score(DOWN, 1)),
        ]
    )
    assert [m.counts for m in board.metrics] == [True, True]
    assert [(s.place, s.method.name) for s in board.competing] == [(1, "y"), (2, "x")]


def test_column_that_no_competing_method_provides_is_left_out() -> None:
    results = [
        make_result("oracle", "a", make_score(UP, 9), make_score(DOWN, 0)),
        make_result("x", "a", make_score(UP, 5), make_score(DOWN, "not provided")),
    ]
    board = make_board(results, sees={"oracle": ("normal",)})
    assert [m.id for m in board.metrics] == ["a.up"]
    assert [m.id for m in board.left_out] == ["b.down"]
    assert [[cell.status for cell in row.quiet] for row in board.competing] == [["not provided"]]
    assert [len(s.cells) for s in board.competing + board.references] == [1, 1]
    broken = make_board([*results, make_result("y", "a", failed="boom")], sees={"oracle": ("normal",)})
    assert [m.id for m in broken.left_out] == ["b.down"]
    alone = make_board(results[:1], sees={"oracle": ("normal",)})
    assert ([m.id for m in alone.metrics], alone.left_out) == (["a.up", "b.down"], ())


def test_tabletop_is_asked_whether_reflection_and_shadow_are_gone() -> None:
    ids = ("counterfactual.residual.mirror.specular", "counterfactual.residual.shadow.diffuse")
    metrics = [UP, SIDE, *(replace(SIDE, id=i) for i in ids)]
    assert [m.id for m in headline_of("tabletop", metrics)] == ["a.up", *ids]
    assert [m.id for m in headline_of("dark", metrics)] == ["a.up"]
    table = {m.id for m in ge.all_metrics()}
    assert {i for track in TRACKS for i in words_of(track).headline} <= table


def test_best_needs_a_value() -> None:
    board = make_board([make_result("x", "a", make_score(UP, "failed", reason="r"))])
    assert not board.competing[0].cells[0].best


def test_columns_are_the_metrics_that_the_track_has() -> None:
    with_one = make_board([make_result("x", "a", make_score(DOWN, 5))])
    assert [m.id for m in with_one.metrics] == ["b.down"]
    with_none = make_board([make_result("x", "a", failed="boom")])
    assert [m.id for m in with_none.metrics] == ["a.up", "b.down"]


def test_full_table_has_every_metric_and_single_views() -> None:
    results = [
        make_result("x", "a", make_score(SIDE, 0.25, per_view={"v1": 0.2, "v0": 0.3}), seed=0),
        make_result("x", "a", make_score(SIDE, 0.75, per_view={"v1": 0.6}), seed=1),
        make_result("y", "a", make_score(SIDE, 0.9)),
    ]
    heads = make_board(results).methods
    (row,) = metric_rows(results, heads, [SIDE])
    assert [(c.text, c.best) for c in row.cells] == [("0.500", True), ("0.900", False)]
    rows = view_rows(results, heads, [SIDE])
    assert [(r.view, [c.text for c in r.cells]) for r in rows] == [
        ("v0", ["0.300", "–"]), ("v1", ["0.400", "–"]),
    ]  # fmt: skip


def test_failures_with_one_reason_stand_in_one_line() -> None:
    scores = (
        make_score(UP, "failed", reason="no file"), make_score(DOWN, "failed", reason="no file"),
        make_score(SIDE, "failed", reason=""),
    )  # fmt: skip
    results = [make_result("x", "a", *scores), make_result("y", "b", failed="boom", seed=3)]
    found = failures(results, (UP, DOWN, SIDE))
    assert [(f.method, f.where, f.what, f.reason) for f in found] == [
        ("x", "a, seed 0", "Up, Down", "no file"),
        ("x", "a, seed 0", "Side", "no reason given"),
        ("y", "b, seed 3", "the whole job", "boom"),
    ]


def test_job_without_scores_is_a_failure() -> None:
    silent = replace(make_result("x", "a"), sheet=None)
    (found,) = failures([silent], (UP,))
    assert found.reason.startswith("expected scores of this job")
    assert read_metric(silent, UP.id).status == "failed"


def test_warnings_are_told_once() -> None:
    warned = make_score(UP, 1.0, warnings=("careful", "careful"))
    assert [w.reason for w in warnings([make_result("x", "a", warned)])] == ["careful"]
    both = make_result("x", "a", warned, make_score(DOWN, 1.0, warnings=("careful", "late")))
    assert [(w.what, w.reason) for w in warnings([both])] == [("a.up, b.down", "careful"), ("b.down", "late")]


def test_what_concerns_the_whole_folder_is_told() -> None:
    result = make_result("x", "a", make_score(UP, 1.0, warnings=("careful",)))
    assert result.sheet is not None
    odd = replace(result, sheet=replace(result.sheet, warnings=("left out: z.Y",)))
    told = [(w.what, w.reason) for w in warnings([odd])]
    assert told == [("the whole folder", "left out: z.Y"), ("a.up", "careful")]


def test_that_what_is_handed_truth_is_too_good_is_no_news() -> None:
    too_good = make_score(UP, 1.0, warnings=(f"1 dB is above: {HOLDS_NOISE}", "careful"))
    results = [make_result(name, "a", too_good) for name in ("oracle", "rival")]
    told = [(w.method, w.reason.startswith("1 dB")) for w in warnings(results, {"oracle"})]
    assert told == [("oracle", False), ("rival", True), ("rival", False)]


def test_scene_without_this_metric_is_no_failure() -> None:
    reading = read_metric(make_result("x", "a", make_score(UP, 1.0)), DOWN.id)
    assert (reading.status, reading.reason) == ("not provided", "this scene has no such score")


def test_single_views_of_a_failed_job_are_failed_not_missing() -> None:
    results = [
        make_result("x", "a", make_score(UP, 1.0, per_view={"v": 1.0})), make_result("y", "a", failed="boom"),
        make_result("z", "a", make_score(UP, "not provided")),
    ]  # fmt: skip
    (row,) = view_rows(results, make_board(results).methods, [UP])
    assert sorted((c.status, c.text) for c in row.cells) == [
        ("failed", "failed"), ("not provided", "–"), ("scored", "1.00"),
    ]  # fmt: skip


def test_help_of_a_column_names_its_worst_and_best_value() -> None:
    board = make_board([make_result(n, "a", make_score(UP, v), make_score(DOWN, v)) for n, v in
                        (("x", 5), ("y", 9), ("z", 7))])  # fmt: skip
    assert [m.here for m in board.metrics] == ["from 5.00 (x) to 9.00 (y)", "from 9.00 (y) to 5.00 (x)"]
    assert make_board([make_result("x", "a", make_score(UP, 5))]).metrics[0].here == ""


def test_method_that_was_not_run_on_every_scene_is_not_compared() -> None:
    results = [make_result("everywhere", s, make_score(UP, 5)) for s in ("a", "b")]
    board = make_board([*results, make_result("once", "a", make_score(UP, 50))])
    assert [(s.method.name, s.cells[0].best) for s in board.competing] == [
        ("everywhere", True), ("once", False),
    ]  # fmt: skip
    assert "run on 1 of 2 scenes" in board.competing[1].cells[0].notes
    assert "run on 1 of 2 scenes" in board.competing[1].cells[0].lacks


def test_scene_without_the_metric_does_not_count() -> None:
    results = [make_result("x", "a", make_score(UP, 5)), make_result("x", "b", make_score(DOWN, 5))]
    assert [c.complete for c in make_board(results).competing[0].cells] == [True, True]


def test_metrics_of_one_group_stand_together() -> None:
    late = replace(UP, id="a.late")
    result = make_result("x", "a", *(make_score(m, 1.0) for m in (UP, DOWN, late)))
    record = RunRecord("s", 1, (), (), (UP, DOWN, late), (result,), {}, "", 0)
    assert [m.id for m in metrics_of(record, [result])] == ["a.up", "a.late", "b.down"]


def test_metric_that_nobody_provides_is_named_and_has_no_row() -> None:
    none = make_score(DOWN, "not provided")
    results = [
        make_result("x", "a", make_score(UP, 5), none, make_score(SIDE, "failed", reason="r")),
        make_result("y", "a", make_score(UP, "not provided"), none),
    ]
    methods = make_board(results).methods
    rows, quiet = told_rows(metric_rows(results, methods, (UP, DOWN, SIDE)), methods)
    assert [row.metric.id for row in rows] == ["a.up", "b.side"]
    assert [row.metric.title for row in quiet] == ["Down"]


def test_what_references_alone_provide_says_nothing_beside_methods() -> None:
    results = [
        make_result("oracle", "a", make_score(UP, 9), make_score(DOWN, 0)),
        make_result("x", "a", make_score(UP, 5), make_score(DOWN, "not provided")),
    ]
    for own, expected in ((results, ["b.down"]), (results[:1], [])):
        methods = make_board(own, sees={"oracle": ("normal",)}).methods
        _, quiet = told_rows(metric_rows(own, methods, (UP, DOWN)), methods)
        assert [row.metric.id for row in quiet] == expected


FAMILY = {"own": "own", "own-long": "own", "other": "other"}
"""A method, the same with other settings, and a rival."""


def family_results() -> list[JobResult]:
    """The variant is better than all."""
    values = {"own": 3.0, "own-long": 5.0, "other": 2.0}
    return [make_result(name, "a", make_score(UP, value)) for name, value in values.items()]


def test_a_variant_has_no_place_and_is_never_marked_as_best() -> None:
    board = make_board(family_results(), entries=FAMILY)
    assert [(s.method.name, s.place, s.cells[0].best) for s in board.families] == [
        ("own", 1, True), ("own-long", None, False), ("other", 2, False),
    ]  # fmt: skip
    (row,) = metric_rows(family_results(), board.methods, [UP])
    assert [cell.best for cell in row.cells] == [True, False, False]


def test_places_are_those_of_the_rows_that_are_shown_first() -> None:
    """Two variants between two methods in one column must not outweigh another column."""
    up = {"own": 3.0, "own-a": 2.9, "own-b": 2.8, "other": 2.0, "third": 1.0}
    down = {"own": 5.0, "own-a": 9.0, "own-b": 9.0, "other": 4.0, "third": 6.0}
    results = [make_result(n, "a", make_score(UP, up[n]), make_score(DOWN, down[n])) for n in up]
    entries = {name: name.partition("-")[0] for name in up}
    board = make_board(results, entries=entries)
    assert [(s.method.name, s.place) for s in board.families] == [
        ("own", 1), ("own-a", None), ("own-b", None), ("other", 1), ("third", 3),
    ]  # fmt: skip


def test_a_column_of_one_method_and_its_variants_does_not_count() -> None:
    values = {"own": 3.0, "own-long": 5.0, "other": "not provided"}
    results = [make_result(n, "a", make_score(UP, v), make_score(DOWN, 1)) for n, v in values.items()]
    assert [m.counts for m in make_board(results, entries=FAMILY).metrics] == [False, True]


def test_a_variant_of_a_row_that_does_not_compete_has_a_line() -> None:
    board = make_board(family_results(), {"own": ("normal",)}, FAMILY)
    assert [head.name for head in board.methods] == ["own-long", "other", "own"]


@pytest.mark.parametrize(
    ("true", "predicted", "said"),
    [
        (2, 1, "50.00 by 1 missing light"),
        (3, 1, "66.67 by 2 missing lights"),
        (1, 4, "75.00 by 3 extra lights"),
        (2, 2, ""),
    ],
)
def test_a_score_of_lights_says_what_those_without_a_partner_make(true: int, predicted: int, said: str):
    """All others are exactly in place, so they make the whole of it."""
    pairs = min(true, predicted)
    match = LightMatch(((0, 0),) * pairs, (0.0,) * pairs, true - pairs, predicted - pairs)
    value = _position(MatchedLights((), (), (), 5.0, "", match))
    scores = [
        make_score(replace(DOWN, id=f"light.{name}"), number, expected=true)
        for name, number in (("position", value), ("missing", match.missing), ("extra", match.extra))
    ]
    cell = pool([read_metric(make_result("m", "a", *scores), "light.position")], "%")
    assert cell.unpaired == said
    assert (said in cell.notes) == bool(said)
    assert said.startswith(cell.text) or value == 0
    counted = pool([read_metric(make_result("m", "a", *scores), "light.missing")], "count")
    assert counted.unpaired == ""
    assert ("100 % of the diameter" in cell.price) == bool(said)


LIGHTS = {metric.record.id: metric for metric in METRICS}


@pytest.mark.parametrize("metric", sorted(PRICES))
@pytest.mark.parametrize(("true", "predicted"), [(2, 1), (4, 1), (1, 4), (3, 3), (8, 11)])
def test_scores_over_true_lights_tell_missing_ones_alone(metric: str, true: int, predicted: int):
    """All others have no error, so the missing ones make the whole of the score, and extra ones nothing."""
    rule, record = LIGHTS[metric].rule, LIGHTS[metric].record
    pairs = min(true, predicted)
    assert rule.error is not None
    value = _value(replace(rule, error=lambda p, t, matched: 0.0), [(LAMP, LAMP)] * pairs, true - pairs, NONE)
    scores = [
        make_score(replace(record, id=name), number, expected=true, scored=pairs)
        for name, number in (
            (metric, value),
            ("light.missing", true - pairs),
            ("light.extra", predicted - pairs),
        )
    ]
    cell = pool([read_metric(make_result("m", "a", *scores), metric)], record.unit)
    missing = true - pairs
    assert cell.unpaired == (
        f"{cell.text} by {missing} missing light{'s' if missing > 1 else ''}" if missing else ""
    )
    assert bool(cell.price) == bool(missing)
    if missing:
        assert f"counts {rule.price:g} {record.unit} in the mean over true lights" in cell.price
        assert "Extra lights do not enter" in cell.price


def test_every_score_of_lights_is_known_by_whose_mean_it_is():
    """A new metric of lights has to say here how lights without a partner enter it."""
    over_true = {name: metric.rule.price for name, metric in LIGHTS.items() if metric.rule.error}
    assert over_true == PRICES
    assert {name for name, metric in LIGHTS.items() if metric.rule.together} == {POSITION, MISSING, EXTRA}


def test_a_score_counts_missing_lights_that_it_judges():
    """Three of 8 lights are missing, and one of the 4 with an axis."""
    scores = [
        make_score(replace(DOWN, id=name), value, expected=expected, scored=scored)
        for name, value, expected, scored in (
            ("light.direction", 60.0, 4, 3), ("light.chromaticity", 40.0, 8, 5),
            ("light.missing", 3.0, 8, 5), ("light.extra", 0.0, 8, 5),
        )
    ]  # fmt: skip
    told = {
        name: pool([read_metric(make_result("m", "a", *scores), name)], "°")
        for name in ("light.direction", "light.chromaticity")
    }
    assert told["light.direction"].unpaired == "45.00 by 1 missing light"
    assert "that have an axis" in told["light.direction"].price
    assert told["light.chromaticity"].unpaired == "33.75 by 3 missing lights"


def test_lights_without_a_partner_are_means_over_scenes() -> None:
    numbers = {"a": (50.0, 1.0, 0.0), "b": (80.0, 0.0, 2.0)}
    readings = []
    for scene, found in numbers.items():
        names = ("light.position", "light.missing", "light.extra")
        scores = [make_score(replace(DOWN, id=n), v, expected=2) for n, v in zip(names, found, strict=True)]
        readings.append(read_metric(make_result("m", scene, *scores), "light.position"))
    cell = pool(readings, "%")
    assert (cell.text, cell.unpaired) == ("65.00", "50.00 by 0.5 missing, 1 extra lights")


def test_a_mean_of_both_infinities_is_not_the_best() -> None:
    results = [
        make_result("wild", "a", make_score(UP, math.inf)),
        make_result("wild", "b", make_score(UP, -math.inf)),
        *(make_result("tame", scene, make_score(UP, 1)) for scene in "ab"),
    ]
    board = make_board(results)
    assert [(s.method.name, s.cells[0].best) for s in board.competing] == [("tame", True), ("wild", False)]


def test_pictures_are_called_best_and_next_only_if_they_are() -> None:
    order = ("a", "b", "c")
    assert _labels(order, "a", "b") == {"a": "best", "b": "next"}
    assert _labels(order, "a", "c") == {"a": "best", "c": "next with pictures"}
    assert _labels(order, "b", "c") == {"b": "best with pictures", "c": "next with pictures"}
    assert _labels(order, "c", "") == {"c": "best with pictures"}


def test_the_head_says_how_many_scenes_have_such_a_score() -> None:
    results = [
        make_result("x", "a", make_score(UP, 5), make_score(DOWN, 5)),
        make_result("x", "b", make_score(DOWN, 5)),
    ]
    heads = {head.id: head.scenes for head in make_board(results).metrics}
    assert heads == {UP.id: "1 of 2 scenes", DOWN.id: ""}

# SPDX-License-Identifier: Apache-2.0
"""Comparison of methods by their score sheets, on runs made by hand."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from graycard.eval.statistics import RULE, Question, compare_run
from graycard.io import write_json
from graycard.records import (
    COMPARISON,
    AboveCeiling,
    Job,
    JobResult,
    MethodRecord,
    MetricRecord,
    RunRecord,
    Score,
    ScoreSheet,
    read_comparison,
)

UP = MetricRecord("psnr", "PSNR", "novel view", "dB", True, math.inf, "", True, 0.3)
DOWN = MetricRecord("angle", "Angle", "normal", "°", False, 0.0, "", True, 0.5)
Values = Mapping[str, Sequence[Sequence[float | None]]]
"""By method: for each scene the values of its seeds; None is a failed score."""


def make_run(
    values: Values, metric: MetricRecord = UP, handed: Sequence[str] = (), ceiling: float | None = 60.0
) -> RunRecord:
    results = [
        result_of(method, scene, seed, value, metric, ceiling)
        for method, scenes in values.items()
        for scene, found in enumerate(scenes)
        for seed, value in enumerate(found)
    ]
    methods = tuple(MethodRecord(m, "", ("radiance",) if m in handed else ()) for m in values)
    return RunRecord("demo", 1, (), methods, (UP, DOWN), tuple(results), {}, "", 0.0)


def result_of(
    method: str, scene: int, seed: int, value: float | None, metric: MetricRecord, ceiling: float | None
) -> JobResult:
    job = Job("dark", f"s{scene}", method, seed, {})
    known = metric.unit, metric.higher_is_better, metric.optimum
    score = Score(
        metric.id, "graycard-1", "failed" if value is None else "scored", value, *known, noise_ceiling=ceiling
    )
    sheet = ScoreSheet("dark", f"s{scene}", method, "", "", (score,))
    return JobResult(job, "", "", "done", sheet=sheet)


def once(values: Sequence[float | None] | np.ndarray) -> list[list[float | None]]:
    return [[value] for value in values]


def scenes(count: int, seed: int = 1000, mean: float = 25.0, sd: float = 2.0) -> np.ndarray:
    return np.random.default_rng(seed).normal(mean, sd, count)


def ranks(run: RunRecord, metric: str = "psnr") -> dict[str, int | None]:
    return {m.method: m.rank for m in compare_run(run).find("dark", metric).methods}


def test_a_clear_lead_and_a_tie():
    base, noise = scenes(8), np.random.default_rng(1)
    run = make_run({
        "weak": once(base - 5 + noise.normal(0, 0.3, 8)),
        "good": once(base + noise.normal(0, 0.3, 8)),
        "same": once(base + noise.normal(0, 0.3, 8)),
    })  # fmt: skip
    found = compare_run(run).find("dark", "psnr")
    assert {m.method: m.rank for m in found.methods} == {"weak": 2, "good": 1, "same": 1}
    pairs = {(p.first, p.second): p for p in found.pairs}
    assert {key: p.verdict for key, p in pairs.items()} == {
        ("weak", "good"): "worse", ("weak", "same"): "worse", ("good", "same"): "tie",
    }  # fmt: skip
    lead = pairs["weak", "good"]
    assert lead.difference == pytest.approx(-5, abs=0.5)
    assert lead.interval is not None
    assert lead.interval[0] < -5 < lead.interval[1] < -4
    assert lead.p_rank == 2 / 2**8
    assert lead.p_rank_holm == 3 * 2 / 2**8
    assert lead.p_mean is not None
    assert lead.p_mean_corrected is not None
    assert lead.p_mean < lead.p_mean_corrected < 0.01


def test_lower_is_better_where_the_metric_says_so():
    base = scenes(8)
    run = make_run({"a": once(base + 5), "b": once(base)}, DOWN)
    assert compare_run(run).find("dark", "angle").pairs[0].verdict == "worse"
    assert ranks(run, "angle") == {"a": 2, "b": 1}


def test_five_scenes_cannot_decide_and_six_can():
    base, gain = scenes(8), 5 + np.random.default_rng(3).normal(0, 0.1, 8)
    for count, verdict, groups in ((5, "too few scenes", {"a": 1, "b": 1}), (6, "better", {"a": 1, "b": 2})):
        run = make_run({"a": once((base + gain)[:count]), "b": once(base[:count])})
        found = compare_run(run)
        assert found.find("dark", "psnr").pairs[0].verdict == verdict
        assert ranks(run) == groups
        assert found.least_scenes == 6
        assert "at least 6 scenes" in found.rule


def test_an_outlier_alone_decides_nothing():
    """One scene with a huge gain: the rank test sees eight signs, and they are mixed."""
    gain = np.array([0.1, -0.1, 0.2, -0.2, 0.1, -0.1, 0.2, 90.0])
    run = make_run({"a": once(scenes(8) + gain), "b": once(scenes(8))})
    assert compare_run(run).find("dark", "psnr").pairs[0].verdict == "tie"


def test_equal_methods_are_seldom_told_apart():
    """Five equal methods, eight scenes: in 95 of 100 such tables no pair is decided."""
    random, false = np.random.default_rng(1000), 0
    for _ in range(60):
        base = random.normal(25, 2, 8)
        run = make_run({name: once(base + random.normal(0, 0.5, 8)) for name in "abcde"})
        false += any(p.verdict != "tie" for p in compare_run(run).find("dark", "psnr").pairs)
    assert false <= 6


def test_seven_methods_are_told_apart_with_eight_scenes():
    """Steps of 3 dB with 0.5 dB of noise: what Holm's correction of the rank test alone could never show."""
    base, random = scenes(8), np.random.default_rng(1000)
    run = make_run({name: once(base + 3 * i + random.normal(0, 0.35, 8)) for i, name in enumerate("abcdefg")})
    found = compare_run(run).find("dark", "psnr")
    assert min(p.p_rank_holm for p in found.pairs if p.p_rank_holm is not None) > 0.05
    assert {m.method: m.rank for m in found.methods} == {name: 7 - i for i, name in enumerate("abcdefg")}


def test_a_row_that_is_handed_truth_is_not_ranked_and_costs_the_others_nothing():
    base, random = scenes(8), np.random.default_rng(5)
    values = {"a": once(base + 2 + random.normal(0, 0.1, 8)), "b": once(base)}
    alone = compare_run(make_run(values)).find("dark", "psnr").pairs[0]
    oracles = {"truth": once([math.inf] * 8), "oracle": once(base + 9)}
    found = compare_run(make_run({**values, **oracles}, handed=("truth", "oracle"))).find("dark", "psnr")
    assert found.pairs[0] == alone
    assert [m.rank for m in found.methods] == [1, 2, None, None]
    assert [m.competes for m in found.methods] == [True, True, False, False]
    truth = found.methods[2]
    assert (truth.mean, truth.interval, truth.scene_sd) == (math.inf, None, None)
    against = {p.second: p for p in found.pairs if p.first == "a"}["truth"]
    assert (against.difference, against.interval, against.p_mean) == (-math.inf, None, None)
    assert against.verdict == "worse"


def test_equal_infinities_are_a_tie_and_opposed_ones_have_no_mean():
    run = make_run({"a": once([math.inf] * 8), "b": once([math.inf] * 8)})
    pair = compare_run(run).find("dark", "psnr").pairs[0]
    assert (pair.difference, pair.p_rank, pair.verdict) == (0.0, None, "tie")
    mixed = [math.inf] * 4 + [20.0] * 4
    run = make_run({"a": once(mixed), "b": once(mixed[::-1])})
    pair = compare_run(run).find("dark", "psnr").pairs[0]
    assert (pair.difference, pair.verdict) == (None, "tie")


def test_a_method_that_lacks_a_scene_is_compared_on_the_others_and_not_ranked():
    base = scenes(9)
    run = make_run({"a": once([*(base[:8] + 5), None]), "b": once(base)})
    found = compare_run(run).find("dark", "psnr")
    assert [(m.scenes, m.expected, m.rank) for m in found.methods] == [(8, 9, None), (9, 9, 1)]
    assert found.pairs[0].scenes == 8
    assert found.pairs[0].difference == pytest.approx(5)


def test_a_scene_counts_only_with_a_score_from_every_seed():
    run = make_run({"a": [[20.0, 22.0], [20.0, None], [20.0, math.nan]], "b": [[1.0], [1.0], [1.0]]})
    (a, b) = compare_run(run).find("dark", "psnr").methods
    assert (a.scenes, a.expected, a.seeds, a.mean) == (1, 3, 2, 21.0)
    assert (b.scenes, b.seeds) == (3, 1)


def test_seeds_are_averaged_before_scenes_and_have_a_spread_of_their_own():
    random = np.random.default_rng(1000)
    base = random.normal(25, 3, 40)
    run = make_run({"a": [list(b + random.normal(0, 0.2, 3)) for b in base], "b": once(base)})
    a, b = compare_run(run).find("dark", "psnr").methods
    assert a.seeds == 3
    assert a.seed_sd == pytest.approx(0.2, rel=0.2)
    assert a.scene_sd == pytest.approx(3, rel=0.3)
    assert b.seed_sd is None
    assert a.interval is not None
    assert a.mean is not None
    assert a.interval[0] < a.mean < a.interval[1]


def test_ceilings_are_averaged_and_scores_above_them_named():
    run = make_run({"a": once([30.0, 41.5]), "b": once([40.9, 30.0])}, ceiling=40.0, handed=("b",))
    found = compare_run(run)
    assert found.find("dark", "psnr").methods[0].ceiling == 40.0
    (above,) = found.above_ceiling
    assert above == AboveCeiling("dark", "s1", "a", 0, "psnr", 41.5, 40.0, 1.5, "dB", ())
    assert found.margins["dB"] == 1.0
    unknown = compare_run(make_run({"a": once([30.0])}, ceiling=None))
    assert unknown.find("dark", "psnr").methods[0].ceiling is None
    handed = compare_run(make_run({"b": once([math.inf])}, ceiling=40.0, handed=("b",)))
    assert handed.above_ceiling[0].handed == ("radiance",)


def test_a_metric_without_a_score_has_no_table():
    run = make_run({"a": once([None, None])})
    assert compare_run(run).metrics == ()
    failed = JobResult(Job("dark", "s0", "a", 0, {}), "", "", "failed", "died")
    assert compare_run(RunRecord("d", 1, (), (), (UP,), (failed,), {}, "", 0)).metrics == ()


def test_a_job_that_failed_is_a_scene_that_lacks():
    run = make_run({"a": once([20.0, 21.0]), "b": once([20.0, 21.0])})
    results = [
        JobResult(r.job, "", "", "failed", "died") if (r.job.method, r.job.scene) == ("b", "s1") else r
        for r in run.results
    ]
    broken = RunRecord("demo", 1, (), run.methods, run.metrics, tuple(results), {}, "", 0.0)
    b = compare_run(broken).find("dark", "psnr").methods[1]
    assert (b.scenes, b.expected, b.rank) == (1, 2, None)


def test_it_survives_the_way_to_disk(tmp_path: Path):
    values: Values = {name: once(scenes(3, seed)) for seed, name in enumerate("ab")}
    found = compare_run(make_run({**values, "truth": once([math.inf] * 3)}, handed=("truth",)))
    write_json(tmp_path / COMPARISON, found)
    assert read_comparison(tmp_path) == found


def test_variants_of_a_method_cost_the_methods_nothing():
    """Twenty ablations are 190 pairs more: with all of them corrected together no lead would be left."""
    base, random = scenes(8), np.random.default_rng(6)
    values = {"a": once(base + 1 + random.normal(0, 0.35, 8)), "b": once(base)}
    alone = compare_run(make_run(values)).find("dark", "psnr").pairs[0]
    assert alone.verdict == "better"
    ablations = {f"a-{i}": once(base + 1 + random.normal(0, 0.35, 8)) for i in range(20)}
    run = make_run({**values, **ablations})
    methods = tuple(replace(m, entry=m.name[0]) for m in run.methods)
    found = compare_run(replace(run, methods=methods)).find("dark", "psnr")
    assert found.pairs[0] == alone
    others = [p for p in found.pairs if "-" in p.first + p.second]
    assert max(p.p_mean_corrected for p in others if p.p_mean_corrected is not None) == 1.0
    together = compare_run(run).find("dark", "psnr").pairs[0]
    assert together.verdict == "tie"


def test_the_rule_says_which_comparisons_are_corrected_together():
    run = make_run({name: once([30.0 + i + k for k in range(6)]) for i, name in enumerate("abc")})
    assert compare_run(run).rule == RULE
    assert "over all pairs of the table" in RULE
    chosen = compare_run(run, Question(against="b"))
    assert chosen.rule.startswith(f"{RULE} Verdicts against 'b', which was chosen before")
    assert "over the comparisons with that row alone" in chosen.rule
    assert [p.second for p in chosen.metrics[0].against] == ["b", "b"]

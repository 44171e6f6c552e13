# SPDX-License-Identifier: Apache-2.0
"""Needs of undecided claims: scenes by simulation of the rule, beside the formula of the t-test."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from claims_by_hand import random_check
from graycard.benchmarks.claims import Check, Quantity, claims_power, judge_claims, judge_run, load_claims
from graycard.benchmarks.claims import _power as module
from graycard.benchmarks.claims._effects import Effect
from graycard.benchmarks.claims._power import MOST, least_count
from graycard.benchmarks.claims._rules import is_decided, verdict_of
from graycard.cli import main
from graycard.eval.statistics import locate, rank_limit, signed_rank_p
from graycard.io import read_json, write_json
from graycard.records import Cost, RunRecord, find_claim
from runs_by_hand import run_of

CLAIMS = """
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
paper = 2.0
negligible = 0.25
"""
EFFECTS = (1.5, -0.6, 0.9, -0.2, 1.1, -0.9, 0.4, 0.6)


def run_with(effects: tuple[float, ...]) -> RunRecord:
    rows = {"mine": effects, "theirs": (0.0,) * len(effects)}
    rows |= {"gray": (-20.0,) * len(effects), "bound": (20.0,) * len(effects)}
    table = {row: {"psnr": [30 + value for value in values]} for row, values in rows.items()}
    return run_of(table, costs={"mine": Cost(3600.0, 1.0), "theirs": Cost(1800.0, 1.0)})


@pytest.fixture
def run(tmp_path: Path) -> Path:
    (tmp_path / "mine.toml").write_text(CLAIMS)
    write_json(tmp_path / "run" / "run.json", run_with(EFFECTS))
    return tmp_path / "run"


def power_of(run: Path) -> module.CheckPower:
    paper = load_claims(str(run.parent / "mine.toml"))
    record = run_with(EFFECTS)
    ledger = judge_claims(record, run, [str(run.parent / "mine.toml")])
    assert find_claim(ledger, "M1").verdict == "undecided"
    (found,) = claims_power(ledger, record, [paper])
    return found


def test_an_open_claim_says_what_it_needs(run: Path) -> None:
    found = power_of(run)
    assert (found.claim, found.check, found.count, found.unit) == ("M1", "psnr", 8, "dB")
    assert found.sd == pytest.approx(np.std(EFFECTS, ddof=1))
    assert found.hours == 1.5
    assert found.claimed is not None
    assert found.claimed.effect == 2.0
    assert found.claimed.scenes is not None
    assert found.claimed.scenes <= 9, "the effect of the paper would be seen at once"
    assert found.claimed.hours == max(0, found.claimed.scenes - 8) * 1.5
    assert found.none is not None
    assert found.none.scenes is not None
    assert found.seen.scenes is not None
    assert found.none.scenes > 8
    assert found.seen.hours == (found.seen.scenes - 8) * 1.5
    assert found == power_of(run), "equal runs give equal bits"


def needs_of(run: Path, record: RunRecord) -> str:
    return find_claim(judge_run(record, run, [str(run.parent / "mine.toml")]), "M1").needs


def test_the_ledger_says_what_would_decide_a_claim(run: Path) -> None:
    scenes = power_of(run).seen.scenes
    said = f"about {scenes} scenes for 80% power, if the effect is as seen (psnr)"
    assert needs_of(run, run_with(EFFECTS)) == said
    assert needs_of(run, run_with((2.0, 2.1, 1.9, 2.2, 1.8, 2.3, 1.7, 2.05))) == "", "it is decided"


def test_five_scenes_of_one_sign_need_a_few_more(run: Path) -> None:
    """Scenes of one sign have p below 5 % from six on."""
    record = run_with((2.0, 2.1, 1.9, 2.2, 1.8))
    assert find_claim(judge_claims(record, run, [str(run.parent / "mine.toml")]), "M1").verdict == "undecided"
    assert needs_of(run, record).startswith("about 6 scenes for 80% power")


def test_an_effect_that_no_number_of_scenes_finds_is_said_to_be_one(run: Path) -> None:
    """Centred at the end of the margin and of the claimed sense at once, by effects of either sign."""
    spread = (1.5, -1.5, 0.9, -0.9, 1.1, -1.1, 0.4, -0.4)
    path = run.parent / "mine.toml"
    path.write_text(CLAIMS.replace("paper = 2.0\n", "").replace("negligible = 0.25\n", ""))
    assert needs_of(run, run_with(spread)) == "more than 400 scenes, if the effect is as small as seen (psnr)"


def test_a_decided_claim_needs_nothing(run: Path) -> None:
    record = run_with((2.0, 2.1, 1.9, 2.2, 1.8, 2.3, 1.7, 2.05))
    ledger = judge_claims(record, run, [str(run.parent / "mine.toml")])
    assert claims_power(ledger, record, [load_claims(str(run.parent / "mine.toml"))]) == []


def test_the_command_shows_and_writes_it(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = run.parent / "power.json"
    command = ["claims", str(run), "--claims", str(run.parent / "mine.toml"), "--power"]
    assert main([*command, "--json", str(out)]) == 0
    said = capsys.readouterr().out
    assert "needs of 1 undecided claims" in said
    line = next(x for x in said.splitlines() if x.startswith("M1") and "psnr: mine" in x)
    (written,) = read_json(out)["result"]
    assert f"{written['seen']['scenes']} ({written['seen']['normal']}) scenes" in line
    assert main(["claims", "--power"]) == 2
    assert "expected a run with --power, got none" in capsys.readouterr().err


def asked(check: Check, effects: np.ndarray, **facts: Any) -> module._Asked:
    values = {"seed_sd": None, "seeds": 1, "hours": 1.0} | facts
    return module._Asked(module._rule(check, (0.95, 0.95)), effects, float(np.median(effects)), **values)


def check_of(**facts: Any) -> Check:
    values: dict[str, Any] = {"rule": "better", "rows": ("a", "b"), "expects": "higher"} | facts
    return Check("c", "says", quantity=Quantity("psnr"), **values)


@pytest.mark.parametrize("effect", [0.3, 0.5, 1.0])
def test_normal_effects_need_what_the_formula_says(effect: float) -> None:
    """The quantiles of a normal distribution stand for scenes that show its shape."""
    effects = stats.norm.ppf((np.arange(60) + 0.5) / 60)
    this = asked(check_of(), effects)
    need = this.need(effect, this.rule.decided, effect)
    assert need.scenes is not None
    assert need.normal is not None
    assert need.scenes == pytest.approx(need.normal, rel=0.12, abs=2)


def test_the_formula_is_the_power_of_the_t_test() -> None:
    normal = module._normal(0.5, 1.0, both=False)
    assert normal is not None
    count = round(normal * 3 / math.pi)
    least = stats.t.isf(0.025, count - 1)
    assert stats.nct.sf(least, count - 1, 0.5 * math.sqrt(count)) == pytest.approx(0.8, abs=0.02)


def test_smallness_needs_more_than_a_sign() -> None:
    effects = stats.norm.ppf((np.arange(60) + 0.5) / 60)
    this = asked(check_of(negligible=0.5), effects)
    assert this.rule.none is not None
    small = this.need(0.0, this.rule.none, 0.5, both=True)
    assert small.scenes is not None
    assert small.normal is not None
    assert small.scenes == pytest.approx(small.normal, rel=0.15)
    within = asked(check_of(rule="within", rows=("a",), accepted=(-0.5, 0.5)), effects)
    assert within.rule.none is not None
    assert within.need(0.0, within.rule.none, 0.5, both=True).scenes == small.scenes


def test_no_number_of_scenes_finds_nothing() -> None:
    effects = stats.norm.ppf((np.arange(60) + 0.5) / 60)
    this = asked(check_of(), effects)
    need = this.need(0.02, this.rule.decided, 0.02)
    assert (need.scenes, need.hours) == (None, None)
    assert need.normal is not None
    assert need.normal > MOST


def test_a_ratio_is_judged_by_its_logarithm() -> None:
    effects = 0.4 * stats.norm.ppf((np.arange(60) + 0.5) / 60)
    this = asked(check_of(scale="ratio", paper=2.0), effects)
    need = this.need(math.log(2.0), this.rule.reproduced, math.log(2.0))
    assert need.effect == pytest.approx(2.0)
    assert need.scenes is not None
    assert need.scenes <= 7


def test_few_scenes_do_not_show_a_shape() -> None:
    this = asked(check_of(), np.array([-1.0, 0.0, 3.0]))
    assert this._residuals().std() == pytest.approx(this.sd, rel=0.01)


def test_seeds_do_where_fits_make_most_of_the_spread() -> None:
    """Eight scenes of spread 1, of which fits make 0.8 in variance: 16 scenes, or the spread of 0.707."""
    effects = np.array([-1.0, 1.0] * 4) * math.sqrt(7 / 8)
    this = asked(check_of(), effects, seed_sd=math.sqrt(0.8))
    assert this.sd == pytest.approx(1.0)
    assert this._seeds(16) == math.ceil(0.8 / (0.5 - 0.2))
    assert this._seeds(80) is None, "scenes would be left over"
    assert this._seeds(8) is None
    assert asked(check_of(), effects, seed_sd=0.5)._seeds(16) is None, "scenes make most of it"
    assert asked(check_of(), effects)._seeds(16) is None, "nobody knows"


def test_ends_of_intervals_are_those_of_the_test() -> None:
    samples = np.random.default_rng(0).normal(0.4, 1, (200, 12))
    ends = module._Ends(samples, 0.95)
    expected = [(signed_rank_p(row) or 1.0) <= 0.05 for row in samples]
    assert (ends.above(0.0) | ends.below(0.0)).tolist() == expected
    assert not module._Ends(samples[:, :5], 0.95).above(-99.0).any(), "five scenes have no interval"
    assert rank_limit(5, 0.95) == -1


@pytest.mark.parametrize("least", [1, 2, 7, 53, MOST])
def test_the_least_count_is_found(least: int) -> None:
    assert least_count(lambda count: float(count >= least)) == max(2, least)


def test_no_count_is_enough() -> None:
    assert least_count(lambda count: 0.5) is None


def test_words_against_a_claim_of_several_checks_ask_for_more() -> None:
    """An interval above the claimed smallness refutes at the stricter level alone."""
    samples = np.random.default_rng(1).normal(1.0, 1.0, (500, 12))
    usual, strict = module._Ends(samples, 0.95), module._Ends(samples, 0.95, 0.9925)
    assert (strict.above(0.0) == usual.above(0.0)).all()
    assert strict.above(0.0, against=True).sum() < usual.above(0.0, against=True).sum()
    expected = [(signed_rank_p(row) or 1.0) <= 0.0075 for row in samples]
    refuted = strict.above(0.0, against=True) | strict.below(0.0, against=True)
    assert refuted.tolist() == expected


@pytest.mark.parametrize("by", ["all", "any"])
def test_the_rule_that_counts_scenes_is_the_rule_that_judges(by: str) -> None:
    """On random samples without ties: decided, reproduced and no effect are the words of verdicts."""
    random, words = np.random.default_rng(24), set[str]()
    levels = (0.95, 0.9925) if by == "all" else (0.9925, 0.95)
    for _ in range(2000):
        check = random_check(random)
        samples = random.normal(random.normal(0, 1.5), random.choice([0.05, 0.5, 2.0]), (1, 12))
        rule, ends = module._rule(check, levels), module._Ends(samples, *levels)
        usual, strict = (locate(samples[0], level) for level in (0.95, 0.9925))
        word = verdict_of(check, Effect(usual.estimate, usual.interval, strict.interval), by)
        words.add(word)
        assert bool(rule.decided(ends)[0]) == is_decided(word), (check, samples, word)
        if word == "no effect":
            assert rule.none is not None
            assert rule.none(ends)[0]
        if word == "reproduced":
            assert rule.reproduced(ends)[0]
    assert words >= {"reproduced", "no effect", "contradicted", "smaller than claimed", "undecided"}

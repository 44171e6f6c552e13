# SPDX-License-Identifier: Apache-2.0
"""The rule of verdicts on random tables: it is monotone, and its words are seldom false."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from claims_by_hand import random_check
from graycard.benchmarks.claims import Check
from graycard.benchmarks.claims._effects import Effect, Levels
from graycard.benchmarks.claims._rules import combined, levels_for, verdict_of
from graycard.eval.statistics import LEVEL, locate
from graycard.records import ClaimVerdict
from verdict_trials import COUNTS, FALSE, SHAPES, SIZE, share_of, shares, wrong_claims, wrong_courses

RANK: dict[ClaimVerdict, int] = {
    "contradicted": 0,
    "no effect": 1,
    "smaller than claimed": 1,
    "undecided": 2,
    "reproduced": 3,
    "larger than claimed": 4,
}
"""Rank of each word, from the least favourable to a claim."""
RAISES = (0.02, 0.2, 1.0, 5.0)


def verdict_on(
    checks: Sequence[Check], effects: Sequence[np.ndarray], levels: Levels, by: str
) -> ClaimVerdict:
    """Return the verdict on a claim of some checks."""
    found: list[ClaimVerdict] = []
    for check, values in zip(checks, effects, strict=True):
        usual, strict = locate(values, levels.usual), locate(values, levels.strict)
        found.append(verdict_of(check, Effect(usual.estimate, usual.interval, strict.interval), by))
    return combined(found, by)


def random_effects(random: np.random.Generator, count: int) -> np.ndarray:
    """Return effects of one of many shapes, some with ties and some with an outlier."""
    effects = random.normal(random.normal(0, 2), random.choice([0.05, 0.5, 2.0]), count)
    if random.random() < 0.3:
        effects = np.round(effects, 1)
    if random.random() < 0.3:
        effects[random.integers(count)] += random.choice([-20.0, 20.0])
    return effects


@pytest.mark.slow  # test_claims_rules.py has one for each kind of rule
def test_no_scene_that_is_more_favourable_makes_a_verdict_less_so() -> None:
    """10,000 tables of one to four checks, of which some scenes are made better."""
    random, found_words = np.random.default_rng(30), set[str]()
    for _ in range(10_000):
        by = "all" if random.random() < 0.7 else "any"
        checks = [random_check(random) for _ in range(random.integers(1, 5))]
        count = int(random.choice(COUNTS[:4]))
        levels = Levels(LEVEL, levels_for(len(checks), LEVEL))
        before = [random_effects(random, count) for _ in checks]
        after = [effects.copy() for effects in before]
        raised = after[random.integers(len(checks))]
        places = np.argsort(raised)[: random.integers(1, count + 1)]
        raised[places if random.random() < 0.5 else random.permutation(places)[:1]] += random.choice(RAISES)
        old = verdict_on(checks, before, levels, by)
        new = verdict_on(checks, after, levels, by)
        assert RANK[new] >= RANK[old], (checks, before, after, old, new)
        found_words |= {old, new}
    assert found_words == set(RANK)


@pytest.mark.parametrize("shape", SHAPES)
def test_words_are_false_in_five_percent_at_most(shape: str) -> None:
    """The docs have the figures of 20,000 trials; four standard errors are left for 4,000."""
    slack = 4 * math.sqrt(0.05 * 0.95 / 4000)
    for count in (6, 12, 40):
        for word, effect in FALSE.items():
            assert share_of(shares(shape, effect, count, trials=4000).words, word) <= 0.05 + slack
    assert shares(shape, 0.0, 12, trials=4000).covered >= 0.95 - slack


@pytest.mark.parametrize("shape", SHAPES)
def test_claims_of_several_checks_are_refuted_falsely_in_five_percent_at_most(shape: str) -> None:
    slack = 4 * math.sqrt(0.05 * 0.95 / 2000)
    for checks in (2, 5):
        assert wrong_claims(checks, shape, 12, trials=2000) <= 0.05 + slack


@pytest.mark.parametrize("rows", [3, 6])
@pytest.mark.parametrize("shape", ["lognormal", "exponential"])
def test_flat_courses_are_contradicted_in_five_percent_at_most(shape: str, rows: int) -> None:
    """Each of their steps is enough to contradict, and is drawn apart from the others."""
    for count in (8, 12):
        assert wrong_courses(rows, shape, count) <= 0.05
    assert wrong_courses(rows, shape, 20, trials=1000, fall=1.0) > 0.95, "courses that fall are found"


def test_what_is_claimed_and_true_is_found() -> None:
    """Power on eight normal scenes, and none without six."""
    assert share_of(shares("normal", SIZE, 8, trials=4000).words, "reproduced") > 0.98
    assert shares("normal", SIZE, 5, trials=200).words == {"undecided": 1.0}

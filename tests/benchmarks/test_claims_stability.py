# SPDX-License-Identifier: Apache-2.0
"""The noise of a run's own fits and the share of refits with one verdict, beside other computations."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from claims_by_hand import (
    SPREAD,
    check_of,
    fitted,
    interval_of,
    judged,
    led_by,
    seeded,
)
from graycard.benchmarks.claims import Check, _stability
from graycard.benchmarks.claims._effects import Levels, Sample, summarise
from graycard.benchmarks.claims._noise import FitNoise
from graycard.benchmarks.claims._rules import verdict_of
from graycard.benchmarks.claims._stability import Deciding, Judged
from graycard.records import MethodRecord, RunRecord
from refits_by_hand import deviation, refits, share_above
from runs_by_hand import result_of, scene_of

EFFECTS = 1.0 + 2 * SPREAD
"""Effects with the interval 0.4 to 1.6."""
LISTED = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
"""Numbers of seeds that are proposed."""


def in_pairs(spread: float, effects: np.ndarray = EFFECTS) -> np.ndarray:
    """Two seeds a scene, so far from their mean; the larger is now the first and now the second."""
    signs = np.array([1, -1] * (len(effects) // 2))
    return np.stack([effects + spread * signs, effects - spread * signs], axis=1)


OWN_FREEDOM = 8.0
"""Degrees of freedom of two fits on each of eight scenes."""


@pytest.mark.parametrize("spread", [0.3, 0.6, 0.9, 1.2])
def test_noise_from_own_seeds_is_the_pooled_deviation(spread: float) -> None:
    found = judged(seeded(in_pairs(spread)), check_of()).checks[0]
    between = 0.5 * EFFECTS.var(ddof=1) * 2 > spread**2
    assert found.noise_from == "2 seeds of this run"
    if between:  # else scenes do not differ at all beyond noise, and their means tell of it, too
        assert found.seed_sd == pytest.approx(spread * math.sqrt(2), rel=1e-4)
    assert found.seed_sd is not None
    whole = np.var(EFFECTS, ddof=1)
    assert found.scene_sd == pytest.approx(math.sqrt(max(0.0, whole - found.seed_sd**2 / 2)), abs=1e-9)


def test_noise_from_own_seeds_of_three_fits() -> None:
    seeds = EFFECTS[:, None] + np.random.default_rng(3).normal(0, 0.3, (8, 3))
    found = judged(seeded(seeds), check_of()).checks[0]
    assert found.noise_from == "3 seeds of this run"
    assert found.seed_sd == pytest.approx(deviation(seeds), rel=1e-4)
    assert list(found.scenes.values()) == pytest.approx(seeds.mean(axis=1))


def test_the_noise_of_a_ratio_is_that_of_its_logarithm() -> None:
    random = np.random.default_rng(5)
    logarithms = EFFECTS[:, None] + random.normal(0, 0.2, (8, 2))
    run = seeded(np.exp(logarithms))
    ones = [
        result_of("theirs", int(r.job.scene[1:]), {"psnr": 1.0}, r.job.seed)
        if r.job.method == "theirs"
        else r
        for r in run.results
    ]
    found = judged(replace(run, results=tuple(ones)), check_of(scale="ratio")).checks[0]
    assert found.seed_sd == pytest.approx(deviation(logarithms), rel=1e-4)


def test_without_noise_every_refit_says_the_same() -> None:
    unfitted = judged(led_by(list(EFFECTS)), check_of())
    assert unfitted.stability == unfitted.checks[0].stability == 1.0
    assert (unfitted.checks[0].seed_sd, unfitted.checks[0].noise_from) == (0.0, "nothing is fitted")
    equal = judged(seeded(in_pairs(0.0)), check_of())
    assert (equal.stability, equal.checks[0].seed_sd) == (1.0, 0.0)


def test_of_fits_that_nobody_repeated_nothing_is_known() -> None:
    found = judged(fitted(led_by(list(EFFECTS))), check_of())
    assert found.stability is found.checks[0].stability is found.checks[0].seed_sd is None
    assert found.checks[0].noise_from == ""
    assert (found.verdict, found.before) == ("undecided", "reproduced")
    assert found.suspended == "nobody measured how far fits of these rows differ"
    assert found.needs == "several seeds a scene"


@pytest.mark.parametrize("spread", [0.2, 0.4, 0.8, 1.2, 1.8])
def test_stability_is_that_of_refits_made_one_by_one(spread: float) -> None:
    found = judged(seeded(in_pairs(spread)), check_of())
    check = found.checks[0]
    assert check.seed_sd is not None
    assert found.stability == check.stability
    assert found.stability == pytest.approx(share_above(EFFECTS, check.seed_sd, OWN_FREEDOM), abs=0.04)
    assert (found.suspended == "") == (check.stability is not None and check.stability >= 0.9)


def test_noise_that_is_not_known_well_makes_verdicts_less_stable() -> None:
    """By as much as refits show whose noise is drawn: two fits a scene against noise known exactly."""
    found = judged(seeded(in_pairs(0.4)), check_of())
    noise = found.checks[0].seed_sd
    assert noise is not None
    assert found.stability is not None
    assert share_above(EFFECTS, noise, OWN_FREEDOM) < share_above(EFFECTS, noise) - 0.01
    assert found.stability < share_above(EFFECTS, noise)


@pytest.mark.parametrize("centre", [0.0, 0.35])
def test_stability_of_an_open_verdict(centre: float) -> None:
    effects = SPREAD + centre - 0.1
    found = judged(seeded(in_pairs(0.2, effects)), check_of())
    noise = found.checks[0].seed_sd
    assert noise is not None
    low, high = refits(effects, noise, OWN_FREEDOM)
    assert found.verdict == "undecided"
    assert found.stability == pytest.approx(float(((low <= 0) & (high >= 0)).mean()), abs=0.04)


def beside(run: RunRecord, names: Mapping[str, str]) -> RunRecord:
    """The run with copies of some rows under other names."""
    more = [
        replace(result, job=replace(result.job, method=names[result.job.method]))
        for result in run.results
        if result.job.method in names
    ]
    methods = tuple(MethodRecord(name, "", ()) for name in names.values())
    return replace(run, results=(*run.results, *more), methods=(*run.methods, *methods))


TWICE = {"mine": "ours", "theirs": "yours"}


def shares_of(run: RunRecord, *checks: Check) -> tuple[float, list[float]]:
    """Return the stability of a claim, and those of its checks."""
    found = judged(run, *checks)
    assert found.stability is not None
    return found.stability, [check.stability or 0.0 for check in found.checks]


@pytest.mark.parametrize(("spread", "effects"), [(0.1, EFFECTS - 0.38), (0.8, EFFECTS), (1.2, EFFECTS)])
def test_checks_of_other_rows_are_refitted_apart(
    monkeypatch: pytest.MonkeyPatch, spread: float, effects: np.ndarray
) -> None:
    """Two that support with shares p each, do so together with p²: nothing is drawn for both."""
    _stability._normals.cache_clear()
    monkeypatch.setattr(_stability, "REFITS", 8000)
    run = beside(seeded(in_pairs(spread, effects)), TWICE)
    both, (one, two) = shares_of(run, check_of(), check_of(id="b", rows=("ours", "yours")))
    _stability._normals.cache_clear()
    assert one == pytest.approx(two, abs=0.03)
    assert 0.4 < one < 0.9
    assert both == pytest.approx(one * two, abs=0.02)


def test_checks_of_the_same_rows_have_the_same_fits() -> None:
    """Two that support with a share p each, do so together with p and not with p²."""
    both, (one, two) = shares_of(seeded(in_pairs(0.8)), check_of(), check_of(id="b"))
    assert both == one == two
    assert both > one**2 + 0.1


def test_checks_that_share_the_row_that_is_fitted_share_its_noise() -> None:
    """Rows that are not fitted, against which it is compared, have none."""
    run = fitted(beside(seeded(in_pairs(0.8)), {"theirs": "yours"}))
    both, (one, two) = shares_of(run, check_of(), check_of(id="b", rows=("mine", "yours")))
    assert both == one == two
    both, (one, two) = shares_of(run, check_of(), check_of(id="b", rows=("yours", "mine"), expects="lower"))
    assert both == one == two, "whichever row stands first"


def test_checks_that_share_one_of_two_fitted_rows_are_between() -> None:
    """Half of the variance of each is of the row that both have: their correlation is 1/2."""
    run = beside(seeded(in_pairs(0.8)), {"theirs": "yours"})
    both, (one, two) = shares_of(run, check_of(), check_of(id="b", rows=("mine", "yours")))
    assert one * two + 0.02 < both < min(one, two) - 0.02


def test_seeds_that_are_asked_for_would_do() -> None:
    """By refits made one by one, so many seeds are enough and the next fewer listed are not.

    What single scenes are is known from the fits at hand alone, however many a refit has.
    """
    found = judged(seeded(in_pairs(0.6)), check_of())
    noise = found.checks[0].seed_sd
    assert noise is not None
    assert found.suspended
    seeds = int(found.needs.removeprefix("about ").removesuffix(" seeds a scene"))
    assert seeds in LISTED[1:]
    fewer = LISTED[LISTED.index(seeds) - 1]
    assert share_above(EFFECTS, noise, OWN_FREEDOM, seeds=seeds) >= 0.9 - 0.03
    assert share_above(EFFECTS, noise, OWN_FREEDOM, seeds=fewer) < 0.9 + 0.03


def test_where_many_seeds_would_turn_the_verdict_more_scenes_are_asked_for() -> None:
    """An interval that meets the band by its noise alone: with more fits it is narrower, and below."""
    effects = 1.0 + 2 * SPREAD
    found = judged(seeded(in_pairs(0.9, effects)), check_of(accepted=(1.5, 9.0)))
    noise = found.checks[0].seed_sd
    assert noise is not None
    assert found.before == "reproduced"
    assert found.needs == "more scenes: no number of seeds is enough"
    low, high = refits(effects, noise, OWN_FREEDOM, seeds=64)
    assert float(((low > 0) & (high < 1.5)).mean()) > 0.5, "smaller than claimed, with many seeds"
    for seeds in LISTED:
        low, high = refits(effects, noise, OWN_FREEDOM, seeds=seeds)
        assert float(((low > 0) & (high >= 1.5)).mean()) < 0.9


def sample_around(effects: np.ndarray) -> Sample:
    """Effects of scenes by seed, as the judge would have them of a run."""
    scenes = tuple(map(scene_of, range(len(effects))))
    return Sample(check_of(), scenes, effects.mean(axis=1), np.empty((len(effects), 0)), effects, np.zeros(2))


def stated(fits: np.ndarray, noise: FitNoise) -> float:
    """Return the share of refits that the judge expects to reproduce as these do; 0 where these do not."""
    sample, levels = sample_around(fits), Levels()
    effect = summarise(sample, levels)
    verdict = verdict_of(sample.check, effect, "all")
    if verdict != "reproduced":
        return 0.0
    judged_once = Judged(sample, effect, verdict, noise)
    share = Deciding((judged_once,), (), levels, "all", {}).stability()
    assert share is not None
    return share


@pytest.mark.parametrize("seeds", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_stated_stability_is_that_of_refits_of_the_true_effects(seeds: int) -> None:
    """Scenes and fits differ alike; whatever the centre. Of refits said to agree in 90 %, 82 to 98 % do.

    Noise is estimated: by three fits on each of eight other scenes, or by two on each of these.
    """
    random, agreed = np.random.default_rng(1130), list[bool]()
    for _ in range(1500):
        true = random.uniform(0, 4.5) + random.standard_normal(8)
        fits = true[:, None] + random.standard_normal((8, seeds))
        freedom = 8 if seeds > 1 else 16
        sd = deviation(fits) if seeds > 1 else math.sqrt(random.chisquare(16) / 16)
        origin = "these fits" if seeds > 1 else "same rows"
        noise = FitNoise(sd, "here", seeds, freedom, frozenset({"mine"}), origin)
        if 0.85 <= stated(fits, noise) <= 0.95:
            again = true + random.standard_normal((8, seeds)).mean(axis=1)
            agreed.append(interval_of(again)[0] > 0)
    assert len(agreed) > 100
    assert np.mean(agreed) == pytest.approx(0.9, abs=0.08)

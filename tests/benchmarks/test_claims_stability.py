# SPDX-License-Identifier: Apache-2.0
"""The noise of fits and the share of refits with the same verdict, beside computations of their own."""

import json
import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import graycard.eval as ge
from claims_by_hand import (
    SPREAD,
    check_of,
    cut_off,
    estimate_of,
    fitted,
    interval_of,
    judged,
    led_by,
    seeded,
)
from graycard.benchmarks import claims
from graycard.benchmarks.claims import Check, Quantity, _stability
from graycard.benchmarks.claims._effects import Levels, Sample, summarise
from graycard.benchmarks.claims._noise import FitNoise
from graycard.benchmarks.claims._rules import verdict_of
from graycard.benchmarks.claims._stability import Deciding, Judged
from graycard.records import (
    CheckResult,
    Job,
    JobResult,
    MethodRecord,
    RunRecord,
    Score,
    ScoreSheet,
)
from runs_by_hand import result_of, scene_of

EFFECTS = 1.0 + 2 * SPREAD
"""Effects with the interval 0.4 to 1.6."""
LISTED = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
"""Numbers of seeds that are proposed."""


def in_pairs(spread: float, effects: np.ndarray = EFFECTS) -> np.ndarray:
    """Two seeds a scene, so far from their mean; the larger is now the first and now the second."""
    signs = np.array([1, -1] * (len(effects) // 2))
    return np.stack([effects + spread * signs, effects - spread * signs], axis=1)


def deviation(seeds: np.ndarray) -> float:
    """Return the pooled standard deviation within scenes, from its definition."""
    squares = sum(sum((value - scene.mean()) ** 2 for value in scene) for scene in seeds)
    return math.sqrt(squares / (seeds.size - len(seeds)))


def refits(
    effects: np.ndarray,
    noise: float,
    freedom: float = math.inf,
    had: int = 2,
    seeds: int = 2,
    most: float = math.inf,
    count: int = 20_000,
) -> tuple[np.ndarray, np.ndarray]:
    """Return both ends of intervals of refits, in the order in which they would come about.

    First what the noise is, then where the centre is, then what each scene's effect is, then new fits of it.

    Args:
        effects: Means over the fits of each scene.
        noise: Standard deviation of one fit, as it was estimated.
        freedom: Of that estimate.
        had: Fits of each scene.
        seeds: Fits of each scene in a refit.
        most: No variance is drawn above it.
        count: Refits.
    """
    random, scenes = np.random.default_rng(4711), len(effects)
    shape, centre = (count, scenes), estimate_of(effects)
    known = math.isinf(freedom)
    variance = noise**2 * (np.ones(count) if known else freedom / random.chisquare(freedom, count))
    fits = np.minimum(variance, most)[:, None]
    kept = np.maximum(0, 1 - fits / had / effects.var(ddof=1))
    around = random.normal(centre, np.sqrt((1 - kept) * fits / had / scenes))
    true = random.normal(around + kept * (effects - centre), np.sqrt(kept * fits / had), shape)
    again = random.normal(true, np.sqrt(fits / seeds))
    one, other = np.triu_indices(scenes)
    walsh = np.sort((again[:, one] + again[:, other]) / 2, axis=1)
    outside = cut_off(scenes, 0.95)
    return walsh[:, outside], walsh[:, -1 - outside]


def share_above(effects: np.ndarray, noise: float, freedom: float = math.inf, **more: Any) -> float:
    low, _ = refits(effects, noise, freedom, **more)
    return float((low > 0).mean())


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


METRIC = "novel_view.psnr"
NOISE = Path(claims.__file__).parent / "noise"


def measured(metric: str = METRIC, run: str = "dark") -> dict[str, dict[str, list[float]]]:
    """The measured scores by row and scene, in the order of seeds, straight from the file."""
    found: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    results = json.loads((NOISE / run / "run.json").read_text(encoding="utf-8"))["results"]
    for result in sorted(results, key=lambda result: result["job"]["seed"]):
        (value,) = (s["value"] for s in result["sheet"]["scores"] if s["metric"] == metric)
        found[result["job"]["method"]][result["job"]["scene"]].append(value)
    return found


def spread_of_row(row: str) -> float:
    return deviation(np.array(list(measured()[row].values())))


def fits_of(
    rows: Sequence[tuple[str, str]],
    effects: np.ndarray,
    name: str = METRIC,
    track: str = "dark",
    steps: int = 4000,
) -> RunRecord:
    """Rows, each by its method, with one seed a scene; the first leads the others by the effects."""
    (metric,) = (m for m in ge.all_metrics() if m.id == name)
    results = []
    for place, (row, _) in enumerate(rows):
        for i, effect in enumerate(effects):
            value = 20.0 + i + (float(effect) if place == 0 else 0.0)
            facts = metric.unit, metric.higher_is_better, metric.optimum
            score = Score(name, "graycard-1", "scored", value, *facts)
            sheet = ScoreSheet(track, f"s{i}", row, "", "", (score,))
            job = Job(track, f"s{i}", row, 0, {"iterations": steps})
            results.append(JobResult(job, "", "", "done", sheet=sheet))
    methods = tuple(MethodRecord(row, "", (), entry) for row, entry in rows)
    scenes = tuple(replace(scene_of(i), track=track) for i in range(len(effects)))
    when = "2026-11-25T00:00:00"
    return RunRecord("hand", 1, scenes, methods, (metric,), tuple(results), {}, when, 1.0)


def of_rows(*rows: str) -> Check:
    return check_of(rows=rows, quantity=Quantity(METRIC))


def noise_of(rows: Sequence[tuple[str, str]], effects: np.ndarray) -> CheckResult:
    return judged(fits_of(rows, effects), of_rows(*(row for row, _ in rows))).checks[0]


def test_rows_that_were_measured_have_the_noise_of_their_difference() -> None:
    """By seed, scene by scene: fits of two rows with one seed may err alike."""
    found = noise_of([("sunfaded", "sunfaded"), ("darkgs", "darkgs")], 1 + 20 * SPREAD)
    table = measured()
    gaps = [np.array(table["sunfaded"][s]) - np.array(table["darkgs"][s]) for s in table["darkgs"]]
    assert found.seed_sd == pytest.approx(deviation(np.array(gaps)))
    assert found.noise_from == "sunfaded, darkgs in noise-dark"


def test_rows_of_a_measured_method_are_as_noisy_as_its_noisiest_row() -> None:
    found = noise_of([("mine", "sunfaded"), ("theirs", "darkgs")], 1 + 20 * SPREAD)
    largest = max("sunfaded", "sunfaded-no-prior", key=spread_of_row)
    expected = math.hypot(spread_of_row(largest), spread_of_row("darkgs"))
    assert found.seed_sd == pytest.approx(expected)
    assert found.noise_from == f"{largest}, darkgs in noise-dark, standing in for these rows"
    assert found.scene_sd == pytest.approx(math.sqrt(np.var(20 * SPREAD, ddof=1) - expected**2))


def test_rows_of_a_method_that_nobody_measured_are_as_noisy_as_any() -> None:
    found = noise_of([("mine", "new")], 1 + 20 * SPREAD)
    noisiest = max(measured(), key=spread_of_row)
    assert found.seed_sd == pytest.approx(spread_of_row(noisiest))
    assert found.noise_from == f"{noisiest} in noise-dark, standing in for these rows"


def test_noise_of_others_is_no_more_than_all_that_scenes_spread() -> None:
    """Scenes that agree within less than one fit's noise show that fits of these rows err alike."""
    effects = 1 + SPREAD / 10
    found = noise_of([("mine", "sunfaded"), ("theirs", "darkgs")], effects)
    assert math.hypot(spread_of_row("sunfaded"), spread_of_row("darkgs")) > effects.std(ddof=1)
    assert found.seed_sd == pytest.approx(effects.std(ddof=1))
    assert found.scene_sd == pytest.approx(0, abs=1e-9)
    assert found.noise_from.startswith("all of the spread between scenes, which is below that of ")


@pytest.mark.parametrize(
    ("metric", "run"), [(METRIC, "multilight"), ("albedo.leakage.highlight", "multilight-highlights")]
)
def test_a_score_that_a_run_of_the_track_lacks_has_the_noise_of_the_next(metric: str, run: str) -> None:
    """Scenes of the first run have no highlights; all that they have is read from them."""
    table = measured(metric, run)["gsid"]
    fits = fits_of([("gsid", "gsid")], 20 * SPREAD, metric, "multilight", 1500)
    check = check_of(rows=("gsid",), quantity=Quantity(metric), against=0.1)
    (found,) = judged(fits, check, track="multilight").checks
    assert found.seed_sd == pytest.approx(deviation(np.array(list(table.values()))))
    assert found.noise_from == f"gsid in noise-{run}"


@pytest.mark.parametrize("wide", [0.5, 1.0, 20.0])
def test_noise_measured_elsewhere_is_never_above_all_that_scenes_spread(wide: float) -> None:
    """Measured on fits of the same rows, its variance is drawn, up to the whole spread of these scenes."""
    rows = [("sunfaded", "sunfaded"), ("darkgs", "darkgs")]
    table = measured()
    gaps = np.array([np.array(table["sunfaded"][s]) - np.array(table["darkgs"][s]) for s in table["darkgs"]])
    noise, freedom = deviation(gaps), gaps.size - len(gaps)
    effects = wide * noise * (0.55 + SPREAD)
    found = judged(fits_of(rows, effects), of_rows("sunfaded", "darkgs"))
    assert found.checks[0].seed_sd == pytest.approx(noise)
    most = effects.var(ddof=1)
    expected = share_above(effects, noise, freedom, had=1, seeds=1, most=most)
    assert found.stability == pytest.approx(expected, abs=0.04)

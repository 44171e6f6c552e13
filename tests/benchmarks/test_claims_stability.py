# SPDX-License-Identifier: Apache-2.0
"""The noise of fits and the share of refits with the same verdict, beside computations of their own."""

import json
import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import graycard.eval as ge
from claims_by_hand import SPREAD, check_of, cut_off, estimate_of, fitted, judged, led_by, seeded
from graycard.benchmarks import claims
from graycard.benchmarks.claims import Check, Quantity
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
"""Of which the interval is 0.4 to 1.6."""
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


def refits(effects: np.ndarray, noise: float, count: int = 20_000) -> tuple[np.ndarray, np.ndarray]:
    """Return both ends of intervals of refits: first what a scene's effect is, then another fit of it."""
    random = np.random.default_rng(4711)
    centre = estimate_of(effects)
    kept = max(0.0, 1 - noise**2 * (len(effects) - 1) / float(((effects - centre) ** 2).sum()))
    true = random.normal(centre + kept * (effects - centre), noise * math.sqrt(kept), (count, len(effects)))
    again = random.normal(true, noise)
    one, other = np.triu_indices(len(effects))
    walsh = np.sort((again[:, one] + again[:, other]) / 2, axis=1)
    outside = cut_off(len(effects), 0.95)
    return walsh[:, outside], walsh[:, -1 - outside]


def share_above(effects: np.ndarray, noise: float) -> float:
    low, _ = refits(effects, noise)
    return float((low > 0).mean())


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
    assert found.verdict == "reproduced"


@pytest.mark.parametrize("spread", [0.4, 0.8, 1.2, 1.8])
def test_stability_is_that_of_refits_made_one_by_one(spread: float) -> None:
    found = judged(seeded(in_pairs(spread)), check_of())
    check = found.checks[0]
    assert check.seed_sd is not None
    assert found.stability == check.stability
    assert found.stability == pytest.approx(share_above(EFFECTS, check.seed_sd / math.sqrt(2)), abs=0.03)
    assert (found.suspended == "") == (check.stability is not None and check.stability >= 0.9)


@pytest.mark.parametrize("centre", [0.0, 0.35])
def test_stability_of_an_open_verdict(centre: float) -> None:
    effects = SPREAD + centre - 0.1
    found = judged(seeded(in_pairs(0.2, effects)), check_of())
    noise = found.checks[0].seed_sd
    assert noise is not None
    low, high = refits(effects, noise / math.sqrt(2))
    assert found.verdict == "undecided"
    assert found.stability == pytest.approx(float(((low <= 0) & (high >= 0)).mean()), abs=0.03)


def test_checks_of_a_claim_are_refitted_apart() -> None:
    """Two that support with shares p each, do so together with p²."""
    run = seeded(in_pairs(1.2))
    one, two = check_of(), check_of(id="b")
    alone = judged(run, one).stability
    assert alone is not None
    both = judged(run, one, two)
    assert both.stability == pytest.approx(alone**2, abs=0.04)
    assert [check.stability for check in both.checks] == pytest.approx([alone, alone], abs=0.03)


def test_seeds_that_are_asked_for_would_do() -> None:
    """By refits made one by one, so many seeds are enough and the next fewer listed are not."""
    found = judged(seeded(in_pairs(1.5)), check_of())
    noise = found.checks[0].seed_sd
    assert noise is not None
    assert found.suspended
    seeds = int(found.needs.removeprefix("about ").removesuffix(" seeds a scene"))
    assert seeds in LISTED[1:]
    fewer = LISTED[LISTED.index(seeds) - 1]
    assert share_above(EFFECTS, noise / math.sqrt(seeds)) >= 0.9 - 0.03
    assert share_above(EFFECTS, noise / math.sqrt(fewer)) < 0.9 + 0.03


METRIC = "novel_view.psnr"
NOISE = Path(claims.__file__).parent / "noise" / "dark" / "run.json"


def measured() -> dict[str, dict[str, list[float]]]:
    """The measured PSNR by row and scene, in the order of seeds, straight from the file."""
    found: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    results = json.loads(NOISE.read_text(encoding="utf-8"))["results"]
    for result in sorted(results, key=lambda result: result["job"]["seed"]):
        (value,) = (s["value"] for s in result["sheet"]["scores"] if s["metric"] == METRIC)
        found[result["job"]["method"]][result["job"]["scene"]].append(value)
    return found


def spread_of_row(row: str) -> float:
    return deviation(np.array(list(measured()[row].values())))


def fits_of(rows: Sequence[tuple[str, str]], effects: np.ndarray) -> RunRecord:
    """Rows, each by its method, with one seed a scene; the first leads the others by the effects."""
    (metric,) = (m for m in ge.all_metrics() if m.id == METRIC)
    results = []
    for place, (row, _) in enumerate(rows):
        for i, effect in enumerate(effects):
            value = 20.0 + i + (float(effect) if place == 0 else 0.0)
            score = Score(METRIC, "graycard-1", "scored", value, "dB", True, math.inf)
            sheet = ScoreSheet("dark", f"s{i}", row, "", "", (score,))
            job = Job("dark", f"s{i}", row, 0, {"iterations": 1000})
            results.append(JobResult(job, "", "", "done", sheet=sheet))
    methods = tuple(MethodRecord(row, "", (), entry) for row, entry in rows)
    scenes = tuple(map(scene_of, range(len(effects))))
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

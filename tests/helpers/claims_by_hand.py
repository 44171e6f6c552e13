# SPDX-License-Identifier: Apache-2.0
"""Claims and runs whose verdicts can be worked out by hand, and the signed-rank interval by counting."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from graycard.benchmarks.claims import Check, Claim, Paper, Quantity, judge_paper
from graycard.records import ClaimResult, JobResult, RunRecord, Score
from runs_by_hand import Values, result_of, run_of

SPREAD = np.array([-0.3, 0.2, -0.1, 0.4, -0.2, 0.1, 0.3, -0.4])
"""Deviations of eight scenes, symmetric about 0.

Their Walsh averages begin -0.4, -0.35, -0.3, -0.3. Of 256 patterns of signs 5 have a rank sum of 3 or less, 2
one of 1 or less, 1 that of 0: the interval is 0.3 wide to either side at 95 %, 0.35 at 98 % and 0.4 at 99 %.
"""
BASE = 30 + np.arange(8.0)
"""Scenes differ far more than methods do: only differences scene by scene can tell."""

LEVELS = ("a", "b", "c")
"""Rows of a course."""


def values(mean: float, spread: np.ndarray = SPREAD) -> list[float]:
    return list(map(float, BASE[: len(spread)] + mean + spread))


def run_with(**rows: Values) -> RunRecord:
    return run_of({"bound": {"psnr": values(9)}, "gray": {"psnr": values(-9)}} | {
        row: {"psnr": found} for row, found in rows.items()
    })  # fmt: skip


def check_of(rule: Any = "better", rows: Sequence[str] = ("mine", "theirs"), **more: Any) -> Check:
    options: dict[str, Any] = {"quantity": Quantity("psnr"), "expects": "higher"} | more
    return Check(options.pop("id", "a"), "mine is better", rule, rows=tuple(rows), **options)


def paper_of(*checks: Check, **more: Any) -> Paper:
    """Return a paper of one claim; ``nested`` and ``budget`` are the paper's, all else the claim's."""
    whole = {name: more.pop(name) for name in ("nested", "budget", "track") if name in more}
    claims = (Claim("S1", "It is better.", "Table 1", checks, **more),)
    facts: dict[str, Any] = {"track": "dark", "bound": "bound", "trivial": "gray", "claims": claims} | whole
    return Paper("p", 1, "A paper", **facts)


def judged(run: RunRecord, *checks: Check, **more: Any) -> ClaimResult:
    """Return the result of the claim; ``level``, ``budgets``, ``scale`` and ``sizes`` are the judge's."""
    names = "level", "budgets", "scale", "sizes"
    options = {name: more.pop(name) for name in names if name in more}
    return judge_paper(paper_of(*checks, **more), run, **options)[0]


def verdict(run: RunRecord, *checks: Check, **more: Any) -> str:
    return judged(run, *checks, **more).verdict


def against(mean: float, spread: np.ndarray = SPREAD) -> RunRecord:
    """``mine`` is better than ``theirs`` by a mean and a spread over scenes."""
    return run_with(mine=values(mean, spread), theirs=values(0, 0 * spread))


def led_by(effects: Sequence[float]) -> RunRecord:
    """``mine`` is ahead of ``theirs`` by so much on each scene."""
    return run_of({"mine": {"psnr": list(effects)}, "theirs": {"psnr": [0.0] * len(effects)}})


def course(*means: float) -> RunRecord:
    """Three rows with these means; scenes differ in how steep they are, by half the spread a level."""
    steps = enumerate(means)
    return run_with(**{n: values(m, i * SPREAD / 2) for n, (i, m) in zip(LEVELS, steps, strict=True)})


def seeded(effects: np.ndarray) -> RunRecord:
    """``mine`` is ahead of ``theirs`` by ``effects`` of shape ``(scenes, seeds)``."""
    run = led_by(list(effects[:, 0]))
    more = [
        result_of(row, scene, {"psnr": float(value) if row == "mine" else 0.0}, seed=seed)
        for scene, found in enumerate(effects)
        for seed, value in enumerate(found[1:], 1)
        for row in ("mine", "theirs")
    ]
    return replace(run, results=(*run.results, *more))


def fitted(run: RunRecord, iterations: int = 1000, rows: Sequence[str] = ("mine",)) -> RunRecord:
    """The run with rows that take steps, so that their fits have noise."""

    def with_steps(result: JobResult) -> JobResult:
        if result.job.method not in rows:
            return result
        return replace(result, job=replace(result.job, settings={"iterations": iterations}))

    return replace(run, results=tuple(map(with_steps, run.results)))


def also_scored(run: RunRecord, metric: str, table: Mapping[str, Sequence[float | None]]) -> RunRecord:
    """The run with a further PSNR of some rows, by scene; None has failed."""

    def with_score(result: JobResult) -> JobResult:
        found = table.get(result.job.method)
        if found is None or result.sheet is None:
            return result
        value = found[int(result.job.scene[1:])]
        status = "failed" if value is None else "scored"
        score = Score(metric, "graycard-1", status, value, "dB", True, float("inf"))
        return replace(result, sheet=replace(result.sheet, scores=(*result.sheet.scores, score)))

    return replace(run, results=tuple(map(with_score, run.results)))


def walsh(sample: Sequence[float] | np.ndarray) -> list[float]:
    """Return the means of every two values and of each with itself, sorted."""
    found = list(map(float, sample))
    return sorted((one + other) / 2 for i, one in enumerate(found) for other in found[i:])


def estimate_of(sample: Sequence[float] | np.ndarray) -> float:
    """Return the Hodges-Lehmann estimate from its definition."""
    return float(np.median(walsh(sample)))


@cache
def cut_off(count: int, level: float) -> int:
    """Return how many Walsh averages lie outside at each end, -1 for none, by all signs of the ranks."""
    ranks = np.arange(1, count + 1)
    sums = np.array([ranks @ np.array(signs) for signs in product((0, 1), repeat=count)])
    tails = [2 * np.mean(sums <= most) for most in range(int(ranks.sum()) // 2)]
    return len([tail for tail in tails if tail <= 1 - level + 1e-12]) - 1


def interval_of(sample: Sequence[float] | np.ndarray, level: float = 0.95) -> tuple[float, float]:
    """Return the exact signed-rank interval from its definition."""
    outside, found = cut_off(len(sample), level), walsh(sample)
    return (-np.inf, np.inf) if outside < 0 else (found[outside], found[-1 - outside])


def random_check(random: np.random.Generator) -> Check:
    """Return a check with or without a band, a margin and bounds."""
    rule = "within" if random.random() < 0.2 else "better"
    size = float(random.uniform(0.1, 3))
    if rule == "within":
        return Check("a", "", rule, Quantity("m"), ("a", "b"), "higher", accepted=(-size, math.inf))
    bands = None, (size / 2, 2 * size), (-size, size), (0.0, math.inf), (size, math.inf)
    band, margin = bands[random.integers(len(bands))], float(random.choice([0.0, 0.1, 1.0]))
    if band is not None and band[1] <= margin:
        margin = 0.9 * band[1]  # one that covers the band is refused
    return Check("a", "", rule, Quantity("m"), ("a", "b"), "higher", accepted=band, negligible=margin)

# SPDX-License-Identifier: Apache-2.0
"""Tables of scores without any true difference, or with some, and how often the rule of a run decides there.

``python tests/helpers/family_errors.py`` prints the shares of false tables for all sizes, shapes and nulls.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from graycard.eval.statistics import ASSURED_MARGIN, correct, signed_rank_ps, student_test

LEVEL = 0.05
SPREAD = 4.0
"""Largest standard deviation of a row over the least; between them they rise by equal factors."""
ROWS, SCENES = (5, 25, 60), (6, 8, 12)
Draw = Callable[[np.random.Generator, tuple[int, ...]], np.ndarray]


def _normal(random: np.random.Generator, size: tuple[int, ...]) -> np.ndarray:
    return random.normal(size=size)


def _lognormal(random: np.random.Generator, size: tuple[int, ...]) -> np.ndarray:
    """Return values of sigma 0.5, with mean 0 and standard deviation 1."""
    deviation = math.sqrt((math.exp(0.25) - 1) * math.exp(0.25))
    return (random.lognormal(0, 0.5, size) - math.exp(0.125)) / deviation


def _heavy(random: np.random.Generator, size: tuple[int, ...]) -> np.ndarray:
    """Return values of Student's t with 3 degrees of freedom, with standard deviation 1."""
    return random.standard_t(3, size) / math.sqrt(3)


SHAPES: dict[str, Draw] = {"normal": _normal, "lognormal": _lognormal, "heavy-tailed": _heavy}


def _all_equal(rows: int) -> np.ndarray:
    return np.zeros(rows)


def _half_equal(rows: int) -> np.ndarray:
    """Return levels of which every second is 0, the others all different and far."""
    return np.where(np.arange(rows) % 2 == 0, 0.0, 1e3 * (1 + np.arange(rows)))


def _equal_in_twos(rows: int) -> np.ndarray:
    return 1e3 * (np.arange(rows) // 2)


NULLS: dict[str, Callable[[int], np.ndarray]] = {
    "all equal": _all_equal, "half equal": _half_equal, "equal in twos": _equal_in_twos,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Family:
    """Pairs that one correction is over."""

    first: np.ndarray
    second: np.ndarray
    assured_margin: float = 1.0

    def decided(self, scores: np.ndarray) -> np.ndarray:
        """Return which pairs the rule decides, shape ``(T, K)``; scores of shape ``(N, T, rows)``."""
        gaps = scores[:, :, self.first] - scores[:, :, self.second]
        columns = gaps.reshape(len(gaps), -1)
        found = correct(student_test(columns), len(self.first), self.assured_margin) < LEVEL
        found[found] = signed_rank_ps(columns[:, found]) < LEVEL
        return found.reshape(gaps.shape[1:])


def all_pairs(rows: int) -> Family:
    return Family(*np.triu_indices(rows, 1), ASSURED_MARGIN)


def against(row: int, rows: int) -> Family:
    others = np.delete(np.arange(rows), row)
    return Family(others, np.full(rows - 1, row))


def deviations(rows: int) -> np.ndarray:
    """Return the standard deviation of each row in a mixed order, the middle one 1."""
    rising = np.geomspace(1 / math.sqrt(SPREAD), math.sqrt(SPREAD), rows)
    return rising[np.random.default_rng(5).permutation(rows)]


def tables(
    draw: Draw, levels: np.ndarray, scenes: int, count: int, seed: int = 1000, at_a_time: int = 100
) -> Iterator[np.ndarray]:
    """Yield scores of ``count`` tables in parts of shape ``(scenes, T, rows)``, with an effect of each scene."""
    random, own = np.random.default_rng(seed), deviations(len(levels))
    for start in range(0, count, at_a_time):
        size = (scenes, min(at_a_time, count - start))
        common = random.normal(25, 3, (*size, 1))
        yield common + draw(random, (*size, len(levels))) * own + levels


def false_tables(family: Family, draw: Draw, levels: np.ndarray, scenes: int, count: int) -> float:
    """Return the share of tables in which some pair of equal rows is decided."""
    equal = levels[family.first] == levels[family.second]
    return sum(
        int((family.decided(scores) & equal).any(axis=1).sum())
        for scores in tables(draw, levels, scenes, count)
    ) / count  # fmt: skip


def power(family: Family, gap: float, scenes: int, rows: int, count: int) -> float:
    """Return how often row 0 is told from row 1, ``gap`` standard deviations of their difference away."""
    own = deviations(rows)
    levels = np.zeros(rows)
    levels[0] = gap * math.hypot(own[0], own[1])
    least, total = np.minimum(family.first, family.second), family.first + family.second
    two = np.flatnonzero((least == 0) & (total == 1))
    return sum(
        int(family.decided(scores)[:, two].sum()) for scores in tables(_normal, levels, scenes, count)
    ) / count  # fmt: skip


def chosen_rows(rows: int) -> dict[str, Family]:
    """Return the comparisons with the row of least spread and with that of most."""
    own = deviations(rows)
    return {"least spread": against(int(own.argmin()), rows), "most spread": against(int(own.argmax()), rows)}


def error_table(count: int, rows: tuple[int, ...] = ROWS) -> Iterator[tuple[str, int, int, str, str, float]]:
    """Yield shape, scenes, rows, null, family and the share of false tables."""
    for shape, draw in SHAPES.items():
        for scenes in SCENES:
            for number in rows:
                for name, family in {"all pairs": all_pairs(number), **chosen_rows(number)}.items():
                    for null, levels in NULLS.items():
                        found = false_tables(family, draw, levels(number), scenes, count)
                        yield shape, scenes, number, null, name, found


def power_table(count: int, rows: tuple[int, ...] = ROWS) -> Iterator[tuple[int, int, float, float, float]]:
    """Yield scenes, rows, gap, and the shares decided among all pairs and against a chosen row."""
    for scenes in SCENES:
        for number in rows:
            for gap in (1.5, 2.0, 3.0, 5.0):
                families = all_pairs(number), against(1, number)
                yield scenes, number, gap, *(power(f, gap, scenes, number, count) for f in families)


if __name__ == "__main__":
    import sys

    tables_of_each = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    for line in (*error_table(tables_of_each), *power_table(1000)):
        sys.stdout.write("\t".join(map(str, line)) + "\n")

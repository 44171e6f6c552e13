# SPDX-License-Identifier: Apache-2.0
"""Tables of scores without any true difference, or with one, and how often the rule of a run decides there.

``python tests/helpers/family_errors.py`` prints the tables of ``docs/lab-notes/2026-11-error-rates.md``.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from graycard.eval.statistics import correct, signed_rank_ps, student_test

LEVEL = 0.05
SPREAD = 4.0
"""Largest standard deviation of a row over the least; between them they rise by equal factors."""
ROWS, SCENES = (5, 25, 60), (6, 8, 12, 20, 40)
GAPS = (1.5, 2.0, 3.0, 5.0)
"""In standard deviations of the difference of two rows."""
Draw = Callable[[np.random.Generator, tuple[int, ...]], np.ndarray]


def _normal(random: np.random.Generator, size: tuple[int, ...]) -> np.ndarray:
    return random.normal(size=size)


def _lognormal(sigma: float) -> Draw:
    """Return a shape with mean 0 and standard deviation 1."""
    deviation = math.sqrt((math.exp(sigma**2) - 1) * math.exp(sigma**2))

    def drawn(random: np.random.Generator, size: tuple[int, ...]) -> np.ndarray:
        return (random.lognormal(0, sigma, size) - math.exp(sigma**2 / 2)) / deviation

    return drawn


def _heavy(random: np.random.Generator, size: tuple[int, ...]) -> np.ndarray:
    """Return values of Student's t with 3 degrees of freedom, with standard deviation 1."""
    return random.standard_t(3, size) / math.sqrt(3)


def _alike(draw: Draw) -> Draw:
    """Return a shape whose rows come in fives, as variants of one method do, correlated by 0.8."""

    def drawn(random: np.random.Generator, size: tuple[int, ...]) -> np.ndarray:
        *front, rows = size
        common = np.repeat(draw(random, (*front, -(-rows // 5))), 5, axis=-1)[..., :rows]
        return math.sqrt(0.8) * common + math.sqrt(0.2) * draw(random, size)

    return drawn


SHAPES: dict[str, Draw] = {
    "normal": _normal, "lognormal": _lognormal(0.5), "heavy-tailed": _heavy,
    "correlated": _alike(_normal), "correlated lognormal": _alike(_lognormal(0.5)),
}  # fmt: skip
BEYOND = {"lognormal, sigma 1": _lognormal(1.0)}
"""Tails so long that few scenes do not show them."""


@dataclass(frozen=True, slots=True)
class Family:
    """Pairs that one correction is over."""

    first: np.ndarray
    second: np.ndarray

    def decided(self, scores: np.ndarray) -> np.ndarray:
        """Return which pairs the rule decides, shape ``(T, K)``; scores of shape ``(N, T, rows)``."""
        gaps = scores[:, :, self.first] - scores[:, :, self.second]
        columns = gaps.reshape(len(gaps), -1)
        found = correct(student_test(columns), len(self.first)) < LEVEL
        found[found] = signed_rank_ps(columns[:, found]) < LEVEL
        return found.reshape(gaps.shape[1:])


def all_pairs(rows: int) -> Family:
    return Family(*np.triu_indices(rows, 1))


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
    """Yield scores of tables in parts of shape ``(scenes, T, rows)``, with an effect of each scene."""
    random, own = np.random.default_rng(seed), deviations(len(levels))
    for start in range(0, count, at_a_time):
        size = (scenes, min(at_a_time, count - start))
        common = random.normal(25, 3, (*size, 1))
        yield common + draw(random, (*size, len(levels))) * own + levels


def false_tables(families: dict[str, Family], drawn: Iterator[np.ndarray]) -> dict[str, float]:
    """Return the share of tables in which a pair is decided, for each family; no row is better than another.

    Tables in which some rows are better have fewer false pairs and not one that is not counted here: a pair's
    verdict depends on its own scores and on the number of pairs alone.
    """
    false, count = dict.fromkeys(families, 0), 0
    for scores in drawn:
        count += scores.shape[1]
        for name, family in families.items():
            false[name] += int(family.decided(scores).any(axis=1).sum())
    return {name: found / count for name, found in false.items()}


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


def families(rows: int) -> dict[str, Family]:
    return {"all pairs": all_pairs(rows), **chosen_rows(rows)}


def error_table(
    count: int, shapes: Mapping[str, Draw] = SHAPES
) -> Iterator[tuple[str, int, int, str, float]]:
    """Yield shape, scenes, rows, family and the share of false tables."""
    for shape, draw in shapes.items():
        for scenes in SCENES:
            for rows in ROWS:
                drawn = tables(draw, np.zeros(rows), scenes, count)
                for family, found in false_tables(families(rows), drawn).items():
                    yield shape, scenes, rows, family, found


def power_table(count: int) -> Iterator[tuple[int, int, float, float, float]]:
    """Yield scenes, rows, gap, and the shares decided among all pairs and against a chosen row."""
    for scenes in SCENES[:3]:
        for rows in ROWS:
            for gap in GAPS:
                every = power(all_pairs(rows), gap, scenes, rows, count)
                yield scenes, rows, gap, every, power(against(1, rows), gap, scenes, rows, count)


def errors_page(count: int, shapes: Mapping[str, Draw] = SHAPES) -> Iterator[str]:
    """Yield the lines of the table of false tables, in per cent: all pairs / the worse of two chosen rows."""
    found = {line[:4]: 100 * line[4] for line in error_table(count, shapes)}
    yield f"| scores | scenes | {' | '.join(f'{rows} rows' for rows in ROWS)} |"
    yield "| --- " * (2 + len(ROWS)) + "|"
    for shape in shapes:
        for scenes in SCENES:
            cells = [
                (found[shape, scenes, rows, "all pairs"],
                 max(found[shape, scenes, rows, name] for name in ("least spread", "most spread")))
                for rows in ROWS
            ]  # fmt: skip
            yield f"| {shape} | {scenes} | {' | '.join(f'{a:.1f} / {b:.1f}' for a, b in cells)} |"


def power_page(count: int) -> Iterator[str]:
    """Yield the lines of the table of power, in per cent: all pairs / against a chosen row."""
    found = {line[:3]: [100 * share for share in line[3:]] for line in power_table(count)}
    yield f"| scenes | rows | {' | '.join(f'gap {gap:g}' for gap in GAPS)} |"
    yield "| --- " * (2 + len(GAPS)) + "|"
    for scenes, rows in dict.fromkeys(line[:2] for line in found):
        cells = (found[scenes, rows, gap] for gap in GAPS)
        yield f"| {scenes} | {rows} | {' | '.join(f'{a:.0f} / {b:.0f}' for a, b in cells)} |"


if __name__ == "__main__":
    import sys

    tables_of_each = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    for page in (errors_page(tables_of_each), errors_page(1000, BEYOND), power_page(1000)):
        sys.stdout.write("\n".join([*page, "", ""]))

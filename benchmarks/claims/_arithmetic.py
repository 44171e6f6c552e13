# SPDX-License-Identifier: Apache-2.0
"""Figures of a paper's own tables against each other: no run is needed to see that a mean is none."""

import math
from itertools import combinations

from graycard.benchmarks.claims._claim import Arithmetic
from graycard.benchmarks.claims._rules import RULES
from graycard.records import CheckResult, ClaimResult, ClaimVerdict

_ROUNDING = 1e-9
"""Rounding error of binary numbers, beside that of printed ones."""


def judge_arithmetic(found: Arithmetic) -> ClaimResult:
    """Tell if the entries of a table fit each other."""
    checks = _means(found) if found.stated else _distinct(found)
    wrong = [check.reason for check in checks if check.verdict == "inconsistent"]
    verdict: ClaimVerdict = "inconsistent" if wrong else "consistent"
    text = (
        f"does not follow from its own entries: {'. '.join(wrong)}"
        if wrong
        else "follows from its own entries"
    )
    return ClaimResult(
        found.id, found.sentence, found.source, verdict, text, RULES["arithmetic"], checks, notes=found.notes
    )


def _means(found: Arithmetic) -> tuple[CheckResult, ...]:
    """Return the mean of each row against the one that is printed.

    Each entry is rounded by half a unit of the last place at most, and so is the printed mean.
    """
    slack = 10.0**-found.decimals + _ROUNDING
    checks = []
    for row, entries in found.entries.items():
        mean, stated = math.fsum(entries) / len(entries), found.stated[row]
        listed = ", ".join(f"{entry:.{found.decimals}f}" for entry in entries)
        fits = abs(mean - stated) <= slack
        reason = f"the mean of {listed} is {mean:.{found.decimals + 1}f}"
        reason += ", as printed" if fits else f", not {stated:.{found.decimals}f}"
        checks.append(
            _check(
                found, row, "the printed mean is that of the entries", reason, fits,
                estimate=mean, stated=stated, accepted=(stated - slack, stated + slack),
            )
        )  # fmt: skip
    return tuple(checks)


def _distinct(found: Arithmetic) -> tuple[CheckResult, ...]:
    """Every two rows against each other."""
    checks = []
    for (one, first), (other, second) in combinations(found.entries.items(), 2):
        same = len(first) == len(second) and first == second
        listed = ", ".join(f"{entry:.{found.decimals}f}" for entry in first)
        reason = f"{one} and {other} are both {listed}" if same else f"{one} and {other} differ"
        checks.append(_check(found, f"{one}, {other}", "different things differ", reason, not same))
    return tuple(checks)


def _check(
    found: Arithmetic,
    row: str,
    says: str,
    reason: str,
    fits: bool,
    *,
    estimate: float | None = None,
    stated: float | None = None,
    accepted: tuple[float, float] | None = None,
) -> CheckResult:
    verdict: ClaimVerdict = "consistent" if fits else "inconsistent"
    return CheckResult(
        row, says, "entries of the table", found.unit, row, "", verdict, reason,
        decides=True, estimate=estimate, paper=stated, accepted=accepted,
    )  # fmt: skip

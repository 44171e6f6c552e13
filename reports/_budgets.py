# SPDX-License-Identifier: Apache-2.0
"""The basis of a verdict: the means of the paper beside ours, and if rows were fitted to the end."""

from collections.abc import Sequence
from dataclasses import dataclass

from graycard.records import Budget, RowFit
from graycard.reports._format import format_value


@dataclass(frozen=True, slots=True)
class FitRow:
    """A fitted row: its steps, and PSNR of views that it was fitted to and that it never saw."""

    row: str
    steps: str
    training: str
    held_out: str


@dataclass(frozen=True, slots=True)
class BudgetTable:
    """The means of the paper beside ours."""

    lines: tuple[tuple[str, str, str], ...]
    """The name of what is counted, then its value in the paper and here."""
    fits: tuple[FitRow, ...]


def budget_table(budget: Budget) -> BudgetTable | None:
    """Return the table of a claim; None where nothing is known on either side."""
    here = dict(budget.here)
    if steps := _steps(budget.fits):
        here.setdefault("steps", steps)
    names = dict.fromkeys((*budget.paper, *here))
    lines = tuple((name, _of_paper(name, budget), here.get(name, "not told")) for name in names)
    fits = tuple(map(_fit, budget.fits))
    return BudgetTable(lines, fits) if lines or fits else None


def _of_paper(name: str, budget: Budget) -> str:
    """Return what the paper used; empty for what is a matter of this run alone."""
    return budget.paper.get(name, "" if name in ("other budgets", "other sizes") else "not told")


def _steps(fits: Sequence[RowFit]) -> str:
    """Return the steps of all fits, or their span; empty where none has a number of steps."""
    known = sorted({fit.steps for fit in fits if fit.steps is not None})
    return " to ".join(f"{steps:,}" for steps in dict.fromkeys((known[0], known[-1]))) if known else ""


def _fit(fit: RowFit) -> FitRow:
    steps = "–" if fit.steps is None else f"{fit.steps:,}"
    training, held_out = (
        "–" if value is None else f"{format_value(value, 'dB')} dB" for value in (fit.training, fit.held_out)
    )
    return FitRow(fit.row, steps, training, held_out)

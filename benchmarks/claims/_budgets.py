# SPDX-License-Identifier: Apache-2.0
"""Runs of one suite at other budgets, beside which a verdict has to stand."""

from collections.abc import Mapping

from graycard import RecordError
from graycard.records import RunRecord


def check_budgets(record: RunRecord, others: Mapping[float, RunRecord]) -> None:
    """Refuse runs that differ from a run in more than their budget; rows may be left out.

    Args:
        record: The run whose claims are judged.
        others: Further runs by the factor on its iterations, as 0.5 and 2.

    Raises:
        RecordError: One is of another suite, budget, scenes or seeds.
    """
    for factor, other in others.items():
        wanted, found = _facts(record, factor * record.budget), _facts(other, other.budget)
        for what, value in wanted.items():
            if found[what] != value:
                raise RecordError(
                    f"expected a run with {what} {value} for {factor:g} times the budget, got {found[what]}. "
                    f"Make it with `graycard bench {record.suite} --budget {factor * record.budget:g}`"
                )


def _facts(run: RunRecord, budget: float) -> dict[str, object]:
    """Return what runs have in common that differ in their budget alone."""
    return {
        "suite": f"{run.suite} version {run.suite_version}",
        "budget": budget,
        "size": run.size.words or "that of the suite",
        "scenes": sorted((scene.scene, scene.truth_sha256[:12]) for scene in run.scenes),
        "seeds": sorted({result.job.seed for result in run.results}),
    }

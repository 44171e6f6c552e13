# SPDX-License-Identifier: Apache-2.0
"""Scores held against a baseline, as a summary tells them."""

from dataclasses import dataclass
from typing import Literal

GateStatus = Literal["worse", "missing", "better", "kept"]
"""``kept``: within the tolerance."""


@dataclass(frozen=True, slots=True)
class GateCheck:
    """One score that a baseline expects."""

    track: str
    scene: str
    method: str
    seed: int
    metric: str
    status: GateStatus
    expected: float
    found: float | None
    """None where the run has no such score."""
    tolerance: float
    """By how much it may get worse, in ``unit``."""
    unit: str
    loss: float
    """By how much it is worse than expected; negative if it is better."""
    reason: str = ""
    """Why there is no score."""


@dataclass(frozen=True, slots=True)
class GateSummary:
    """All scores that a baseline expects."""

    baseline: str
    """Name of its file."""
    checks: tuple[GateCheck, ...]

    def of(self, status: GateStatus) -> tuple[GateCheck, ...]:
        """Return the checks of one status, the largest loss in units of its tolerance first."""
        found = (check for check in self.checks if check.status == status)
        return tuple(sorted(found, key=_tolerances_lost, reverse=True))

    @property
    def passed(self) -> bool:
        """Return true where something was measured, and nothing is worse or missing."""
        return bool(self.checks) and not (self.of("worse") or self.of("missing"))


def _tolerances_lost(check: GateCheck) -> float:
    return check.loss / max(check.tolerance, 1e-12)

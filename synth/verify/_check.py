# SPDX-License-Identifier: Apache-2.0
"""The vocabulary of the verification: a check, its figure, and the bound that the figure must not exceed."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Status = Literal["passed", "failed", "skipped"]


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that was looked at in a scene or in one of its views."""

    name: str
    scene: str
    """``<track>/<scene>``."""
    view: str
    """Empty for what concerns the whole scene."""
    figure: float | None
    """Measurement; None where nothing could be."""
    bound: float | None
    """The check is passed where the figure is not above it."""
    unit: str
    status: Status
    reason: str = ""
    """Words on what was expected, what came and what it looks like; or why the check was skipped."""

    @property
    def strain(self) -> float:
        """The figure as a share of its bound: above 1 the check has failed."""
        if self.figure is None or self.bound is None:
            return float("inf") if self.status == "failed" else 0.0
        if self.bound == 0:
            return float("inf") if self.status == "failed" else self.figure
        return self.figure / self.bound


@dataclass(frozen=True, slots=True)
class At:
    """Place where checks are made: a scene, or one of its views."""

    scene: str
    view: str = ""

    def judge(self, name: str, figure: float, bound: float, unit: str, meaning: str) -> Check:
        """Return a check that passes where ``figure <= bound``; what is not a number fails.

        Args:
            name: Of the check.
            figure: What was measured.
            bound: Most that it may be.
            unit: Of both.
            meaning: What is expected, and what it looks like where it is not so.
        """
        if figure <= bound:
            return Check(name, self.scene, self.view, float(figure), bound, unit, "passed")
        said = f"expected {bound:.4g} {unit} or less, got {figure:.4g}: {meaning}"
        return Check(name, self.scene, self.view, float(figure), bound, unit, "failed", said)

    def fail(self, name: str, reason: str) -> Check:
        """Return a check that has failed without a figure."""
        return Check(name, self.scene, self.view, None, None, "", "failed", reason)

    def skip(self, name: str, reason: str) -> Check:
        """Return a check that could not be made."""
        return Check(name, self.scene, self.view, None, None, "", "skipped", reason)


def worst(checks: Iterable[Check]) -> list[Check]:
    """For each scene and name the check that came nearest to its bound or went farthest beyond it.

    A check that was made counts before one that was skipped.
    """
    found: dict[tuple[str, str], Check] = {}
    for check in checks:
        key = check.scene, check.name
        if key not in found or _rank(check) > _rank(found[key]):
            found[key] = check
    return list(found.values())


def _rank(check: Check) -> tuple[int, float]:
    return ("skipped", "passed", "failed").index(check.status), check.strain

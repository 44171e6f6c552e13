# SPDX-License-Identifier: Apache-2.0
"""Settings of the ways to take an object out of coloured surfels."""

from dataclasses import dataclass

from graycard.methods.surfels import SurfelSettings


@dataclass(frozen=True, slots=True)
class RemovalSettings(SurfelSettings):
    """Settings of ``removal``: those of ``2dgs`` for the first stage, and of what comes after it."""

    second_share: float = 0.25
    """Steps of the second stage, as a share of ``iterations`` and on top of them (GOR-IS: 4,000 after
    30,000; a short fit needs a larger share for surfels that are new)."""
    least_inside: float = 0.3
    """A surfel is the object's if this share of what it gives to photographs lies in masks of it (Gaussian
    Grouping: a probability of 0.3)."""
    grow: float = 0.02
    """By which masks are widened before photographs are believed again, a share of the width: what is next to
    the object has its colours (GOR-IS: 10 pixels)."""
    references: int = 3
    """Views in which the hole is filled in, and which say so to the others; 0: every view for itself."""
    hole_weight: float = 1.0
    """Factor on the photometric loss of pixels in holes, beside 1 of those of photographs (GOR-IS: 0.01 in
    its code)."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        SurfelSettings.__post_init__(self)
        if self.references < 0:
            raise ValueError(f"expected references of 0 or more, got {self.references}")
        if not (0 < self.second_share <= 10 and 0 < self.least_inside <= 1 and 0 <= self.grow < 0.5):
            raise ValueError(
                "expected second_share in (0, 10], least_inside in (0, 1] and grow in [0, 0.5), got "
                f"{self.second_share}, {self.least_inside} and {self.grow}"
            )
        if self.hole_weight < 0:
            raise ValueError(f"expected a hole_weight of 0 or more, got {self.hole_weight}")

    @property
    def second_steps(self) -> int:
        """Steps of the second stage."""
        return max(1, round(self.second_share * self.iterations))


@dataclass(frozen=True, slots=True)
class PerViewSettings(RemovalSettings):
    """Settings of ``removal-per-view``: no view tells another."""

    references: int = 0

    def __post_init__(self) -> None:
        """Check that it is still this method."""
        RemovalSettings.__post_init__(self)
        _check_references(self, 0)


@dataclass(frozen=True, slots=True)
class OneReferenceSettings(RemovalSettings):
    """Settings of ``removal-one-reference``: one view tells all others."""

    references: int = 1

    def __post_init__(self) -> None:
        """Check that it is still this method."""
        RemovalSettings.__post_init__(self)
        _check_references(self, 1)


def _check_references(settings: RemovalSettings, only: int) -> None:
    if settings.references != only:
        raise ValueError(
            f"expected references of {only}, got {settings.references}: the method with any number is "
            "'removal'"
        )

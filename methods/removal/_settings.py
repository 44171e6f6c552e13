# SPDX-License-Identifier: Apache-2.0
"""Settings of radiance-only removal."""

from dataclasses import dataclass
from math import inf
from typing import Literal

from graycard.methods.surfels import SurfelSettings


@dataclass(frozen=True, slots=True)
class StagedSettings(SurfelSettings):
    """Settings of ``2dgs`` for the first stage, and of what comes after it however the object is found."""

    second_share: float = 0.25
    """Steps of the second stage, as a share of ``iterations`` and on top of them (GOR-IS: 4,000 after
    30,000; a short fit needs a larger share for surfels that are new)."""
    grow: float = 0.02
    """By which masks are widened before photographs are believed again, a share of the width: what is next to
    the object has its colours (GOR-IS: 10 pixels)."""
    object_masks: Literal["capture", "prior"] = "capture"
    """Who says where the object is: the masks that the capture grants, or the prior for ``mask``."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        SurfelSettings.__post_init__(self)
        if not 0 < self.second_share <= 10:
            raise ValueError(f"expected second_share in (0, 10], got {self.second_share}")
        if not 0 <= self.grow < 0.5:
            raise ValueError(f"expected grow in [0, 0.5), got {self.grow}")

    @property
    def second_steps(self) -> int:
        """Steps of the second stage."""
        return max(1, round(self.second_share * self.iterations))


@dataclass(frozen=True, slots=True)
class RemovalSettings(StagedSettings):
    """Settings of ``removal``."""

    least_inside: float = 0.3
    """A surfel is the object's if this share of what it gives to photographs lies in masks of it (Gaussian
    Grouping: a probability of 0.3)."""
    references: int = 3
    """Views in which the hole is filled in, and which say so to the others; 0: every view for itself."""
    reference_choice: Literal["largest", "release"] = "largest"
    """Rule for these views: those with the largest holes; or out of ten, as in GOR-IS's released code,
    those that agree least on what is in the holes and look least the same way."""
    holes: Literal["unseen", "hull"] = "unseen"
    """Pixels that are filled in: those that no other view sees behind the object; or, as in GOR-IS's code,
    all that lies in the hull of the object, grown by half."""
    hole_weight: float = 1.0
    """Factor on the photometric loss of pixels in holes, beside 1 of those of photographs (GOR-IS: 0.01 in
    its code)."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        StagedSettings.__post_init__(self)
        if self.references < 0:
            raise ValueError(f"expected references of 0 or more, got {self.references}")
        if not 0 < self.least_inside <= 1:
            raise ValueError(f"expected least_inside in (0, 1], got {self.least_inside}")
        if not 0 <= self.hole_weight < inf:
            raise ValueError(f"expected a finite hole_weight of 0 or more, got {self.hole_weight}")


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


@dataclass(frozen=True, slots=True)
class GroupingSettings(StagedSettings):
    """Settings of ``grouping``; values are Gaussian Grouping's (Ye et al. 2024, their code) unless said."""

    second_share: float = 1 / 3
    """Steps of the second stage, as a share of ``iterations`` and on top of them (10,000 after 30,000)."""
    identity_dim: int = 16
    """Numbers that say whose a surfel is."""
    neighbours: int = 5
    """Number of neighbours of a surfel: they are to be of the same object, and new surfels begin as their
    mean."""
    samples: int = 1000
    """Surfels that are compared with their neighbours at a time."""
    consistency_every: int = 5
    """Steps from one comparison to the next."""
    consistency_weight: float = 2.0
    """Weight of what surfels and their neighbours differ by."""
    identity_rate: float = 1e-2
    """Learning rate of the identities (2.5e-3 in thirty thousand steps)."""
    classifier_rate: float = 5e-3
    """Learning rate of the classifier (5e-4)."""
    least_probability: float = 0.3
    """A surfel is the object's if its identity says so with more than this probability."""
    inside_share: float = 0.5
    """Share of the second stage's loss: what is wrong around holes; the rest is what is wrong outside of
    them."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        StagedSettings.__post_init__(self)
        counts = (self.identity_dim, self.neighbours, self.samples, self.consistency_every)
        if min(counts) < 1:
            raise ValueError(
                "expected 1 or more for identity_dim, neighbours, samples and consistency_every, got "
                f"{counts}"
            )
        if not 0 <= self.consistency_weight < inf:
            raise ValueError(
                f"expected a finite consistency_weight of 0 or more, got {self.consistency_weight}"
            )
        if not (self.identity_rate > 0 and self.classifier_rate > 0):
            rates = self.identity_rate, self.classifier_rate
            raise ValueError(f"expected learning rates above 0, got {rates}")
        if not (0 < self.least_probability < 1 and 0 <= self.inside_share < 1):
            raise ValueError(
                "expected least_probability in (0, 1) and inside_share in [0, 1), got "
                f"{self.least_probability} and {self.inside_share}"
            )


def _check_references(settings: RemovalSettings, only: int) -> None:
    if settings.references != only:
        raise ValueError(
            f"expected references of {only}, got {settings.references}: the method with any number is "
            "'removal'"
        )

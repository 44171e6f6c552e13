# SPDX-License-Identifier: Apache-2.0
"""Records of runs that add scenes until claims are decided, and of runs on scenes that nobody had seen."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from graycard.io import Label, RelativePath


@dataclass(frozen=True, slots=True)
class Look:
    """One look at the claims, after some scenes."""

    scenes: tuple[RelativePath, ...]
    """Those that this look added, ``<track>/<scene>``, in order; of the first look those of the suite."""
    rows: tuple[Label, ...]
    """Those that were fitted on them."""
    undecided: tuple[str, ...] = ()
    """Ids of the pursued claims that stayed undecided, as ``goris R7``."""


@dataclass(frozen=True, slots=True)
class Looks:
    """A run that goes on until claims are decided, as it was planned and as it went."""

    most: int
    """Scenes at which it ends in any case: the level follows from it, so it stays as planned."""
    level: float
    """Level of the intervals at each look, so that all of them hold together in 95 %."""
    claims: Mapping[str, str]
    """SHA-256 of each file of claims that are pursued, by the name of its paper."""
    made: tuple[Look, ...] = ()
    stopped: str = ""
    """Reason that it ended, in words; empty while it goes on."""
    untestable: Mapping[str, str] = field(default_factory=dict)
    """Reasons that pursued claims cannot be tested, by id as ``goris R7``: row and scene."""

    @property
    def lost(self) -> dict[str, str]:
        """Claims that one look left undecided and a later one could not test, with why."""
        open_once = {name for look in self.made for name in look.undecided}
        return {name: why for name, why in self.untestable.items() if name in open_once}


@dataclass(frozen=True, slots=True)
class Edition:
    """The state of code and claims that sealed scenes were rendered for."""

    tag: str
    """Name of a tag of git, or the version of a release as ``v1.0.0``."""
    commit: str
    """Commit of the tag, in full; empty for an installed release."""
    claims: Mapping[str, str] = field(default_factory=dict)
    """SHA-256 of each file of claims at the tag, by its name."""

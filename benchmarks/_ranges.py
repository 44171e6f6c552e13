# SPDX-License-Identifier: Apache-2.0
"""Ranges of seeds that a suite sets aside: scenes that are added where claims need more, and sealed ones."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from graycard.io import Name
from graycard.synth import SceneSpec

TUNING = 1000
"""The first of the seeds on which methods are tuned: they never judge."""


@dataclass(frozen=True, slots=True)
class SceneTemplate:
    """A kind of scene, of which a range has many."""

    track: Name
    family: Name
    knobs: Mapping[str, Any] = field(default_factory=dict)
    """Knobs as those of a scene; of a list the values are taken in turn."""

    def scene(self, seed: int, turn: int) -> SceneSpec:
        """Return the scene of a seed, when so many of this kind came before it."""
        return SceneSpec(self.track, self.family, seed, {k: _in_turn(v, turn) for k, v in self.knobs.items()})


@dataclass(frozen=True, slots=True)
class SceneRange:
    """Scenes in a fixed order: the first of each kind, then the second of each kind, and so on."""

    seeds: tuple[int, int]
    """The first and the last; each is that of one scene."""
    scenes: tuple[SceneTemplate, ...]
    """The kinds, one after the other."""

    def __post_init__(self) -> None:
        first, last = self.seeds
        if not 0 <= first <= last < TUNING:
            raise ValueError(
                f"expected seeds from the first to the last, from 0 to below {TUNING} (from there up methods "
                f"are tuned), got {list(self.seeds)}. Mend seeds"
            )
        if not self.scenes:
            raise ValueError("expected one kind of scene or more for a range of seeds, got none. Add some")

    def drawn(self) -> tuple[SceneSpec, ...]:
        """Return all scenes of the range, in order."""
        first, last = self.seeds
        kinds = len(self.scenes)
        return tuple(
            self.scenes[number % kinds].scene(first + number, number // kinds)
            for number in range(last - first + 1)
        )

    def holds(self, spec: SceneSpec) -> bool:
        """Tell whether a scene is of these seeds and of one of these families, whatever its knobs."""
        kinds = {(kind.track, kind.family) for kind in self.scenes}
        first, last = self.seeds
        return (spec.track, spec.family) in kinds and first <= spec.seed <= last


def _in_turn(value: Any, turn: int) -> Any:
    return value[turn % len(value)] if isinstance(value, list | tuple) else value

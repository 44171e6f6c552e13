# SPDX-License-Identifier: Apache-2.0
"""Scenes that networks are trained on: seeds of their own, all families, half of the knobs at random."""

from collections.abc import Iterable
from dataclasses import fields
from typing import Any

import numpy as np

from graycard.synth import Family, Knob, SceneSpec, all_families, knobs

TRAINING = range(100_000, 110_000)
"""Seeds of scenes that weights are fitted to."""
VALIDATION = range(110_000, 120_000)
"""Seeds of scenes that the curves of a training are measured on."""
SPREAD = 3.0
"""A number that is drawn is at most this times its default, and at least the default by this."""


def check_seeds(seeds: Iterable[int], allowed: range) -> None:
    """Refuse seeds that a network must not see: those that judge, those of tuning, those of the other part.

    Raises:
        ValueError: A seed is not among those that are allowed.
    """
    for seed in seeds:
        if seed not in allowed:
            raise ValueError(
                f"expected seeds of {allowed.start} to {allowed.stop - 1}, got {seed}. Seeds below 1000 "
                f"judge, those of 1000 to 2999 are for tuning; {TRAINING.start} and up train a network, "
                f"{VALIDATION.start} and up validate it"
            )


def training_scene(seed: int) -> SceneSpec:
    """Return the scene of a seed: tracks take turns, then their families; each knob is drawn or left.

    The seed decides all of it.
    """
    by_track: dict[str, list[type[Family]]] = {}
    for family in all_families().values():
        by_track.setdefault(family.track, []).append(family)
    tracks = list(by_track)
    turn, which = divmod(seed, len(tracks))
    families = by_track[tracks[which]]
    family = families[turn % len(families)]
    rng = np.random.default_rng(seed)
    drawn = {knob.name: _drawn(rng, family, knob) for knob in knobs(family) if rng.random() < 0.5}
    return SceneSpec(family.track, family.name, seed, drawn)


def _drawn(rng: np.random.Generator, family: type[Family], knob: Knob) -> Any:
    """Return a value of a knob: any word, or a number around its default; of its range where that is 0."""
    known: tuple[Any, ...] = fields(family)  # pyright: ignore[reportArgumentType] -- a family is a dataclass
    metadata = next(f.metadata for f in known if f.name == knob.name)
    if "words" in metadata:
        return str(rng.choice(metadata["words"]))
    low, high = metadata["range"]
    assert not isinstance(knob.default, str)
    if knob.default > 0:
        low, high = max(low, knob.default / SPREAD), min(high, knob.default * SPREAD)
    value = rng.uniform(low, high)
    return round(value) if isinstance(knob.default, int) else float(value)

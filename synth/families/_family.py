# SPDX-License-Identifier: Apache-2.0
"""Contract of a scene family: a frozen dataclass of knobs that builds a scene from a seed."""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from graycard import Camera, View
from graycard.synth._scene import Scene
from graycard.synth._spec import RenderSettings


@runtime_checkable
class Family(Protocol):
    """A parametric generator of scenes; its fields are its knobs, each with a default and a range."""

    track: ClassVar[str]
    name: ClassVar[str]
    title: ClassVar[str]
    """Description of the scene, without the seed."""

    def build(self, seed: int, settings: RenderSettings) -> Scene:
        """Return the scene of a seed; the same arguments give the same scene, to the bit."""
        ...


def knob(default: float, low: float, high: float) -> Any:
    """Return a dataclass field for a number in ``[low, high]``."""
    return dataclasses.field(default=default, metadata={"range": (low, high)})


def count(default: int, low: int, high: int) -> Any:
    """Return a dataclass field for a whole number in ``[low, high]``."""
    return dataclasses.field(default=default, metadata={"range": (low, high)})


def choice(default: str, *others: str) -> Any:
    """Return a dataclass field for one of several words."""
    return dataclasses.field(default=default, metadata={"words": (default, *others)})


@dataclasses.dataclass(frozen=True, slots=True)
class Knobs:
    """Base of the families: each knob is held against its range when they are made.

    Raises:
        ValueError: A knob is out of its range.
    """

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            _check_knob(field.name, getattr(self, field.name), field.metadata)


def _check_knob(name: str, value: Any, metadata: Mapping[str, Any]) -> None:
    if "words" in metadata:
        words = metadata["words"]
        if value not in words:
            raise ValueError(f"expected {name} to be one of {', '.join(words)}, got {value!r}")
        return
    low, high = metadata["range"]
    if not low <= value <= high:
        raise ValueError(f"expected {name} in [{low}, {high}], got {value}")


def interleaved(cameras: list[Camera], test_views: int) -> tuple[View, ...]:
    """Return views along a path, the held-out ones spread evenly between training ones and never at an end.

    Raises:
        ValueError: Fewer than two cameras are left for training.
    """
    count = len(cameras)
    if count - test_views < 2:
        raise ValueError(f"expected 2 or more training views, got {count - test_views}")
    spots = np.arange(1, test_views + 1) * (count - 1) / (test_views + 1)
    held_out = set(np.floor(spots + 0.5).astype(int).tolist())
    names = ["test" if i in held_out else "train" for i in range(count)]
    return tuple(
        View(f"{split}_{i:03d}", "test" if split == "test" else "train", camera)
        for i, (split, camera) in enumerate(zip(names, cameras, strict=True))
    )

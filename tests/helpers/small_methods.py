# SPDX-License-Identifier: Apache-2.0
"""Methods of a few lines, which tests fit by name: their code runs in a confined process, as any method's.

They import nothing that is closed there. What they saw they tell by what they render, count, save or raise.
"""

import time
from collections.abc import Mapping, Set
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from graycard import Camera, Capture, Composition, GraycardError, MethodError
from graycard.io import write_bytes
from graycard.methods import Guest, NoSettings, Priors, add_resumed

BEFORE_S, BEFORE_MIB = 1000.0, 1e6
"""Cost of its stage, as ``Staged`` tells it."""


@dataclass(frozen=True)
class Even:
    """A decomposition of one colour everywhere."""

    colour: float = 0.5
    told: str = ""
    """Is saved, for the test to read."""
    photographs: Set[str] = field(default_factory=frozenset)
    """Names of the photographs that it was fitted to."""
    provides = frozenset({"base_color", "radiance"})

    def render(self, camera: Camera, layers: list[str]) -> dict[str, np.ndarray]:
        return {name: np.full((camera.height, camera.width, 3), self.colour) for name in layers}

    def lights(self) -> None:
        return None

    def save(self, folder: Path) -> None:
        (folder / "told").write_text(self.told)


class Plain:
    """A method that makes an even colour of anything."""

    summary, needs = "All is of one colour", ()
    settings_type: type = NoSettings

    def fit(self, capture: Capture, priors: Priors, settings: Any, *_: object) -> Even:
        return Even()

    def load(self, folder: Path) -> Even:
        return Even()


class Busy(Plain):
    """A method that takes half a second of a core."""

    summary = "It works for half a second"

    def fit(self, capture: Capture, priors: Priors, settings: Any, *_: object) -> Even:
        until = time.process_time() + 0.5
        while time.process_time() < until:
            pass
        return Even()


@dataclass(frozen=True)
class Counted(Even):
    """A decomposition that counts where the camera of a view stands."""

    odd: bool = False

    def counts(self, camera: Camera) -> Mapping[str, float]:
        place = camera.position[0]
        return {"steps" if not self.odd or place < 1 else "strides": float(place)}


class Counting(Plain):
    """A method whose decomposition counts."""

    odd = False

    def fit(self, capture: Capture, priors: Priors, settings: Any, *_: object) -> Counted:
        return Counted(odd=self.odd)


class Odd(Counting):
    """It counts other things in other views."""

    odd = True


class Host(Even):
    """A scene that an object is put into: its colour is how much of the pictures of its scene that fills."""

    def compose(self, composition: Composition, guest: Guest | None = None) -> "Host | None":
        if guest is None:
            return None
        assert guest.masks.keys() == guest.cameras.keys()
        assert guest.decomposition.photographs == guest.cameras.keys()  # pyright: ignore
        assert guest.decomposition.told != self.told  # pyright: ignore
        return Host(float(np.mean(list(guest.masks.values()))))


class Hosting(Plain):
    """A method that puts objects into scenes."""

    def fit(self, capture: Capture, priors: Priors, settings: Any, *_: object) -> Host:
        return Host(told=str(capture.root), photographs=frozenset(view.name for view in capture.train))


@dataclass(frozen=True)
class Place:
    """Settings of ``Peeping``."""

    path: str = ""


class Peeping(Hosting):
    """It tries to read a file in the second of its fits only, and says nothing when it is refused."""

    settings_type = Place
    fits = 0

    def fit(self, capture: Capture, priors: Priors, settings: Place, *_: object) -> Host:
        Peeping.fits += 1
        if Peeping.fits == 2:
            with suppress(GraycardError):
                Path(settings.path).read_text()
        return super().fit(capture, priors, settings)


@dataclass(frozen=True)
class Checkpoint:
    """Folder of the stages."""

    checkpoint: str = ""


class Unstaged(Plain):
    """A method whose setting means something else."""

    settings_type = Checkpoint

    def fit(self, capture: Capture, priors: Priors, settings: Checkpoint, *_: object) -> Even:
        self.found(settings)
        return Even(told=settings.checkpoint)

    def found(self, settings: Checkpoint) -> None:
        """Nothing."""


class Staged(Unstaged):
    """A method that finds what another fit has left."""

    staged = True

    def found(self, settings: Checkpoint) -> None:
        if settings.checkpoint.endswith("/"):
            left = Path(settings.checkpoint) / "stage"
            if left.exists():
                add_resumed(BEFORE_S, BEFORE_MIB)
            write_bytes(left, b"done")


class Waits(Unstaged):
    """A method that leaves a stage when another process says so."""

    staged = True

    def found(self, settings: Checkpoint) -> None:
        folder = Path(settings.checkpoint)
        (folder / "begun").touch()
        while not (folder / "go on").exists():
            time.sleep(0.02)
        write_bytes(folder / "late", b"done")


class Off(Unstaged):
    """A method that says it has no stages."""

    staged = False


class Peeks(Unstaged):
    """A method that looks for what others have left."""

    staged = True

    def found(self, settings: Checkpoint) -> None:
        (Path(settings.checkpoint).parents[1] / "other" / "stage").read_text()


class Compiles(Plain):
    """A method of which a kernel is compiled before its fit, which always fails."""

    kernels: tuple[str, ...] = ("harmonics",)

    def fit(self, capture: Capture, priors: Priors, settings: Any, *_: object) -> Even:
        raise MethodError("expected no fit, got one")


class CompilesNothing(Compiles):
    """It names kernels that there are not."""

    kernels = ("maps 5",)

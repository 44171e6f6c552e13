# SPDX-License-Identifier: Apache-2.0
"""A method in a process that can reach nothing but its capture, and the decompositions that it makes."""

import math
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any
from weakref import finalize

import numpy as np

from graycard import Camera, Capture, Composition, EnvironmentLight, Light, MethodError, Progress
from graycard.io import from_builtins, printable, silent, to_builtins
from graycard.methods._contract import Ask, Decomposition, Guest, Priors
from graycard.methods._registry import BUILT_IN
from graycard.methods.confined._kernels import keep_kernels, note_use
from graycard.methods.confined._program import Ran
from graycard.methods.confined._saved import take_files
from graycard.methods.confined._wire import (
    ask_in,
    error_in,
    error_out,
    light_out,
    lights_in,
    lights_out,
    priors_out,
    question_in,
    shortened,
)
from graycard.processes import ChannelError, Confined, Message, words_of_end

_NO_PRIORS = Priors()
_LONGEST_STEP = 200
"""Characters of what a method says of its progress."""


@dataclass(frozen=True, slots=True)
class Known:
    """Needs, asks and settings of a method, before it is fitted."""

    needs: tuple[str, ...]
    asks: tuple[Ask, ...]
    settings: Mapping[str, Any]
    """All of them, as in JSON."""


@dataclass(frozen=True, slots=True)
class Spent:
    """Cost of what a fit found done."""

    seconds: float
    peak_mib: float


@dataclass(eq=False)
class ConfinedMethod:
    """A method in a process of its own."""

    name: str
    """A registered name or ``module:attribute``."""
    label: str
    """Its name in messages."""
    process: Confined
    scratch: Path
    """Folder of the process."""
    progress: Progress = silent
    released: deque[int] = field(default_factory=deque)
    """Numbers of decompositions that are not used any more."""
    numbers: Iterator[int] = field(default_factory=count)
    since: float = field(default_factory=time.time)

    def load(self, settings: Mapping[str, Any]) -> Known:
        """Import the method.

        Args:
            settings: Those that differ from its defaults.

        Raises:
            UnknownNameError: No method has this name.
            MethodError: It does not load, or does not take its settings.
        """
        told = self.ask("load", {"method": self.name, "settings": dict(settings)}).data
        with self.as_asked():
            needs = tuple(map(str, told["needs"]))
            return Known(needs, tuple(map(ask_in, told["asks"])), dict(told["settings"]))

    def compile(self) -> None:
        """Compile the kernels that it needs and the cache lacks: in no process that runs code of others.

        Raises:
            UnknownNameError: It names kernels that there are not.
        """
        parts, missing, folders = self._kernels()
        if missing:
            from graycard.methods.splat import warm_kernels  # PyTorch takes long to import

            warm_kernels(parts, self.progress)
            _, _, folders = self._kernels()
        note_use(folders)

    def keep_kernels(self) -> None:
        """Keep what a method of graycard's own has compiled; those of others are code of others."""
        if self.name in BUILT_IN:
            keep_kernels(self.scratch / "kernels" / "graycard", self.since)

    def fit(
        self,
        capture: Capture,
        priors: Priors,
        settings: Mapping[str, Any],
        seed: int,
        stages: Path | None = None,
    ) -> tuple[Decomposition, Spent]:
        """Fit it.

        Args:
            capture: A copy in its folder.
            priors: What it is handed; models answer in this process.
            settings: Those that differ from its defaults.
            seed: Of all that is drawn.
            stages: Where it saves stages, if it has any.

        Raises:
            MethodError: It cannot fit the capture, or its process ended.
        """
        handed = priors_out(priors)
        told = {
            "method": self.name, "settings": dict(settings), "seed": seed, "priors": handed.data,
            "capture": str(capture.root), "stages": None if stages is None else str(stages),
        }  # fmt: skip
        found = self.ask("fit", told, handed.arrays, priors).data
        with self.as_asked():
            spent = Spent(max(0.0, _number(found["resumed_s"])), max(0.0, _number(found["resumed_mib"])))
        return self.decomposition(found), spent

    def seed(self, seed: int) -> None:
        """Seed all random sources of the process."""
        self.ask("seed", {"seed": seed})

    def call(self, function: str, **arguments: Any) -> Any:
        """Call ``module:function`` there with JSON data, and return what it gives.

        Raises:
            GraycardError: As it raises.
        """
        return self.ask("call", {"method": self.name, "function": function, "arguments": arguments}).data

    def run(
        self,
        command: Sequence[str],
        folder: Path,
        logs: Path,
        variables: Mapping[str, str],
        timeout_s: float | None = None,
    ) -> Ran:
        """Run a program there, as :func:`graycard.methods.confined._program.run_program` does.

        Raises:
            MethodError: It cannot be started, or the process ended.
        """
        told = {
            "command": list(command), "folder": str(folder), "logs": str(logs),
            "variables": dict(variables), "timeout_s": timeout_s,
        }  # fmt: skip
        found = self.ask("run", told).data
        return from_builtins(Ran, found, MethodError, "how a program ended")

    def ask(
        self,
        verb: str,
        data: Mapping[str, Any],
        arrays: Mapping[str, np.ndarray] = {},
        priors: Priors = _NO_PRIORS,
    ) -> Message:
        """Ask for something, and answer what is asked meanwhile.

        Raises:
            MethodError: The process ended, or sent what is no message.
            GraycardError: What the method's code raised.
        """
        released = [self.released.popleft() for _ in range(len(self.released))]
        told = {**data, "label": self.label, "released": released}
        try:
            self.process.channel.send(Message(verb, told, arrays))
            while (message := self.process.channel.receive()).kind != "done":
                self._meet(message, priors)
        except ChannelError as cause:
            words = words_of_end(self.process.end())
            raise MethodError(
                f"the process of method {self.label!r} ended without an answer: {cause}. {words}"
            ) from None
        return message

    def decomposition(self, told: Mapping[str, Any]) -> Any:
        """Return the decomposition of a number, which can do what is told; None where there is none."""
        with self.as_asked():
            if told["number"] is None:
                return None
            kind = _kind_of(tuple(verb for verb in _VERBS if verb in told["able"]))
            found = kind(self, int(told["number"]), frozenset(map(str, told["provides"])))
        finalize(found, self.released.append, found.number)
        return found

    @contextmanager
    def as_asked(self) -> Iterator[None]:
        """Say of an answer that it is none, where the block cannot read it.

        Raises:
            MethodError: It cannot.
        """
        try:
            yield
        except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as cause:
            what = f"the answer of method {self.label!r} cannot be read"
            raise MethodError(f"{what}: {type(cause).__name__}: {cause}") from None

    def _kernels(self) -> tuple[list[str], list[str], list[str]]:
        """Return the parts of the engine that the method uses, jobs that are missing, and folders in use."""
        found = self.ask("kernels", {"method": self.name}).data
        with self.as_asked():
            parts, missing, folders = ([str(x) for x in found[k]] for k in ("parts", "missing", "folders"))
        return parts, missing, folders

    def _meet(self, message: Message, priors: Priors) -> None:
        """Meet a message that comes before the answer.

        Raises:
            GraycardError: It is an error.
        """
        match message.kind:
            case "progress":
                with self.as_asked():
                    done, doing = (
                        _number(message.data[0]),
                        printable(shortened(str(message.data[1]), _LONGEST_STEP)),
                    )
                self.progress(done, doing)
            case "ask":
                self.process.channel.send(_answer(message, priors))
            case "error":
                with self.as_asked():
                    error = error_in(message.data)
                raise error
            case other:
                raise ChannelError(f"expected an answer, got {other!r}")


def _number(value: Any) -> float:
    """Return a number that came as JSON data.

    Raises:
        ValueError: It is none, or not finite.
    """
    if not math.isfinite(number := float(value)):
        raise ValueError(f"expected a finite number, got {value!r}")
    return number


def _answer(message: Message, priors: Priors) -> Message:
    """Answer a question to a prior; an error is an answer too."""
    try:
        question = question_in(message.data, message.arrays)
        priors.require(question.kind)
        return Message("answer", None, {"answer": np.asarray(priors.models[question.kind].answer(question))})
    except Exception as error:
        return Message("error", error_out(error))


@dataclass(frozen=True, eq=False)
class ConfinedDecomposition:
    """A decomposition in another process."""

    method: ConfinedMethod
    number: int
    provides: frozenset[str]

    def render(self, camera: Camera, layers: Sequence[str]) -> dict[str, np.ndarray]:
        """Render layers, as of :class:`graycard.methods.Decomposition`."""
        told = {"number": self.number, "camera": to_builtins(camera), "layers": list(layers)}
        return dict(self.method.ask("render", told).arrays)

    def lights(self) -> tuple[Light, ...] | None:
        """Return the lights that were found."""
        told = self.method.ask("lights", {"number": self.number}).data
        with self.method.as_asked():
            return lights_in(told)

    def save(self, folder: Path) -> None:
        """Write the decomposition.

        Raises:
            MethodError: The method writes something else than files.
            OutputError: The folder cannot be written to, or the disk is full.
        """
        made = self.method.scratch / f"saved-{next(self.method.numbers)}"
        made.mkdir()
        self.method.ask("save", {"number": self.number, "folder": str(made)})
        take_files(made, folder)


class _Relights(ConfinedDecomposition):
    def relight(self, lights: tuple[Light, ...]) -> Any:
        """Exchange the lights."""
        told = {"number": self.number, "lights": lights_out(lights)}
        return self.method.decomposition(self.method.ask("relight", told).data)


class _Composes(ConfinedDecomposition):
    def compose(self, composition: Composition, guest: Guest | None = None) -> Any:
        """Put an object in; the guest is of the same process."""
        told = {"number": self.number, "composition": to_builtins(composition), "guest": None}
        masks: dict[str, np.ndarray] = {}
        if guest is not None:
            assert isinstance(guest.decomposition, ConfinedDecomposition), "it was fitted in this process"
            told["guest"] = {
                "number": guest.decomposition.number,
                "cameras": {name: to_builtins(camera) for name, camera in guest.cameras.items()},
            }
            masks = dict(guest.masks)
        return self.method.decomposition(self.method.ask("compose", told, masks).data)


class _Removes(ConfinedDecomposition):
    def remove(self, object_id: int) -> Any:
        """Take an object away."""
        told = {"number": self.number, "object": object_id}
        return self.method.decomposition(self.method.ask("remove", told).data)


class _Surrounds(ConfinedDecomposition):
    def environment(self, light: EnvironmentLight) -> np.ndarray:
        """Return the image of an environment."""
        told = {"number": self.number, "light": light_out(light)}
        found = self.method.ask("environment", told)
        with self.method.as_asked():
            return found.arrays["image"]


class _Counts(ConfinedDecomposition):
    def counts(self, camera: Camera) -> dict[str, float]:
        """Count the work that a picture takes."""
        told = self.method.ask("counts", {"number": self.number, "camera": to_builtins(camera)}).data
        with self.method.as_asked():
            return {str(name): _number(value) for name, value in told.items()}


_VERBS: Mapping[str, type[ConfinedDecomposition]] = {
    "relight": _Relights,
    "compose": _Composes,
    "remove": _Removes,
    "environment": _Surrounds,
    "counts": _Counts,
}


@cache
def _kind_of(able: tuple[str, ...]) -> type[ConfinedDecomposition]:
    """Return a kind of decomposition that can do these verbs and no others: what it claims is what it has."""
    bases = tuple(_VERBS[verb] for verb in able) or (ConfinedDecomposition,)
    return type("ConfinedDecomposition", bases, {})

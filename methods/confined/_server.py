# SPDX-License-Identifier: Apache-2.0
"""The process in which a method's code runs: it does what it is asked, and is told no truth.

It answers one request after another. While it is at one it may ask a prior in turn.
"""

import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from graycard import Composition, MethodError, open_capture
from graycard.io import from_builtins, to_builtins
from graycard.methods._blame import blame
from graycard.methods._contract import (
    Compiled,
    Composable,
    Counting,
    Decomposition,
    Guest,
    Method,
    Relightable,
    Removable,
    Staged,
    Surrounded,
    asks_of,
)
from graycard.methods._predict import check_decomposition, lights_found
from graycard.methods._priors import Question
from graycard.methods._registry import load_method, settings_of
from graycard.methods._resumed import resumed_time
from graycard.methods._seeds import seed_everything
from graycard.methods.confined._frames import places_of_code
from graycard.methods.confined._program import run_program
from graycard.methods.confined._wire import (
    Arrays,
    Parcel,
    camera_in,
    error_in,
    error_out,
    light_in,
    lights_in,
    lights_out,
    priors_in,
    question_out,
    text_out,
)
from graycard.processes import Channel, ChannelError, Message

OFTEN_S = 0.1
"""Time between two messages of progress."""
_ABLE: Mapping[str, type[Any]] = {
    "relight": Relightable,
    "compose": Composable,
    "remove": Removable,
    "environment": Surrounded,
    "counts": Counting,
}
"""Protocols that a decomposition may follow besides, by their verb."""


def serve(channel: Channel) -> None:
    """Do what is asked until the other side closes the channel.

    Raises:
        ChannelError: It has.
    """
    answer_all(Server(channel))


def answer_all(server: "Server") -> None:
    """Do what is asked until the other side closes the channel.

    Raises:
        ChannelError: It has.
    """
    warnings.filterwarnings(
        "ignore", "Could not obtain multiprocessing lock"
    )  # Numba's, for want of /dev/shm
    channel = server.channel
    while True:
        request = channel.receive()
        try:
            done = server.do(request)
        except ChannelError:
            raise
        except BaseException as error:
            channel.send(Message("error", error_out(error, server.own)))
        else:
            channel.send(Message("done", done.data, done.arrays))


@dataclass(eq=False)
class Server:
    """The decompositions that a method has made so far."""

    channel: Channel
    own: tuple[str, ...] = ()
    """Files and folders of the method's code."""
    made: dict[int, Decomposition] = field(default_factory=dict)
    count: int = 0
    told_s: float = 0.0
    """Moment at which progress was told last."""

    def do(self, request: Message) -> Parcel:
        """Do what is asked.

        Raises:
            GraycardError: It cannot be done.
        """
        for number in request.data["released"]:
            self.made.pop(number, None)
        verb = getattr(self, f"do_{request.kind}")
        with blame(request.data["label"]):
            return verb(request.data, request.arrays)

    def do_call(self, data: Any, arrays: Arrays) -> Parcel:
        """Call a function with JSON data, and return what it gives."""
        self.own = places_of_code(data["method"])
        module, _, name = data["function"].partition(":")
        return Parcel(getattr(import_module(module), name)(**data["arguments"]))

    def do_run(self, data: Any, arrays: Arrays) -> Parcel:
        """Run a program, and say how it ended."""
        ran = run_program(
            data["command"],
            Path(data["folder"]),
            Path(data["logs"]),
            data["variables"],
            data["timeout_s"],
            lambda line: self.progress(0.0, line),
        )
        return Parcel(to_builtins(ran))

    def do_load(self, data: Any, arrays: Arrays) -> Parcel:
        """Import a method, and say what it needs."""
        self.own = places_of_code(data["method"])
        method = load_method(data["method"])
        settings = settings_of(method, data["settings"])
        asks = [{"kind": ask.kind, "of": ask.of, "optional": ask.optional} for ask in asks_of(method)]
        told = {"needs": [str(name) for name in method.needs], "asks": asks}
        return Parcel({**told, "settings": to_builtins(settings)})

    def do_kernels(self, data: Any, arrays: Arrays) -> Parcel:
        """Say which parts of the engine a method uses, and what of them is not compiled yet."""
        method = load_method(data["method"])
        parts = list(method.kernels) if isinstance(method, Compiled) else []
        if not parts:
            return Parcel({"parts": [], "missing": [], "folders": []})
        from graycard.methods._numba import link_shared  # Numba takes long to import
        from graycard.methods.splat import missing_kernels

        return Parcel({"parts": parts, "missing": missing_kernels(parts), "folders": link_shared()})

    def do_seed(self, data: Any, arrays: Arrays) -> Parcel:
        """Seed all global random sources."""
        seed_everything(data["seed"])
        return Parcel(None)

    def do_fit(self, data: Any, arrays: Arrays) -> Parcel:
        """Fit a method that has not been fitted before: what one keeps of a fit is not there in another."""
        method = load_method(data["method"])
        seed_everything(data["seed"])
        settings = _settings(method, data["settings"], data["stages"])
        capture = open_capture(Path(data["capture"]), check=False)
        priors = priors_in(data["priors"], arrays, _Asked(self.channel))
        with resumed_time() as resumed:
            found = method.fit(capture, priors, settings, data["seed"], self.progress)
        check_decomposition(data["label"], found)
        spent = {"resumed_s": resumed.seconds, "resumed_mib": resumed.peak_mib}
        return Parcel({**self.kept(found), **spent})

    def do_render(self, data: Any, arrays: Arrays) -> Parcel:
        """Render layers."""
        names = list(data["layers"])
        rendered = self.made[data["number"]].render(camera_in(data["camera"]), names)
        if not isinstance(rendered, Mapping):
            raise MethodError(f"expected the layers {names}, got {rendered!r}")
        return Parcel(None, {str(name): _numbers(str(name), rendered[name]) for name in rendered})

    def do_lights(self, data: Any, arrays: Arrays) -> Parcel:
        """Say which lights were found."""
        return Parcel(lights_out(lights_found(self.made[data["number"]])))

    def do_environment(self, data: Any, arrays: Arrays) -> Parcel:
        """Give the image of an environment."""
        found: Any = self.made[data["number"]]
        name = light_in(data["light"]).name
        light = next(light for light in lights_found(found) or () if light.name == name)
        return Parcel(None, {"image": _numbers(f"the image of {name!r}", found.environment(light))})

    def do_relight(self, data: Any, arrays: Arrays) -> Parcel:
        """Exchange the lights."""
        found: Any = self.made[data["number"]]
        return Parcel(self.kept(found.relight(lights_in(data["lights"]))))

    def do_compose(self, data: Any, arrays: Arrays) -> Parcel:
        """Put an object in."""
        found: Any = self.made[data["number"]]
        composition = from_builtins(Composition, data["composition"])
        return Parcel(self.kept(found.compose(composition, self._guest(data["guest"], arrays))))

    def do_remove(self, data: Any, arrays: Arrays) -> Parcel:
        """Take an object away."""
        found: Any = self.made[data["number"]]
        return Parcel(self.kept(found.remove(data["object"])))

    def do_counts(self, data: Any, arrays: Arrays) -> Parcel:
        """Count the work that a picture takes."""
        found: Any = self.made[data["number"]]
        return Parcel({str(k): float(v) for k, v in found.counts(camera_in(data["camera"])).items()})

    def do_save(self, data: Any, arrays: Arrays) -> Parcel:
        """Write a decomposition to a folder."""
        self.made[data["number"]].save(Path(data["folder"]))
        return Parcel(None)

    def _guest(self, data: Any, arrays: Arrays) -> Guest | None:
        """Return an object of another scene."""
        if data is None:
            return None
        cameras = {name: camera_in(camera) for name, camera in data["cameras"].items()}
        return Guest(self.made[data["number"]], cameras, {name: arrays[name] for name in cameras})

    def kept(self, found: Any) -> dict[str, Any]:
        """Keep a decomposition, and say what it can do; the number of one that is not provided is None."""
        if found is None:
            return {"number": None}
        self.count += 1
        self.made[self.count] = found
        able = [verb for verb, protocol in _ABLE.items() if isinstance(found, protocol)]
        return {"number": self.count, "provides": sorted(map(str, found.provides)), "able": able}

    def progress(self, done: float, doing: str, /) -> None:
        """Tell of progress, not too often."""
        if time.monotonic() >= self.told_s:
            self.told_s = time.monotonic() + OFTEN_S
            self.channel.send(Message("progress", [float(done), text_out(str(doing))]))


@dataclass(frozen=True, slots=True)
class _Asked:
    """A prior that answers in another process."""

    channel: Channel

    def answer(self, question: Question) -> np.ndarray:
        """Return the answer, unchecked.

        Raises:
            GraycardError: There is none.
        """
        asked = question_out(question)
        reply = self.channel.ask(Message("ask", asked.data, asked.arrays))
        if reply.kind == "error":
            raise error_in(reply.data)
        return reply.arrays["answer"]


def _settings(method: Method, changes: Mapping[str, Any], stages: str | None) -> Any:
    """Return the settings of a fit; a method that has stages saves them where others look for them."""
    settings = settings_of(method, changes)
    if stages is not None and isinstance(method, Staged) and method.staged and not settings.checkpoint:
        return replace(settings, checkpoint=f"{stages}/")
    return settings


def _numbers(name: str, values: Any) -> np.ndarray:
    """Return an array of real numbers.

    Raises:
        MethodError: It is of something else.
    """
    found = np.asarray(values)
    if found.dtype.kind not in "fiub":
        raise MethodError(f"expected {name} as real numbers, got {found.dtype} of shape {found.shape}")
    return found

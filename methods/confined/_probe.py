# SPDX-License-Identifier: Apache-2.0
"""The process in which a method's contract is checked: it does what a fit asks, and keeps what it saw.

What a fit takes without a word, as a tensor in place of an array, is a fact here.
"""

import contextlib
import os
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from graycard.methods._registry import load_method
from graycard.methods.confined._frames import is_called_by
from graycard.methods.confined._server import Server, answer_all
from graycard.methods.confined._wire import Arrays, Parcel, camera_in, text_out
from graycard.processes import Channel

_MOST = 200
"""Facts that are kept at most."""
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_CHANGING = frozenset({"os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.link", "os.symlink"})
_CACHES = ("__pycache__", ".pyc", ".nbi", ".nbc")
"""Parts of names of what Python and Numba keep of code."""
_TRUTH = frozenset({"truth", "truth.json", "lights.json"})


@dataclass(frozen=True, slots=True)
class Fact:
    """Something that a method did."""

    kind: str
    what: str = ""
    number: float = 0.0


@dataclass(eq=False)
class Probe(Server):
    """A server that keeps facts."""

    facts: list[Fact] = field(default_factory=list)
    scratch: str = os.sep
    """Folder that the method may write to."""
    stops: bool = False
    """True if the next call of progress is told to stop."""

    def note(self, kind: str, what: str = "", number: float = 0.0) -> None:
        """Keep a fact, each once."""
        fact = Fact(kind, text_out(what)[:500], number)
        if fact not in self.facts and len(self.facts) < _MOST:
            self.facts.append(fact)

    def do_watch(self, data: Any, arrays: Arrays) -> Parcel:
        """Forget the facts so far, and say whether the next fit is to be stopped."""
        self.facts, self.stops, self.scratch = [], bool(data["stops"]), os.path.realpath(data["scratch"])
        return Parcel(None)

    def do_facts(self, data: Any, arrays: Arrays) -> Parcel:
        """Say what was seen."""
        return Parcel([[fact.kind, fact.what, fact.number] for fact in self.facts])

    def do_load(self, data: Any, arrays: Arrays) -> Parcel:
        """Import a method, and look at its settings."""
        told = super().do_load(data, arrays)
        kind = load_method(data["method"]).settings_type
        if not kind.__dataclass_params__.frozen:
            self.note("settings-not-frozen", kind.__name__)
        return told

    def do_fit(self, data: Any, arrays: Arrays) -> Parcel:
        """Fit, and keep how that ended and what it took."""
        begun = time.process_time(), time.monotonic()
        how = "returned"
        try:
            return super().do_fit(data, arrays)
        except BaseException as error:
            how = type(error).__name__
            raise
        finally:
            self.note("fit-ended", how, time.process_time() - begun[0])
            self.note("fit-seconds", "", time.monotonic() - begun[1])

    def progress(self, *given: Any) -> None:
        """Look at a call of progress; the first one is stopped if that was asked for."""
        self.note("progress")
        if len(given) != 2:
            self.note("progress-wrong", f"{len(given)} arguments")
            raise TypeError(f"expected progress(done, doing), got {len(given)} arguments")
        done, doing = given
        if not isinstance(done, Real) or not 0 <= float(done) <= 1 + 1e-6:
            self.note("progress-wrong", f"done = {done!r}")
        elif not isinstance(doing, str):
            self.note("progress-wrong", f"doing = {doing!r}")
        if self.stops:
            self.stops = False
            raise KeyboardInterrupt
        with contextlib.suppress(TypeError, ValueError):
            super().progress(float(done), str(doing))

    def do_render(self, data: Any, arrays: Arrays) -> Parcel:
        """Render layers, and keep what they were before they became arrays of numbers."""
        names, camera = list(data["layers"]), camera_in(data["camera"])
        begun = time.process_time()
        rendered = self.made[data["number"]].render(camera, names)
        self.note_render(time.process_time() - begun)
        if not isinstance(rendered, Mapping):
            self.note("no-mapping", type(rendered).__name__)
            return Parcel(None)
        for name in sorted(set(map(str, rendered)) ^ set(names)):
            self.note("layer-missing" if name in names else "layer-besides", name)
        found = {str(name): self._array(str(name), values) for name, values in rendered.items()}
        return Parcel(None, {name: values for name, values in found.items() if values is not None})

    def note_render(self, seconds: float) -> None:
        """Keep the least time of a rendering: the first may compile."""
        before = [fact.number for fact in self.facts if fact.kind == "render-seconds"]
        self.facts = [fact for fact in self.facts if fact.kind != "render-seconds"]
        self.note("render-seconds", "", min([seconds, *before]))

    def do_restore(self, data: Any, arrays: Arrays) -> Parcel:
        """Load a decomposition that was saved."""
        return Parcel(self.kept(load_method(data["method"]).load(Path(data["folder"]))))

    def _array(self, name: str, values: Any) -> np.ndarray | None:
        """Return a layer as an array of numbers; None for what cannot be one."""
        kind = type(values)
        if kind.__module__.partition(".")[0] in ("torch", "jax", "jaxlib", "tensorflow", "cupy"):
            self.note("tensor", f"{name} as {kind.__module__.partition('.')[0]}.{kind.__name__}")
            with contextlib.suppress(Exception):
                values = values.detach().cpu().numpy()
        try:
            found = np.asarray(values)
        except Exception as cause:
            self.note("no-array", f"{name}: {cause}")
            return None
        if found.dtype.kind not in "fiub":
            self.note("no-numbers", f"{name} as {found.dtype}")
            return None
        return found


_watching: list[Probe] = []
"""The probe of this process, once its method may run."""


def _audit(event: str, arguments: tuple[Any, ...]) -> None:
    """Keep what lines of the method's own code open, change or connect to."""
    if not _watching or not (event in _CHANGING or event in ("open", "socket.__new__", "subprocess.Popen")):
        return
    probe = _watching[0]
    if not probe.own or not is_called_by(probe.own, 2):
        return
    if event == "socket.__new__":
        probe.note("network")
    elif event != "subprocess.Popen":
        _note_file(probe, event, arguments)


def _note_file(probe: Probe, event: str, arguments: tuple[Any, ...]) -> None:
    path = arguments[0]
    if not isinstance(path, str | bytes | os.PathLike) or any(x in os.fsdecode(path) for x in _CACHES):
        return
    place = Path(os.path.realpath(os.fsdecode(path)))
    writes = event in _CHANGING or (isinstance(arguments[2], int) and bool(arguments[2] & _WRITING))
    if writes and not _is_free(place, probe.scratch):
        probe.note("writes-outside", str(place))
    elif event == "open" and not place.is_relative_to(probe.scratch) and _TRUTH & {*place.parts}:
        probe.note("reads-truth", str(place))


def _is_free(place: Path, scratch: str) -> bool:
    """Tell whether a method may write to a place: to its folder, to temporary files, and to devices."""
    return any(
        place.is_relative_to(free) for free in (scratch, os.path.realpath(tempfile.gettempdir()), "/dev")
    )


def serve_probe(channel: Channel) -> None:
    """Do what is asked of a method whose contract is checked, until the other side closes the channel.

    Raises:
        ChannelError: It has.
    """
    if not _watching:
        sys.addaudithook(_audit)
    _watching[:] = [Probe(channel)]
    answer_all(_watching[0])

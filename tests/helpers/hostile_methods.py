# SPDX-License-Identifier: Apache-2.0
"""Methods that end badly, or leave something behind."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from graycard.methods import add_resumed
from graycard.methods._gray import GrayMethod

LONG_S = 600


def _channel() -> socket.socket:
    """The socket to the process that asks."""
    for number in range(3, 64):
        with contextlib.suppress(OSError):
            return socket.socket(fileno=number)
    raise OSError


def _leave_children() -> None:
    """Start processes that outlive the fit."""
    if os.fork() == 0:
        time.sleep(LONG_S)
    if os.fork() == 0:
        os.setsid()
        time.sleep(LONG_S)
    subprocess.Popen([sys.executable, "-c", f"import time; time.sleep({LONG_S})"], start_new_session=True)


def _ignore_and_hang() -> None:
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    time.sleep(LONG_S)


def _close_all() -> None:
    os.closerange(0, 256)
    time.sleep(LONG_S)


def _fork_and_die() -> None:
    _leave_children()
    os.abort()


def _write_garbage() -> None:
    _channel().sendall(b"\xff" * 100)
    time.sleep(LONG_S)


def _write_half() -> None:
    _channel().sendall(b"\0\0\0\0\0\0\0\x10{")
    os._exit(0)


def _pretend_to_be_done() -> None:
    data = b'{"kind": "done", "data": {"number": 1, "provides": ["depth"], "able": []}, "arrays": []}'
    _channel().sendall(len(data).to_bytes(8, "big") + data)
    os._exit(0)


def _claim_infinity() -> None:
    data = (
        b'{"kind": "done", "data": {"number": 1, "provides": [], "able": [], "resumed_s": "inf", '
        b'"resumed_mib": 0}, "arrays": []}'
    )
    _channel().sendall(len(data).to_bytes(8, "big") + data)
    os._exit(0)


def _talk() -> None:
    """Say more than a terminal and a record can take."""
    data = b'{"kind": "progress", "data": [0.5, "%s"], "arrays": []}' % (b"a" * 2**24)
    channel = _channel()
    channel.sendall(len(data).to_bytes(8, "big") + data)
    channel.detach()
    raise RuntimeError("b" * 2**24)


def _blame_the_disk() -> None:
    data = b'{"kind": "error", "data": {"error": "OutputError", "words": "full", "trace": ""}, "arrays": []}'
    _channel().sendall(len(data).to_bytes(8, "big") + data)
    time.sleep(1.0)


def _raise_broken_words() -> None:
    class BrokenError(Exception):
        def __str__(self) -> str:
            raise ValueError

    raise BrokenError


def _kill_parent() -> None:
    """Kill the process that started this one; the kernel may not let it."""
    with contextlib.suppress(PermissionError):
        os.kill(os.getppid(), signal.SIGKILL)
    os._exit(3)


ENDS: dict[str, Callable[[], Any]] = {
    "exit": lambda: os._exit(0),
    "code": lambda: os._exit(7),
    "abort": os.abort,
    "segmentation": lambda: os.kill(os.getpid(), signal.SIGSEGV),
    "fork_and_die": _fork_and_die,
    "hang": _ignore_and_hang,
    "descriptors": _close_all,
    "memory": lambda: np.ones(50 * 2**30, np.uint8),
    "garbage": _write_garbage,
    "half": _write_half,
    "endless": lambda: add_resumed(float("inf")),
    "done": _pretend_to_be_done,
    "infinity": _claim_infinity,
    "talk": _talk,
    "disk": _blame_the_disk,
    "system_exit": lambda: sys.exit(0),
    "interrupt": lambda: (_ for _ in ()).throw(KeyboardInterrupt()),
    "words": _raise_broken_words,
    "parent": _kill_parent,
}


class Hostile(GrayMethod):
    """Does one of these things in its fit."""

    summary = "Ends badly"
    how: ClassVar[str] = ""

    def fit(self, capture: Any, priors: Any, settings: Any, seed: int, progress: Any) -> Any:
        ENDS[self.how]()
        return super().fit(capture, priors, settings, seed, progress)


class Leaves(GrayMethod):
    """Leaves processes and a thread behind, and gives a sound result."""

    summary = "Leaves children"

    def fit(self, capture: Any, priors: Any, settings: Any, seed: int, progress: Any) -> Any:
        _leave_children()
        threading.Thread(target=lambda: time.sleep(LONG_S), daemon=True).start()
        return super().fit(capture, priors, settings, seed, progress)


class Escapes(GrayMethod):
    """Leaves a process with a session and an environment of its own."""

    summary = "Leaves a process that bears no mark"

    def fit(self, capture: Any, priors: Any, settings: Any, seed: int, progress: Any) -> Any:
        sleep = [sys.executable, "-c", f"import time; time.sleep({LONG_S})", os.environ["HOSTILE_TEST"]]
        again = f"import subprocess; subprocess.Popen({sleep!r}, env={{}}, start_new_session=True)"
        subprocess.run([sys.executable, "-c", again], env={}, start_new_session=True, check=True)
        return super().fit(capture, priors, settings, seed, progress)


class Exchanges(GrayMethod):
    """Puts a link where its capture is, or tries to."""

    summary = "Exchanges its capture"

    def fit(self, capture: Any, priors: Any, settings: Any, seed: int, progress: Any) -> Any:
        for place in (capture.root, capture.root.parent):
            with contextlib.suppress(OSError):
                os.rename(place, f"{place}-aside")
                os.symlink(os.environ["HOSTILE_TEST"], place)
            with contextlib.suppress(OSError):
                (place / "written").write_text("written")
        if not (capture.root / "capture.json").exists() or list(capture.root.parent.rglob("written")):
            raise RuntimeError("the capture was exchanged")
        return super().fit(capture, priors, settings, seed, progress)


def __getattr__(name: str) -> type[Hostile]:
    """``hostile_methods:exit`` is the method that ends in the way of that name."""
    if name not in ENDS:
        raise AttributeError(name)
    return type(name, (Hostile,), {"how": name})

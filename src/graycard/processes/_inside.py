# SPDX-License-Identifier: Apache-2.0
"""Prepare processes that are to run code of others.

The starter imports what they need, and forks one whenever it is asked to. That one waits until it is told
what is open to it. Threads that libraries have started by then would not be bound by Landlock; a fork leaves
them behind.
"""

import contextlib
import errno
import os
import socket
import struct
import sys
import tempfile
import traceback
from collections.abc import Callable, Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NoReturn

from threadpoolctl import threadpool_limits

from graycard.io import from_builtins, keep_freed_memory
from graycard.processes._channel import Channel, ChannelError, Message
from graycard.processes._family import MARK, adopt_orphans, end_adopted, lead_family
from graycard.processes._guard import Guard
from graycard.processes._landlock import restrict
from graycard.processes._places import Places, has_nvidia, is_inside, open_code, rules_of
from graycard.processes._seccomp import refuse_calls

NUMBER = struct.Struct(">i")
"""An answer of a starter."""
_STAGES = ("benchmarks", "eval", "methods", "reports", "synth")


def serve_starts(serve: str, control: str) -> NoReturn:
    """Fork processes that run a function, one after another; ends this process.

    Each request brings the descriptors of a channel and of a file for refusals. The answer is the id of the
    fork, or the number of an error below 0; once it has ended, its exit code follows.

    Args:
        serve: ``module:function``.
        control: Descriptor of a socket that brings requests and takes answers.
    """
    keep_freed_memory()  # forks do so, too
    lead_family()
    adopt_orphans()
    sys.argv[:] = ["graycard"]
    module, _, name = serve.partition(":")
    work = getattr(import_module(module), name)
    with contextlib.suppress(OSError), socket.socket(fileno=int(control)) as requests:
        while True:
            request, given, _, _ = socket.recv_fds(requests, 1, 2)
            if not request:
                break  # no more are needed
            if not (child := _fork()):
                requests.close()
                lead_family()
                _await_confinement(work, *given)
            for number in given:
                os.close(number)
            requests.sendall(NUMBER.pack(child))
            if child > 0:
                _, status = os.waitpid(child, 0)
                end_adopted()
                requests.sendall(NUMBER.pack(os.waitstatus_to_exitcode(status)))
    os._exit(0)


def _fork() -> int:
    """Fork, and return what ``os.fork`` does; the number of an error, below 0, where it fails."""
    try:
        return os.fork()
    except OSError as error:
        return -(error.errno or errno.EAGAIN)


def _await_confinement(work: Callable[[Channel], None], connection: int, notes: int) -> NoReturn:
    """Wait to be confined, and run a function; ends this process."""
    code = 1
    try:
        for number in (connection, notes):
            os.set_inheritable(number, False)
        channel = Channel(socket.socket(fileno=connection))
        _run(work, channel, channel.receive().data, notes)
        code = 0
    except ChannelError:
        code = 0  # nobody is interested, or not any more
    except BaseException:
        traceback.print_exc()
    finally:  # a fork must not go on as the starter
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _run(work: Callable[[Channel], None], channel: Channel, told: dict[str, Any], notes: int) -> None:
    """Close to this process what it is told, and run a function."""
    places = from_builtins(Places, told["places"])
    _take_environment(told["environment"], places)
    code = _code_of(told["code"])
    sys.path[:], rules = open_code(sys.path, places)
    sys.path_importer_cache.clear()
    if any(is_inside(os.getcwd(), os.path.realpath(place)) for place in places.closed):
        os.chdir(places.scratch)  # its name may be that of the scene
    _fix_memory()
    version = restrict([*rules_of(places, code), *rules])
    filtered = refuse_calls(unix_sockets=has_nvidia())
    _limit_threads()
    Guard(places.closed, places.opened, notes).install()
    told.clear()  # code of others finds what stands in frames above it
    channel.send(Message("confined", {"landlock": version, "seccomp": filtered}))
    work(channel)


def _take_environment(variables: Mapping[str, str], places: Places) -> None:
    """Take over environment variables; caches and temporary files go to the folder of this process."""
    mark = os.environ.get(MARK)
    os.environ.clear()
    os.environ.update(variables)
    scratch = Path(places.scratch)
    for name in ("tmp", "home"):
        (scratch / name).mkdir(exist_ok=True)
    tempfile.tempdir = str(scratch / "tmp")
    home = str(scratch / "home")
    os.environ |= {"TMPDIR": tempfile.tempdir, "HOME": home, "XDG_CACHE_HOME": home}
    if mark:
        os.environ[MARK] = mark


def _fix_memory() -> None:
    """Let code of others not lift the limit of memory."""
    try:
        import resource
    except ImportError:  # not on this system
        return
    soft, _ = resource.getrlimit(resource.RLIMIT_DATA)
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_DATA, (soft, soft))


def _limit_threads() -> None:
    """Limit the threads of libraries that are loaded; some may be started, which are to be restricted too."""
    threads = os.environ.get("OMP_NUM_THREADS", "")
    if threads.isdecimal():
        threadpool_limits(int(threads))


def _code_of(module: str) -> list[str]:
    """Return the places of graycard's code and of a module's package: ``sys.path`` lacks editable ones."""
    if module and os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())  # a module that is named outright may lie there
    names = ["graycard", *(f"graycard.{stage}" for stage in _STAGES), *module.split(".")[:1]]
    found = [spec for name in names if name and (spec := find_spec(name)) is not None]
    places = [place for spec in found for place in spec.submodule_search_locations or [spec.origin or ""]]
    return [place for place in places if os.path.exists(place)]

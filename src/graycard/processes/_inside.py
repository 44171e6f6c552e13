# SPDX-License-Identifier: Apache-2.0
"""Prepare a process that is to run code of others.

It imports what it needs first, and waits. Told what is open to it, it forks: threads that libraries have
started by then would not be bound by Landlock, and a fork leaves them behind. Only the fork runs code of
others.
"""

import contextlib
import os
import signal
import socket
import sys
import tempfile
import warnings
from collections.abc import Callable, Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NoReturn

from threadpoolctl import threadpool_limits

from graycard.io import from_builtins
from graycard.processes._channel import Channel, ChannelError, Message
from graycard.processes._family import MARK, die_with_parent, lead_family
from graycard.processes._guard import Guard
from graycard.processes._landlock import restrict
from graycard.processes._places import Places, open_code, rules_of

_STAGES = ("benchmarks", "eval", "methods", "reports")
_TELLING = ("PWD", "OLDPWD", "_")
"""Environment variables that tell of folders which are closed."""


def await_confinement(serve: str, connection: str, notes: str) -> NoReturn:
    """Import a function, wait to be confined, and run it; ends this process.

    Args:
        serve: ``module:function``.
        connection: Descriptor of the socket that it gets as a :class:`Channel`.
        notes: Descriptor to which refusals are written.
    """
    lead_family()
    sys.argv[:] = ["graycard"]
    channel = Channel(socket.socket(fileno=int(connection)))
    module, _, name = serve.partition(":")
    work = getattr(import_module(module), name)
    os.set_inheritable(int(notes), False)
    try:
        told = channel.receive().data
    except ChannelError:
        os._exit(0)  # it is not needed
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # Python 3.12 warns of threads: none is used
        child = os.fork()
    if child:
        channel.close()
        os.close(int(notes))
        _end_as(child)
    die_with_parent()
    _run(work, channel, told, int(notes))


def _run(work: Callable[[Channel], None], channel: Channel, told: dict[str, Any], notes: int) -> NoReturn:
    """Close to this process what it is told, and run a function."""
    places = from_builtins(Places, told["places"])
    _take_environment(told["environment"], places)
    code = _code_of(told["code"])
    sys.path[:] = open_code(sys.path, places)
    sys.path_importer_cache.clear()
    version = restrict(rules_of(places, [*sys.path, *code]))
    Guard(places.closed, places.opened, notes).install()
    told.clear()  # code of others finds what stands in frames above it
    channel.send(Message("confined", {"landlock": version, "pid": os.getpid()}))
    try:
        work(channel)
    except ChannelError:
        os._exit(0)  # nobody is interested any more
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(0)


def _take_environment(variables: Mapping[str, str], places: Places) -> None:
    """Take over environment variables; caches and temporary files go to the folder of this process."""
    mark = os.environ.get(MARK)
    os.environ.clear()
    os.environ.update({k: v for k, v in variables.items() if k not in _TELLING})
    scratch = Path(places.scratch)
    for name in ("tmp", "home"):
        (scratch / name).mkdir(exist_ok=True)
    tempfile.tempdir = str(scratch / "tmp")
    home = str(scratch / "home")
    os.environ |= {"TMPDIR": tempfile.tempdir, "HOME": home, "XDG_CACHE_HOME": home}
    if mark:
        os.environ[MARK] = mark
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


def _end_as(child: int) -> NoReturn:
    """Wait for the fork, and end as it ended."""
    _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        with contextlib.suppress(OSError):  # SIGKILL has no handler
            signal.signal(-code, signal.SIG_DFL)
        os.kill(os.getpid(), -code)
    os._exit(code)

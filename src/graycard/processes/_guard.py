# SPDX-License-Identifier: Apache-2.0
"""An audit hook (PEP 578) that refuses closed data to Python code, and notes what was tried.

It sees what Python and graycard's own readers open, list, link, change or hand to another program, in every
thread, and cannot be taken off again. It keeps mistakes and shortcuts out, not malice: code that opens files
in a language of its own is not seen. Where the kernel has Landlock, that refuses such code too.
"""

import contextlib
import json
import os
import re
import sys
from collections.abc import Sequence
from typing import Any

from graycard import MethodError
from graycard.io import printable
from graycard.processes._places import is_inside

FORBIDDEN = "graycard.synth"
"""The renderer: whoever knows a scene's seed could render its truth anew."""

_ONE_PATH = frozenset(
    {"open", "os.listdir", "os.scandir", "os.chdir", "graycard.read", "sqlite3.connect",
     "os.remove", "os.rmdir", "os.mkdir", "os.truncate", "os.chmod", "os.chown", "os.utime",
     "os.setxattr", "os.removexattr", "os.getxattr", "os.listxattr"}
)  # fmt: skip
_TWO_PATHS = frozenset({"os.link", "os.symlink", "os.rename"})
_AROUND = frozenset({"os.rename", "os.remove", "os.rmdir"})
"""Events in which a folder around what is closed counts as closed."""
_PROGRAMS = frozenset({"subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.spawn", "pty.spawn"})
_WATCHED = _ONE_PATH | _TWO_PATHS | _PROGRAMS | {"import"}
_SEPARATORS = re.compile(r"[\s'\"=:;,|&<>()\[\]{}]+")
"""Separators of the words of a command, in a shell's line as well as in a list of arguments."""
_LONGEST = 2000
"""Characters of a note: a pipe takes so much at once."""


class Guard:
    """The hook."""

    def __init__(self, closed: Sequence[str], opened: Sequence[str] = (), notes: int | None = None) -> None:
        """Close folders.

        Args:
            closed: Folders and files, with all that is below.
            opened: Folders below these that stay open.
            notes: A descriptor to which each refusal is written as a line of JSON, those of processes that
                this one forks as well.
        """
        self._closed = tuple(os.path.realpath(place) for place in closed)
        self._opened = tuple(os.path.realpath(place) for place in opened)
        self._notes = notes
        self.refused: list[str] = []
        """Paths and commands that were refused in this process, in order, each once."""

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        """Judge an event; :func:`sys.addaudithook` calls this."""
        if event not in _WATCHED:
            return
        if event == "import":
            if f"{arguments[0]}.".startswith(f"{FORBIDDEN}."):
                self._refuse(str(arguments[0]))
        elif event in _PROGRAMS:
            if self._names(arguments[:3]):
                self._refuse(f"{event} {arguments[:2]!r}")
        else:
            for path in arguments[: 2 if event in _TWO_PATHS else 1]:
                if (text := _text(path)) is not None and self._closes(text, around=event in _AROUND):
                    self._refuse(os.path.abspath(text))

    def install(self) -> None:
        """Hold from now on, in all threads of this process and in those that it forks."""
        sys.addaudithook(self)

    def _closes(self, path: str, *, around: bool) -> bool:
        """Tell whether a path, links in it followed, leads to what is closed, or lies around it."""
        real = os.path.realpath(path)
        if any(is_inside(real, place) for place in self._opened):
            return False
        if around and any(is_inside(place, real) for place in self._closed):
            return True
        return any(is_inside(real, place) for place in self._closed)

    def _names(self, command: tuple[Any, ...]) -> bool:
        """Tell whether a command names what is closed: another program has no hook.

        Args:
            command: What the audit event says of it: the program, its arguments, and for some the folder in
                which it starts. Relative paths and links are followed from there and from here.
        """
        words = repr(command)
        if any(place in words for place in self._closed):
            return True
        starts = [os.getcwd(), *(text for text in map(_text, command) if text and os.path.isdir(text))]
        named = [word for word in _SEPARATORS.split(words) if word]
        paths = [os.path.join(start, word) for start in starts for word in named]
        return any(self._closes(path, around=False) for path in paths if os.path.lexists(path))

    def _refuse(self, what: str) -> None:
        """Keep in mind what was tried.

        Raises:
            MethodError: Always.
        """
        what = printable(what)[:_LONGEST]
        if what not in self.refused:
            self.refused.append(what)
            if self._notes is not None:
                with contextlib.suppress(BlockingIOError):
                    os.write(self._notes, json.dumps(what).encode() + b"\n")
        raise MethodError(
            f"the method tried to reach {what}: truth is closed while a method runs. A method that is to see "
            "some of it names it in `needs`"
        )


def _text(path: Any) -> str | None:
    """Return a path as text; None for an open file's number, which was judged when it was opened."""
    return os.fsdecode(path) if isinstance(path, str | bytes | os.PathLike) else None

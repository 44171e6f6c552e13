# SPDX-License-Identifier: Apache-2.0
"""Truth is closed while a method's code runs: it gets a copy of the capture, and a hook refuses the rest.

The copy lies outside of the dataset, so no path that a method is handed leads to the truth. Whoever opens it
by a path found elsewhere is refused by an audit hook (PEP 578), which sees what Python and graycard's own
readers open, list, link or hand to another program, in every thread. It keeps mistakes and shortcuts out, not
malice: code that reads files in a language of its own is not seen.
"""

import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from graycard import Capture, GraycardError, MethodError, open_capture
from graycard.io import output_error

GUARD = "capture-copy-and-audit-hook-1"
"""Name and version of this way to close the truth, for the record."""

_ONE_PATH = frozenset({"open", "os.listdir", "os.scandir", "os.chdir", "graycard.read"})
_TWO_PATHS = frozenset({"os.link", "os.symlink", "os.rename"})
_PROGRAMS = frozenset({"subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.spawn"})
_SEPARATORS = re.compile(r"[\s'\"=:;,|&<>()\[\]{}]+")
"""What stands between the words of a command, in a shell's line as well as in a list of arguments."""


class Guard:
    """What is closed, and what was tried."""

    def __init__(
        self,
        dataset: Path,
        jobs: Path | None = None,
        own: Path | None = None,
        *,
        other: Path | None = None,
        stages: Path | None = None,
    ) -> None:
        """Close every ``truth/`` of a dataset, and the jobs of a run but one.

        Args:
            dataset: ``DATASET``; its scenes are ``DATASET/<track>/<scene>``.
            jobs: Where predictions of other methods lie, one of which may be the truth itself.
            own: The folder in ``jobs`` that stays open.
            other: Another dataset, which a guest comes from.
            stages: ``RUN/stages/<code>/<capture>``, which stays open; other stages of the run are closed.
        """
        datasets = [dataset] if other is None else [dataset, other]
        self._datasets = [os.path.realpath(place) for place in datasets]
        self._jobs = os.path.realpath(jobs) if jobs is not None else None
        self._own = os.path.realpath(own) if own is not None else None
        self._stages = os.path.realpath(stages) if stages is not None else None
        self._all_stages = os.path.realpath(stages.parents[1]) if stages is not None else None
        self.refused: list[str] = []
        """Paths that were refused, in order, each once."""

    def closes(self, path: str) -> bool:
        """Whether a path, links in it followed, leads to what is closed."""
        real = os.path.realpath(path)
        for dataset in self._datasets:
            if _inside(real, dataset):
                parts = os.path.relpath(real, dataset).split(os.sep)
                return len(parts) > 2 and parts[2] == "truth"
        if _inside(real, self._all_stages):
            return not _inside(real, self._stages)
        return _inside(real, self._jobs) and not _inside(real, self._own)

    def moves(self, path: str) -> bool:
        """Whether renaming a path takes truth out of what is closed: a scene's folder, or one around it."""
        real = os.path.realpath(path)
        for dataset in self._datasets:
            if _inside(real, dataset):
                return len(os.path.relpath(real, dataset).split(os.sep)) <= 2
        return any(_inside(dataset, real) for dataset in self._datasets)

    def names(self, command: tuple[Any, ...]) -> bool:
        """Whether a command names the dataset or other jobs: another program has no hook.

        Args:
            command: What the audit event says of it: the program, its arguments, and for some the folder in
                which it starts. Relative paths and links are followed from there and from here.
        """
        words = repr(command)
        closed = [place for place in (*self._datasets, self._jobs, self._all_stages) if place]
        if any(place in words for place in closed):
            return True
        starts = [os.getcwd(), *(text for text in map(_text, command) if text and os.path.isdir(text))]
        named = [word for word in _SEPARATORS.split(words) if word]
        paths = [os.path.join(start, word) for start in starts for word in named]
        real = [os.path.realpath(path) for path in paths if os.path.lexists(path)]
        return any(_inside(path, place) for path in real for place in closed)

    def refuse(self, what: str) -> None:
        """Keep in mind what was tried.

        Raises:
            MethodError: Always.
        """
        if what not in self.refused:
            self.refused.append(what)
        raise MethodError(
            f"expected a method to keep to its capture, got an attempt to reach {what}: truth is closed "
            "while a method runs. A method that is to see some of it names it in `needs`"
        )


class _Hook:
    """The one hook of this process; a hook cannot be taken off again, so it rests between fits."""

    guard: Guard | None = None
    installed = False

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        guard = self.guard
        if guard is None or event not in _WATCHED:
            return
        if event in _PROGRAMS:
            if guard.names(arguments[:3]):
                guard.refuse(f"{event} {arguments[:2]!r}")
            return
        for path in arguments[: 2 if event in _TWO_PATHS else 1]:
            closes = guard.moves if event == "os.rename" else guard.closes
            if (text := _text(path)) is not None and (closes(text) or guard.closes(text)):
                guard.refuse(os.path.abspath(text))


_WATCHED = _ONE_PATH | _TWO_PATHS | _PROGRAMS
_HOOK = _Hook()


@contextmanager
def closed(guard: Guard) -> Iterator[None]:
    """Close the truth to all threads of this process for the time of the block.

    Raises:
        MethodError: Raised in the code that tries to reach it.
    """
    if not _HOOK.installed:
        sys.addaudithook(_HOOK)
        _HOOK.installed = True
    before, _HOOK.guard = _HOOK.guard, guard
    try:
        yield
    finally:
        _HOOK.guard = before


@contextmanager
def copied_capture(folder: Path) -> Iterator[Capture]:
    """A copy of a capture in a temporary folder of its own, which goes with the block.

    What the user can mend in it is said of the folder that it is a copy of.

    Raises:
        DatasetError: It is missing or damaged.
        OutputError: There is no room for the copy.
    """
    open_capture(folder)  # what is wrong with it is said of the folder that the user knows
    with tempfile.TemporaryDirectory(prefix="graycard-", ignore_cleanup_errors=True) as root:
        copy = Path(root) / "capture"
        try:
            shutil.copytree(folder, copy)
        except OSError as cause:
            raise output_error(copy, cause) from cause
        try:
            yield open_capture(copy)
        except GraycardError as cause:
            told = (a.replace(str(copy), str(folder)) if isinstance(a, str) else a for a in cause.args)
            cause.args = tuple(told)
            raise


def closed_to_fits(
    scene: Path,
    own: Path | None = None,
    jobs: Path | None = None,
    donor: Path | None = None,
    stages: Path | None = None,
) -> Guard:
    """The guard of a fit on ``DATASET/<track>/<scene>``, and on the scene that a guest comes from."""
    other = None if donor is None else Path(donor).absolute().parents[1]
    return Guard(Path(scene).absolute().parents[1], jobs, own, other=other, stages=stages)


def _inside(path: str, folder: str | None) -> bool:
    return folder is not None and (path == folder or path.startswith(folder.rstrip(os.sep) + os.sep))


def _text(path: Any) -> str | None:
    """A path as text; None for an open file's number, which was judged when it was opened."""
    return os.fsdecode(path) if isinstance(path, str | bytes | os.PathLike) else None

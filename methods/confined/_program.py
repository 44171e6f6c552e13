# SPDX-License-Identifier: Apache-2.0
"""Run a program from within a confined process: it is bound by all that binds that process."""

import contextlib
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from graycard.io import printable
from graycard.methods.confined._saved import end_of_file

_LOOK_S = 0.1
"""Seconds between two looks at a program."""
_DROPPED = ("PYTHON", "GRAYCARD_", "COVERAGE_", "VIRTUAL_ENV", "CONDA_PREFIX")
"""Begins of names of variables that are meant for graycard's own interpreter."""
_KEPT = "GRAYCARD_WORKER"
"""Mark by which all that a worker has started is found and ended."""
_TAIL = 2**16
"""Bytes of the end of an output that are read."""
OUTPUTS = ("stdout.txt", "stderr.txt")


@dataclass(frozen=True, slots=True)
class Ran:
    """The end of a program."""

    code: int | None
    """Exit code, below 0 for a signal; None where it ran out of time and was killed."""
    seconds: float
    cpu_s: float
    """CPU time of the program and of all that it has waited for, seconds."""
    peak_mib: float
    """Most memory of one of its processes; at least that of the process that started it."""
    output: str
    """End of its standard output."""
    errors: str
    """End of its standard error."""


def run_program(
    command: Sequence[str],
    folder: Path,
    logs: Path,
    variables: Mapping[str, str],
    timeout_s: float | None,
    tell: Callable[[str], None],
) -> Ran:
    """Run a program to its end, and kill what it leaves in its process group.

    Args:
        command: Program and arguments.
        folder: Where it starts.
        logs: Folder for what it prints.
        variables: Environment variables besides those of this process that are not graycard's own.
        timeout_s: Seconds after which it is killed; None: never.
        tell: Called now and then with the last line that it printed.

    Raises:
        OSError: It cannot be started.
    """
    begun = time.monotonic()
    files = [logs / name for name in OUTPUTS]
    with files[0].open("wb") as output, files[1].open("wb") as errors:
        process = subprocess.Popen(
            list(command),
            cwd=folder,
            env={**_passed(), **variables},
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=errors,
            process_group=0,
        )
    code, used = _awaited(process, None if timeout_s is None else begun + timeout_s, files, tell)
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    seconds, cpu_s = time.monotonic() - begun, used.ru_utime + used.ru_stime
    peak_mib = used.ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)
    return Ran(code, seconds, cpu_s, peak_mib, *map(_end_of, files))


def _awaited(
    process: subprocess.Popen[bytes], end: float | None, files: Sequence[Path], tell: Callable[[str], None]
) -> tuple[int | None, resource.struct_rusage]:
    """Return the exit code of a program, None for one that was killed as its time was over, and its cost."""
    while True:
        is_late = end is not None and time.monotonic() >= end
        if is_late:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)
        ended, status, used = os.wait4(process.pid, 0 if is_late else os.WNOHANG)
        if ended:
            process.returncode = os.waitstatus_to_exitcode(status)  # Popen would wait for it as well
            return None if is_late else process.returncode, used
        for line in _last_lines(files):
            tell(line)
        time.sleep(_LOOK_S)


def _passed() -> dict[str, str]:
    """Return the variables of this process that are not meant for its own interpreter."""
    return {
        name: value for name, value in os.environ.items() if name == _KEPT or not name.startswith(_DROPPED)
    }


def _last_lines(files: Sequence[Path]) -> Iterator[str]:
    """Yield the last line of the file that was written last, if there is one."""
    newest = max(files, key=_changed)
    lines = _end_of(newest, 1000).replace("\r", "\n").split("\n")
    yield from [line for line in lines if line.strip()][-1:]


def _changed(path: Path) -> int:
    """Return when a file was written last; 0 for one that the program has removed."""
    try:
        return path.lstat().st_mtime_ns
    except OSError:
        return 0


def _end_of(path: Path, most: int = _TAIL) -> str:
    """Return the end of a text file, control characters as escapes."""
    return printable(end_of_file(path.parent, path.name, most).decode(errors="replace"))

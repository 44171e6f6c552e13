# SPDX-License-Identifier: Apache-2.0
"""Fit by a command: the scene is handed to a program in a confined process, and its outputs are taken.

The program runs as the code of any method does: Landlock and seccomp bind it, its scene has no name, its
memory and time are limited, and it ends with all that it started.
"""

import tempfile
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from graycard import Capture, GraycardError, MethodError, Progress
from graycard.benchmarks._handed import check_there, copied_capture, places_of, scratch_folder
from graycard.benchmarks.commands._code import (
    Interpreter,
    argv_of,
    check_reads,
    code_of,
    digest,
    hashes_of_reads,
    interpreter_of,
)
from graycard.benchmarks.commands._command import RECORDED, Command, told_of
from graycard.benchmarks.commands._handing import hand_over, take_outputs
from graycard.io import code_hash, sha256, write_bytes
from graycard.methods.confined import (
    OUTPUTS,
    ConfinedMethod,
    Introduction,
    Ran,
    confined,
    end_of_file,
    take_files,
)
from graycard.records import Access, Cost

LOG = "output.txt"
"""File beside the predictions of a job with the end of what its command printed."""
_KEPT = 2**18
"""Bytes of each output that are kept."""
_LINES = 12
"""Lines of its standard error that the reason of a failure quotes."""
_CODE = ("graycard:open_capture", "graycard.adoption:adopt", "graycard.exchange:export_capture")
"""Code of graycard through which a command is given its capture and its outputs become predictions."""


@dataclass(frozen=True, slots=True)
class CommandSpec:
    """All that a fit by a command depends on."""

    command: Command
    method: str
    """Name of the row."""
    settings: Mapping[str, Any]
    """In the place of placeholders."""
    seed: int
    scene: Path
    """``DATASET/<track>/<scene>``."""
    allowed: tuple[Path, ...] = ()
    """Files and folders that it may read and change besides."""
    code_sha256: str = ""
    """SHA-256 that its code has to have, as :func:`introduction_of_command` found it; empty for any."""
    reads_sha256: Mapping[str, str] = field(default_factory=dict)
    """SHA-256 that what it reads in its place has to have before and after, as found there; none for any."""


def introduction_of_command(command: Command, settings: Mapping[str, Any]) -> Introduction:
    """Return what is to be known of a command before it runs: its code is hashed, nothing is run.

    Raises:
        MethodError: Its code or its interpreter is missing.
    """
    interpreter, code = interpreter_of(command), code_of(command)
    told = dict(told_of(command))
    told["code_sha256"] = digest(code.files)
    told["files"] = {name: code.files[name] for name in code.named if name in code.files}
    told["reads"] = hashes_of_reads(command)
    told["python_version"] = interpreter.version
    told = {name: value for name, value in told.items() if value}
    summary = f"Code of others in a process of its own: {command.run}"
    return Introduction(summary, (), {**settings, RECORDED: told}, (), f"command-1 {code_hash(_CODE)}")


def fit_command(
    spec: CommandSpec, predictions: Path, progress: Progress, jobs: Path | None = None
) -> tuple[Cost, Access]:
    """Run a command on a scene, and write its predictions folder; what it printed lies beside that.

    Args:
        spec: What to run.
        predictions: Where to; older predictions are replaced, anything else is left alone.
        progress: Called now and then with the last line that it printed.
        jobs: Folder of all jobs of a run, which are closed to it.

    Raises:
        MethodError: It ends with another exit code than 0, too late, or without predictions, or what it
            reads is not what it was.
        PredictionError: Its predictions cannot be read.
        DatasetError: The scene is missing or damaged.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    with ExitStack() as things:
        check_reads(spec.command, spec.reads_sha256, predictions)
        scratch, copies = things.enter_context(scratch_folder()), things.enter_context(scratch_folder())
        check_there([spec.scene])
        capture = things.enter_context(copied_capture(spec.scene / "capture", copies / "a" / "capture"))
        course = _Course.begun(spec, scratch, hand_over(spec.command, capture, copies))
        reads = [Path(name).expanduser().absolute() for name in spec.command.reads]
        readable = (copies, *course.interpreter.readable, *reads)
        places = places_of(scratch, [spec.scene], {}, jobs, allowed=spec.allowed, readable=readable)
        with confined(spec.method, scratch, places, progress, module="") as process:
            try:
                ran = course.done(process)
            finally:
                _keep_log(course.logs, predictions.parent / LOG)
            access = _access(spec, process)
        check_reads(spec.command, spec.reads_sha256, predictions)
        _take(spec, course, capture, predictions)
    return Cost(ran.seconds, ran.peak_mib, cpu_s=ran.cpu_s), access


@dataclass(frozen=True, slots=True)
class _Course:
    """A command under way: its folders and words."""

    spec: CommandSpec
    interpreter: Interpreter
    code: Path
    """The copy of its code, where it starts."""
    logs: Path
    out: Path
    values: dict[str, object]
    """In the place of placeholders."""

    @staticmethod
    def begun(spec: CommandSpec, scratch: Path, handed: Path) -> "_Course":
        """Copy the code, and make the folders.

        Raises:
            MethodError: The code is not what it was when the bench began.
        """
        interpreter, code = interpreter_of(spec.command), code_of(spec.command)
        folders = [scratch / name for name in ("code", "printed", "out")]
        for folder in folders:
            folder.mkdir()
        code.copy(folders[0])
        if spec.code_sha256 not in ("", digest({name: sha256(folders[0] / name) for name in code.files})):
            raise MethodError(
                f"expected the code in {code.folder} as it was when the bench began, got another. Start the "
                "bench again"
            )
        values = {**spec.settings, "capture": handed, "out": folders[2], "seed": spec.seed}
        started, logs, out = folders
        return _Course(spec, interpreter, started, logs, out, values)

    def done(self, process: ConfinedMethod) -> Ran:
        """Run what sets it up, then the command, and return how that ended.

        Raises:
            MethodError: One of them fails.
        """
        command = self.spec.command
        if command.setup:
            self._ran(process, command.setup, dict(self.spec.settings))
        return self._ran(process, command.run, self.values)

    def _ran(self, process: ConfinedMethod, text: str, values: dict[str, object]) -> Ran:
        command = self.spec.command
        variables = {**self.interpreter.variables, **command.environment}
        argv = argv_of(text, self.interpreter, values)
        ran = process.run(argv, self.code, self.logs, variables, command.timeout)
        if ran.code == 0:
            return ran
        ended = f"ended with exit code {ran.code}"
        if ran.code is None:
            ended = f"did not end within {command.timeout:g} s"
        said = _last_words(ran).replace(f"{self.code}/", "")  # a folder that is gone by then
        raise MethodError(f"`{text}` {ended}. {said}")


def _last_words(ran: Ran) -> str:
    """Return the last lines of what a program printed, of its errors if there are any."""
    for name, text in (("standard error", ran.errors), ("standard output", ran.output)):
        lines = [line for line in text.splitlines() if line.strip()]
        if lines:
            return f"Its {name} ends with:\n" + "\n".join(f"  {line}" for line in lines[-_LINES:])
    return "It printed nothing"


def _keep_log(logs: Path, kept: Path) -> None:
    """Keep the end of what a command printed."""
    parts = []
    for name in sorted(OUTPUTS):
        if text := end_of_file(logs, name, _KEPT).decode(errors="replace"):
            parts.append(f"--- {Path(name).stem}\n{text}")
    if parts:
        write_bytes(kept, "\n".join(parts).encode())


def _take(spec: CommandSpec, course: _Course, capture: Capture, predictions: Path) -> None:
    """Copy outputs to where nobody writes to them any more, and make predictions of them."""
    with scratch_folder() as taken:
        made = Path(tempfile.mkdtemp(dir=taken))
        take_files(course.out, made)
        try:
            take_outputs(spec.command, made, capture, spec.method, predictions)
        except GraycardError as cause:
            said = " ".join(str(part) for part in cause.args).replace(str(made), "{out}")
            cause.args = (said,)
            raise


def _access(spec: CommandSpec, process: ConfinedMethod) -> Access:
    """Return what a command could see, for the record."""
    manifest = sha256(spec.scene / "capture" / "manifest.json")
    confined = process.process
    return Access(confined.guard, manifest, (), confined.refusals(), "", tuple(map(str, spec.allowed)))

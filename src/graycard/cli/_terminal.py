# SPDX-License-Identifier: Apache-2.0
"""The two streams that verbs write to, and the tables, files and progress that several of them need."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import fill
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    ProgressColumn,
    Task,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as ProgressBar
from rich.table import Table
from rich.text import Text

from graycard import __version__
from graycard.cli._log import logged
from graycard.io import Progress, printable, write_json

OK, FAILED = 0, 1
WIDE = 1000
"""Columns of what is no terminal."""


class _PrintableConsole(Console):
    """A console that shows control characters of names and messages as escapes, and does not obey them."""

    def render_str(self, text: str, **options: Any) -> Text:
        """Return a text ready to be printed, on its own or in the cell of a table."""
        return super().render_str(printable(text), **options)


def _console(stderr: bool) -> Console:
    """Return a console that cuts nothing off: in a file or a pipe its lines are as long as need be."""
    console = _PrintableConsole(stderr=stderr, soft_wrap=True, highlight=False, markup=False, emoji=False)
    if not console.is_terminal:
        console.width = WIDE
    return console


verb: ContextVar[str] = ContextVar("verb", default="")
"""The verb that runs."""


@dataclass(frozen=True, slots=True)
class Shell:
    """Frame that ``--json`` writes around a result that is no record of its own."""

    verb: str
    result: Any
    graycard: str = __version__
    format: str = "graycard-output"
    format_version: int = 1


@dataclass(frozen=True)
class Terminal:
    """The output of a verb: results on stdout, progress and advice on stderr."""

    out: Console = field(default_factory=lambda: _console(stderr=False))
    err: Console = field(default_factory=lambda: _console(stderr=True))

    def say(self, first: str, *more: str) -> None:
        """Print a line on stdout, and further ones indented; a terminal has them wrapped between words."""
        for text, indent in ((first, ""), *((line, "  ") for line in more)):
            whole = indent + text
            if self.out.is_terminal:
                whole = fill(
                    whole,
                    self.out.width,
                    subsequent_indent=f"{indent}  ",
                    break_long_words=False,
                    break_on_hyphens=False,
                )
            self.out.print(whole)

    def advise(self, advice: str) -> None:
        """Say how to get more out of this machine; an empty advice says nothing."""
        if advice:
            self.err.print(f"advice: {advice}")

    @contextmanager
    def progress(self, doing: str) -> Iterator[Progress]:
        """Show what is done, how far and how long, by a bar or by lines of a log, while a block runs.

        Args:
            doing: What is done on what, until the work says more.
        """
        if self.err.is_terminal:
            with _bar(self.err, doing) as report:
                yield report
        else:
            with logged(self.err, doing) as report:
                yield report


class _Doing(ProgressColumn):
    """Words on what is done: where a terminal is narrow they are cut, and the times are not."""

    def render(self, task: Task) -> Text:
        """Return the words, on one line."""
        return Text(task.description, overflow="ellipsis", no_wrap=True)


@contextmanager
def _bar(console: Console, doing: str) -> Iterator[Progress]:
    """Show a bar for the length of a block: what, how far, since when and for how long still."""
    columns = (
        _Doing(),
        BarColumn(bar_width=console.width // 8),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("left", style="dim"),
        TimeRemainingColumn(),
    )
    with ProgressBar(*columns, console=console, transient=True) as bar:
        task = bar.add_task(printable(doing), total=1.0)

        def report(done: float, doing: str, /) -> None:
            bar.update(task, completed=done, description=printable(doing))

        yield report


def new_table(*heads: str) -> Table:
    """Return a table without lines whose cells wrap rather than lose their ends."""
    table = Table(box=None, pad_edge=False)
    for head in heads:
        table.add_column(head, overflow="fold")
    return table


def write_optional_json(path: Path | None, value: Any) -> None:
    """Write what a verb has found to a file, if one was asked for: a record as it is, all else in a shell.

    Every such file has ``format`` and ``format_version``; in a shell, ``result`` holds the value.
    """
    if path is None:
        return
    is_record = hasattr(value, "format") and hasattr(value, "format_version")
    write_json(path, value if is_record else Shell(verb.get(), value))

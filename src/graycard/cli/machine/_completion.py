# SPDX-License-Identifier: Apache-2.0
"""The verb that lets a shell complete verbs and options."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Literal

import tyro

from graycard.cli._parse import write_completion
from graycard.cli._terminal import OK, Terminal


@dataclass(frozen=True)
class CompletionCommand:
    """Print what lets a shell complete verbs and options. Keep it where the shell looks: of bash
    ~/.local/share/bash-completion/completions/graycard, of zsh a folder of $fpath as _graycard, of fish
    ~/.config/fish/completions/graycard.fish; a new shell then knows it.
    """

    shell: Annotated[Literal["bash", "zsh", "fish"], tyro.conf.Positional]
    """Your shell."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Print it; tyro writes it from the same dataclasses that it parses by."""
        with suppress(SystemExit):  # tyro ends the program once it has written
            write_completion(["--tyro-write-completion", self.shell, "-"])
        return OK

# SPDX-License-Identifier: Apache-2.0
"""Export a saved decomposition."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from graycard._errors import GraycardError
from graycard.cli._terminal import OK, Terminal

if TYPE_CHECKING:
    from graycard.methods.trained import SplatFormat


def export_surfels(folder: Path, kind: SplatFormat, out: Path, terminal: Terminal) -> int:
    """Write the surfels of a saved decomposition to a file.

    Raises:
        GraycardError: There are none, or the file is a folder.
    """
    from graycard.methods.trained import write_splat
    from graycard.methods.viewer import saved_surfels

    if out.is_dir():
        raise GraycardError(f"expected a file to write to, got the folder {out}. Name a file in it")
    surfels = saved_surfels(folder)
    write_splat(out, surfels, kind)
    terminal.out.print(f"export: {out} as {kind}, {len(surfels)} surfels")
    return OK

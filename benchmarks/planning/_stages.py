# SPDX-License-Identifier: Apache-2.0
"""The folder of a run in which fits leave stages for others; several benches may use it at a time."""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from graycard.benchmarks._jobs import FitJob
from graycard.io import lock_words, remove_unheld, used_folder, writable_folder

STAGES = "stages"
"""Its name. Below it are ``<code>/<capture>-<threads>``."""


@contextmanager
def staging(run: Path) -> Iterator[None]:
    """Keep the stages of a run in place for the time of the block, whichever bench ends meanwhile.

    Raises:
        OutputError: The folder cannot be made.
    """
    with used_folder(run / STAGES) as folder:
        writable_folder(folder)
        yield


def clear_stages(run: Path, plan: Sequence[FitJob]) -> None:
    """Remove the stages of a run, unless another bench uses them: the last one removes them.

    A fit that is under way may write to its folder alone: it could not make that anew. Where no lock tells
    that another machine is at work, folders stay, and files go. A fit makes a stage again that it lacks.

    Args:
        run: The run folder.
        plan: Fits that are done.
    """
    if not remove_unheld(run / STAGES, shutil.rmtree) and lock_words(run):
        for folder in {job.stages for job in plan if job.stages is not None}:
            for path in folder.glob("[!.]*"):  # hidden ones are partial files, which another bench may write
                with suppress(OSError):
                    path.unlink()

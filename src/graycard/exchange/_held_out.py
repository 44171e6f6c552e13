# SPDX-License-Identifier: Apache-2.0
"""Keep the photographs of held-out views beside an imported capture, where no method sees them."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from graycard._held_out import PHOTOGRAPHS
from graycard.exchange._cameras import PosedPhotograph
from graycard.exchange._photographs import read_photograph
from graycard.io import Manifest, atomic_folder, remove, write_manifest, write_rgb


def write_held_out(folder: Path, shots: Sequence[PosedPhotograph], capture: Manifest) -> None:
    """Write photographs as linear light; nothing is written where there are none.

    Args:
        folder: Where to; what an import that was cut off has left there goes.
        shots: The held-out ones that have a photograph.
        capture: Manifest of their capture.

    Raises:
        DatasetError: A photograph is broken.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    remove(folder)
    if not shots:
        return
    with atomic_folder(folder) as partial:
        for shot in shots:
            linear = read_photograph(shot.image, shot.camera.width, shot.camera.height)
            write_rgb(partial / f"{PHOTOGRAPHS}/{shot.name}.exr", linear)
        write_manifest(partial, replace(capture, format="graycard-held-out"))

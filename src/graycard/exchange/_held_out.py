# SPDX-License-Identifier: Apache-2.0
"""Keep the photographs of held-out views beside an imported capture, where no method sees them."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from graycard._held_out import PHOTOGRAPHS, SENSOR
from graycard._sensor import Sensor
from graycard.exchange._cameras import PosedPhotograph
from graycard.exchange._develop_pictures import FoundPictures, develop_held_out
from graycard.exchange._doctor import ImportRow
from graycard.io import Manifest, write_json, write_manifest, write_rgb


def write_held_out(
    folder: Path, found: FoundPictures, capture: Manifest, sensor: Sensor | None
) -> tuple[ImportRow, ...]:
    """Write photographs as linear light; nothing is written where there are none.

    Args:
        folder: Where to: a part of a scene that is not yet whole.
        found: The photographs.
        capture: Manifest of their capture.
        sensor: Their exposures; None where all are taken as exposed alike.

    Returns:
        Rows about their pixels.

    Raises:
        DatasetError: A photograph is broken.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    if not found.held:
        return ()

    def keep(shot: PosedPhotograph, light: np.ndarray) -> None:
        write_rgb(folder / f"{PHOTOGRAPHS}/{shot.name}.exr", light, quick=shot.keeps_pixels)

    rows = develop_held_out(found, keep)
    if sensor is not None:
        write_json(folder / SENSOR, sensor)
    write_manifest(folder, replace(capture, format="graycard-held-out"))
    return rows

# SPDX-License-Identifier: Apache-2.0
"""Photographs of held-out views of an imported capture: what a real scene can be judged by without truth."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from graycard._capture import Capture, View, file_of, of_size
from graycard._errors import DatasetError
from graycard._sensor import Sensor
from graycard.io import read_rgb

HELD_OUT = "held_out"
"""Folder beside the capture, which no method sees."""
PHOTOGRAPHS = "photographs"
SENSOR = "sensor.json"
"""Exposures of held-out photographs, beside them."""


@dataclass(frozen=True, slots=True)
class HeldOut:
    """The photographs that were held out of a capture. They are no truth: light and nothing else is known."""

    capture: Capture
    """Opened, with the cameras and the exposure."""
    views: tuple[View, ...]
    """Held-out views that have a photograph."""
    root: Path
    sha256: str
    """Hash of the manifest, which holds the hash of each file."""
    sensor: Sensor | None = None
    """Exposures of the photographs, as EXIF tells them; None where all are taken as exposed alike."""

    @property
    def lacking(self) -> tuple[View, ...]:
        """Held-out views without a photograph, which are not judged."""
        known = {view.name for view in self.views}
        return tuple(view for view in self.capture.test if view.name not in known)

    def exposure(self, view: View) -> float:
        """Return the factor on the capture's exposure with which a photograph was taken: it ends at white."""
        return 1.0 if self.sensor is None else self.sensor.exposure(view.name)

    def photograph(self, view: View) -> np.ndarray:
        """Return the linear photograph of a held-out view, shape ``(H, W, 3)``, float32, in the capture's
        unit.

        Raises:
            DatasetError: It has none, or the file is broken or of another size than the camera.
        """
        if view not in self.views:
            raise DatasetError(f"expected a held-out view with a photograph, got {view.name}")
        path = file_of(self.root, f"{PHOTOGRAPHS}/{view.name}.exr")
        return of_size(read_rgb(path), view, path)

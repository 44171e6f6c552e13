# SPDX-License-Identifier: Apache-2.0
"""Captures: views, photographs, granted masks and sparse points."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from graycard._camera import Camera
from graycard._errors import DatasetError, UnknownNameError
from graycard._sensor import Sensor
from graycard.io import IN_MEMORY, Name, inside, read_layers, read_rgb
from graycard.points import Points, no_points, read_points

POINTS = "points.ply"
"""Sparse points, beside the index of a capture."""

Split = Literal["train", "test"]


@dataclass(frozen=True, slots=True)
class View:
    """One camera of a scene. A method fits on ``train`` views and is scored on ``test`` views."""

    name: Name
    split: Split
    camera: Camera


@dataclass(frozen=True, slots=True)
class Capture:
    """Data of a user with a camera: linear photographs, cameras, granted masks. Never truth."""

    track: Name
    scene: Name
    views: tuple[View, ...]
    exposure: float
    """Factor that brings radiance to display range: the 99th percentile of the training photographs
    becomes 1. All images of a scene are shown and compared with this one factor."""
    light_on_camera: bool
    """True if the scene is lit by a light that moves with the camera."""
    target: int | None = None
    """The object id that the removal task names, if there is one; its mask is granted on training views."""
    sensor: Sensor | None = None
    """The camera's bits, noise and exposures; None for photographs as rendered, or where nobody says."""
    root: Path | None = field(default=None, metadata=IN_MEMORY)
    """Folder of the files."""

    @property
    def train(self) -> tuple[View, ...]:
        """The views with a photograph."""
        return tuple(v for v in self.views if v.split == "train")

    @property
    def test(self) -> tuple[View, ...]:
        """The held-out views: camera only."""
        return tuple(v for v in self.views if v.split == "test")

    def view(self, name: str) -> View:
        """Return the view of a name.

        Raises:
            UnknownNameError: There is none.
        """
        return find_view(self.views, name)

    def photograph(self, view: View) -> np.ndarray:
        """Return the linear photograph of a training view, shape ``(H, W, 3)``, float32, W/m²/sr.

        Where there is a ``sensor``, its exposure is divided out again: what is at its white may be brighter.

        Raises:
            DatasetError: The view is held out, or the file is missing, broken or of another size than the
                camera.
        """
        if view.split != "train":
            raise DatasetError(f"expected a training view, got {view.name}: its photograph is held out")
        path = file_of(self.root, f"photographs/{view.name}.exr")
        return of_size(read_rgb(path), view, path)

    def points(self) -> Points:
        """Sparse points, as structure from motion finds them; none where the capture holds none.

        Raises:
            DatasetError: The file is broken, or names a view that the capture has not.
        """
        path = file_of(self.root, POINTS)
        found = read_points(path) if path.is_file() else no_points()
        if len(found.view) and not (found.view.min() >= 0 and found.view.max() < len(self.views)):
            raise DatasetError(f"expected views 0 to {len(self.views) - 1} in {path}, got {found.view.max()}")
        return found

    def target_mask(self, view: View) -> np.ndarray:
        """Return where a training view sees the target object, shape ``(H, W)``, bool.

        Raises:
            DatasetError: The scene has no target, the view is held out, or the file is broken, of another
                object or of another size than the camera.
        """
        if self.target is None or view.split != "train":
            raise DatasetError(f"expected a training view of a scene with a target, got {view.name}")
        path = file_of(self.root, f"masks/target/{view.name}.exr")
        layers = read_layers(path)
        if "object_id" not in layers:
            raise DatasetError(f"expected object_id in {path}, got {', '.join(sorted(layers)) or 'nothing'}")
        ids = layers["object_id"]
        others = sorted(set(np.unique(ids).tolist()) - {0, self.target})
        if others:
            raise DatasetError(
                f"expected object {self.target}, the target of the capture, or 0 in {path}, got "
                f"{', '.join(map(str, others[:4]))}. Write the masks of the object that is to be removed"
            )
        return of_size(ids > 0, view, path)


def of_size(image: np.ndarray, view: View, path: Path) -> np.ndarray:
    """Return the image ``(H, W, ...)`` of a file, if it is as large as the camera of its view.

    Raises:
        DatasetError: It is larger or smaller.
    """
    height, width = image.shape[:2]
    if (width, height) != (view.camera.width, view.camera.height):
        raise DatasetError(
            f"expected {path} to be {view.camera.width}x{view.camera.height} pixels, as its camera is, got "
            f"{width}x{height}. Render the scene again, or import it anew"
        )
    return image


def find_view(views: tuple[View, ...], name: str) -> View:
    """Return the view of a name.

    Raises:
        UnknownNameError: There is none.
    """
    for view in views:
        if view.name == name:
            return view
    raise UnknownNameError("view", name, (v.name for v in views))


def file_of(root: Path | None, name: str) -> Path:
    """Return a file of a capture or a truth that was opened.

    Raises:
        DatasetError: It is in memory only, or the name leads out of the folder.
    """
    if root is None:
        raise DatasetError("expected a capture or truth that was opened from a folder, got one in memory")
    return inside(root, name, error=DatasetError) if name else root

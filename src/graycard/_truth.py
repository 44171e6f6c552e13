# SPDX-License-Identifier: Apache-2.0
"""Truth of a scene: the true layers of each view, the lights, and pictures under other lights."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from graycard._capture import View, file_of, find_view, of_size
from graycard._errors import DatasetError
from graycard.edits import COMPOSITION, Composition, LightEdit, composed_file, find_edit
from graycard.io import IN_MEMORY, Label, Name, from_builtins, read_json, read_layers, read_rgb
from graycard.layers import with_geometry
from graycard.lights import EnvironmentLight, Light, check_finite, read_lights


@dataclass(frozen=True, slots=True)
class SceneObject:
    """One object of a scene; ``object_id`` layers hold its id."""

    id: int
    """1 or more; 0 is where nothing is seen."""
    name: Label
    emits: bool
    """True if it is the surface of a light."""


@dataclass(frozen=True, slots=True)
class Truth:
    """Everything exact about a scene, with the variance of what is estimated."""

    track: Name
    scene: Name
    views: tuple[View, ...]
    exposure: float
    diameter: float
    """Diagonal of the box around the cameras and what they see, metres: the yardstick of positions."""
    objects: tuple[SceneObject, ...]
    target: int | None = None
    noise_ceiling: float | None = None
    """dB: PSNR, as displayed, of noise-free pictures of all views against those of the truth. No method can
    score more but by chance. None where it was not measured."""
    photograph_ceiling: float | None = None
    """dB: the same of training views alone, where these have light paths of their own number. Then
    :attr:`noise_ceiling` is that of held-out views alone. None where all views have the same."""
    edits: tuple[LightEdit, ...] = ()
    """Changes of the lights under which the held-out views are known."""
    root: Path | None = field(default=None, metadata=IN_MEMORY)
    """Folder of the files."""

    def view(self, name: str) -> View:
        """Return the view of a name.

        Raises:
            UnknownNameError: There is none.
        """
        return find_view(self.views, name)

    def layers(self, view: View, *, derive: bool = True) -> dict[str, np.ndarray]:
        """All true layers of a view by name, each ``(H, W)`` or ``(H, W, 3)``.

        Args:
            view: Of this truth.
            derive: Make ``distance`` and ``position`` from depth and camera where the file has none.

        Raises:
            DatasetError: The file is missing, broken or of another size than the camera. Later: a layer is
                asked for that it has not.
        """
        path = file_of(self.root, f"views/{view.name}.exr")
        found = _true_layers(path, view)
        return _named(with_geometry(found, view.camera), path) if derive else found

    def lights(self) -> tuple[Light, ...]:
        """Return the exact lights.

        Raises:
            DatasetError: The file is missing or broken.
        """
        return _finite_lights(file_of(self.root, "lights.json"))

    def environment(self, light: EnvironmentLight) -> np.ndarray:
        """Return the image of one of :meth:`lights`, shape ``(H, W, 3)``, float32, radiance in W/m²/sr.

        Raises:
            DatasetError: The file is missing or broken.
        """
        return read_rgb(file_of(self.root, light.image))

    def relit(self, edit: str, view: View) -> dict[str, np.ndarray]:
        """Return a held-out view under changed lights: ``radiance`` with its variance and both its halves.

        Args:
            edit: Name of one of :attr:`edits`.
            view: A ``test`` view.

        Returns:
            Layers by name, each ``(H, W, 3)``, float32.

        Raises:
            UnknownNameError: There is no such edit.
            DatasetError: It is a training view, or the file is missing or broken.
        """
        found = find_edit(self.edits, edit)
        _refuse_training(view)
        return _true_layers(file_of(self.root, found.view_file(view.name)), view)

    def relit_lights(self, edit: str) -> tuple[Light, ...]:
        """Return the exact lights of an edit; the image of an environment lies beside their file.

        Raises:
            UnknownNameError: There is no such edit.
            DatasetError: The file is missing or broken.
        """
        return _finite_lights(file_of(self.root, f"{find_edit(self.edits, edit).folder}/lights.json"))

    def composition(self) -> Composition | None:
        """Return the object of another scene that is put into this one; None where none is.

        Raises:
            DatasetError: The file is broken.
        """
        path = file_of(self.root, f"{COMPOSITION}/composition.json")
        if not path.is_file():
            return None
        return from_builtins(Composition, read_json(path, DatasetError), DatasetError, str(path))

    def composed(self, view: View) -> dict[str, np.ndarray]:
        """Return a held-out view with the object of :meth:`composition` in it.

        Returns:
            ``radiance`` with its variance and both its halves, ``(H, W, 3)``, and ``object_id``, ``(H, W)``.

        Raises:
            DatasetError: It is a training view, or the file is missing or broken.
        """
        _refuse_training(view)
        return _true_layers(file_of(self.root, composed_file(view.name)), view)

    def emitter_ids(self) -> frozenset[int]:
        """Ids of the objects that are surfaces of lights."""
        return frozenset(o.id for o in self.objects if o.emits)


class _TrueLayers(dict[str, np.ndarray]):
    """Layers by name; whoever asks for one that the file has not is told which file lacks it."""

    path: Path

    def __missing__(self, name: str) -> np.ndarray:
        raise DatasetError(
            f"expected {name} in {self.path}, got {', '.join(sorted(self)) or 'nothing'}. Render the scene "
            "again"
        )


def _true_layers(path: Path, view: View) -> dict[str, np.ndarray]:
    found = read_layers(path)
    of_size(next(iter(found.values())), view, path)
    return _named(found, path)


def _named(layers: Mapping[str, np.ndarray], path: Path) -> _TrueLayers:
    found = _TrueLayers(layers)
    found.path = path
    return found


def _finite_lights(path: Path) -> tuple[Light, ...]:
    lights = read_lights(path)
    check_finite(lights, str(path))
    return lights


def _refuse_training(view: View) -> None:
    if view.split != "test":
        raise DatasetError(f"expected a held-out view, got {view.name}: only those are known changed")

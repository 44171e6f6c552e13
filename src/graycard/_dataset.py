# SPDX-License-Identifier: Apache-2.0
"""One scene on disk: ``capture/`` is what a method may see, ``truth/`` is what it is judged by.

DATASET/<track>/<scene>/capture/  manifest.json capture.json points.ply photographs/ masks/<mask>/<view>.exr
DATASET/<track>/<scene>/truth/    manifest.json truth.json lights.json [environment.exr] views/<view>.exr
                                  relighting/<edit>/{lights.json [environment.exr] views/<view>.exr}
                                  [composition/{composition.json views/<view>.exr}]
"""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from graycard._camera import Camera
from graycard._edits import COMPOSITION, Composition, LightEdit, composed_file, find_edit
from graycard._errors import DatasetError, UnknownNameError
from graycard._exr import read_layers, read_rgb
from graycard._json import IN_MEMORY, decode, read_json, write_json
from graycard._lights import Light, light_from_json, light_to_json
from graycard._manifest import MANIFEST, Manifest, check_files, read_manifest
from graycard._points import Points, no_points, read_points
from graycard._sensor import Sensor

TRACKS = ("dark", "tabletop", "multilight")

IMPORTER = "graycard.import"
"""Generator, in the manifest, of a capture that holds a user's own photographs: it has no truth."""

POINTS = "points.ply"
"""Sparse points, beside the index of a capture."""

Split = Literal["train", "test"]


@dataclass(frozen=True, slots=True)
class View:
    """One camera of a scene. A method fits on ``train`` views and is scored on ``test`` views."""

    name: str
    split: Split
    camera: Camera


@dataclass(frozen=True, slots=True)
class Capture:
    """What a user with a camera would have: linear photographs, cameras, granted masks. Never truth."""

    track: str
    scene: str
    views: tuple[View, ...]
    exposure: float
    """Factor that brings radiance to display range: the 99th percentile of the training photographs
    becomes 1. All images of a scene are shown and compared with this one factor."""
    light_on_camera: bool
    """Whether the scene is lit by a light that moves with the camera."""
    target: int | None = None
    """The object id that the removal task names, if there is one; its mask is granted on training views."""
    sensor: Sensor | None = None
    """The camera's bits, noise and exposures; None for photographs as rendered, or where nobody says."""
    root: Path | None = field(default=None, metadata=IN_MEMORY)
    """Where the files are."""

    @property
    def train(self) -> tuple[View, ...]:
        """The views with a photograph."""
        return tuple(v for v in self.views if v.split == "train")

    @property
    def test(self) -> tuple[View, ...]:
        """The held-out views: camera only."""
        return tuple(v for v in self.views if v.split == "test")

    def view(self, name: str) -> View:
        """The view of a name.

        Raises:
            UnknownNameError: There is none.
        """
        return _find_view(self.views, name)

    def photograph(self, view: View) -> np.ndarray:
        """The linear photograph of a training view, shape ``(H, W, 3)``, float32, W/m²/sr.

        Where there is a ``sensor``, its exposure is divided out again: what is at its white may be brighter.

        Raises:
            DatasetError: The view is held out, or the file is missing or broken.
        """
        if view.split != "train":
            raise DatasetError(f"expected a training view, got {view.name}: its photograph is held out")
        return read_rgb(_file(self.root, f"photographs/{view.name}.exr"))

    def points(self) -> Points:
        """Sparse points, as structure from motion finds them; none where the capture holds none.

        Raises:
            DatasetError: The file is broken, or names a view that the capture has not.
        """
        path = _file(self.root, POINTS)
        found = read_points(path) if path.is_file() else no_points()
        if len(found.view) and not (found.view.min() >= 0 and found.view.max() < len(self.views)):
            raise DatasetError(f"expected views 0 to {len(self.views) - 1} in {path}, got {found.view.max()}")
        return found

    def target_mask(self, view: View) -> np.ndarray:
        """Where a training view sees the target object, shape ``(H, W)``, bool.

        Raises:
            DatasetError: The scene has no target, the view is held out, or the file is broken.
        """
        if self.target is None or view.split != "train":
            raise DatasetError(f"expected a training view of a scene with a target, got {view.name}")
        return read_layers(_file(self.root, f"masks/target/{view.name}.exr"))["object_id"] > 0


@dataclass(frozen=True, slots=True)
class SceneObject:
    """One object of a scene; ``object_id`` layers hold its id."""

    id: int
    """1 or more; 0 is where nothing is seen."""
    name: str
    emits: bool
    """Whether it is the surface of a light."""


@dataclass(frozen=True, slots=True)
class Truth:
    """Everything exact about a scene, with the variance of what is estimated."""

    track: str
    scene: str
    views: tuple[View, ...]
    exposure: float
    diameter: float
    """Diagonal of the box around the cameras and what they see, metres: the yardstick of positions."""
    objects: tuple[SceneObject, ...]
    target: int | None = None
    noise_ceiling: float | None = None
    """dB: PSNR, as displayed, of noise-free pictures of all views against those of the truth. No method can
    score more but by chance. None where it was not measured."""
    edits: tuple[LightEdit, ...] = ()
    """Changes of the lights under which the held-out views are known."""
    root: Path | None = field(default=None, metadata=IN_MEMORY)
    """Where the files are."""

    def view(self, name: str) -> View:
        """The view of a name.

        Raises:
            UnknownNameError: There is none.
        """
        return _find_view(self.views, name)

    def layers(self, view: View) -> dict[str, np.ndarray]:
        """All true layers of a view by name, each ``(H, W)`` or ``(H, W, 3)``.

        Raises:
            DatasetError: The file is missing or broken.
        """
        return read_layers(_file(self.root, f"views/{view.name}.exr"))

    def lights(self) -> tuple[Light, ...]:
        """The exact lights.

        Raises:
            DatasetError: The file is missing or broken.
        """
        return read_lights(_file(self.root, "lights.json"))

    def relit(self, edit: str, view: View) -> dict[str, np.ndarray]:
        """A held-out view under changed lights: ``radiance`` with its variance and both its halves.

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
        return read_layers(_file(self.root, found.view_file(view.name)))

    def relit_lights(self, edit: str) -> tuple[Light, ...]:
        """The exact lights of an edit; the image of an environment lies beside their file.

        Raises:
            UnknownNameError: There is no such edit.
            DatasetError: The file is missing or broken.
        """
        return read_lights(_file(self.root, f"{find_edit(self.edits, edit).folder}/lights.json"))

    def composition(self) -> Composition | None:
        """The object of another scene that is put into this one; None where none is.

        Raises:
            DatasetError: The file is broken.
        """
        path = _file(self.root, f"{COMPOSITION}/composition.json")
        if not path.is_file():
            return None
        return decode(Composition, read_json(path, DatasetError), DatasetError, str(path))

    def composed(self, view: View) -> dict[str, np.ndarray]:
        """A held-out view with the object of :meth:`composition` in it.

        Returns:
            ``radiance`` with its variance and both its halves, ``(H, W, 3)``, and ``object_id``, ``(H, W)``.

        Raises:
            DatasetError: It is a training view, or the file is missing or broken.
        """
        _refuse_training(view)
        return read_layers(_file(self.root, composed_file(view.name)))

    def emitter_ids(self) -> frozenset[int]:
        """Ids of the objects that are surfaces of lights."""
        return frozenset(o.id for o in self.objects if o.emits)


def open_capture(folder: Path, *, check: bool = True) -> Capture:
    """The capture in ``folder`` (``.../<scene>/capture``).

    Args:
        folder: The capture folder.
        check: Compare every file with its SHA-256 first.

    Raises:
        DatasetError: It is missing, half-written, damaged, or of a newer format.
    """
    return _open(Capture, Path(folder), "capture", check)


def open_truth(folder: Path, *, check: bool = True) -> Truth:
    """The truth in ``folder`` (``.../<scene>/truth``).

    Args:
        folder: The truth folder.
        check: Compare every file with its SHA-256 first.

    Raises:
        DatasetError: It is missing (an imported capture has none), half-written, damaged, or of a newer
            format.
    """
    _refuse_imported(Path(folder))
    return _open(Truth, Path(folder), "truth", check)


def write_index(folder: Path, content: Capture | Truth) -> None:
    """Write ``capture.json`` or ``truth.json``; the manifest is sealed after it."""
    name = "capture" if isinstance(content, Capture) else "truth"
    write_json(Path(folder) / f"{name}.json", content)


def read_lights(path: Path) -> tuple[Light, ...]:
    """The lights in a JSON list.

    Raises:
        DatasetError: The file is missing or broken, or a light has an unknown key or type.
    """
    data = read_json(path, DatasetError)
    if not isinstance(data, list):
        raise DatasetError(f"expected a JSON list of lights in {path}, got {type(data).__name__}")
    return tuple(light_from_json(item, DatasetError, str(path)) for item in data)


def write_lights(path: Path, lights: tuple[Light, ...]) -> None:
    """Write lights as a JSON list.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    write_json(path, [light_to_json(light) for light in lights])


def scene_folders(dataset: Path, track: str | None = None) -> list[Path]:
    """The folders ``<track>/<scene>`` in a dataset, sorted; half-written ones are left out."""
    tracks = TRACKS if track is None else (track,)
    folders = [p for t in tracks for p in sorted((Path(dataset) / t).glob("[!.]*"))]
    return [
        p for p in folders if all((p / part / "manifest.json").is_file() for part in ("capture", "truth"))
    ]


def capture_folders(dataset: Path) -> list[Path]:
    """The folders ``<track>/<scene>`` with a whole capture and a whole truth or none, sorted."""
    folders = [p for track in TRACKS for p in sorted((Path(dataset) / track).glob("[!.]*"))]
    parts = [(p, p / "capture" / MANIFEST, p / "truth") for p in folders]
    return [p for p, capture, truth in parts if capture.is_file() and _is_whole_or_absent(truth)]


def manifest_of(content: Capture | Truth) -> Manifest:
    """The manifest of an opened capture or truth."""
    kind = "graycard-capture" if isinstance(content, Capture) else "graycard-truth"
    return read_manifest(_file(content.root, ""), kind)


def _open(cls: type[Any], folder: Path, name: str, check: bool) -> Any:
    manifest = read_manifest(folder, f"graycard-{name}")
    if check:
        check_files(folder, manifest)
    path = folder / f"{name}.json"
    found = decode(cls, read_json(path, DatasetError), DatasetError, str(path))
    if (found.track, found.scene) != (manifest.track, manifest.scene):
        raise DatasetError(
            f"expected {path} to be of {manifest.track}/{manifest.scene}, as its manifest says, "
            f"got {found.track}/{found.scene}"
        )
    wanted = (
        {"train"} if cls is Capture else {"train", "test"}
    )  # photographs of a user may all be for training
    if not wanted <= {view.split for view in found.views}:
        raise DatasetError(
            f"expected {' and '.join(sorted(wanted))} views in {path}, got {len(found.views)} views"
        )
    return replace(found, root=folder)


def _is_whole_or_absent(folder: Path) -> bool:
    return not folder.exists() or (folder / MANIFEST).is_file()


def _refuse_imported(folder: Path) -> None:
    """Say that a capture of a user's own photographs has no truth.

    Raises:
        DatasetError: ``folder`` would be the truth beside such a capture.
    """
    capture = folder.parent / "capture"
    if folder.exists() or not (capture / MANIFEST).is_file():
        return
    if read_manifest(capture, "graycard-capture").generator.get("name") == IMPORTER:
        raise DatasetError(
            f"expected the truth of a rendered scene at {folder}, got an imported capture, which has no "
            "truth: it can be fitted by methods that need none and looked at, not scored. For scores, take a "
            "scene of `graycard render`"
        )


def _refuse_training(view: View) -> None:
    if view.split != "test":
        raise DatasetError(f"expected a held-out view, got {view.name}: only those are known changed")


def _find_view(views: tuple[View, ...], name: str) -> View:
    for view in views:
        if view.name == name:
            return view
    raise UnknownNameError("view", name, (v.name for v in views))


def _file(root: Path | None, name: str) -> Path:
    if root is None:
        raise DatasetError("expected a capture or truth that was opened from a folder, got one in memory")
    return root / name

# SPDX-License-Identifier: Apache-2.0
"""The folder that any method, in any language, hands in to be scored.

PREDICTIONS/predictions.json    who made it, for which scene
PREDICTIONS/views/<view>.exr    channels <layer>.<suffix>, linear, float32
PREDICTIONS/lights.json         optional: the lights that were found
PREDICTIONS/relighting/<edit>/views/<view>.exr   optional: held-out views under changed lights
PREDICTIONS/composition/views/<view>.exr         optional: held-out views with an object put in
PREDICTIONS/environments/       optional: images of environments among them, or where lights.json says
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from graycard._errors import GraycardError, OutputError, PredictionError
from graycard.edits import COMPOSITION, RELIGHTING, composed_file, relit_file
from graycard.io import (
    IN_MEMORY,
    KnownLayers,
    Label,
    Name,
    RelativePath,
    check_version,
    from_builtins,
    inside,
    read_json,
    read_known_layers,
    read_rgb,
    remove,
    sha256,
    sha256_of_files,
    unknown_channels,
    writable_folder,
    write_json,
    write_layers,
    write_rgb,
)
from graycard.layers import find_codes
from graycard.lights import EnvironmentLight, Light, read_lights, write_lights

INDEX, LIGHTS, VIEWS, ENVIRONMENTS = "predictions.json", "lights.json", "views", "environments"
FOLDERS = (VIEWS, ENVIRONMENTS, RELIGHTING, COMPOSITION)
PREDICTIONS_VERSION = 1


@dataclass(frozen=True, slots=True)
class Predictions:
    """Statements of a method about a scene."""

    method: Label
    track: Name
    scene: Name
    format: str = "graycard-predictions"
    format_version: int = PREDICTIONS_VERSION
    files: Mapping[RelativePath, str] = field(default_factory=dict)
    """SHA-256 by relative path; optional, and checked where it is given."""
    root: Path | None = field(default=None, metadata=IN_MEMORY)
    hashes: Mapping[str, str] | None = field(default=None, repr=False, compare=False, metadata=IN_MEMORY)
    """SHA-256 of all files as :meth:`hashed` found them; None where each is hashed when it is read."""

    def view_names(self) -> list[str]:
        """Names of the views that have a file."""
        return sorted(p.stem for p in (self._root / VIEWS).glob("*.exr"))

    def layers(self, view: str) -> dict[str, np.ndarray]:
        """Return all predicted layers of a view that can be used, each ``(H, W)`` or ``(H, W, 3)``, by name.

        Raises:
            PredictionError: As for :meth:`known_layers`.
        """
        return dict(self.known_layers(view).layers)

    def known_layers(self, view: str) -> KnownLayers:
        """Return the predicted layers of a view, and why some cannot be used.

        Channels that belong to no layer are passed over; :meth:`unknown_channels` names them.

        Raises:
            PredictionError: The file is missing or broken, has no layer that is known, or was changed
                after its hash was taken.
        """
        path = inside(self._root, VIEWS, f"{view}.exr", error=PredictionError)
        if not path.is_file():
            have = ", ".join(self.view_names()) or "none"
            raise PredictionError(
                f"expected a prediction for view {view!r} at {path}, got none. Present: {have}"
            )
        self._check_hash(path)
        return read_known_layers(path, PredictionError)

    def unknown_channels(self) -> dict[str, str]:
        """Return the channels in files of views and changed views that belong to no layer.

        Returns:
            By name of the channel: the name that was perhaps meant, or an empty one.
        """
        folders = (self._root / folder for folder in (VIEWS, RELIGHTING, COMPOSITION))
        files = (path for folder in folders for path in sorted(folder.rglob("*.exr")))
        found: dict[str, str] = {}
        for path in files:
            found |= unknown_channels(path)
        return found

    def relit(self, edit: str, view: str) -> dict[str, np.ndarray] | None:
        """Return the predicted picture of a held-out view under changed lights: ``radiance``, ``(H, W, 3)``.

        Args:
            edit: Name of the change, as in :attr:`graycard.Truth.edits`.
            view: Name of the view.

        Returns:
            None where the method provides none.

        Raises:
            PredictionError: As for :meth:`known_layers`, or radiance cannot be used.
        """
        return self._optional(relit_file(edit, view))

    def composed(self, view: str) -> dict[str, np.ndarray] | None:
        """Return the predicted picture of a held-out view with an object of another scene: ``radiance``.

        Returns:
            None where the method provides none.

        Raises:
            PredictionError: As for :meth:`known_layers`, or radiance cannot be used.
        """
        return self._optional(composed_file(view))

    def _optional(self, name: str) -> dict[str, np.ndarray] | None:
        path = inside(self._root, name, error=PredictionError)
        if not path.is_file() and name not in self.files:
            return None
        self._check_hash(path)
        found = read_known_layers(path, PredictionError)
        if fault := found.faults.get("radiance"):
            raise PredictionError(fault)
        return dict(found.layers)

    def lights(self) -> tuple[Light, ...] | None:
        """Return the predicted lights; None where the method provides none.

        Raises:
            PredictionError: The file is broken or was changed after its hash was taken, or a light has an
                unknown key or type.
        """
        path = inside(self._root, LIGHTS, error=PredictionError)
        if not path.is_file() and LIGHTS not in self.files:
            return None
        self._check_hash(path)
        try:
            return read_lights(path)
        except GraycardError as cause:
            raise PredictionError(str(cause)) from cause

    def environment(self, light: EnvironmentLight) -> np.ndarray:
        """Return the image of one of :meth:`lights`, shape ``(H, W, 3)``, float32, radiance in W/m²/sr.

        Raises:
            PredictionError: The file is missing or broken, lies outside of the folder, was changed after its
                hash was taken, or holds values that are not finite or below 0.
        """
        path = inside(self._root, light.image, error=PredictionError)
        self._check_hash(path)
        values = read_rgb(path, PredictionError)
        if not (values >= 0).all() or not np.isfinite(values).all():
            raise PredictionError(f"expected finite radiance of 0 or more in {path}, got other values")
        return values

    def hashed(self) -> tuple["Predictions", str]:
        """Hash all files now, once.

        Returns:
            The same predictions, which hold these hashes against the index when a file is read and do not
            hash it again: what changes from now on is not seen. And :func:`predictions_hash` of the folder.
        """
        hashes = sha256_of_files(self._root)
        return replace(self, hashes=hashes), _hash_of_hashes(hashes)

    def is_whole(self) -> bool:
        """Return whether the files are exactly those that the index lists, as they were written."""
        return sha256_of_files(self._root, skip=lambda name: name == INDEX) == dict(self.files)

    def _check_hash(self, path: Path) -> None:
        """Prove that a file is the one that the index lists, if it lists it."""
        name = path.relative_to(self._root).as_posix()
        listed = self.files.get(name)
        if self.hashes is not None:
            found = self.hashes.get(name, "none")
        else:
            found = sha256(path) if path.is_file() else "none"
        if listed is not None and found != listed:
            raise PredictionError(
                f"expected {path} with SHA-256 {listed[:12]}…, got {found[:12]}: it changed after {INDEX} "
                "was written. Write the predictions again"
            )

    @property
    def _root(self) -> Path:
        if self.root is None:
            raise PredictionError("expected predictions that were opened from a folder, got some in memory")
        return self.root


def open_predictions(folder: Path) -> Predictions:
    """Return the predictions in a folder.

    Raises:
        PredictionError: There is no index, it is of another format, or it has an unknown key.
    """
    path = Path(folder) / INDEX
    if not path.is_file():
        raise PredictionError(
            f"expected a predictions folder with {INDEX} at {folder}, got "
            f"{'a folder without it' if Path(folder).is_dir() else 'nothing'}. See docs/reference/formats.md"
        )
    data = read_json(path, PredictionError)
    check_version(data, PREDICTIONS_VERSION, path, PredictionError)
    found = from_builtins(Predictions, data, PredictionError, str(path))
    if found.format != "graycard-predictions":
        raise PredictionError(f"expected graycard-predictions in {path}, got {found.format}")
    return replace(found, root=Path(folder))


def clear_predictions(folder: Path) -> Path:
    """Make room for predictions: older ones go, index first; anything else in the folder is not ours.

    Raises:
        OutputError: The folder holds something else, or cannot be written to.
    """
    folder = Path(folder)
    check_room(folder)
    writable_folder(folder)
    for name in (INDEX, LIGHTS, *FOLDERS):
        remove(folder / name)
    return folder


def check_room(folder: Path) -> None:
    """Prove that a folder is free or holds predictions and nothing else.

    Raises:
        OutputError: It holds something else.
    """
    folder = Path(folder)
    names = [p.name for p in folder.iterdir() if not p.name.startswith(".")] if folder.is_dir() else []
    foreign = sorted(set(names) - {INDEX, LIGHTS, *FOLDERS})
    if foreign:
        raise OutputError(
            f"expected {folder} to be free or to hold predictions, got {', '.join(foreign[:3])} in it. "
            "Choose another output folder"
        )


def write_view(folder: Path, view: str, layers: Mapping[str, np.ndarray]) -> None:
    """Write the predicted layers of one view.

    Args:
        folder: The predictions folder.
        view: Name of the view, as in the capture.
        layers: By layer name, each ``(H, W)`` or ``(H, W, 3)``, linear. Pixels that are not judged may hold
            anything; one that is judged and not finite fails the scores of its layer.

    Raises:
        UnknownNameError: A layer is not in the vocabulary.
        ValueError: An array has a shape that its layer has not, or holds whole numbers, as 8-bit codes.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    for name, values in layers.items():
        _refuse_codes(view, name, values)
    write_layers(inside(folder, VIEWS, f"{view}.exr"), layers)


def _refuse_codes(where: str, layer: str, values: np.ndarray) -> None:
    """Raise ValueError for an image of whole numbers, in which 0 to 255 would be taken for 0 to 1."""
    if fault := find_codes(layer, np.asarray(values)):
        raise ValueError(f"{where}: {fault}")


def write_environment(folder: Path, light: EnvironmentLight, image: np.ndarray) -> EnvironmentLight:
    """Write the image of a predicted environment.

    Args:
        folder: The predictions folder.
        light: Whose image it is.
        image: shape ``(H, W, 3)``, latitude-longitude, radiance in W/m²/sr.

    Returns:
        The light with the path of its image: what belongs into ``lights.json``.

    Raises:
        ValueError: The array has another shape, or holds whole numbers, as 8-bit codes.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    _refuse_codes(light.name, "radiance", image)
    path = f"{ENVIRONMENTS}/{light.name}.exr"
    write_rgb(inside(folder, path), image)
    return replace(light, image=path)


def write_relit(folder: Path, edit: str, view: str, radiance: np.ndarray) -> None:
    """Write a picture of a held-out view under changed lights.

    Args:
        folder: The predictions folder.
        edit: Name of the change: ``truth/relighting/<edit>/lights.json`` are the lights after it.
        view: Name of the view, as in the capture.
        radiance: ``(H, W, 3)``, linear, W/m²/sr.

    Raises:
        ValueError: The array has another shape, or holds whole numbers, as 8-bit codes.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    _refuse_codes(f"{edit}, {view}", "radiance", radiance)
    write_layers(inside(folder, relit_file(edit, view)), {"radiance": radiance})


def write_composed(folder: Path, view: str, radiance: np.ndarray) -> None:
    """Write a picture of a held-out view with the object of ``truth/composition/composition.json`` in it.

    Args:
        folder: The predictions folder.
        view: Name of the view, as in the capture.
        radiance: ``(H, W, 3)``, linear, W/m²/sr.

    Raises:
        ValueError: The array has another shape, or holds whole numbers, as 8-bit codes.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    _refuse_codes(f"composition, {view}", "radiance", radiance)
    write_layers(inside(folder, composed_file(view)), {"radiance": radiance})


def finish_predictions(
    folder: Path, predictions: Predictions, lights: tuple[Light, ...] | None = None
) -> None:
    """Write the lights and, last, the index with the hash of each file: now the folder is whole."""
    if lights is not None:
        write_lights(Path(folder) / LIGHTS, lights)
    files = sha256_of_files(Path(folder), skip=lambda name: name == INDEX)
    write_json(Path(folder) / INDEX, replace(predictions, files=files))


def predictions_hash(folder: Path) -> str:
    """SHA-256 of what ``sha256sum`` prints for the files of a predictions folder, sorted by name."""
    return _hash_of_hashes(sha256_of_files(Path(folder)))


def _hash_of_hashes(hashes: Mapping[str, str]) -> str:
    lines = "".join(f"{value}  {name}\n" for name, value in hashes.items())
    return hashlib.sha256(lines.encode()).hexdigest()

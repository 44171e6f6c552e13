# SPDX-License-Identifier: Apache-2.0
"""Keep half-made scenes apart from whole ones, so that no half-made one is ever read.

Pictures are rendered into ``.<scene>.partial/truth/scene``, and a stamp beside it says for which spec.
When all are there, the capture is derived from the truth, both are sealed, and the folder is moved
to its final place in one step. A damaged scene goes back to being a partial one.
"""

import os
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from graycard import DatasetError, NewerFormatError, OutputError, RecordError
from graycard.io import damaged_files, read_json, read_layers, read_manifest, write_json

_PARTS = ("capture", "truth")


@dataclass(frozen=True, slots=True)
class Place:
    """Folders of a scene in a dataset."""

    dataset: Path
    track: str
    scene: str

    @property
    def final(self) -> Path:
        """The folder of the whole scene."""
        return self.dataset / self.track / self.scene

    @property
    def work(self) -> Path:
        """The hidden folder of all that is not whole; a listing of scenes does not look so deep."""
        return self.dataset / self.track / f".{self.scene}.partial"

    @property
    def partial(self) -> Path:
        """The scene in the making; closed to fits as truth is, by the name of the folder around it."""
        return self.work / "truth" / "scene"

    @property
    def stamp(self) -> Path:
        """The file that says which spec the scene in the making is of, its seed included: closed as well."""
        return self.work / "truth" / "stamp.json"

    @property
    def lock(self) -> Path:
        """The file that the process holds which makes the scene."""
        return self.dataset / self.track / f".{self.scene}.lock"

    def aside(self, token: str) -> Path:
        """Return a folder for pictures that one of several processes renders; closed as well."""
        return self.work / "truth" / f"aside-{token}"

    @property
    def replaced(self) -> Path:
        """Folder in which a broken scene waits until the new one is whole."""
        return self.work / "replaced"


def view_file(view: str) -> str:
    """Return the file of a view's true layers, relative to the truth."""
    return f"views/{view}.exr"


def damage(place: Place) -> dict[str, str]:
    """Return what is wrong with the files of a final folder, by path relative to it; empty if it is whole.

    Raises:
        NewerFormatError: It is of a newer format.
    """
    faults: dict[str, str] = {}
    for part in _PARTS:
        folder = place.final / part
        try:
            manifest = read_manifest(folder, f"graycard-{part}")
        except NewerFormatError:
            raise  # not damaged, and not ours to replace
        except DatasetError as cause:
            faults[f"{part}/manifest.json"] = str(cause)
            continue
        faults |= {f"{part}/{name}": fault for name, fault in damaged_files(folder, manifest).items()}
    return faults


def reopen(place: Place, stamp: Mapping[str, Any], faults: Mapping[str, str]) -> None:
    """Make a damaged scene a partial one again: what is damaged goes, what is whole stays.

    Killed between any two of its steps it leaves a folder that is still seen to be damaged, or a partial one.
    """
    discard(place.work)
    write_json(place.stamp, stamp)
    for name in faults:
        (place.final / name).unlink(missing_ok=True)
    move(place.final, place.partial)


def resume(place: Place, stamp: Mapping[str, Any], *, same: bool) -> None:
    """Get the partial folder ready: keep pictures that were made for this stamp, and nothing else.

    Args:
        place: Where the scene is made.
        stamp: What it is made from.
        same: Whether what is there was made from the same, whatever has been added to specs since.

    Raises:
        OutputError: What is there cannot be removed, or the stamp cannot be written.
    """
    if not same:
        discard(place.work)
    write_json(place.stamp, stamp)
    for part in _PARTS:
        (place.partial / part / "manifest.json").unlink(missing_ok=True)
    for unfinished in list(place.partial.rglob(".*.partial")):  # its process was killed while it wrote
        unfinished.unlink()


def stamped(place: Place) -> Mapping[str, Any] | None:
    """Return the stamp of the partial folder; None where there is none that can be read."""
    try:
        found = read_json(place.stamp)
    except RecordError:
        return None
    return found if isinstance(found, dict) else None


def is_whole_view(path: Path) -> bool:
    """Return whether a file of layers is there and can be read to its end; what is left of another one
    goes.
    """
    try:
        read_layers(path)
    except DatasetError:
        path.unlink(missing_ok=True)
        return False
    return True


def promote(place: Place) -> None:
    """Move the finished scene to its final place; a broken one that lies there goes first."""
    discard(place.replaced)
    if place.final.exists():
        move(place.final, place.replaced)
    move(place.partial, place.final)
    with suppress(OutputError):  # a worker that was given up may still write there
        discard(place.work)


def discard(folder: Path) -> None:
    """Remove a folder that graycard made for itself, if it is there.

    Raises:
        OutputError: It cannot be removed.
    """
    if folder.exists():
        try:
            shutil.rmtree(folder)
        except OSError as cause:
            raise OutputError(
                f"expected to remove {folder}, got {cause.strerror or cause}. Change its permissions"
            ) from cause


def leftovers(dataset: Path) -> list[Place]:
    """Scenes that are whole and still have a folder of what was not: their making was cut off at its end."""
    folders = sorted(dataset.glob("*/.*.partial"))
    places = [
        Place(dataset, f.parent.name, f.name.removeprefix(".").removesuffix(".partial")) for f in folders
    ]
    return [place for place in places if is_made(place)]


def is_made(place: Place) -> bool:
    """Tell whether a scene lies at its final place, whole or damaged."""
    return all((place.final / part / "manifest.json").is_file() for part in _PARTS)


def foreign_content(place: Place) -> list[str]:
    """Names in a final folder that no scene folder has: then it is not ours to replace."""
    if not place.final.exists():
        return []
    if not place.final.is_dir():
        return [place.final.name]
    return sorted(p.name for p in place.final.iterdir() if p.name not in _PARTS)


def move(source: Path, target: Path) -> None:
    """Rename a file or folder, and make the folder that it goes to.

    Raises:
        OutputError: It cannot be renamed.
    """
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(source, target)
    except OSError as cause:
        raise OutputError(
            f"expected to rename {source} to {target}, got {cause.strerror or cause}. Is another graycard "
            "at work on this scene? Run the same command again"
        ) from cause

# SPDX-License-Identifier: Apache-2.0
"""Predictions of other code as a row of a bench: they are taken as they are, and scored as any others.

FOLDER/<track>/<scene>/predictions.json views/ ...   as docs/reference/formats.md describes
"""

import hashlib
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from graycard import PredictionError, open_predictions
from graycard.io import dumps, inside, sha256_of_files, write_bytes
from graycard.predictions import INDEX, finish_predictions
from graycard.records import Job


@dataclass(frozen=True, slots=True)
class Given:
    """Predictions of one scene, as they were when the bench began."""

    folder: Path
    sha256: str
    """Over its files; empty where they cannot be read, of which the job says more."""


def given_for(folder: str, track: str, scene: str) -> Given:
    """Return the predictions of one scene in a folder of those of many; whether there are any shows in the
    job.
    """
    place = Path(folder).expanduser() / track / scene
    try:
        return Given(place, _digest(_hashes(place)))
    except PredictionError:
        return Given(place, "")


def check_folder(folder: str, scenes: Sequence[tuple[str, str]]) -> None:
    """Find a folder that holds predictions of no scene at all before any work is done.

    Args:
        folder: Of predictions of many scenes.
        scenes: Track and name of each scene of the suite.

    Raises:
        PredictionError: There is nothing for any of them.
    """
    root = Path(folder).expanduser()
    if any((root / track / scene / INDEX).is_file() for track, scene in scenes):
        return
    there = ", ".join(sorted(p.name for p in root.iterdir())[:5]) if root.is_dir() else ""
    got = f"a folder of {there or 'nothing'}" if root.is_dir() else "a file" if root.exists() else "nothing"
    track, scene = scenes[0]
    raise PredictionError(
        f"expected predictions of other code for a scene of the suite in {root.absolute()}, as "
        f"{track}/{scene}/{INDEX}, got {got}. See docs/reference/suite-files.md"
    )


def take_predictions(given: Given, folder: Path, job: Job) -> None:
    """Copy predictions into the folder of a job; the index is written last, with the hash of each file.

    Args:
        given: What to copy; it is left as it is.
        folder: Where to; what is there is replaced.
        job: What they are of.

    Raises:
        PredictionError: There are none, they cannot be read, they are of another scene, have changed since
            the bench began, or are not the files that their index lists.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    found, hashes = open_predictions(given.folder), _hashes(given.folder)
    if (found.track, found.scene) != (job.track, job.scene):
        raise PredictionError(
            f"expected predictions of {job.track}/{job.scene} in {given.folder}, got those of "
            f"{found.track}/{found.scene}. Put them where they belong, or mend {INDEX}"
        )
    for name, listed in found.files.items():
        if hashes.get(name) != listed:
            raise PredictionError(
                f"expected {name} in {given.folder} with SHA-256 {listed[:12]}…, as {INDEX} lists it, got "
                f"{hashes.get(name, 'none')[:12]}. Write the predictions again, or leave `files` out"
            )
    shutil.rmtree(folder, ignore_errors=True)
    wanted = {name: value for name, value in hashes.items() if name != INDEX}
    for name in wanted:
        write_bytes(inside(folder, name), _read(given.folder / name))
    if _digest(hashes) != given.sha256 or sha256_of_files(folder) != wanted:
        raise PredictionError(
            f"expected {given.folder} to stay as it was when the bench began, got other files. Run it again"
        )
    finish_predictions(folder, replace(found, method=job.method))


def _hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of each file by its relative path, hidden files left out."""
    for path in folder.rglob("*"):
        if path.is_symlink() and path.is_dir():
            raise PredictionError(
                f"expected files and folders in {folder}, got a link to a folder, {path.name}, which is not "
                "followed. Copy what it leads to, or link the folder of the scene as a whole"
            )
    try:
        return sha256_of_files(folder)
    except OSError as cause:
        raise _unreadable(Path(cause.filename or folder), cause) from cause


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as cause:
        raise _unreadable(path, cause) from cause


def _unreadable(path: Path, cause: OSError) -> PredictionError:
    return PredictionError(f"expected predictions that can be read at {path}, got: {cause.strerror or cause}")


def _digest(hashes: dict[str, str]) -> str:
    return hashlib.sha256(dumps(hashes).encode()).hexdigest()

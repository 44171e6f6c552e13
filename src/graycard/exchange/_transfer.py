# SPDX-License-Identifier: Apache-2.0
"""Captures to and from the folders of other programs; nothing is left half-written."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from graycard._capture import POINTS, Capture, View
from graycard._errors import DatasetError, UnknownNameError
from graycard.dataset import IMPORTER, TRACKS, open_capture, write_index
from graycard.exchange._cameras import PosedPhotograph, check_names
from graycard.exchange._colmap import find_model, read_colmap, read_colmap_points, write_colmap
from graycard.exchange._develop_pictures import (
    Developed,
    FoundPictures,
    PictureOptions,
    develop_pictures,
    find_pictures,
)
from graycard.exchange._doctor import ImportRow
from graycard.exchange._nerfstudio import INDEX, read_nerfstudio, read_nerfstudio_points, write_nerfstudio
from graycard.io import (
    FORMAT_VERSION,
    Manifest,
    Progress,
    atomic_folder,
    check_name,
    silent,
    write_layers,
    write_manifest,
    write_rgb,
)
from graycard.points import Points, write_points

ExchangeFormat = Literal["nerfstudio", "colmap"]
TARGET = 1
"""Object id that an imported target gets."""
_WRITERS: dict[ExchangeFormat, Callable[[Capture, Path], None]] = {
    "nerfstudio": write_nerfstudio,
    "colmap": write_colmap,
}


def export_capture(scene: Path, kind: ExchangeFormat, out: Path) -> Capture:
    """Write a capture as another program reads it, as 8-bit sRGB at the scene's exposure.

    Cameras of held-out views are written, photographs of them are not: a capture has none.

    Args:
        scene: ``DATASET/<track>/<scene>``.
        kind: The format.
        out: A new or an empty folder.

    Raises:
        UnknownNameError: There is no such format.
        DatasetError: The capture is missing or damaged.
        OutputError: The folder is in use or cannot be written to, or the disk is full.
    """
    if kind not in _WRITERS:
        raise UnknownNameError("format", kind, get_args(ExchangeFormat))
    capture = open_capture(Path(scene) / "capture")
    with atomic_folder(out) as folder:
        _WRITERS[kind](capture, folder)
    return capture


def import_capture(
    source: Path,
    dataset: Path,
    track: str,
    scene: str,
    *,
    hold_out_every: int = 8,
    pictures: PictureOptions | None = None,
    version: str = "",
    progress: Progress = silent,
) -> Path:
    """Write ``DATASET/<track>/<scene>/capture`` from photographs with their cameras; there is no truth.

    Args:
        source: As of :func:`import_and_tell`.
        dataset: As of :func:`import_and_tell`.
        track: As of :func:`import_and_tell`.
        scene: As of :func:`import_and_tell`.
        hold_out_every: As of :func:`import_and_tell`.
        pictures: As of :func:`import_and_tell`.
        version: As of :func:`import_and_tell`.
        progress: As of :func:`import_and_tell`.

    Returns:
        The scene's folder.

    Raises:
        GraycardError: As of :func:`import_and_tell`.
    """
    made, _ = import_and_tell(
        source,
        dataset,
        track,
        scene,
        hold_out_every=hold_out_every,
        pictures=pictures,
        version=version,
        progress=progress,
    )
    return made


def import_and_tell(
    source: Path,
    dataset: Path,
    track: str,
    scene: str,
    *,
    hold_out_every: int = 8,
    pictures: PictureOptions | None = None,
    version: str = "",
    progress: Progress = silent,
) -> tuple[Path, tuple[ImportRow, ...]]:
    """Write ``DATASET/<track>/<scene>/capture`` from photographs with their cameras, and say what was done.

    Photographs become linear Rec.709; :mod:`graycard.exchange.pictures` says how. The world stays as it is.

    Args:
        source: A folder with ``transforms.json``, or with a COLMAP text model and ``images/``.
        dataset: Where to.
        track: What kind of scene it is. On ``tabletop`` masks are taken as the object to be removed,
            black where it is seen.
        scene: A name for it.
        hold_out_every: Each how many-th photograph, by name, is held out, from the last of the first so many;
            0 for none. It does nothing where the source says itself which are test views.
        pictures: Orientation, background, exposures and the sense of masks.
        version: Of graycard, for the manifest.
        progress: Called for each photograph.

    Returns:
        The scene's folder, and a row for each thing that was done to the pixels.

    Raises:
        UnknownNameError: There is no such track.
        DatasetError: The source is missing, malformed or incomplete, or the name is none for a folder.
        OutputError: The scene exists, or the folder cannot be written to.
    """
    if track not in TRACKS:
        raise UnknownNameError("track", track, TRACKS)
    try:
        check_name(scene)
    except ValueError as cause:
        raise DatasetError(f"{cause}. Give the scene another --scene") from cause
    kind, shots = _read(Path(source))
    listed = any(shot.held_out for shot in shots)
    kept = _split([_kept_of(s, track) for s in shots], 0 if listed else hold_out_every)
    found = find_pictures([shot for shot in kept if not shot.held_out], pictures or PictureOptions())
    points = _read_points(Path(source), kept)
    split: dict[str, str | int] = {"split": "as listed"} if listed else {"hold_out_every": hold_out_every}
    manifest = Manifest(
        "graycard-capture",
        FORMAT_VERSION,
        track,
        scene,
        {"name": IMPORTER, "version": version},
        {},
        {"format": kind, **split},
    )
    out = Path(dataset) / track / scene / "capture"
    with atomic_folder(out) as folder:
        developed = _develop(found, folder, progress)
        views = tuple(View(s.name, "test" if s.held_out else "train", s.camera) for s in kept)
        target = TARGET if found.masks else None
        if points is not None and len(points):
            write_points(folder / POINTS, points)
        light = developed.exposure, track == "dark", target, developed.sensor
        write_index(folder, Capture(track, scene, views, *light))
        write_manifest(folder, manifest)
    told = [ImportRow("points", len(points), points.said)] if points is not None and points.said else []
    return out.parent, (*developed.rows, *told)


def _develop(found: FoundPictures, folder: Path, progress: Progress) -> Developed:
    """Write linear photographs and masks."""

    def keep(shot: PosedPhotograph, light: np.ndarray) -> None:
        write_rgb(folder / f"photographs/{shot.name}.exr", light, quick=True)

    def keep_mask(shot: PosedPhotograph, target: np.ndarray) -> None:
        ids = np.where(target, TARGET, 0)
        write_layers(folder / f"masks/target/{shot.name}.exr", {"object_id": ids})

    return develop_pictures(found, keep, keep_mask, progress)


def _read(source: Path) -> tuple[ExchangeFormat, list[PosedPhotograph]]:
    """The shots of a folder, by name."""
    if (source / INDEX).is_file():
        kind, shots = "nerfstudio", read_nerfstudio(source)
    elif model := find_model(source):
        kind, shots = "colmap", read_colmap(source, model)
    else:
        raise DatasetError(
            f"expected a folder with {INDEX} or with sparse/0/cameras.txt at {source}, got "
            f"{'neither' if source.is_dir() else 'nothing'}. See docs/formats.md"
        )
    check_names((shot.name for shot in shots), source)
    return kind, sorted(shots, key=lambda shot: shot.name)


def _read_points(source: Path, kept: Sequence[PosedPhotograph]) -> Points | None:
    """Return the sparse points of a folder; None if it has none."""
    if (source / INDEX).is_file():
        return read_nerfstudio_points(source)
    model = find_model(source)
    numbers = {shot.name: number for number, shot in enumerate(kept) if not shot.held_out}
    return None if model is None else read_colmap_points(model, numbers)


def _split(shots: Sequence[PosedPhotograph], every: int) -> list[PosedPhotograph]:
    """The shots, every n-th of them held out.

    Raises:
        DatasetError: None is left to be trained on, or ``every`` is negative or 1.
    """
    if every < 0 or every == 1:
        raise DatasetError(f"expected to hold out every 2nd photograph or fewer, or 0 for none, got {every}")
    split = [_hold_out(s) if every and i % every == every - 1 else s for i, s in enumerate(shots)]
    if all(shot.held_out for shot in split):
        raise DatasetError(f"expected a photograph that is not held out, got {len(split)} that are")
    return split


def _hold_out(shot: PosedPhotograph) -> PosedPhotograph:
    return replace(shot, held_out=True)


def _kept_of(shot: PosedPhotograph, track: str) -> PosedPhotograph:
    """A shot without its mask, unless the track has an object to be removed."""
    return shot if track == "tabletop" else replace(shot, mask=None)

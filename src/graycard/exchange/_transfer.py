# SPDX-License-Identifier: Apache-2.0
"""Captures to and from the folders of other programs; nothing is left half-written."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from graycard._capture import POINTS, Capture, View
from graycard._errors import DatasetError, UnknownNameError
from graycard._held_out import HELD_OUT
from graycard.dataset import IMPORTER, TRACKS, open_capture, write_index
from graycard.exchange._cameras import PosedPhotograph, check_names
from graycard.exchange._colmap import find_model, read_colmap, read_colmap_points, write_colmap
from graycard.exchange._held_out import write_held_out
from graycard.exchange._nerfstudio import INDEX, read_nerfstudio, read_nerfstudio_points, write_nerfstudio
from graycard.exchange._photographs import check_mask, check_photograph, read_mask, read_photograph
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
SAMPLES = 2**20
"""Values of a photograph, about, from which the exposure is found: all of a large one fill the memory."""
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
    version: str = "",
    progress: Progress = silent,
) -> Path:
    """Write ``DATASET/<track>/<scene>/capture`` from photographs with their cameras; there is no truth.

    Photographs of held-out views go to ``held_out/`` beside it, where there are any.

    PNG and JPEG are decoded by the sRGB curve, EXR is taken as linear. The world stays as it is.

    Args:
        source: A folder with ``transforms.json``, or with a COLMAP text model and ``images/``.
        dataset: Where to.
        track: What kind of scene it is. On ``tabletop`` masks are taken as the object to be removed,
            black where it is seen.
        scene: A name for it.
        hold_out_every: Each how many-th photograph, by name, is held out, from the last of the first so many;
            0 for none. It does nothing where the source says itself which are test views.
        version: Of graycard, for the manifest.
        progress: Called for each photograph.

    Returns:
        The scene's folder.

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
    masked = _check_files(kept)
    points = _read_points(Path(source), kept)
    seen = [shot for shot in kept if shot.held_out and shot.image.is_file()]
    settings = (
        {"format": kind, "split": "as listed"}
        if listed
        else {"format": kind, "hold_out_every": hold_out_every}
    )
    manifest = Manifest(
        "graycard-capture",
        FORMAT_VERSION,
        track,
        scene,
        {"name": IMPORTER, "version": version},
        {},
        settings,
    )
    out = Path(dataset) / track / scene / "capture"
    with atomic_folder(out) as folder:
        exposure = _write_photographs(kept, folder, masked, progress)
        views = tuple(View(s.name, "test" if s.held_out else "train", s.camera) for s in kept)
        target = TARGET if masked else None
        if points is not None and len(points):
            write_points(folder / POINTS, points)
        write_index(folder, Capture(track, scene, views, exposure, track == "dark", target))
        write_manifest(folder, manifest)
        write_held_out(out.parent / HELD_OUT, seen, manifest)
    return out.parent


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
    """The sparse points of a folder; None if it has none."""
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


def _check_files(shots: Sequence[PosedPhotograph]) -> bool:
    """Check what is to be read, before anything is written.

    Returns:
        Whether there are masks.

    Raises:
        DatasetError: A photograph or a mask is missing or of another size; only some have a mask; or masks
            show no object or nothing else.
    """
    train = [shot for shot in shots if not shot.held_out]
    for shot in train:
        check_photograph(shot.image, shot.camera.width, shot.camera.height)
        if shot.mask is not None:
            check_mask(shot.mask, shot.camera.width, shot.camera.height)
    for shot in (shot for shot in shots if shot.held_out and shot.image.is_file()):
        check_photograph(shot.image, shot.camera.width, shot.camera.height)
    bare = [shot.name for shot in train if shot.mask is None]
    if bare and len(bare) < len(train):
        raise DatasetError(
            f"expected a mask for each training photograph or for none, got none for {len(bare)} of "
            f"{len(train)}, the first {bare[0]}. Add them"
        )
    if not bare:
        _check_masks(train)
    return not bare


def _check_masks(train: Sequence[PosedPhotograph]) -> None:
    """Refuse masks that no method could remove an object by.

    Raises:
        DatasetError: None shows an object, or one shows nothing else.
    """
    advice = (
        "Masks are black where the object is seen and white elsewhere: mend them, or import without masks"
    )
    seen = False
    for shot in train:
        assert shot.mask is not None, "there is one for each"
        mask = read_mask(shot.mask, shot.camera.width, shot.camera.height)
        if mask.all():
            raise DatasetError(
                f"expected a mask with an object in {shot.mask}, got one that is all black. {advice}"
            )
        seen |= bool(mask.any())
    if not seen:
        raise DatasetError(
            f"expected an object in some mask of {len(train)}, as {train[0].mask}, got masks without any "
            f"black. {advice}"
        )


def _write_photographs(
    shots: Sequence[PosedPhotograph], folder: Path, masked: bool, progress: Progress
) -> float:
    """Write linear photographs and masks; returns the exposure, by which their 99th percentile becomes 1."""
    levels = []
    train = [shot for shot in shots if not shot.held_out]
    for number, shot in enumerate(train):
        progress(number / len(train), shot.name)
        size = shot.camera.width, shot.camera.height
        linear = read_photograph(shot.image, *size)
        write_rgb(folder / f"photographs/{shot.name}.exr", linear)
        levels.append(linear.reshape(-1, 3)[:: max(1, linear.size // SAMPLES)].ravel())
        if masked and shot.mask is not None:
            ids = np.where(read_mask(shot.mask, *size), TARGET, 0)
            write_layers(folder / f"masks/target/{shot.name}.exr", {"object_id": ids})
    white = float(np.percentile(np.concatenate(levels), 99))
    if white <= 0:
        raise DatasetError(f"expected photographs with some light, got {len(train)} that are black")
    return 1 / white

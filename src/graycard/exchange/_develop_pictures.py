# SPDX-License-Identifier: Apache-2.0
"""Photographs and masks of shots: found before anything is written, then read a few at a time."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Literal, TypeVar

import numpy as np

from graycard._errors import DatasetError
from graycard._sensor import Sensor
from graycard.exchange._cameras import PosedPhotograph
from graycard.exchange._develop import develop, develop_mask
from graycard.exchange._doctor import ImportRow, merge_rows
from graycard.exchange.pictures import (
    ANY_KIND,
    Background,
    Exposure,
    FoundPicture,
    MaskKind,
    MaskObject,
    Note,
    Orientation,
    Picture,
    exposures_beside,
    find_photographs,
    judge_masks,
    look_at_masks,
    read_mask,
    read_photograph,
    relative_exposures,
    shape_of_mask,
)
from graycard.io import Progress, silent
from graycard.resources import usable_cores

DoneT = TypeVar("DoneT")
Exposures = Literal["exif", "alike"]
"""Relative exposures of photographs: as EXIF tells them, or all alike."""
SAMPLES = 2**22
"""Values of all photographs, about, from which the exposure is found: all of them fill the memory."""
WORKERS = 4
"""Photographs that are in memory at once, at most."""
FEWEST = 2**14
"""Values of one photograph, about, that are looked at."""
_DARK_LEVELS = 16
"""Levels of a photograph of 8 bits, up to which most of it lies, that make it a dark one."""


@dataclass(frozen=True, slots=True)
class PictureOptions:
    """Choices about pixels."""

    orientation: Orientation = "auto"
    """Way to take EXIF orientation: as camera sizes tell, pixels as stored, or turned upright."""
    background: Background = "none"
    """Light behind transparent pixels; with none they are an error."""
    exposures: Exposures = "exif"
    """Divide photographs by the exposures that EXIF tells, or take all as exposed alike."""
    mask_object: MaskObject = "auto"
    """Side of masks that is the object: black, unless masks look inverted, which is an error."""


@dataclass(frozen=True, slots=True)
class RelativeExposures:
    """Exposures of photographs, 1 in the geometric mean of those of training views."""

    train: tuple[float, ...]
    """One for each training view, or none where all are taken as exposed alike."""
    held: tuple[float, ...]
    """One for each held-out view that has a photograph."""


@dataclass(frozen=True, slots=True)
class FoundPictures:
    """Photographs that are there and fit their cameras, and masks of training views."""

    shots: tuple[PosedPhotograph, ...]
    """Training views."""
    held: tuple[PosedPhotograph, ...]
    """Held-out views that have a photograph."""
    photographs: tuple[FoundPicture, ...]
    """One for each of both, training views first."""
    masks: tuple[FoundPicture, ...]
    """One for each training view, or none."""
    mask_kind: MaskKind
    """Kind that all masks have."""
    white_is_object: bool
    exposures: RelativeExposures
    options: PictureOptions
    rows: tuple[ImportRow, ...]


@dataclass(frozen=True, slots=True)
class Developed:
    """Exposure, sensor and rows that follow from all photographs together."""

    exposure: float
    """The factor by which their 99th percentile becomes 1."""
    sensor: Sensor | None
    """The exposures of single photographs; None where all are taken as exposed alike."""
    held_out: Sensor | None
    """The same of those of held-out views."""
    rows: tuple[ImportRow, ...]


@dataclass(frozen=True, slots=True)
class _Done:
    """The little that is kept of a photograph once it is written."""

    sample: np.ndarray
    """Some of its light, any number of values."""
    rows: tuple[ImportRow, ...]
    bits: int


def find_pictures(
    train: Sequence[PosedPhotograph], options: PictureOptions, held: Sequence[PosedPhotograph] = ()
) -> FoundPictures:
    """Find the photographs and masks of training shots, and look through the masks.

    Args:
        train: Training shots.
        options: What whoever imports has chosen.
        held: Held-out shots that have a photograph.

    Raises:
        DatasetError: One is missing, broken, of another size or kind; only some shots have a mask; masks
            show no object or nothing else, or look inverted.
    """
    photographs = find_photographs([(s.image, s.size) for s in (*train, *held)], options.orientation)
    bare = [shot.name for shot in train if shot.mask is None]
    if bare and len(bare) < len(train):
        raise DatasetError(
            f"expected a mask for each training photograph or for none, got none for {len(bare)} of "
            f"{len(train)}, the first {bare[0]}. Add them"
        )
    masked = [(s.mask, s.size) for s in train if s.mask is not None]
    masks = find_photographs(masked, options.orientation, "mask")
    kind, white, rows = ANY_KIND, False, []
    if masks:
        kind = look_at_masks(masks)
        white, judged = _look_through(masks, kind, options.mask_object)
        rows += judged
    told = [photograph.exposure for photograph in photographs]
    exposures, noted = _exposures(told[: len(train)], told[len(train) :], options.exposures)
    seen = tuple(train), tuple(held), tuple(photographs), tuple(masks)
    return FoundPictures(*seen, kind, white, exposures, options, (*rows, *noted))


def _exposures(
    train: Sequence[Exposure | None], held: Sequence[Exposure | None], chosen: Exposures
) -> tuple[RelativeExposures, list[ImportRow]]:
    """Return exposures and rows about them; those of held-out photographs are no matter of the others."""
    if chosen == "alike":
        note = Note("exposure", "EXIF is not asked, all are taken as exposed alike")
        return RelativeExposures((), (1.0,) * len(held)), [_row(note, len(train) + len(held))]
    found, note = relative_exposures(train)
    others, lacking = exposures_beside(held, train)
    rows = [_row(note, len(train))] if note else []
    if lacking:
        said = "held out, EXIF tells less of it than of others: taken as exposed as they are in the mean"
        rows.append(ImportRow("exposure", lacking, said, warns=True))
    if others != [1.0] * len(held):
        said = "held out, exposed otherwise than others in the mean: light is divided by the ratio"
        rows.append(ImportRow("exposure", sum(other != 1 for other in others), said))
    return RelativeExposures(tuple(found or ()), tuple(others)), rows


def develop_held_out(
    found: FoundPictures, keep: Callable[[PosedPhotograph, np.ndarray], None]
) -> tuple[ImportRow, ...]:
    """Read each photograph of a held-out view as those of training views are, and hand it on.

    Args:
        found: Where they are.
        keep: As of :func:`develop_pictures`.

    Returns:
        Rows about their pixels.

    Raises:
        DatasetError: One is broken.
    """

    def work(number: int) -> tuple[Note, ...]:
        shot = found.held[number]
        light, picture = _light(found, len(found.shots) + number, found.exposures.held[number])
        keep(shot, develop(light, shot))
        return picture.notes

    return merge_rows(_row(note) for notes in _in_order(work, len(found.held)) for note in notes)


def _light(found: FoundPictures, number: int, exposure: float) -> tuple[np.ndarray, Picture]:
    """Return the light of a photograph at the exposure that all have in common, and the photograph."""
    picture = read_photograph(found.photographs[number], found.options.background)
    picture = replace(picture, notes=(*picture.notes, *_darkness(picture.light, picture.bits)))
    return picture.light if exposure == 1 else picture.light / np.float32(exposure), picture


def develop_pictures(
    found: FoundPictures,
    keep: Callable[[PosedPhotograph, np.ndarray], None],
    keep_mask: Callable[[PosedPhotograph, np.ndarray], None],
    progress: Progress = silent,
) -> Developed:
    """Read photographs and masks of training views and hand them on; few are in memory at a time.

    Args:
        found: Where they are.
        keep: Called from several threads with the light of each photograph as its camera sees it,
            ``(H, W, 3)``, float32.
        keep_mask: Called likewise with where each mask shows the object, shape ``(H, W)``, bool.
        progress: Called for each photograph.

    Raises:
        DatasetError: One is broken, or all photographs are black.
    """
    budget = max(FEWEST, SAMPLES // len(found.shots))

    def work(number: int) -> _Done:
        shot = found.shots[number]
        exposures = found.exposures.train
        light, picture = _light(found, number, exposures[number] if exposures else 1.0)
        notes = list(picture.notes)
        light = develop(light, shot)
        keep(shot, light)
        if found.masks:
            black, told = read_mask(found.masks[number], found.mask_kind)
            notes += told
            keep_mask(shot, develop_mask(~black if found.white_is_object else black, shot))
        pixels = light.reshape(-1, 3)
        sample = pixels[:: max(1, -(-light.size // budget))].ravel()
        return _Done(sample, tuple(map(_row, notes)), picture.bits)

    samples, rows, depths = [], [], set()
    for number, done in enumerate(_in_order(work, len(found.shots))):
        progress((number + 1) / len(found.shots), found.shots[number].name)
        samples.append(done.sample)
        rows += done.rows
        depths.add(done.bits)
    white = float(np.percentile(np.concatenate(samples), 99))
    if white <= 0:
        raise DatasetError(f"expected photographs with some light, got {len(found.shots)} that are black")
    bits = depths.pop() if len(depths) == 1 else 0
    train, held = found.exposures.train, found.exposures.held
    is_told = bool(train) or any(other != 1 for other in held)
    return Developed(
        1 / white,
        _sensor(found.shots, train, white, bits),
        _sensor(found.held, held if is_told else (), white, bits),
        merge_rows([*rows, *found.rows]),
    )


def _in_order(work: Callable[[int], DoneT], count: int) -> Iterator[DoneT]:
    """Yield what comes of photographs, in their order; few are in memory at a time, none after an error."""
    pool = ThreadPoolExecutor(max_workers=min(WORKERS, usable_cores()))
    try:
        yield from pool.map(work, range(count))
    finally:
        pool.shutdown(cancel_futures=True)


def _row(note: Note, count: int = 1) -> ImportRow:
    return ImportRow(note.what, count, note.said, note.warns)


def _look_through(
    masks: Sequence[FoundPicture], kind: MaskKind, chosen: MaskObject
) -> tuple[bool, list[ImportRow]]:
    shapes = [shape_of_mask(read_mask(mask, kind)[0]) for mask in masks]
    white, note = judge_masks(shapes, [mask.path for mask in masks], chosen)
    return white, [_row(note, len(masks))]


def _sensor(
    shots: Sequence[PosedPhotograph], exposures: Sequence[float], white: float, bits: int
) -> Sensor | None:
    """Return the exposures as a capture has them: white is where radiance × exposure × factor is 1."""
    if not exposures:
        return None
    factors = zip(shots, exposures, strict=True)
    return Sensor(bits=bits, exposures={shot.name: factor * white for shot, factor in factors})


def _darkness(light: np.ndarray, bits: int) -> Iterator[Note]:
    """Yield a warning of a photograph of 8 bits of which most lies in a few levels."""
    if bits == 8 and float(np.median(light)) < _DARK_LEVELS / 255 / 12.92:
        levels = f"most of it lies below level {_DARK_LEVELS} of 255"
        yield Note("darkness", f"dark for 8 bits, {levels}: 16 bits or EXR keep more", warns=True)

# SPDX-License-Identifier: Apache-2.0
"""Photographs of a plan become a capture, or are only looked at; nothing is left half-written."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from graycard._capture import POINTS, Capture, View
from graycard._errors import DatasetError
from graycard.colour import srgb_decode
from graycard.dataset import IMPORTER, write_index
from graycard.exchange._cameras import PosedPhotograph
from graycard.exchange._cutout import read_cutout
from graycard.exchange._develop import develop, develop_mask
from graycard.exchange._doctor import ImportRow, merge_rows
from graycard.exchange._given_truth import write_given_truth
from graycard.exchange._photographs import read_mask, read_photograph
from graycard.exchange._plan import ImportOptions, ImportPlan, plan_import
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
from graycard.points import write_points

SAMPLES = 2**21
"""Pixels of all photographs, about, from which the exposure is found: all of them fill the memory."""
FEWEST = 2**12
"""Pixels of one photograph, about, that are looked at."""
TARGET = 1
"""Object id that an imported target gets."""
WORKERS = 4
"""Photographs that are in memory at once, at most."""
_DARK = float(srgb_decode(np.array(5 / 255)))
"""Light of level 5 of 255: below, a step of 8 bits is over a fifth of the value."""
_COARSE = 8
"""Different values below, up to which a photograph has been rounded to 8 bits."""


@dataclass(frozen=True, slots=True)
class _Developed:
    """What is kept of one photograph once it is written."""

    sample: np.ndarray
    """Some of its light, float32, any number of pixels."""
    rows: tuple[ImportRow, ...]


def import_capture(
    source: Path,
    dataset: Path,
    track: str,
    scene: str,
    options: ImportOptions | None = None,
    *,
    version: str = "",
    progress: Progress = silent,
) -> Path:
    """Write ``DATASET/<track>/<scene>/capture`` from photographs with their cameras.

    Args:
        source: As of :func:`plan_import`.
        dataset: Where to.
        track: As of :func:`plan_import`.
        scene: A name for it.
        options: As of :func:`plan_import`.
        version: Of graycard, for the manifest.
        progress: Called for each photograph.

    Returns:
        The scene's folder.

    Raises:
        UnknownNameError: There is no such track, model or photograph.
        DatasetError: The source is missing, malformed or incomplete, or the name is none for a folder.
        OutputError: The scene exists, or the folder cannot be written to.
    """
    check_scene_name(scene)
    plan = plan_import(source, track, options)
    write_import(plan, dataset, scene, version=version, progress=progress)
    return Path(dataset) / track / scene


def check_scene_name(scene: str) -> None:
    """Refuse a name that is none for a folder.

    Raises:
        DatasetError: It is none.
    """
    try:
        check_name(scene)
    except ValueError as cause:
        raise DatasetError(f"{cause}. Give the scene another --scene") from cause


def write_import(
    plan: ImportPlan, dataset: Path, scene: str, *, version: str = "", progress: Progress = silent
) -> tuple[ImportRow, ...]:
    """Write what was planned; there is truth beside it only where the source has true layers.

    Args:
        plan: It says what.
        dataset: Where to: ``DATASET/<track>/<scene>``.
        scene: A name for it.
        version: Of graycard, for the manifest.
        progress: Called for each photograph.

    Returns:
        The plan's rows, and those about the pixels.

    Raises:
        DatasetError: A photograph is broken, or all are black, or the name is none for a folder.
        OutputError: The scene exists, or the folder cannot be written to.
    """
    check_scene_name(scene)
    home = Path(dataset) / plan.track / scene
    generator = {"name": IMPORTER, "version": version}
    manifest = Manifest("graycard-capture", FORMAT_VERSION, plan.track, scene, generator, {}, plan.settings)
    with atomic_folder(home / "capture") as folder:

        def keep(shot: PosedPhotograph, light: np.ndarray) -> None:
            write_rgb(folder / f"photographs/{shot.name}.exr", light)
            if plan.masked and shot.mask is not None:
                mask = develop_mask(read_mask(shot.mask, *shot.size), shot)
                ids = np.where(mask, TARGET, 0)
                write_layers(folder / f"masks/target/{shot.name}.exr", {"object_id": ids})

        exposure, rows = _develop_all(plan, keep, progress)
        views = tuple(View(s.name, "test" if s.held_out else "train", s.camera) for s in plan.shots)
        target = TARGET if plan.masked else None
        if plan.points is not None and len(plan.points):
            write_points(folder / POINTS, plan.points)
        capture = Capture(plan.track, scene, views, exposure, plan.track == "dark", target)
        write_index(folder, capture)
        write_manifest(folder, manifest)
        if plan.has_truth:
            rows.append(write_given_truth(plan, capture, home / "truth", generator))
    return merge_rows([*plan.rows, *rows])


def survey_import(plan: ImportPlan, progress: Progress = silent) -> tuple[ImportRow, ...]:
    """Return the rows that :func:`write_import` would, by reading all photographs and writing nothing.

    Raises:
        DatasetError: A photograph is broken, or all are black.
    """
    _, rows = _develop_all(plan, lambda shot, light: None, progress)
    return merge_rows([*plan.rows, *rows])


def _develop_all(
    plan: ImportPlan, keep: Callable[[PosedPhotograph, np.ndarray], None], progress: Progress
) -> tuple[float, list[ImportRow]]:
    """Read and develop training photographs and hand each on.

    Returns:
        The exposure, by which their 99th percentile becomes 1, and rows about them.
    """
    train = plan.train
    budget = max(FEWEST, SAMPLES // len(train))

    def work(shot: PosedPhotograph) -> _Developed:
        light, rows = _read_light(shot)
        picture = develop(light, shot)
        keep(shot, picture)
        sample = _some(picture, budget)
        return _Developed(sample, (*rows, *_darkness(_some(light, budget))))

    samples, rows = [], []
    for number, done in enumerate(_in_order(train, work)):
        progress((number + 1) / len(train), train[number].name)
        samples.append(done.sample)
        rows += done.rows
    white = float(np.percentile(np.concatenate(samples), 99))
    if white <= 0:
        raise DatasetError(f"expected photographs with some light, got {len(train)} that are black")
    return 1 / white, rows


def _in_order(
    shots: Sequence[PosedPhotograph], work: Callable[[PosedPhotograph], _Developed]
) -> Iterator[_Developed]:
    """Yield what comes of shots, in their order; few are worked on at a time, and none after an error."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    pool = ThreadPoolExecutor(max_workers=min(WORKERS, cores))
    try:
        yield from pool.map(work, shots)
    finally:
        pool.shutdown(cancel_futures=True)


def _read_light(shot: PosedPhotograph) -> tuple[np.ndarray, list[ImportRow]]:
    if not shot.cutout:
        return read_photograph(shot.image, *shot.size), []
    light, coverage = read_cutout(shot.image, *shot.size)
    if coverage.min() == 1:
        return light, []
    return light, [ImportRow("transparency", 1, "made black, as nothing is there")]


def _some(picture: np.ndarray, count: int) -> np.ndarray:
    """Return the light of some pixels, evenly spread: about ``count`` of them, all where there are fewer."""
    pixels = picture.reshape(-1, 3)
    return pixels[:: max(1, -(-len(pixels) // count))].copy().ravel()


def _darkness(sample: np.ndarray) -> list[ImportRow]:
    """Return a warning about a photograph most of which lies in the lowest levels of 8 bits."""
    dark = sample[sample < _DARK]
    if len(dark) <= sample.size / 2 or len(np.unique(dark)) > _COARSE:
        return []
    said = "darker than their quantisation: over half is below level 5 of 255. Import 16 bits or EXR"
    return [ImportRow("photographs", 1, said, warns=True)]

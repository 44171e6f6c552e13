# SPDX-License-Identifier: Apache-2.0
"""Photographs of a plan become a scene, written whole or not at all, or are only looked at."""

from pathlib import Path

import numpy as np

from graycard._capture import POINTS, Capture, View
from graycard._errors import DatasetError, OutputError
from graycard._held_out import HELD_OUT
from graycard.dataset import IMPORTER, write_index
from graycard.exchange._cameras import PosedPhotograph
from graycard.exchange._develop_pictures import Developed, develop_held_out, develop_pictures
from graycard.exchange._doctor import ImportRow, merge_rows
from graycard.exchange._given_truth import develop_given_truth, write_given_truth
from graycard.exchange._held_out import write_held_out
from graycard.exchange._plan import ImportOptions, ImportPlan, check_options, plan_import
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

TARGET = 1
"""Object id that an imported target gets."""


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
    return import_and_tell(source, dataset, track, scene, options, version=version, progress=progress)[0]


def import_and_tell(
    source: Path,
    dataset: Path,
    track: str,
    scene: str,
    options: ImportOptions | None = None,
    *,
    version: str = "",
    progress: Progress = silent,
) -> tuple[Path, tuple[ImportRow, ...]]:
    """Import as :func:`import_capture` does, and return also a row for each thing that was done."""
    check_import(dataset, track, scene, options or ImportOptions())
    plan = plan_import(source, track, options)
    rows = write_import(plan, dataset, scene, version=version, progress=progress)
    return Path(dataset) / track / scene, rows


def check_import(dataset: Path | None, track: str, scene: str, options: ImportOptions) -> None:
    """Refuse what can be refused before a camera or photograph is looked at.

    Args:
        dataset: As of :func:`import_capture`; None where nothing will be written.
        track: As of :func:`import_capture`.
        scene: As of :func:`import_capture`.
        options: As of :func:`import_capture`.

    Raises:
        UnknownNameError: There is no such track.
        DatasetError: The scene's name is none for a folder, or an option is none.
        OutputError: The scene exists.
    """
    check_scene_name(scene)
    check_options(track, options)
    home = Path(dataset) / track / scene if dataset is not None else None
    if home is not None and (home.is_file() or (home.is_dir() and any(home.iterdir()))):
        raise OutputError(
            f"expected a new or an empty folder at {home}, got one in use. Give another --scene"
        )


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
    generator = {"name": IMPORTER, "version": version}
    manifest = Manifest("graycard-capture", FORMAT_VERSION, plan.track, scene, generator, {}, plan.settings)
    with atomic_folder(Path(dataset) / plan.track / scene) as home:
        capture, developed = _write_capture(home / "capture", plan, manifest, progress)
        held = write_held_out(home / HELD_OUT, plan.pictures, manifest, developed.held_out)
        rows = [*developed.rows, *held]
        if plan.has_truth:
            rows += write_given_truth(plan, capture, home / "truth", generator)
        else:
            rows += develop_given_truth(plan, _nothing)
    return merge_rows([*plan.rows, *rows])


def _write_capture(
    folder: Path, plan: ImportPlan, manifest: Manifest, progress: Progress
) -> tuple[Capture, Developed]:
    def keep(shot: PosedPhotograph, light: np.ndarray) -> None:
        write_rgb(folder / f"photographs/{shot.name}.exr", light, quick=shot.keeps_pixels)

    def keep_mask(shot: PosedPhotograph, target: np.ndarray) -> None:
        ids = np.where(target, TARGET, 0)
        write_layers(folder / f"masks/target/{shot.name}.exr", {"object_id": ids})

    developed = develop_pictures(plan.pictures, keep, keep_mask, progress)
    views = tuple(View(s.name, "test" if s.held_out else "train", s.camera) for s in plan.shots)
    target = TARGET if plan.pictures.masks else None
    if plan.points is not None and len(plan.points):
        write_points(folder / POINTS, plan.points)
    light = developed.exposure, plan.track == "dark", target, developed.sensor
    capture = Capture(plan.track, manifest.scene, views, *light)
    write_index(folder, capture)
    write_manifest(folder, manifest)
    return capture, developed


def survey_import(plan: ImportPlan, progress: Progress = silent) -> tuple[ImportRow, ...]:
    """Return the rows that :func:`write_import` would, by reading all pictures and writing nothing.

    Raises:
        DatasetError: A photograph or a true layer is broken, or all photographs are black.
    """
    developed = develop_pictures(plan.pictures, _nothing, _nothing, progress)
    held = develop_held_out(plan.pictures, _nothing)
    return merge_rows([*plan.rows, *developed.rows, *held, *develop_given_truth(plan, _nothing)])


def _nothing(shot: PosedPhotograph, picture: object) -> None:
    """Keep nothing."""

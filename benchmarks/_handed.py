# SPDX-License-Identifier: Apache-2.0
"""Hand a fit a copy of the capture that does not tell its scene, and close all other data to it."""

import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from graycard import TRACKS, Capture, GraycardError, MethodError, open_capture
from graycard.dataset import manifest_of, write_index
from graycard.io import output_error, write_manifest
from graycard.processes import AUDIT_HOOK, SECCOMP, Places
from graycard.records import RUN_FILE

GUARDS = re.compile(rf"(landlock-[0-9]+\+)?({SECCOMP}\+)?{AUDIT_HOOK}|capture-copy-and-audit-hook-1")
"""The ways in which truth was closed to a fit: by the kernel besides, by a hook of Python alone, and as
before, by a hook in the process that read the truth."""
OPAQUE = "this-scene"
"""The name that every scene has in a fit."""
_OF_RUNS = (
    "jobs", "dataset", "stages", "report", RUN_FILE, "comparison.json", "claims.json", "suite.json",
)  # fmt: skip
"""Files and folders of a run that are closed."""


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Return a temporary folder, which goes with the block.

    Raises:
        OutputError: There is no room for it.
    """
    try:
        made = tempfile.TemporaryDirectory(prefix="graycard-", ignore_cleanup_errors=True)
    except OSError as cause:
        raise output_error(Path(tempfile.gettempdir()), cause) from cause
    with made as name:
        yield Path(name).resolve()


@contextmanager
def copied_capture(folder: Path, copy: Path) -> Iterator[Capture]:
    """Copy a capture. The files of the copy do not name the scene; what is yielded does.

    What the user can mend in it is said of the folder that it is a copy of.

    Args:
        folder: The capture.
        copy: Where to; nothing is there yet.

    Raises:
        DatasetError: It is missing or damaged.
        OutputError: There is no room for the copy.
    """
    capture = open_capture(folder)  # what is wrong with it is said of the folder that the user knows
    try:
        shutil.copytree(folder, copy)
    except OSError as cause:
        raise output_error(copy, cause) from cause
    write_index(copy, replace(capture, scene=OPAQUE))
    write_manifest(copy, replace(manifest_of(capture), scene=OPAQUE, seeds={}, settings={}))
    try:
        yield replace(capture, root=copy)
    except GraycardError as cause:
        told = (a.replace(str(copy), str(folder)) if isinstance(a, str) else a for a in cause.args)
        cause.args = tuple(told)
        raise


def check_there(scenes: list[Path]) -> None:
    """Refuse scenes that are not there: to close what lies around their names could close the code.

    Raises:
        DatasetError: A scene is missing.
    """
    for scene in scenes:
        open_capture(Path(scene) / "capture", check=False)


def places_of(
    scratch: Path,
    scenes: list[Path],
    settings: Mapping[str, Any],
    jobs: Path | None = None,
    stages: Path | None = None,
    *,
    allowed: tuple[Path, ...] = (),
    readable: tuple[Path, ...] = (),
) -> Places:
    """Return what is open and what is closed to a fit.

    Args:
        scratch: Folder of its own.
        scenes: ``DATASET/<track>/<scene>`` of what is fitted: their datasets are closed.
        settings: Of the method; a ``checkpoint`` among them names a file or folder that it may write to.
        jobs: Folder of all jobs of the run, whose other files are closed with it.
        stages: Where it saves stages, ``RUN/stages/<code>/<capture>``; other stages of the run are closed.
        allowed: Files and folders that it may read and change besides.
        readable: Files and folders that it may only read: copies of captures, and weights.

    Raises:
        MethodError: Data would be open with what it may read or write.
    """
    closed = [place for scene in scenes for place in _of_dataset(Path(scene).absolute().parents[1], scene)]
    closed += [jobs.parent / name for name in _OF_RUNS] if jobs is not None else []
    closed += [stages.parents[1]] if stages is not None else []
    opened = [stages] if stages is not None else []
    checkpoint = settings.get("checkpoint")
    if isinstance(checkpoint, str) and checkpoint:
        opened.append(Path(checkpoint) if checkpoint.endswith("/") else Path(checkpoint).absolute().parent)
    real = [place.resolve() for place in closed]
    for place in (*opened[stages is not None :], *allowed):
        there = place.resolve()
        if any(data.is_relative_to(there) or there.is_relative_to(data) for data in real):
            raise MethodError(
                f"expected a file or folder without scenes and results, got {place}: a fit could read truth "
                "there. Name one that lies elsewhere"
            )
    for folder in opened:
        _make(folder)
    return Places(
        str(scratch),
        readable=tuple(map(str, readable)),
        writable=tuple(map(str, allowed)),
        closed=tuple(map(str, real)),
        opened=tuple(str(folder.resolve()) for folder in opened),
    )


def _of_dataset(dataset: Path, scene: Path) -> list[Path]:
    """Return what of a dataset is closed: scenes with their truth, and pictures of it."""
    tracks = {Path(scene).absolute().parent.name, *TRACKS}
    return [dataset / name for name in (*sorted(tracks), "look")]


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as cause:
        raise output_error(folder, cause) from cause

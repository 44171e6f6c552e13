# SPDX-License-Identifier: Apache-2.0
"""Predictions of other code as a row of a bench: they are taken as they are, and scored as any others.

FOLDER/<track>/<scene>/predictions.json views/ ...   as docs/formats.md describes
"""

import shutil
from dataclasses import replace
from pathlib import Path

from graycard import Job, PredictionError, finish_predictions, open_predictions, writable_folder
from graycard._files import output_error, sha256_of_files
from graycard._predictions import INDEX

HANDED_IN = "Predictions of other code, handed in: what they were made from, and at which cost, is not known"


def check_folder(folder: str) -> None:
    """Find predictions that are handed in before any work is done.

    Raises:
        PredictionError: There is no such folder.
    """
    if not Path(folder).is_dir():
        raise PredictionError(
            f"expected a folder with predictions of other code, <track>/<scene>/ in it, at {folder}, got "
            f"{'a file' if Path(folder).exists() else 'nothing'}. See docs/formats.md"
        )


def take_predictions(given: Path, folder: Path, job: Job) -> None:
    """Copy predictions into the folder of a job; the index is written last, with the hash of each file.

    Args:
        given: The predictions folder, which is left as it is.
        folder: Where to; what is there is replaced.
        job: What they are of.

    Raises:
        PredictionError: There are none, they are of another scene, or not the files that their index lists.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    found = open_predictions(given)
    if (found.track, found.scene) != (job.track, job.scene):
        raise PredictionError(
            f"expected predictions of {job.track}/{job.scene} in {given}, got those of "
            f"{found.track}/{found.scene}. Put them where they belong, or mend {INDEX}"
        )
    if found.files and not found.is_whole():
        raise PredictionError(
            f"expected the files that {given / INDEX} lists, as they were then, got others. Write the "
            "predictions again, or leave `files` out"
        )
    shutil.rmtree(folder, ignore_errors=True)
    for name in sha256_of_files(given, skip=lambda name: name == INDEX):
        try:
            writable_folder((folder / name).parent)
            shutil.copyfile(given / name, folder / name)
        except OSError as cause:
            raise output_error(folder / name, cause) from cause
    finish_predictions(folder, replace(found, method=job.method))

# SPDX-License-Identifier: Apache-2.0
"""Cameras of bare photographs, found by COLMAP: features, matches, and a sparse model."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from graycard._errors import DatasetError
from graycard.exchange._pycolmap import import_pycolmap
from graycard.exchange.pictures import SUFFIXES
from graycard.io import Progress, silent, temporary_folder

MOST_PAIRS = 60
"""Photographs up to which each is matched with each other; beyond, with its neighbours by name."""
NEIGHBOURS = 20
LARGEST = 1600
"""Longest side, pixels, at which features are looked for."""
SEED = 0


@contextmanager
def find_cameras(photographs: Path, progress: Progress = silent) -> Iterator[Path]:
    """Yield a folder of COLMAP's layout with models of photographs; it goes when the block ends.

    COLMAP decides which photographs share a camera; each has a lens with radial distortion.

    Args:
        photographs: A folder of them, with folders below.
        progress: Called for each step.

    Raises:
        GraycardError: pycolmap is not installed.
        DatasetError: There are no photographs, or COLMAP finds no cameras for them.
    """
    pycolmap = import_pycolmap("finding cameras of bare photographs")
    names = sorted(
        path.relative_to(photographs).as_posix()
        for path in Path(photographs).rglob("*")
        if path.suffix.lower() in SUFFIXES and path.suffix.lower() != ".exr" and path.is_file()
    )
    if len(names) < 2:
        raise DatasetError(
            f"expected two or more photographs as PNG or JPEG in {photographs}, got {len(names)}. Add them"
        )
    with temporary_folder() as folder:
        home, database = Path(photographs).resolve(), folder / "database.db"
        (folder / "images").symlink_to(home, target_is_directory=True)
        pycolmap.logging.minloglevel = 2  # errors alone
        pycolmap.set_random_seed(SEED)
        progress(0.0, "features")
        options = pycolmap.FeatureExtractionOptions(max_image_size=LARGEST)
        mode = pycolmap.CameraMode.AUTO
        pycolmap.extract_features(database, home, names, mode, extraction_options=options)
        progress(0.3, "matches")
        if len(names) <= MOST_PAIRS:
            pycolmap.match_exhaustive(database)
        else:
            near = pycolmap.SequentialPairingOptions(overlap=NEIGHBOURS)
            pycolmap.match_sequential(database, pairing_options=near)
        progress(0.6, "cameras")
        (folder / "sparse").mkdir()
        if not pycolmap.incremental_mapping(database, home, folder / "sparse"):
            raise DatasetError(
                f"expected photographs of one scene that overlap in {photographs}, got {len(names)} that "
                "COLMAP finds no cameras for. Take more, with smaller steps between them"
            )
        yield folder

# SPDX-License-Identifier: Apache-2.0
"""Pictures one after the other: a GIF, an MP4, or a folder of PNG files."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from graycard import MethodError
from graycard.io import atomic_folder, atomic_path

FILMS = (".gif", ".mp4")


def check_film(path: Path) -> None:
    """Refuse a film that cannot be written, before its pictures are drawn.

    Raises:
        MethodError: The suffix is another one, or what encodes MP4 is not installed.
    """
    suffix = Path(path).suffix.lower()
    if suffix and suffix not in FILMS:
        raise MethodError(f"expected .gif, .mp4 or the name of a folder, got {path}. Choose another --out")
    if suffix == ".mp4" and find_spec("imageio_ffmpeg") is None:
        raise MethodError(
            f"expected imageio-ffmpeg to write {path}, got none. Run pip install 'graycard[view]', or choose "
            "a .gif or a folder"
        )


def write_film(path: Path, pictures: Sequence[np.ndarray], rate: float) -> None:
    """Write pictures, whole or not at all.

    Args:
        path: ``.gif`` or ``.mp4``; without a suffix, a new or an empty folder for PNG files.
        pictures: uint8 ``(H, W, 3)``, of one size; MP4 wants even sides.
        rate: Pictures a second.

    Raises:
        MethodError: As :func:`check_film`.
        OutputError: The folder cannot be written to or is in use, or the disk is full.
    """
    import imageio.v3 as iio

    check_film(path)
    suffix = Path(path).suffix.lower()
    if not suffix:
        with atomic_folder(path) as folder:
            for number, picture in enumerate(pictures):
                iio.imwrite(folder / f"{number:04d}.png", picture)
        return
    with atomic_path(path) as partial:
        if suffix == ".gif":
            iio.imwrite(partial, np.stack(pictures), extension=".gif", duration=1000 / rate, loop=0)
        else:
            iio.imwrite(
                partial,
                np.stack(pictures),
                extension=".mp4",
                plugin="FFMPEG",
                fps=rate,
                output_params=["-f", "mp4"],  # the name of a partial file does not tell
            )

# SPDX-License-Identifier: Apache-2.0
"""Captures to the folders of other programs; nothing is left half-written."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal, get_args

from graycard._capture import Capture
from graycard._errors import UnknownNameError
from graycard.dataset import open_capture, open_truth
from graycard.exchange._blender import write_blender
from graycard.exchange._nerfstudio import write_nerfstudio
from graycard.exchange._tensoir import write_tensoir
from graycard.exchange.colmap._folder import write_colmap, write_colmap_binary
from graycard.io import atomic_folder

ExchangeFormat = Literal["nerfstudio", "colmap", "colmap-binary", "blender", "tensoir"]
_WRITERS: dict[ExchangeFormat, Callable[[Capture, Path], None]] = {
    "nerfstudio": write_nerfstudio,
    "colmap": write_colmap,
    "colmap-binary": write_colmap_binary,
    "blender": write_blender,
}


def left_out_of(capture: Capture, kind: ExchangeFormat) -> list[str]:
    """Return parts of a capture that a format has no place for, in words."""
    if kind not in ("blender", "tensoir"):
        return []
    masks = [f"{len(capture.train)} masks of the target"] if capture.target is not None else []
    count = len(capture.points())
    return masks + ([f"{count} sparse points"] if count else [])


def export_capture(scene: Path, kind: ExchangeFormat, out: Path) -> Capture:
    """Write a capture as another program reads it, as 8-bit sRGB at the scene's exposure.

    Cameras of held-out views are written, photographs of them are not: a capture has none. But ``tensoir`` is
    a layout of truth: it has true layers of all views, and pictures of held-out ones.

    Args:
        scene: ``DATASET/<track>/<scene>``.
        kind: The format.
        out: A new or an empty folder.

    Raises:
        UnknownNameError: There is no such format.
        DatasetError: The capture or the truth is missing or damaged, or the format cannot say its cameras.
        OutputError: The folder is in use or cannot be written to, or the disk is full.
    """
    if kind not in get_args(ExchangeFormat):
        raise UnknownNameError("format", kind, get_args(ExchangeFormat))
    capture = open_capture(Path(scene) / "capture")
    truth = open_truth(Path(scene) / "truth") if kind == "tensoir" else None
    with atomic_folder(out) as folder:
        if kind == "tensoir":
            write_tensoir(capture, truth, folder)
        else:
            _WRITERS[kind](capture, folder)
    return capture

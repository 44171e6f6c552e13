# SPDX-License-Identifier: Apache-2.0
"""Shots, names and poses as the camera files of all programs have them, and the checks that all need.

Held-out views: their cameras are exported, their photographs are not, for a capture has none.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

import numpy as np

from graycard._camera import Camera
from graycard._capture import Capture, View
from graycard._errors import DatasetError
from graycard.exchange._lens import Intrinsics, Lens
from graycard.exchange._photographs import write_mask, write_photograph
from graycard.exchange.pictures import SUFFIXES, Files
from graycard.io import check_distinct, check_label, check_name

LOOSE = 1e-3
"""A pose whose axes are this near to a rotation was rounded when it was written, and is made one."""


@dataclass(frozen=True, slots=True)
class PosedPhotograph:
    """One photograph of another program's files, with its camera."""

    name: str
    camera: Camera
    """Pinhole that the files name, without distortion."""
    image: Path
    mask: Path | None = None
    """Black where other programs ignore the photograph."""
    held_out: bool = False
    """True if the files say that it is a test view: then its photograph need not be there."""
    lens: Lens | None = None
    """Lens that bends the photograph; None where nothing does."""
    size: tuple[int, int] = (0, 0)
    """Width and height of the photograph, pixels."""
    cutout: bool = False
    """True if its layout says that nothing is seen where it is transparent."""
    layers: Mapping[str, Path] = field(default_factory=dict)
    """True layers of the view that lie beside its photograph, by graycard's names."""

    @property
    def keeps_pixels(self) -> bool:
        """Tell whether the camera's picture has the photograph's own pixels, none of them averaged."""
        return self.lens is None and self.size == (self.camera.width, self.camera.height)


def make_shot(
    image: Path, name: str, intrinsics: Intrinsics, pose: np.ndarray, where: str
) -> PosedPhotograph:
    """Return a photograph with its camera from numbers that were read.

    Args:
        image: Its file.
        name: Of the view.
        intrinsics: Of its camera.
        pose: Camera to world, shape ``(4, 4)``, OpenCV axes.
        where: File and entry, for the message.

    Raises:
        DatasetError: A number is not finite, or the pose is no rotation with a translation.
    """
    camera = make_camera(intrinsics.size, intrinsics.focal, intrinsics.centre, pose, where)
    return PosedPhotograph(name, camera, image, lens=intrinsics.lens, size=intrinsics.size)


def image_name(view: View) -> str:
    """Return the path of a view's photograph in an export."""
    return f"images/{view.name}.png"


def write_photographs(capture: Capture, folder: Path, mask_suffix: str) -> None:
    """Write the training photographs at the scene's exposure as 8-bit sRGB, and the masks that are granted.

    A mask is black at the target object: nerfstudio and COLMAP both ignore what is black.

    Args:
        capture: What to export.
        folder: Where to: ``images/<view>.png``, ``masks/<view><mask_suffix>``.
        mask_suffix: nerfstudio is told the name of a mask, COLMAP appends ``.png`` to that of the image.
    """
    for view in capture.train:
        write_photograph(folder / image_name(view), capture.photograph(view) * capture.exposure)
        if capture.target is not None:
            write_mask(folder / f"masks/{view.name}{mask_suffix}", capture.target_mask(view))


def make_camera(
    size: tuple[int, int],
    focal: tuple[float, float],
    centre: tuple[float, float],
    pose: np.ndarray,
    where: str,
) -> Camera:
    """Return a camera from numbers that were read.

    Args:
        size: Width and height, pixels.
        focal: fx and fy, pixels.
        centre: Principal point, pixels, (0, 0) at the outer corner of the first pixel.
        pose: Camera to world, shape ``(4, 4)``, OpenCV axes.
        where: File and entry, for the message.

    Raises:
        DatasetError: A number is not finite, the size or the focal length is not positive, or the pose is
            no rotation with a translation.
    """
    K = np.array([[focal[0], 0, centre[0]], [0, focal[1], centre[1]], [0, 0, 1]], dtype=np.float64)
    if not (np.isfinite(K).all() and np.isfinite(pose).all()):
        raise DatasetError(
            f"expected finite intrinsics and a finite pose in {where}, got {K.tolist()} and {pose.tolist()}. "
            "Leave this camera out"
        )
    try:
        return Camera(*size, K, _rigid(pose))
    except ValueError as cause:
        raise DatasetError(f"{where}: {cause}. Correct it, or leave this camera out") from cause


def view_name(image: str) -> str:
    """Return the name of a view from the path of its image: ``images/a/b.png`` becomes ``a_b``."""
    path = PurePosixPath(image.replace("\\", "/"))
    path = path.with_suffix("") if path.suffix.lower() in SUFFIXES else path
    parts = [p for p in path.parts if p not in ("/", ".", "..")]
    return "_".join(parts[1:] if len(parts) > 1 and parts[0] == "images" else parts).lstrip(".")


def source_file(folder: Path, text: str, where: str) -> Path:
    """Return the file that another program's files name, below their folder; links are followed.

    Raises:
        DatasetError: It is absolute, leads out of the folder, or holds control characters.
    """
    path = PurePosixPath(text.replace("\\", "/"))
    try:
        check_label(text)
        if path.is_absolute() or ".." in path.parts or (path.parts[:1] and path.parts[0].endswith(":")):
            raise ValueError(f"got {text!r}")
    except ValueError as cause:
        raise DatasetError(
            f"expected a path below {folder} in {where}, relative to it: {cause}. Put the file there"
        ) from cause
    return folder / path


def photograph_file(folder: Path, text: str, where: str) -> Path:
    """Return the photograph that a file names, with or without its suffix.

    Args:
        folder: Where the path begins.
        text: The path.
        where: File and entry, for the message.

    Returns:
        Its path, also where names differ in case alone; the path as it is named where there is no file.

    Raises:
        DatasetError: It is absolute, leads out of the folder, or holds control characters.
    """
    path = source_file(folder, text, where)
    if path.is_file() or path.suffix.lower() in SUFFIXES:
        return path
    named = [path, *(path.with_name(path.name + suffix) for suffix in SUFFIXES)]
    if there := next((candidate for candidate in named if candidate.is_file()), None):
        return there  # without a look at the whole folder
    files = Files()
    return next((found for candidate in named if (found := files.find(candidate))), path)


def check_names(names: Iterable[str], where: Path) -> None:
    """Prove that there are shots and that no two have one name.

    Raises:
        DatasetError: There is none, or two have one name.
    """
    counts = Counter(names := tuple(names))
    if not counts:
        raise DatasetError(f"expected one or more photographs with their cameras in {where}, got none")
    double = [name for name, count in counts.items() if count > 1]
    if double or "" in counts:
        raise DatasetError(
            f"expected photographs of different names in {where}, got {counts[double[0]] if double else 1} "
            f"named {double[0] if double else ''!r} (folder and suffix aside). Rename them"
        )
    try:
        check_distinct(map(check_name, names))
    except ValueError as cause:
        raise DatasetError(f"{cause}, in {where}. Rename the photograph") from cause


def _rigid(pose: np.ndarray) -> np.ndarray:
    """Return the pose with the nearest rotation (polar decomposition), if it is near to one.

    Else unchanged.
    """
    left, scales, right = np.linalg.svd(pose[:3, :3])
    if np.abs(scales - 1).max() > LOOSE:
        return pose
    mended = pose.copy()
    mended[:3, :3] = left @ right
    return mended

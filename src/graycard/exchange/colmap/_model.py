# SPDX-License-Identifier: Apache-2.0
"""A sparse model of COLMAP in memory, as both its forms hold it, and what a capture takes of it."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from graycard._errors import DatasetError
from graycard.exchange._cameras import LOOSE, PosedPhotograph
from graycard.exchange._develop import develop_pixels
from graycard.exchange._doctor import ImportRow, plural
from graycard.exchange._lens import Intrinsics
from graycard.points import Points, no_points

FARTHEST = 1e30
"""Number in a pose from which it is no place: its square would overflow."""
ROUNDING = 1e-6
"""Pixels by which a keypoint on the border of a picture may lie outside of it."""
HELD_OUT = -1
MISSING = -2


@dataclass(frozen=True, slots=True)
class ModelImage:
    """One image with its pose and keypoints."""

    name: str
    """Path of its file as the model gives it, unchecked."""
    camera: int
    """Id of its camera."""
    pose: np.ndarray
    """Camera to world, shape ``(4, 4)``, OpenCV axes."""
    keypoints: np.ndarray
    """Shape ``(N, 2)``, pixels."""
    where: str
    """File and entry, for messages."""


@dataclass(frozen=True, slots=True)
class ModelPoints:
    """The points with their tracks."""

    positions: np.ndarray
    """Shape ``(N, 3)``, world."""
    colors: np.ndarray
    """Shape ``(N, 3)``, uint8."""
    point: np.ndarray
    """Shape ``(M,)``: for each observation, the index of its point."""
    image: np.ndarray
    """Shape ``(M,)``: for each observation, the id of its image."""
    keypoint: np.ndarray
    """Shape ``(M,)``: for each observation, the index of the keypoint in its image."""


@dataclass(frozen=True, slots=True)
class Model:
    """Cameras, images and points."""

    cameras: Mapping[int, Intrinsics]
    images: Mapping[int, ModelImage]
    points: ModelPoints | None = field(default=None)
    """None where the model has no such file."""


def pose_of(quaternion: Sequence[float], translation: Sequence[float], where: str) -> np.ndarray:
    """Return camera to world, shape ``(4, 4)``, from its inverse.

    Args:
        quaternion: w, x, y, z.
        translation: World to camera.
        where: File and entry, for the message.

    Raises:
        DatasetError: The quaternion is not of unit length, or a number is not finite.
    """
    from scipy.spatial.transform import Rotation

    numbers = [*quaternion, *translation]
    near = all(abs(x) < FARTHEST for x in translation)
    if not (np.isfinite(numbers).all() and near and abs(math.hypot(*quaternion) - 1) < LOOSE):
        raise DatasetError(
            f"expected a unit quaternion and a finite translation in {where}, got {numbers}, of length "
            f"{math.hypot(*quaternion):.4g}, {LOOSE:g} or more from 1. Export the model again, or leave this "
            "image out"
        )
    w, x, y, z = quaternion
    rotation = Rotation.from_quat([x, y, z, w]).as_matrix()  # normalises
    pose = np.eye(4)
    pose[:3, :3] = rotation.T
    pose[:3, 3] = -rotation.T @ np.asarray(translation)
    return pose


def points_of(
    model: Model, shots: Sequence[PosedPhotograph], names: Mapping[int, str]
) -> tuple[Points | None, list[ImportRow]]:
    """Return the points that a training view sees, or that have no track at all, and what is left out.

    Args:
        model: Points and keypoints.
        shots: The views of the capture, in its order, with their cameras as of the capture.
        names: Name of the view by id of its image.
    """
    found = model.points
    if found is None:
        return None, []
    numbers = {shot.name: HELD_OUT if shot.held_out else n for n, shot in enumerate(shots)}
    views = {image: numbers.get(name, MISSING) for image, name in names.items()}
    view = np.array([views.get(int(i), MISSING) for i in found.image], np.int64)
    rows = _left_out(found, view)
    seen = view >= 0
    tracked = np.bincount(found.point, minlength=len(found.positions)) > 0
    kept = ~tracked | (np.bincount(found.point[seen], minlength=len(tracked)) > 0)
    if not kept.any():
        return no_points(), rows
    pixel = np.zeros((len(view), 2))
    inside = seen.copy()
    for image, here in _by_image(found.image, seen):
        shot = shots[numbers[names[image]]]
        pixel[here] = develop_pixels(model.images[image].keypoints[found.keypoint[here]], shot)
        size = shot.camera.width, shot.camera.height
        miss = np.maximum(-pixel[here], pixel[here] - size).max(axis=-1)
        inside[here] = miss < ROUNDING  # not so where it is NaN
    if outside := int((seen & ~inside).sum()):
        said = "left out of the tracks: outside of the pictures once lenses are undone"
        rows.append(ImportRow("observations", outside, said))
    seen = inside
    whole = Points(found.positions, found.colors, found.point[seen], view[seen], pixel[seen])
    rows.insert(
        0, ImportRow("points", int(kept.sum()), f"kept, with {plural(int(seen.sum()), 'observation')}")
    )
    return whole.take(kept), rows


def check_tracks(points: ModelPoints, counts: Mapping[int, int], where: str) -> None:
    """Prove that tracks name keypoints that are there; images that are not there are allowed.

    Args:
        points: They are checked.
        counts: Number of keypoints by id of the image.
        where: The file, for the message.

    Raises:
        DatasetError: A track names a keypoint beyond the last of its image.
    """
    most = np.array([counts.get(int(i), np.iinfo(np.int64).max) for i in points.image], np.int64)
    bad = np.flatnonzero((points.keypoint < 0) | (points.keypoint >= most))
    if len(bad):
        image, keypoint = int(points.image[bad[0]]), int(points.keypoint[bad[0]])
        raise DatasetError(
            f"expected tracks in {where} of keypoints that are there, got keypoint {keypoint} of image "
            f"{image}, which has {counts[image]}. Export the model again"
        )


def _by_image(images: np.ndarray, wanted: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """Yield each image with the indices of its observations that are wanted."""
    here = np.flatnonzero(wanted)
    here = here[np.argsort(images[here], kind="stable")]
    if len(here):
        starts = np.flatnonzero(np.diff(images[here])) + 1
        for part in np.split(here, starts):
            yield int(images[part[0]]), part


def _left_out(found: ModelPoints, view: np.ndarray) -> list[ImportRow]:
    """Return rows about observations and points that a capture does not take."""
    rows = []
    if gone := int((view == MISSING).sum()):
        said = "of images that the model does not have, left out of the tracks"
        rows.append(ImportRow("observations", gone, said, warns=True))
    count = len(found.positions)
    seen = np.bincount(found.point[view >= 0], minlength=count) > 0
    unseen = (np.bincount(found.point, minlength=count) > 0) & ~seen
    if lost := int(unseen.sum()):
        rows.append(ImportRow("points", lost, "left out: only held-out views see them"))
    return rows

# SPDX-License-Identifier: Apache-2.0
"""The plane of a flat glossy surface: at the height at which the views' outlines of it agree (inferred).

Stereo matches what looks alike in two views, which on a mirror is its reflection: a metal table is found at
the depth of the reflected floor. But the outline of the table is its own. The normal is a prior's; for each
of many heights along it the outline in one view is projected to other views by way of the plane, as
silhouettes are in space carving (Kutulakos and Seitz 2000).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
import torch
from scipy.ndimage import binary_opening
from skimage.measure import label
from skimage.morphology import convex_hull_image

from graycard import Camera
from graycard.io import Room
from graycard.methods._tensors import float_tensor
from graycard.methods.goris._training_views import TrainingView
from graycard.methods.removal import points_in_picture
from graycard.methods.surfels import plane_depth

SPREAD = 25.0
"""Degrees from the common normal within which a pixel belongs to the flat surface."""
LEAST_FLAT = 0.75
"""Share of the glossy pixels that have to belong to it, or the surface is curved, or there are several."""
MOST_TURN = 2.5
"""Degrees (root mean square) by which the normal may turn with position on the surface, or it is curved: on
tables of 1.4 m that is a sag of 3 cm, as much as the error of depth by stereo. A prior's errors differ from
view to view and leave less than 1 degree."""
LEAST_AGREEMENT = 0.7
"""Overlap (intersection over union) of outlines below which no height is accepted."""
APART, LESS, MORE_WRONG = 0.1, 0.01, 1.3
"""A height is accepted if all heights farther from it than ``APART`` of the range have an overlap less by
``LESS``, or ``MORE_WRONG`` times as much that does not overlap: where a surface fills the pictures, its
outlines tell little."""
HEIGHTS, FINER = 48, 21
"""Heights that are tried over the range of the sparse points and a quarter beyond, then around the best."""
_BEYOND = 0.25
_EVERY = 3
"""Pixels between those of an outline that are projected."""
_PARTNERS = 7
"""Views at most to which each outline is projected."""


@dataclass(frozen=True, eq=False)
class _Outline:
    """Outline of the flat surface in one view."""

    camera: Camera
    inside: np.ndarray
    """Shape ``(H, W)``, bool: the convex hull of what is visible, as objects on the surface occlude parts of
    it. Hulls are preserved by projection."""


@dataclass(frozen=True, eq=False)
class _Told:
    """Answers of a prior on the surfaces in one view."""

    normal: np.ndarray
    """Shape ``(H, W, 3)``, world, float64."""
    glossy: np.ndarray
    """Shape ``(H, W)``, bool."""
    known: np.ndarray
    """Shape ``(H, W)``, bool: where it tells a normal."""

    def faces(self, common: np.ndarray) -> np.ndarray:
        """Return where normals are near another one, shape ``(H, W)``, bool."""
        return self.normal @ common > np.cos(np.radians(SPREAD))


@dataclass(frozen=True, eq=False)
class FlatSurface:
    """A flat glossy surface in the training views."""

    mirrors: list[np.ndarray]
    """Masks of each view, shape ``(H, W)``, bool: what is glossy and does not face another way. Glazed
    objects on a table do: they count as rough, as reflected rays meet rough surfels alone, so that the
    table reflects them."""
    depths: list[np.ndarray]
    """z-depth of each view, shape ``(H, W)``, metres, NaN where it does not see the surface."""
    normal: np.ndarray
    """Shape ``(3,)``, world, unit, towards the cameras: the median of a prior's, whose errors differ from
    pixel to pixel."""

    def alone(self, shots: Sequence[TrainingView]) -> list[TrainingView]:
        """Return the views with this surface as the only glossy one, and its normal there in place of a
        prior's.
        """
        found, room = [], Room()
        for shot, mask in zip(shots, self.mirrors, strict=True):
            glossy, normal = room.keep(self._alone(shot, float_tensor(mask)))
            found.append(replace(shot, glossy=glossy, normal=normal))
        return found

    def _alone(self, shot: TrainingView, mirror: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return what is glossy, and normals."""
        assert shot.normal is not None, "normals told of the surface"
        normal = torch.where(mirror[..., None] > 0, float_tensor(self.normal), shot.normal)
        return shot.glossy * mirror, normal


def flat_surface(shots: Sequence[TrainingView], points: np.ndarray) -> FlatSurface | None:
    """Return the flat glossy surface of a scene, if there is one.

    Args:
        shots: The training views, with a prior's masks and normals.
        points: Shape ``(M, 3)``, world, metres: the sparse points, whose range is searched.

    Returns:
        None where no prior tells normals or glossy surfaces, they are not flat, no height is accepted, or
        there are no points.
    """
    views, room = [], Room()
    for shot in shots:
        if not shot.told or shot.normal is None:
            return None
        normal = shot.normal.numpy().astype(np.float64)
        known = (normal**2).sum(axis=-1) > 0.5
        views.append(room.keep(_Told(normal, shot.glossy.numpy() > 0.5, known)))
    count = sum(int((view.glossy & view.known).sum()) for view in views)
    if min(count, len(points)) == 0:
        return None
    common = _median(views)
    common /= max(float(np.linalg.norm(common)), 1e-12)
    flat = [room.keep(view.glossy & view.known & view.faces(common)) for view in views]
    if sum(int(of.sum()) for of in flat) / count < LEAST_FLAT:
        return None
    outlines = [
        room.keep(_Outline(shot.photograph.camera, _hull(of))) for shot, of in zip(shots, flat, strict=True)
    ]
    height = _height(outlines, common, points @ common)
    if height is None:
        return None
    plane = np.append(common, -height)
    depths = [
        room.keep(np.where(of & one.inside, plane_depth(one.camera, plane), np.nan))
        for of, one in zip(flat, outlines, strict=True)
    ]
    if _turn(outlines, depths, views, common) > MOST_TURN:
        return None
    mirrors = [room.keep(view.glossy & (view.faces(common) | ~view.known)) for view in views]
    return FlatSurface(mirrors, depths, common)


def _median(views: Sequence[_Told]) -> np.ndarray:
    """Return the median of the normals of glossy pixels, shape ``(3,)``."""
    parts = (
        Room().joined(view.normal[view.glossy & view.known, axis] for view in views) for axis in range(3)
    )
    return np.array([np.median(part, overwrite_input=True) for part in parts])


def _hull(flat: np.ndarray) -> np.ndarray:
    """Return the convex hull of the largest connected part, specks left out."""
    parts = cast(np.ndarray, label(binary_opening(flat), connectivity=1))  # no return_num, no tuple
    if not parts.any():
        return np.zeros_like(flat)
    return convex_hull_image(parts == 1 + np.bincount(parts.ravel())[1:].argmax())


def _height(outlines: Sequence[_Outline], normal: np.ndarray, known: np.ndarray) -> float | None:
    """Height of the best overlap, metres along the normal; None if it is low, or as high nearly anywhere."""
    margin = _BEYOND * np.ptp(known)
    heights = np.linspace(known.min() - margin, known.max() + margin, HEIGHTS)
    agree = np.array([agreement(outlines, normal, height) for height in heights])
    best = int(agree.argmax())
    if best in (0, HEIGHTS - 1) or agree[best] < LEAST_AGREEMENT:
        return None
    other = agree[np.abs(heights - heights[best]) > APART * np.ptp(heights)].max()
    if other > agree[best] - LESS and 1 - other < MORE_WRONG * (1 - agree[best]):
        return None
    finer = np.linspace(heights[best - 1], heights[best + 1], FINER)
    return float(finer[np.argmax([agreement(outlines, normal, height) for height in finer])])


def _turn(
    outlines: Sequence[_Outline], depths: Sequence[np.ndarray], views: Sequence[_Told], common: np.ndarray
) -> float:
    """Turn of normals with position, degrees (root mean square).

    The components of normals along the plane are fitted by a linear function of position: on a sphere they
    are one, and errors that do not depend on position drop out. Sums over views are enough for the fit.
    """
    along = np.linalg.svd(common[None])[2][1:]

    def parts() -> Iterator[np.ndarray]:
        """Yield places and normals along the plane, shape ``(N, 4)``, of each view."""
        for one, depth, view in zip(outlines, depths, views, strict=True):
            seen = np.isfinite(depth)
            places = one.camera.unproject(depth)[seen]
            yield np.concatenate([places @ along.T, view.normal[seen] @ along.T], axis=1)

    count = sum(int(np.isfinite(depth).sum()) for depth in depths)
    mean = np.sum([part.sum(axis=0) for part in parts()], axis=0) / count
    spread = np.sum([(part - mean).T @ (part - mean) for part in parts()], axis=0) / count
    slope = np.linalg.lstsq(spread[:2, :2], spread[:2, 2:], rcond=None)[0]
    return float(np.degrees(np.sqrt(np.trace(slope.T @ spread[:2, :2] @ slope))))


def agreement(outlines: Sequence[_Outline], normal: np.ndarray, height: float) -> float:
    """Intersection over union of outlines and of those of other views, projected by way of a plane.

    Args:
        outlines: One a view.
        normal: Shape ``(3,)``, unit, of the plane.
        height: Along it, metres.

    Returns:
        From 0 to 1; 0 where no view sees what another does.
    """
    both = either = 0
    for number, one in enumerate(outlines):
        depth = plane_depth(one.camera, np.append(normal, -height))
        some = np.zeros_like(one.inside)
        some[::_EVERY, ::_EVERY] = True
        some &= np.isfinite(depth)
        places = one.camera.unproject(depth)[some]
        others = [other for k, other in enumerate(outlines) if k != number]
        for other in others[number % _step(len(others)) :: _step(len(others))]:
            seen, row, column, _ = points_in_picture(other.camera, places)
            mine, theirs = one.inside[some][seen], other.inside[row, column]
            both += int((mine & theirs).sum())
            either += int((mine | theirs).sum())
    return both / max(either, 1)


def _step(others: int) -> int:
    return max(1, -(-others // _PARTNERS))

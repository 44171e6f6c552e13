# SPDX-License-Identifier: Apache-2.0
"""Sparse points as structure from motion would find them in the training photographs.

Corners of the photographs are followed through the views by the true geometry; what is uncertain about real
ones is put back: their pixels are noisy, their positions are triangulated from these, some are wrong.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from graycard import Camera, Points, View, srgb_encode
from graycard.synth._spec import CaptureSettings
from graycard.synth._stream import stream

MIN_VIEWS = 3
"""A track of two is as often a wrong match as a right one; incremental mappers want three."""
MIN_ANGLE = 1.5
"""Degrees between the outer rays of a track, as COLMAP's ``filter_min_tri_angle``."""
DARKEST = 0.06
"""Display grey, 15 of 255, below which the noise of a camera hides a patch."""
QUALITY = 0.02
"""Smaller eigenvalue of the structure tensor, in shares of the photograph's largest, below which there is no
corner: between OpenCV's usual 0.01 and 0.1. Less, and the noise of the renderer passes for corners."""
_GRAZING = 0.2
"""Cosine of the steepest view under which a patch still looks like itself: 78 degrees."""
_STEPS = 5
_DEPTHS = (0.5, 2.0)
"""Distances: how far wrong matches put a point, in shares of its distance from the first camera."""


_Peaks = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Sighting:
    """Pixels of one training view with what they show, each array ``(H, W, ...)``."""

    index: int
    """Index of the view in ``capture.views``."""
    camera: Camera
    shown: np.ndarray
    """The displayed photograph in [0, 1], three channels."""
    position: np.ndarray
    normal: np.ndarray
    object_id: np.ndarray

    @property
    def grey(self) -> np.ndarray:
        """Mean of the channels, shape ``(H, W)``."""
        return self.shown.mean(axis=-1)


def sighting(
    index: int, view: View, photograph: np.ndarray, exposure: float, layers: dict[str, np.ndarray]
) -> Sighting:
    """Return what a view sees, from its photograph and its true layers at pixel centres."""
    depth, rays = layers["depth"].astype(np.float64), view.camera.rays()
    distance = np.where(np.isfinite(depth), depth, 0) / (rays @ view.camera.forward)
    return Sighting(
        index,
        view.camera,
        srgb_encode(photograph * exposure),
        view.camera.position + distance[..., None] * rays,
        layers["normal"].astype(np.float64),
        layers["object_id"],
    )


def sparse_points(sightings: Sequence[Sighting], settings: CaptureSettings, seed: int) -> Points:
    """Return the points that structure from motion would find: as many as there are, at most
    ``settings.points``.

    Args:
        sightings: The training views.
        settings: How many points, their noise in pixels and their share of outliers.
        seed: Of the scene.

    Returns:
        Points, those of the strongest corners; perhaps none.
    """
    true, strength = _tracks(sightings)
    order = np.argsort(-strength, kind="stable")[: settings.points]
    kept = np.zeros(len(strength), dtype=bool)
    kept[order] = True
    true = true.take(kept)
    if not len(true):
        return true
    cameras = {s.index: s.camera for s in sightings}
    noise = stream(seed, "points.noise").normal(0, settings.point_noise, true.pixel.shape)
    noisy = Points(true.positions, true.colors, true.point, true.view, true.pixel + noise)
    found = Points(triangulate(noisy, cameras), true.colors, true.point, true.view, noisy.pixel)
    return _with_outliers(found, noise, cameras, settings.outliers, stream(seed, "points.outliers"))


def triangulate(points: Points, cameras: dict[int, Camera]) -> np.ndarray:
    """Positions of least squared reprojection error, by Gauss-Newton, shape ``(N, 3)``, metres.

    Args:
        points: Observations, with positions to start from.
        cameras: By index of the view.
    """
    found = points.positions.copy()
    for _ in range(_STEPS):
        miss, slope = _residuals(found, points, cameras)
        normal = _sums(np.einsum("mij,mik->mjk", slope, slope), points)
        rhs = _sums(np.einsum("mij,mi->mj", slope, miss), points)
        found = found + np.linalg.solve(normal, rhs[..., None])[..., 0]
    return found


def _residuals(
    positions: np.ndarray, points: Points, cameras: dict[int, Camera]
) -> tuple[np.ndarray, np.ndarray]:
    """Observed minus projected pixels ``(M, 2)``, and the slope of the projection ``(M, 2, 3)``."""
    miss, slope = np.zeros((len(points.point), 2)), np.zeros((len(points.point), 2, 3))
    for index, camera in cameras.items():
        here = points.view == index
        local = positions[points.point[here]] @ camera.world_to_camera[:3, :3].T
        local = local + camera.world_to_camera[:3, 3]
        z = local[:, 2]
        projected = np.zeros((len(z), 2, 3))
        projected[:, 0, 0] = projected[:, 1, 1] = 1 / z
        projected[:, :, 2] = -local[:, :2] / z[:, None] ** 2
        slope[here] = camera.K[:2, :2] @ projected @ camera.world_to_camera[:3, :3]
        miss[here] = points.pixel[here] - camera.project(positions[points.point[here]])[0]
    return miss, slope


def _sums(values: np.ndarray, points: Points) -> np.ndarray:
    sums = np.zeros((len(points), *values.shape[1:]))
    np.add.at(sums, points.point, values)
    return sums


def _tracks(sightings: Sequence[Sighting]) -> tuple[Points, np.ndarray]:
    """Return true positions of corners with all pixels that see them, and how strong each corner is."""
    taken = {s.index: np.zeros(s.grey.shape, dtype=bool) for s in sightings}
    positions, colors, strengths, seen = [], [], [], []
    peaks = [_peaks(s) for s in sightings]
    for s, (rows, columns, response) in zip(sightings, peaks, strict=True):
        free = ~taken[s.index][rows, columns]
        corners, strength = (rows[free], columns[free]), response[free]
        places, normals = s.position[corners], s.normal[corners]
        pixels = [
            _pixels_that_see(places, normals, s.object_id[corners], other, peak)
            for other, peak in zip(sightings, peaks, strict=True)
        ]
        visible = np.stack([v for _, v in pixels], axis=-1)
        kept = (visible.sum(axis=-1) >= MIN_VIEWS) & (_angle(places, visible, sightings) >= MIN_ANGLE)
        first = sum(len(p) for p in positions)
        for other, (pixel, sees) in zip(sightings, pixels, strict=True):
            here = kept & sees
            _mark(taken[other.index], pixel[here])
            number = first + np.cumsum(kept)[here] - 1
            seen.append((number, np.full(len(number), other.index), pixel[here]))
        positions.append(places[kept])
        colors.append(np.rint(255 * s.shown[corners][kept]).astype(np.uint8))
        strengths.append(strength[kept])
    point, view, pixel = (np.concatenate([part[i] for part in seen]) for i in range(3))
    return Points(np.concatenate(positions), np.concatenate(colors), point, view, pixel), np.concatenate(
        strengths
    )


def _peaks(s: Sighting) -> _Peaks:
    """Rows and columns of the corners that a view shows, and the smaller eigenvalue at each."""
    from skimage.feature import corner_peaks, corner_shi_tomasi  # two seconds, for whoever fits or scores

    response = corner_shi_tomasi(s.grey, sigma=1)
    peaks = corner_peaks(response, min_distance=2, threshold_abs=0, threshold_rel=QUALITY)
    rows, columns = peaks.astype(np.intp).reshape(-1, 2).T
    good = (s.object_id[rows, columns] > 0) & (s.grey[rows, columns] >= DARKEST)
    return rows[good], columns[good], response[rows, columns][good]


def _pixels_that_see(
    places: np.ndarray, normals: np.ndarray, ids: np.ndarray, s: Sighting, peaks: _Peaks
) -> tuple[np.ndarray, np.ndarray]:
    """Return where places appear in a view ``(N, 2)``, and whether it sees them well enough to match them."""
    pixel, z = s.camera.project(places)
    inside = (z > 0) & (pixel >= 0).all(axis=-1) & (pixel < (s.camera.width, s.camera.height)).all(axis=-1)
    column, row = np.where(inside[:, None], pixel, 0).astype(np.intp).T
    away = s.camera.position - places
    facing = np.einsum("ni,ni->n", normals, away) > _GRAZING * np.linalg.norm(away, axis=-1)
    gap = np.linalg.norm(s.position[row, column] - places, axis=-1)
    # Half a pixel's diagonal on a surface seen at the steepest angle; a hidden point is farther away.
    near = gap <= np.maximum(z, 0) / s.camera.K[0, 0] * np.sqrt(0.5) / _GRAZING
    # A corner that is but noise in one photograph is not found again in the next.
    again = np.zeros(s.grey.shape, dtype=bool)
    _mark(again, np.stack(peaks[1::-1], axis=-1))
    return pixel, inside & facing & near & again[row, column] & (s.object_id[row, column] == ids)


def _angle(places: np.ndarray, visible: np.ndarray, sightings: Sequence[Sighting]) -> np.ndarray:
    """Return the widest angle between two rays to each place, degrees, shape ``(N,)``."""
    rays = np.stack([s.camera.position - places for s in sightings], axis=1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    cosine = np.einsum("nai,nbi->nab", rays, rays)
    both = visible[:, :, None] & visible[:, None, :]
    return np.degrees(np.arccos(np.clip(np.where(both, cosine, 1).min(axis=(1, 2)), -1, 1)))


def _mark(taken: np.ndarray, pixel: np.ndarray) -> None:
    """Take the pixels around each point, so that its corner in another view is not a second point."""
    height, width = taken.shape
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            column = np.clip(pixel[:, 0].astype(np.intp) + dx, 0, width - 1)
            row = np.clip(pixel[:, 1].astype(np.intp) + dy, 0, height - 1)
            taken[row, column] = True


def _with_outliers(
    points: Points,
    noise: np.ndarray,
    cameras: dict[int, Camera],
    share: float,
    rng: np.random.Generator,
) -> Points:
    """Return some points moved along the ray of their first view, and seen where that puts them.

    A repeated texture gives such matches: they agree with all their pixels, so no reprojection error tells
    them. Pixels outside a photograph are dropped; a point that fewer than two would be left of stays right.
    """
    wrong = rng.random(len(points)) < share
    factor = np.exp(rng.uniform(np.log(_DEPTHS[0]), np.log(_DEPTHS[1]), len(points)))
    first = np.full(len(points), max(cameras) + 1)
    np.minimum.at(first, points.point, points.view)
    eyes = np.array([cameras[index].position for index in first])
    moved = eyes + np.where(wrong, factor, 1)[:, None] * (points.positions - eyes)
    pixel, inside = np.zeros_like(points.pixel), np.zeros(len(points.point), dtype=bool)
    for index, camera in cameras.items():
        here = points.view == index
        pixel[here], z = camera.project(moved[points.point[here]])
        pixel[here] += noise[here]
        size = camera.width, camera.height
        inside[here] = (z > 0) & (pixel[here] >= 0).all(axis=-1) & (pixel[here] < size).all(axis=-1)
    wrong &= np.bincount(points.point[inside], minlength=len(points)) >= 2
    of_wrong = wrong[points.point]
    kept = ~of_wrong | inside
    return Points(
        np.where(wrong[:, None], moved, points.positions),
        points.colors,
        points.point[kept],
        points.view[kept],
        np.where(of_wrong[:, None], pixel, points.pixel)[kept],
    )

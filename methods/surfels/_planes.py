# SPDX-License-Identifier: Apache-2.0
"""Large planes among points, and where views see them: rooms and tables are made of these.

A plane sweep fails where little is to be seen on a surface, where a highlight moves over it, and where it is
seen at a grazing angle, for its windows face the camera. On a plane that is known from where the sweep did
not fail, windows lie as the surface does, and one choice of few is asked for (piecewise planar stereo: Sinha
et al. 2009; Gallup et al. 2010).
"""

from collections.abc import Sequence

import numpy as np

from graycard import Camera
from graycard.io import Room
from graycard.methods._numba import njit
from graycard.methods.splat.parallel import UNWRAPPED, run, share, task
from graycard.methods.surfels._ncc import SweptView, mean_ncc
from graycard.methods.surfels._paths import Ease, semi_global
from graycard.methods.surfels._sweep import SweptDepth, partners_of
from graycard.methods.surfels._transfer import count_hidden

MOST = 6
"""Planes that are looked for."""
SHARE = 0.03
"""Share of all points that a plane must hold."""
THICK = 0.015
"""Distance of a point to its plane, in shares of that to its camera."""
SAMPLES, TRIALS = 4000, 1500
"""Points that are looked at, and planes through three of them that are tried."""
NEARBY = 60
"""Points, nearest in an order along the images, from which the three are drawn."""
WINDOW = 5
"""Pixels on each side of the windows that are compared: with few labels, fewer pixels tell more of edges."""
FAINT = 0.3
"""Likeness up to which windows tell nothing: neighbours decide."""
SURFACE = 0.2
"""Cost of a pixel that lies on none of the planes, in likeness: planes are what rooms are made of."""
CHANGE = 0.6
"""Cost of a change between neighbouring pixels costs, where the photograph shows no edge."""
EDGE = 0.03
"""Difference of grey, encoded, that takes this price to 1/e: planes end where the photograph has edges."""
LEAST = 0.1
"""Share of the price that the sharpest edge leaves."""
IN_THE_WAY = 1.0
"""Cost that a pixel pays for each view that sees through where it would be."""
BEYOND = 2.0
"""Limit: how far planes are followed, in farthest depths that are looked at."""


def with_planes(views: Sequence[SweptView], swept: Sequence[SweptDepth], seed: int) -> list[SweptDepth]:
    """Depths that are those of large planes wherever these look right.

    Args:
        views: Photographs, as they were swept.
        swept: What the sweep says about each.
        seed: Of the trials.

    Returns:
        Depths of the planes where a view sees one, and sure there; elsewhere as they were.
    """
    points, reach = _sure_points(views, swept)
    planes = large_planes(points, THICK * reach, seed)
    if not len(planes):
        return list(swept)
    room = Room()
    return [room.keep(_on_planes(number, views, swept, planes)) for number in range(len(views))]


def large_planes(points: np.ndarray, tolerance: np.ndarray, seed: int) -> np.ndarray:
    """Planes that hold many of the points, the largest first (RANSAC: Fischler and Bolles 1981).

    Args:
        points: shape ``(M, 3)``, metres; neighbours in this order are likely to be on one surface.
        tolerance: shape ``(M,)``, metres: how far each may lie off its plane.
        seed: equal seeds give equal planes.

    Returns:
        Shape ``(K, 4)``, K from 0 to ``MOST``: unit normals n and offsets d, with n x + d = 0.
    """
    random, least = np.random.default_rng(seed), max(3, SHARE * len(points))
    planes = []
    while len(planes) < MOST and len(points) >= least:
        plane = _largest(points, tolerance, random)
        if (_off(points, plane) < tolerance).sum() < least:
            break
        planes.append(plane)
        rest = _off(points, plane) > 2 * tolerance
        points, tolerance = points[rest], tolerance[rest]
    return np.array(planes).reshape(-1, 4)


def plane_depth(camera: Camera, plane: np.ndarray) -> np.ndarray:
    """z-depth at which each pixel sees a plane, shape ``(H, W)``, metres; NaN where it does not."""
    rays = camera.rays() / (camera.rays() @ camera.forward)[..., None]
    towards = rays @ plane[:3]
    with np.errstate(divide="ignore"):
        depth = -(camera.position @ plane[:3] + plane[3]) / towards
    return np.where(np.isfinite(depth) & (depth > 0), depth, np.nan)


def _sure_points(views: Sequence[SweptView], swept: Sequence[SweptDepth]) -> tuple[np.ndarray, np.ndarray]:
    """Return some of the points that stereo is sure of, world, and how far they are from their cameras,
    metres.
    """
    counts = [int(one.sure.sum()) for one in swept]
    some = np.linspace(0, sum(counts) - 1, min(SAMPLES, sum(counts))).astype(np.int64)
    found, reach, first = [], [], 0
    for view, one, count in zip(views, swept, counts, strict=True):
        own = some[(some >= first) & (some < first + count)] - first
        first += count
        rays = view.camera.rays()[one.sure]
        distance = one.depth[one.sure] / (rays @ view.camera.forward)
        found.append(view.camera.position + rays[own] * distance[own, None])
        reach.append(distance[own])
    return np.concatenate(found), np.concatenate(reach)


def _largest(points: np.ndarray, tolerance: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the best of many planes through three points near each other, fitted to all that it holds."""
    first = random.integers(len(points), size=TRIALS)
    others = (first[:, None] + random.integers(1, NEARBY, size=(TRIALS, 2))) % len(points)
    a, b, c = points[first], points[others[:, 0]], points[others[:, 1]]
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(lengths > 0, lengths, 1)
    offsets = -(normals * a).sum(axis=1)
    scores = np.empty(TRIALS)
    _score(points, tolerance, normals, offsets, scores)
    best = int(np.where(lengths[:, 0] > 0, scores, 0).argmax())
    plane = np.append(normals[best], offsets[best])
    for _ in range(3):
        plane = _fitted(points[_off(points, plane) < tolerance], plane)
    return plane


@njit(cache=True)
def _score(points, tolerance, normals, offsets, scores):
    """Return how well planes hold points: the less the farther off, by squares (MSAC: Torr and Zisserman
    2000).

    Args:
        points: ``(M, 3)``, metres.
        tolerance: ``(M,)``, metres.
        normals: ``(K, 3)``.
        offsets: ``(K,)``, metres.
        scores: ``(K,)``, to be written.
    """
    run(task(_score_some, (points, tolerance, normals, offsets, scores)))


@njit(**UNWRAPPED)
def _score_some(part, parts, points, tolerance, normals, offsets, scores):
    """Write a part of the scores."""
    first, past = share(part, parts, len(normals))
    for plane in range(first, past):
        x, y, z, offset = normals[plane, 0], normals[plane, 1], normals[plane, 2], offsets[plane]
        score = 0.0
        for at in range(len(points)):
            off = (points[at, 0] * x + points[at, 1] * y + points[at, 2] * z + offset) / tolerance[at]
            score += max(1 - off * off, 0.0)
        scores[plane] = score


def _fitted(points: np.ndarray, plane: np.ndarray) -> np.ndarray:
    """Return the plane of least squares; the one that was, if there are too few points."""
    if len(points) < 3:
        return plane
    mean = points.mean(axis=0)
    normal = np.linalg.svd(points - mean, full_matrices=False)[2][2]
    return np.append(normal, -normal @ mean)


def _off(points: np.ndarray, plane: np.ndarray) -> np.ndarray:
    return np.abs(points @ plane[:3] + plane[3])


def _on_planes(
    number: int, views: Sequence[SweptView], swept: Sequence[SweptDepth], planes: np.ndarray
) -> SweptDepth:
    """Return what a view sees: the surface that stereo found, or one of the planes."""
    view, found = views[number], swept[number]
    partners = [views[p] for p in partners_of(views, number)]
    if not partners:
        return found
    depths = np.stack([found.depth, *(plane_depth(view.camera, plane) for plane in planes)])
    valid = np.isfinite(depths) & (depths < BEYOND * view.far)
    depths = np.where(valid, depths, view.far)
    ncc = mean_ncc(view, partners, 1 / depths, WINDOW)
    cost = np.where(valid, 1 - np.maximum(ncc, FAINT), 2.0)
    cost[0] += np.where(found.sure, 0, SURFACE)
    blocks = np.zeros(depths[1:].shape, np.int32)
    for other, (seen, its) in enumerate(zip(views, swept, strict=True)):
        if other != number:
            count_hidden(view.camera, depths[1:], seen.camera, its.depth, its.sure, blocks)
    cost[1:] += IN_THE_WAY * blocks
    label = semi_global(np.moveaxis(cost, 0, -1), CHANGE, CHANGE, _edges(view)).argmin(axis=-1)
    chosen = np.take_along_axis(depths, label[None], axis=0)[0]
    return SweptDepth(np.where(label > 0, chosen, found.depth), found.sure | (label > 0))


def _edges(view: SweptView) -> Ease:
    """Costs: how easily planes change between neighbours, down and across."""
    down, across = (np.abs(np.diff(view.grey.numpy(), axis=axis)) for axis in (0, 1))
    return LEAST + (1 - LEAST) * np.exp(-down / EDGE), LEAST + (1 - LEAST) * np.exp(-across / EDGE)

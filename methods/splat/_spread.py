# SPDX-License-Identifier: Apache-2.0
"""Even subsets of points on surfaces."""

import numpy as np
from scipy.spatial import KDTree

NEIGHBOURS = 3
"""Whose root mean squared distance is called the spacing, as in 3D Gaussian Splatting."""
_SURPLUS = 1.03
_ROUNDS = 12


def spread_evenly(points: np.ndarray, count: int, seed: int, sizes: np.ndarray | None = None) -> np.ndarray:
    """Choose points that keep their distance from each other and leave no hole.

    Darts are thrown at the points until each one is taken or lies within one distance of a taken one
    (a maximal Poisson-disc sample, Cook 1986); the distance is adapted until ``count`` are left.

    Args:
        points: shape ``(M, D)``, in any space with a Euclidean distance.
        count: how many to choose; all are if there are no more.
        seed: of the order in which darts are thrown.
        sizes: shape ``(M,)``, positive: the distance to keep around each point, in any unit; equal for all
            by default.

    Returns:
        ``min(count, M)`` indices, ascending.
    """
    if len(points) <= count:
        return np.arange(len(points))
    sizes = np.ones(len(points)) if sizes is None else sizes
    tree, order = KDTree(points), np.random.default_rng(seed).permutation(len(points))
    radius = _first_radius(tree, points[order[:1000]], sizes[order[:1000]], len(points) / count)
    best = order
    for _ in range(_ROUNDS):
        taken = _throw_darts(tree, order, radius * sizes)
        if count <= len(taken) < len(best):
            best = taken
        if count <= len(taken) <= _SURPLUS * count:
            break
        radius *= np.sqrt(len(taken) / (count * (1 + _SURPLUS) / 2))  # on a surface: distance^2 times count
    return np.sort(_without_crowded(points, best, sizes[best], len(best) - count))


def spacing(points: np.ndarray) -> np.ndarray:
    """Root mean squared distance of each point to its nearest neighbours, shape ``(M,)``; M >= 2."""
    count = min(NEIGHBOURS, len(points) - 1)
    distances, _ = KDTree(points).query(points, k=count + 1)
    return np.sqrt((distances[:, 1:] ** 2).mean(axis=1))  # a point is its own nearest


def _first_radius(tree: KDTree, some: np.ndarray, sizes: np.ndarray, share: float) -> float:
    """About the distance within which lie as many points as one chosen stands for."""
    distances, _ = tree.query(some, k=int(np.ceil(share)) + 1)
    return max(float(np.median(distances[:, -1] / sizes)), float(np.finfo(np.float32).tiny))


def _throw_darts(tree: KDTree, order: np.ndarray, radii: np.ndarray) -> np.ndarray:
    free = np.ones(len(order), dtype=bool)
    taken = []
    for dart in order:
        if free[dart]:
            taken.append(dart)
            free[tree.query_ball_point(tree.data[dart], radii[dart])] = False
    return np.array(taken)


def _without_crowded(points: np.ndarray, chosen: np.ndarray, sizes: np.ndarray, surplus: int) -> np.ndarray:
    """Drop those with the nearest neighbours, but never both of two neighbours."""
    if surplus == 0:
        return chosen
    found = KDTree(points[chosen]).query(points[chosen], k=2)
    distances, nearest = np.asarray(found[0]), np.asarray(found[1])
    gone: set[int] = set()
    for point in np.argsort(distances[:, 1] / sizes, kind="stable"):
        if len(gone) < surplus and int(nearest[point, 1]) not in gone:
            gone.add(int(point))
    rest = np.setdiff1d(np.arange(len(chosen)), list(gone))
    return chosen[rest[: len(chosen) - surplus]]

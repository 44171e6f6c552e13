# SPDX-License-Identifier: Apache-2.0
"""Procedural triangle meshes in numpy: closed, outward, with texture coordinates and own normals.

Normals are made here and not by the renderer, whose parallel version sums them in a random order.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

_Corner = tuple[int, int, int, int]
"""A vertex of a box: the axis of the face that it belongs to, and on which side of each axis it lies."""

_SIGNS = tuple((x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1))


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """A triangle mesh; faces run counter-clockwise seen from outside."""

    vertices: np.ndarray
    """Shape ``(V, 3)``, metres."""
    faces: np.ndarray
    """Shape ``(F, 3)``, indices of vertices."""
    normals: np.ndarray
    """Shape ``(V, 3)``, unit length."""
    uv: np.ndarray
    """Texture coordinates, shape ``(V, 2)``."""

    def moved(self, to: Iterable[float], turn: float = 0.0, size: float = 1.0) -> "Mesh":
        """Return this mesh scaled by ``size``, turned by ``turn`` radians about z, then moved by ``to``
        metres.
        """
        rotation = turn_about_z(turn)
        vertices = size * self.vertices @ rotation.T + np.asarray(tuple(to))
        return replace(self, vertices=vertices, normals=self.normals @ rotation.T)

    def tilted(self, angle: float) -> "Mesh":
        """Return this mesh turned by ``angle`` radians about x."""
        c, s = np.cos(angle), np.sin(angle)
        rotation = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
        return replace(self, vertices=self.vertices @ rotation.T, normals=self.normals @ rotation.T)

    def posed(self, rotation: np.ndarray, to: np.ndarray) -> "Mesh":
        """Return this mesh turned by a rotation matrix of shape ``(3, 3)``, then moved by ``to`` metres."""
        return replace(self, vertices=self.vertices @ rotation.T + to, normals=self.normals @ rotation.T)


def turn_about_z(angle: float) -> np.ndarray:
    """Rotation matrix about z by ``angle`` radians, shape ``(3, 3)``."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def merge(parts: Iterable[Mesh]) -> Mesh:
    """Several meshes as one object."""
    parts = list(parts)
    offsets = np.cumsum([0, *(len(p.vertices) for p in parts[:-1])])
    return Mesh(
        np.concatenate([p.vertices for p in parts]),
        np.concatenate([p.faces + o for p, o in zip(parts, offsets, strict=True)]),
        np.concatenate([p.normals for p in parts]),
        np.concatenate([p.uv for p in parts]),
    )


def box(size: tuple[float, float, float], bevel: float = 0.01) -> Mesh:
    """Return a box around the origin with bevelled edges.

    Args:
        size: Full edge lengths, metres.
        bevel: Width of the bevel, metres; the normals turn smoothly across it.

    Returns:
        A mesh whose texture coordinates are metres.
    """
    half = np.array(size) / 2
    bevel = min(bevel, 0.45 * float(min(size)))
    keys: list[_Corner] = [(axis, *sign) for axis in range(3) for sign in _SIGNS]
    vertices = np.array([np.where(np.arange(3) == axis, half, half - bevel) * sign for axis, *sign in keys])
    normals = np.array([np.eye(3)[axis] * sign[axis] for axis, *sign in keys])
    uv = np.array([np.delete(vertex, key[0]) for vertex, key in zip(vertices, keys, strict=True)])
    polygons = [[keys.index(corner) for corner in polygon] for polygon in _box_polygons()]
    return Mesh(vertices, _outward(vertices, polygons), normals, uv)


def _box_polygons() -> list[list[_Corner]]:
    """Six faces, twelve bevels and eight corners as rings of ``(axis, sx, sy, sz)``."""
    ring = ((-1, -1), (-1, 1), (1, 1), (1, -1))
    polygons: list[list[_Corner]] = []
    for axis in range(3):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        for side in (-1, 1):
            polygons.append([(axis, *_signs({axis: side, a: s, b: t})) for s, t in ring])
        for s, t in ring:
            low, high = (_signs({a: s, b: t, axis: end}) for end in (-1, 1))
            polygons.append([(a, *low), (a, *high), (b, *high), (b, *low)])
    return polygons + [[(axis, *sign) for axis in range(3)] for sign in _SIGNS]


def _signs(by_axis: dict[int, int]) -> tuple[int, int, int]:
    return by_axis[0], by_axis[1], by_axis[2]


def _outward(vertices: np.ndarray, polygons: list[list[int]]) -> np.ndarray:
    """Triangles of convex polygons around the origin, each turned so that it faces away from it."""
    faces = [(p[0], p[i], p[i + 1]) for p in polygons for i in range(1, len(p) - 1)]
    a, b, c = (vertices[[f[k] for f in faces]] for k in range(3))
    inward = (np.cross(b - a, c - a) * (a + b + c)).sum(-1) < 0
    return np.array([(f[0], f[2], f[1]) if flip else f for f, flip in zip(faces, inward, strict=True)])


def lathe(profile: Iterable[tuple[float, float]], segments: int = 64) -> Mesh:
    """Return a body turned about z.

    Args:
        profile: ``(radius, height)`` in metres, from the axis at the bottom along the outside upwards;
            it ends on the axis, so that the body is closed.
        segments: Number of steps around the axis.

    Returns:
        A mesh whose u runs once around and whose v is the share of the profile's length.
    """
    line = np.array(list(profile), dtype=np.float64)
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    radius, height = line[None, :, 0], line[None, :, 1]
    points = np.stack(
        [radius * np.cos(angle)[:, None], radius * np.sin(angle)[:, None], height + 0 * angle[:, None]],
        axis=-1,
    )
    u, v = np.meshgrid(angle / (2 * np.pi), length / length[-1], indexing="ij")
    return grid(points, np.stack([u, v], axis=-1))


def torus(major: float, minor: float, segments: int = 64) -> Mesh:
    """Return a ring around z: ``major`` to the middle of the tube, ``minor`` the tube's radius, metres."""
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    around, tube = np.meshgrid(angle, angle, indexing="ij")
    distance = major + minor * np.cos(tube)
    points = np.stack([distance * np.cos(around), distance * np.sin(around), minor * np.sin(tube)], axis=-1)
    return grid(points, np.stack([around * 3, tube], axis=-1) / (2 * np.pi))


def blob(radius: float, rng: np.random.Generator, roughness: float = 0.12, segments: int = 64) -> Mesh:
    """Return a pebble: a sphere whose radius varies smoothly by about ``roughness`` of itself."""
    polar, around = np.meshgrid(
        np.linspace(0, np.pi, segments // 2 + 1), np.linspace(0, 2 * np.pi, segments + 1), indexing="ij"
    )
    outward = np.stack(
        [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1
    )
    bumps = np.zeros(polar.shape)
    for frequency in (1.7, 2.9, 4.6):
        wave = rng.normal(size=3) * frequency
        bumps += np.sin(outward @ wave + rng.uniform(0, 2 * np.pi)) / frequency
    points = radius * (1 + roughness * bumps)[..., None] * outward
    uv = np.stack([around / (2 * np.pi), 1 - polar / np.pi], axis=-1)
    return grid(points.swapaxes(0, 1)[:, ::-1], uv.swapaxes(0, 1)[:, ::-1])


def grid(points: np.ndarray, uv: np.ndarray) -> Mesh:
    """Return a smooth mesh over a rectangular grid of points.

    Args:
        points: Shape ``(U, V, 3)``, metres; outside is along ``d/du x d/dv``.
        uv: Texture coordinates, shape ``(U, V, 2)``.
    """
    rows, columns = points.shape[:2]
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    a = (i * columns + j).ravel()
    b, c, d = a + columns, a + columns + 1, a + 1
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    vertices = points.reshape(-1, 3)
    area = np.linalg.norm(_face_normals(vertices, faces), axis=1)
    faces = faces[area > 1e-14]  # at a pole one side of a cell has no length
    return Mesh(vertices, faces, smooth_normals(vertices, faces), uv.reshape(-1, 2))


def smooth_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return unit normals of vertices, shape ``(V, 3)``: area-weighted means over the faces around each
    point.

    Vertices at the same place (a seam, a pole) share one normal.
    """
    _, place = np.unique(np.round(vertices, 7), axis=0, return_inverse=True)
    place = place.reshape(-1)
    total = np.zeros((place.max() + 1, 3))
    weighted = _face_normals(vertices, faces)
    for corner in range(3):
        np.add.at(total, place[faces[:, corner]], weighted)
    return (total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30))[place]


def _face_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)

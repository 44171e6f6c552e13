# SPDX-License-Identifier: Apache-2.0
"""Surfaces on which objects stand, flat and curved, as shapes alone."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from graycard.synth._mesh import Mesh, box, lathe, turn_about_z

HEIGHT = 0.75
"""Height of the highest point of each surface, metres."""

_SOLE = 0.004
"""Tolerance: what lies no higher above an object's lowest point belongs to the sole that it stands on,
metres."""


class Surface(Protocol):
    """A surface above the origin that objects can stand on."""

    def top(self) -> Mesh:
        """Return the surface and the board that it belongs to; texture coordinates are metres."""
        ...

    def foot(self) -> Mesh:
        """Support of the board."""
        ...

    def stand(self, shape: Mesh, x: float, y: float, turn: float) -> Mesh:
        """Return a shape that stood on z = 0 at the origin, stood at a place of the surface.

        Args:
            shape: As it was.
            x: Place along x, metres.
            y: Place along y, metres.
            turn: Angle by which the shape is turned about its own upright axis, radians.
        """
        ...


@dataclass(frozen=True, slots=True)
class Flat:
    """A rectangular table top."""

    length: float = 1.5
    width: float = 1.1

    def top(self) -> Mesh:
        """Return a board 5 cm thick."""
        return box((self.length, self.width, 0.05), 0.015).moved((0, 0, HEIGHT - 0.025))

    def foot(self) -> Mesh:
        """Return a dark trestle, a little smaller than the top."""
        height = HEIGHT - 0.05
        return box((self.length - 0.4, self.width - 0.4, height), 0.02).moved((0, 0, height / 2))

    def stand(self, shape: Mesh, x: float, y: float, turn: float) -> Mesh:
        """Return the shape, upright."""
        return shape.moved((x, y, HEIGHT), turn)


@dataclass(frozen=True, slots=True)
class Dome:
    """A round table top that is a cap of a sphere: it bulges upwards."""

    curvature: float
    """One over the sphere's radius, 1/m."""
    reach: float = 0.72
    """From the axis to the edge, metres."""

    def top(self) -> Mesh:
        """Return a board 5 cm thick at its edge, with the sphere's own normals."""
        angle = np.linspace(np.arcsin(self.reach * self.curvature), 0, 49)
        sphere = 1 / self.curvature
        arc = [(float(sphere * np.sin(a)), self._fall(float(sphere * np.sin(a)))) for a in angle]
        under, lip = arc[0][1] - 0.05, self.reach + 0.01
        side = [(0.0, under), (lip - 0.008, under), (lip, under + 0.008), (lip, arc[0][1] - 0.012)]
        board = lathe([*side, *arc], 128)
        outward = (board.vertices + np.array([0, 0, sphere])) * self.curvature
        on_cap = np.abs(np.linalg.norm(outward, axis=1) - 1) < 1e-6
        normals = np.where(on_cap[:, None], outward, board.normals)
        uv = board.vertices[:, :2]
        return replace(board, vertices=board.vertices + np.array([0, 0, HEIGHT]), normals=normals, uv=uv)

    def foot(self) -> Mesh:
        """Return a turned pedestal."""
        top = HEIGHT + self._fall(self.reach) - 0.05
        t = np.linspace(0, 1, 24)
        waist = 0.12 + 0.24 * (2 * t - 1) ** 4
        side = [(float(r), float(z)) for r, z in zip(waist, 0.02 + (top - 0.02) * t, strict=True)]
        return lathe([(0.0, 0.0), (side[0][0], 0.0), *side, (0.0, top)], 48)

    def stand(self, shape: Mesh, x: float, y: float, turn: float) -> Mesh:
        """Return the shape with its axis along the normal, sunk until the rim of its sole touches
        the sphere.
        """
        outward = np.array([x, y, 1 / self.curvature + self._fall(float(np.hypot(x, y)))]) * self.curvature
        low = shape.vertices[:, 2] < shape.vertices[:, 2].min() + _SOLE
        sole = float(np.linalg.norm(shape.vertices[low, :2], axis=1).max())
        contact = np.array([0, 0, HEIGHT - 1 / self.curvature]) + outward / self.curvature
        rotation = _from_z_to(outward) @ turn_about_z(turn)
        return shape.posed(rotation, contact + self._fall(sole) * outward)

    def _fall(self, distance: float) -> float:
        """Height of the cap at a distance from its axis, relative to its top: 0 or less, metres."""
        return float(np.sqrt(1 / self.curvature**2 - distance**2) - 1 / self.curvature)


def _from_z_to(direction: np.ndarray) -> np.ndarray:
    """Return the smallest rotation that takes +z to a unit vector above the horizon, shape ``(3, 3)``."""
    x, y, z = direction
    cross = np.array([[0, 0, x], [0, 0, y], [-x, -y, 0]])
    return np.eye(3) + cross + cross @ cross / (1 + z)  # Rodrigues' formula

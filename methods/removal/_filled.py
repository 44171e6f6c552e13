# SPDX-License-Identifier: Apache-2.0
"""Holes that a prior inpaints, and the points of the background that inpainted views show."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, cast

import numpy as np
import torch
from scipy.ndimage import binary_dilation, label
from skimage.restoration import inpaint_biharmonic

from graycard import Camera
from graycard.io import Room
from graycard.methods._contract import Priors
from graycard.methods.removal._behind import Behind, points_in_picture
from graycard.methods.splat import depth_to_normals


@dataclass(frozen=True, eq=False)
class BackgroundPoints:
    """Points of the background behind the object, as inpainted views show them."""

    points: np.ndarray
    """Shape ``(M, 3)``, world, metres."""
    normals: np.ndarray
    """Shape ``(M, 3)``, world, unit, to the view that shows them."""
    colours: np.ndarray
    """Shape ``(M, 3)``, linear, display range."""
    distances: np.ndarray
    """Shape ``(M,)``, metres, from that view."""
    layers: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Other values, by name, each ``(M,)`` or ``(M, C)``."""


@dataclass(frozen=True, eq=False)
class Target:
    """The target of a training view without the object."""

    behind: Behind
    picture: np.ndarray
    """Shape ``(H, W, 3)``, linear, display range."""
    known: np.ndarray
    """Shape ``(H, W)``, bool: in the hole, where ``picture`` says what is there."""
    layers: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Other layers to show, by name, each ``(H, W)`` or ``(H, W, C)``."""


class Choice(NamedTuple):
    """Rule by which views that tell others are chosen."""

    candidates: int
    """Number of views that are filled in."""
    pick: Callable[[Mapping[int, Target], int], dict[int, Target]]
    """Handed those and how many are wanted."""


def targets_of(
    behind: Sequence[Behind],
    priors: Priors,
    references: int,
    choose: Choice | None = None,
) -> tuple[list[Target], BackgroundPoints]:
    """Targets of views, and the points that their holes show.

    Args:
        behind: The training views.
        priors: They inpaint radiance.
        references: Views that are filled in and tell the others, those with the largest holes; 0: all views
            are, and none tells another.
        choose: Which of more views that are filled in tell the others; None: those with the largest holes.

    Raises:
        MethodError: The prior does not inpaint, or its answer is not sound.
    """
    filled = filled_views(behind, priors, choose.candidates if choose and references else references)
    if choose and references:
        filled = choose.pick(filled, references)
    wall = _joined([_wall(target) for target in filled.values()])
    if not references:
        return own_targets(behind, filled), wall
    room = Room()
    return [filled[k] if k in filled else _told(one, wall, room) for k, one in enumerate(behind)], wall


def filled_views(behind: Sequence[Behind], priors: Priors, most: int = 0) -> dict[int, Target]:
    """Return the views with the largest holes, inpainted, by the numbers of the views.

    Args:
        behind: The training views.
        priors: They inpaint radiance, and other layers if there are any.
        most: No more views than these; 0: all that have a hole.

    Raises:
        MethodError: The prior does not inpaint, or its answer is not sound.
    """
    order = sorted(range(len(behind)), key=lambda k: -int(behind[k].hole.sum()))
    with_hole = [k for k in order if behind[k].hole.any()]
    room = Room()
    return {k: _filled(behind[k], priors, room) for k in (with_hole[:most] if most else with_hole)}


def _filled(behind: Behind, priors: Priors, room: Room) -> Target:
    picture = np.maximum(priors.inpainting(behind.picture, behind.view, behind.hole), 0)
    layers = {
        name: priors.inpainting(layer, behind.view, behind.hole, name)
        for name, layer in behind.layers.items()
    }
    return Target(behind, room.keep(picture), behind.hole, room.keep(layers))


def own_targets(behind: Sequence[Behind], filled: Mapping[int, Target]) -> list[Target]:
    """Each view as it was filled in for itself, and as it is where it has no hole."""
    return [filled.get(k, Target(one, one.picture, one.hole, one.layers)) for k, one in enumerate(behind)]


def _wall(filled: Target) -> BackgroundPoints:
    """Return the points in the hole of a filled view, on depths that go on from around it."""
    behind = filled.behind
    camera, hole = behind.view.camera, behind.hole
    depth = filled_depth(behind.depth, hole)
    rays = camera.rays()
    distance = depth / (rays @ camera.forward)
    normals = depth_to_normals(torch.from_numpy(depth), camera).numpy()
    lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
    normals = np.where(lengths > 0, normals / np.maximum(lengths, 1e-12), -rays)  # the border has none
    shown = hole & np.isfinite(depth)
    points = camera.position + distance[shown][:, None] * rays[shown]
    layers = {name: layer[shown] for name, layer in filled.layers.items()}
    return BackgroundPoints(points, normals[shown], filled.picture[shown], distance[shown], layers)


def filled_depth(depth: np.ndarray, hole: np.ndarray) -> np.ndarray:
    """Depth whose hole is filled by the smoothest surface that goes on from its rim.

    The inverse of depth is filled in, for it is linear on the image of a plane (biharmonic equation, solved
    by scikit-image).

    Args:
        depth: Shape ``(H, W)``, z-depth, metres; +inf where there is nothing.
        hole: Shape ``(H, W)``, bool.

    Returns:
        Shape ``(H, W)``, metres; +inf where there is nothing, and in parts of the hole that no surface rims.
    """
    seen = np.isfinite(depth) & ~hole
    parts, count = cast(tuple[np.ndarray, int], label(hole))  # a number only if it is handed an output
    rims = [part for part in range(1, count + 1) if binary_dilation(parts == part)[seen].any()]
    told = np.isin(parts, rims)
    if not told.any():
        return np.where(hole, np.inf, depth)
    inverse = np.where(seen, 1 / np.where(seen, depth, 1.0), 0.0)
    filled = inpaint_biharmonic(inverse, ~seen)  # within the range of what is seen: above 0
    return np.where(told, 1 / np.where(told, filled, 1.0), np.where(hole, np.inf, depth))


def _told(behind: Behind, wall: BackgroundPoints, room: Room) -> Target:
    """Return a view as the wall tells it: its nearest points, each in the pixel that it falls into."""
    camera = behind.view.camera
    rows, columns, nearest = seen_points(camera, wall.points)
    inside = behind.hole[rows, columns]
    rows, columns, nearest = rows[inside], columns[inside], nearest[inside]
    known = np.zeros_like(behind.hole)
    known[rows, columns] = True

    def told(image: np.ndarray, points: np.ndarray) -> np.ndarray:
        image = image.copy()
        image[rows, columns] = points[nearest]
        return image

    layers = room.keep({name: told(behind.layers[name], points) for name, points in wall.layers.items()})
    picture = room.keep(told(behind.picture, wall.colours))
    return Target(behind, picture, known, {**behind.layers, **layers})


def seen_points(camera: Camera, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows and columns of the pixels that points fall into, and the number of the nearest point in each.

    Args:
        camera: Of the view.
        points: Shape ``(M, 3)``, world, metres.
    """
    numbers, rows, columns, z = points_in_picture(camera, points)
    order = np.argsort(z, kind="stable")
    pixels, first = np.unique((rows * camera.width + columns)[order], return_index=True)
    return pixels // camera.width, pixels % camera.width, numbers[order][first]


def _joined(walls: Sequence[BackgroundPoints]) -> BackgroundPoints:
    """All points; none of no walls."""
    if not walls:
        nothing = np.zeros((0, 3))
        return BackgroundPoints(nothing, nothing, nothing, np.zeros(0))
    names = ("points", "normals", "colours", "distances")
    layers = {name: np.concatenate([wall.layers[name] for wall in walls]) for name in walls[0].layers}
    joined = {name: np.concatenate([getattr(wall, name) for wall in walls]) for name in names}
    return BackgroundPoints(**joined, layers=layers)

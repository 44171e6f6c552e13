# SPDX-License-Identifier: Apache-2.0
"""The background behind an object: what other views have seen of it, and what none has."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import torch

from graycard import Camera, Capture, View
from graycard.io import Room
from graycard.methods.removal._target import widened
from graycard.methods.surfels import all_colours, coloured_layers

NEAR = 0.02
"""Relative difference in depth within which a point is the one that a view sees."""


@dataclass(frozen=True, eq=False)
class Behind:
    """A training view without the object."""

    view: View
    doubt: np.ndarray
    """Shape ``(H, W)``, bool: the object and what is next to it, where the photograph is masked out."""
    hole: np.ndarray
    """Shape ``(H, W)``, bool: part of ``doubt`` that no other view has seen behind the object."""
    picture: np.ndarray
    """Shape ``(H, W, 3)``, linear, display range: the photograph, and in doubt what surfels show."""
    depth: np.ndarray
    """Shape ``(H, W)``, z-depth of the surfels, metres; +inf where they cover less than half of a pixel."""
    layers: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Other layers, by name, each ``(H, W)`` or ``(H, W, C)``: to be filled in too."""


@dataclass(frozen=True, eq=False)
class RenderedView:
    """View of surfels, as :class:`Behind` has it."""

    picture: np.ndarray
    depth: np.ndarray
    layers: Mapping[str, np.ndarray] = field(default_factory=dict)


def views_behind(
    capture: Capture,
    draw: Callable[[Camera], RenderedView],
    masks: Sequence[np.ndarray],
    grow: float,
    effects: Sequence[np.ndarray] | None = None,
    added: Sequence[np.ndarray] | None = None,
) -> list[Behind]:
    """Return the training views without the object.

    Args:
        capture: The photographs.
        draw: What a camera sees without the object.
        masks: Of the object, one a view, shape ``(H, W)``, bool.
        grow: By which they are widened, a share of the width.
        effects: Where views show the object by way of other surfaces, as ``masks``; None: nowhere. There
            photographs are in doubt too, but what is there is seen.
        added: Light that photographs lack for the object's shadow, one a view, shape ``(H, W, 3)``, linear,
            display range; None: none.
    """
    hidden = [widened(mask, grow) for mask in masks]
    doubts = hidden
    if effects is not None:
        doubts = [one | widened(effect, grow) for one, effect in zip(hidden, effects, strict=True)]
    room = Room()
    drawn = [room.keep(draw(view.camera)) for view in capture.train]
    cameras = [view.camera for view in capture.train]
    found = []
    for number, view in enumerate(capture.train):
        shown = drawn[number]
        others = [(cameras[k], drawn[k].depth, hidden[k]) for k in range(len(cameras)) if k != number]
        hole = hidden[number] & ~seen_elsewhere(cameras[number], shown.depth, hidden[number], others)
        photograph = np.asarray(capture.photograph(view), np.float64) * capture.exposure
        photograph = photograph if added is None else photograph + added[number]
        picture = room.keep(np.where(doubts[number][..., None], shown.picture, photograph))
        found.append(Behind(view, doubts[number], hole, picture, shown.depth, shown.layers))
    return found


def drawn_colours(values: Mapping[str, torch.Tensor]) -> Callable[[Camera], RenderedView]:
    """Return what cameras see of coloured surfels: the picture, linear and in display range, over their sky.

    Args:
        values: Parameters of surfels and sky by name.
    """

    @torch.no_grad()
    def draw(camera: Camera) -> RenderedView:
        layers = coloured_layers(values, all_colours(values, camera), camera, exposure=1.0)
        return RenderedView(layers["radiance"].astype(np.float64), layers["depth"].astype(np.float64))

    return draw


def seen_elsewhere(
    camera: Camera,
    depth: np.ndarray,
    where: np.ndarray,
    others: Sequence[tuple[Camera, np.ndarray, np.ndarray]],
) -> np.ndarray:
    """Return which pixels show a surface that another view sees too, and there not in doubt (as 3DGIC has
    it).

    Args:
        camera: Of the view.
        depth: Shape ``(H, W)``, without the object, metres; +inf where nothing is known.
        where: Shape ``(H, W)``, bool: which pixels are asked for.
        others: Camera, depth and doubt of the other views.

    Returns:
        Shape ``(H, W)``, bool.
    """
    asked = where & np.isfinite(depth)
    rays = camera.rays()[asked]
    points = camera.position + depth[asked][:, None] * rays / (rays @ camera.forward)[:, None]
    seen = np.zeros(len(points), bool)
    for other, its_depth, its_doubt in others:
        numbers, rows, columns, z = points_in_picture(other, points)
        alike = np.abs(z / its_depth[rows, columns] - 1) <= NEAR  # where it sees nothing, never
        seen[numbers] |= alike & ~its_doubt[rows, columns]
    found = np.zeros_like(where)
    found[asked] = seen
    return found


def points_in_picture(
    camera: Camera, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Numbers of the points that fall into a picture, their rows and columns there, and z-depths in metres.

    Args:
        camera: Of the view.
        points: Shape ``(M, 3)``, world, metres.
    """
    places, z = camera.project(points)
    column, row = np.floor(np.where(z[:, None] > 0, places, -1)).astype(int).T
    inside = (z > 0) & (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
    numbers = np.flatnonzero(inside)
    return numbers, row[numbers], column[numbers], z[numbers]

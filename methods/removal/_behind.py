# SPDX-License-Identifier: Apache-2.0
"""What is behind an object: what other views saw of it, and what none has ever seen."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from graycard import Camera, Capture, View
from graycard.methods.removal._target import widened
from graycard.methods.surfels import all_colours, coloured_layers

NEAR = 0.02
"""A point whose depth differs from what a view sees there by no more than this share is what it sees."""


@dataclass(frozen=True, eq=False)
class Behind:
    """A training view without the object."""

    view: View
    doubt: np.ndarray
    """Shape ``(H, W)``, bool: the object and what is next to it, where the photograph is not believed."""
    hole: np.ndarray
    """Shape ``(H, W)``, bool: part of ``doubt`` that no other view has seen behind the object."""
    picture: np.ndarray
    """Shape ``(H, W, 3)``, linear, display range: the photograph, and in doubt what surfels show."""
    depth: np.ndarray
    """Shape ``(H, W)``, z-depth of the surfels, metres; +inf where they cover less than half of a pixel."""


def views_behind(
    capture: Capture,
    values: Mapping[str, torch.Tensor],
    masks: Sequence[np.ndarray],
    grow: float,
) -> list[Behind]:
    """The training views without the object.

    Args:
        capture: The photographs.
        values: Parameters of surfels and sky by name, the object's taken out.
        masks: Of the object, one a view, shape ``(H, W)``, bool.
        grow: By which they are widened, a share of the width.
    """
    doubts = [widened(mask, grow) for mask in masks]
    drawn = [_drawn(values, view.camera) for view in capture.train]
    cameras = [view.camera for view in capture.train]
    depths = [depth for _, depth in drawn]
    found = []
    for number, view in enumerate(capture.train):
        doubt, (shown, depth) = doubts[number], drawn[number]
        others = [(cameras[k], depths[k], doubts[k]) for k in range(len(cameras)) if k != number]
        hole = doubt & ~seen_elsewhere(cameras[number], depth, doubt, others)
        photograph = np.asarray(capture.photograph(view), np.float64) * capture.exposure
        found.append(Behind(view, doubt, hole, np.where(doubt[..., None], shown, photograph), depth))
    return found


def seen_elsewhere(
    camera: Camera,
    depth: np.ndarray,
    where: np.ndarray,
    others: Sequence[tuple[Camera, np.ndarray, np.ndarray]],
) -> np.ndarray:
    """Which pixels show a surface that another view sees too, and there not in doubt (as 3DGIC has it).

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


@torch.no_grad()
def _drawn(values: Mapping[str, torch.Tensor], camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Picture, linear and in display range, and z-depth of surfels over their sky."""
    layers = coloured_layers(values, all_colours(values, camera), camera, exposure=1.0)
    return layers["radiance"].astype(np.float64), layers["depth"].astype(np.float64)

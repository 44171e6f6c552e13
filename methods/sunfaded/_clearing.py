# SPDX-License-Identifier: Apache-2.0
"""Find space without surfaces: before what a training camera sees by stereo, a prior or the sparse points.

What hangs right before a camera is seen by that camera alone, and explains its photograph however wrong it
is: no other view objects. Such plates take the surfels that the surfaces behind them need.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from scipy.ndimage import minimum_filter

from graycard import Camera, Capture
from graycard.io import Room
from graycard.methods.splat import CENTRES
from graycard.methods.sunfaded._guess import GeometryGuess
from graycard.methods.surfels import SweptDepth, observations

WINDOW = 9
"""Pixels on each side of the windows whose least depth counts: edges of a prior's depth are soft."""
FEWEST = 10
"""Points of a view by which the scale of a prior's depth is found."""


@dataclass(frozen=True, eq=False)
class Clearing:
    """Finds surfels that hang before surfaces which a training camera sees."""

    cameras: Sequence[Camera]
    """Cameras of the training views."""
    free: Sequence[torch.Tensor]
    """Depth z of each before which nothing is, shape ``(H, W)``, metres; 0 where nobody knows."""

    def __call__(self, surfels: Mapping[str, torch.Tensor]) -> torch.Tensor:
        """Return True for surfels whose centre a camera looks through, shape ``(N,)``."""
        centres = surfels[CENTRES].detach()
        found = torch.zeros(len(centres), dtype=torch.bool, device=centres.device)
        for camera, free in zip(self.cameras, self.free, strict=True):
            found |= _before(centres, camera, free)
        return found


def _before(centres: torch.Tensor, camera: Camera, free: torch.Tensor) -> torch.Tensor:
    pose, lens = (centres.new_tensor(m, dtype=torch.float32) for m in (camera.world_to_camera, camera.K))
    seen = centres @ pose[:3, :3].T + pose[:3, 3]
    depth = seen[:, 2]
    column, row = (seen @ lens.T)[:, :2].T / depth.clamp(min=1e-6)
    inside = (depth > 0) & (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
    column, row = (torch.where(inside, place, 0.0).long() for place in (column, row))
    return inside & (depth < free[row, column])


def clearing_of(
    capture: Capture,
    guesses: Sequence[GeometryGuess],
    share: float,
    swept: Sequence[SweptDepth] | None = None,
) -> Clearing:
    """Return the space that is free before each training camera.

    What stereo is sure of counts first. Elsewhere a prior's depth counts, whose scale is found by the sparse
    points that the view saw. Without one the nearest of these points is taken for the nearest surface.

    Args:
        capture: Cameras and sparse points.
        guesses: One a training view.
        share: Of those depths up to which it is free, below 1: all are rough.
        swept: Depth of each training view by stereo; None without.
    """
    points = capture.points()
    numbers = [n for n, view in enumerate(capture.views) if view.split == "train"]
    cameras = [capture.views[n].camera for n in numbers]
    free, room = [], Room()
    found = [None] * len(numbers) if swept is None else swept
    for n, camera, guess, stereo in zip(numbers, cameras, guesses, found, strict=True):
        pixels, depths = observations(points, n, camera)
        known = None if guess.depth is None else scaled_depth(guess.depth.numpy(), pixels, depths)
        if known is None:
            nearest = depths.min() if len(depths) else 0.0
            known = np.full((camera.height, camera.width), nearest)
        if stereo is not None:
            known = np.where(stereo.sure, stereo.depth, known)
        least = minimum_filter(known, WINDOW)
        depth = np.where(np.isfinite(least), share * least, 0.0).astype(np.float32)
        free.append(room.keep(torch.from_numpy(depth)))
    return Clearing(cameras, free)


def scaled_depth(guess: np.ndarray, pixels: np.ndarray, depths: np.ndarray) -> np.ndarray | None:
    """Return a prior's depth in metres: times the median of what sparse points say that is missing.

    Args:
        guess: Shape ``(H, W)``, above 0, of any scale; infinite where it knows nothing.
        pixels: Where points are seen, shape ``(N, 2)``, as :meth:`Camera.project` gives them.
        depths: Theirs, shape ``(N,)``, z, metres.

    Returns:
        Shape ``(H, W)``; None if too few points are seen.
    """
    column, row = pixels.astype(int).T
    told = guess[row, column]
    usable = np.isfinite(told)
    if usable.sum() < FEWEST:
        return None
    return guess * np.median(depths[usable] / told[usable])

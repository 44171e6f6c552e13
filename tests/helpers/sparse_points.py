# SPDX-License-Identifier: Apache-2.0
"""Sparse points for the tiny scene: true ones, and many."""

from pathlib import Path

import numpy as np

from graycard import Capture, Points, open_capture, open_truth, srgb_encode
from graycard.points import write_points


def with_points(scene: Path, spacing: int = 3) -> Capture:
    """The capture with sparse points, here of every third pixel that sees something."""
    capture = open_capture(scene / "capture", check=False)
    truth = open_truth(scene / "truth", check=False)
    found = []
    for number, view in enumerate(capture.views):
        if view.split == "train":
            layers, rays = truth.layers(view), view.camera.rays()
            distance = layers["depth"] / (rays @ view.camera.forward)
            chosen = np.zeros(distance.shape, bool)
            chosen[::spacing, ::spacing] = True
            row, column = np.nonzero(chosen & np.isfinite(distance))
            positions = view.camera.position + distance[row, column, None] * rays[row, column]
            shown = srgb_encode(capture.photograph(view)[row, column] * capture.exposure)
            pixel = np.stack([column, row], axis=1) + 0.5
            found.append((positions, shown, np.full(len(row), number), pixel))
    positions, shown, views, pixel = (np.concatenate(parts) for parts in zip(*found, strict=True))
    colours = np.rint(255 * shown).astype(np.uint8)
    points = Points(positions, colours, np.arange(len(positions)), views, pixel)
    write_points(scene / "capture" / "points.ply", points)
    return capture

# SPDX-License-Identifier: Apache-2.0
"""Sparse points in COLMAP's text: ``points3D.txt``, and their keypoints in ``images.txt``."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from graycard._capture import Capture
from graycard._errors import DatasetError
from graycard.points import Points, no_points

_FIELDS = "POINT3D_ID X Y Z R G B ERROR TRACK[]"
Keypoints = Mapping[str, tuple[int | None, list[str]]]
"""By image id: the index of its view, None where that is held out, and the fields of its keypoints."""


@dataclass(frozen=True, slots=True)
class PointLines:
    """What the text files say about points."""

    keypoints: dict[str, str]
    """The second line of an image, by name of the view."""
    points: list[str]
    """The lines of ``points3D.txt``."""


def point_lines(capture: Capture) -> PointLines:
    """The points of a capture; images are numbered from 1 in the order of its training views."""
    points = capture.points()
    keypoints, tracks = {}, [""] * len(points)
    for image, view in enumerate(capture.train, 1):
        here = np.flatnonzero(points.view == capture.views.index(view))
        fields = [f"{_text(points.pixel[m])} {points.point[m] + 1}" for m in here]
        keypoints[view.name] = " ".join(fields)
        for index, m in enumerate(here):
            tracks[points.point[m]] += f" {image} {index}"
    errors = _reprojection_errors(capture, points)
    rows = zip(points.positions, points.colors, errors, tracks, strict=True)
    lines = [
        f"{number} {_text(position)} {color[0]} {color[1]} {color[2]} {error!r}{track}"
        for number, (position, color, error, track) in enumerate(rows, 1)
    ]
    return PointLines(keypoints, lines)


def parse_points(lines: Iterable[tuple[int, str]], keypoints: Keypoints, path: Path) -> Points:
    """The points of ``points3D.txt`` that a training view sees, or that have no track at all.

    Raises:
        DatasetError: A line is malformed, or a track names an image or a keypoint that is not there.
    """
    positions, colors, seen = [], [], []
    for number, line in lines:
        fields, where = line.split(), f"{path}, line {number}"
        if not fields or fields[0].startswith("#"):
            continue
        position, color, track = _point(fields, keypoints, where)
        if not track and len(fields) > 8:
            continue
        seen += [(len(positions), *observation) for observation in track]
        positions.append(position)
        colors.append(color)
    if not positions:
        return no_points()
    table = np.array(seen, dtype=np.float64).reshape(-1, 4)
    return Points(
        np.array(positions),
        np.array(colors, dtype=np.uint8),
        table[:, 0].astype(np.int64),
        table[:, 1].astype(np.int64),
        table[:, 2:],
    )


def _point(
    fields: list[str], keypoints: Keypoints, where: str
) -> tuple[list[float], list[int], list[tuple[int, float, float]]]:
    """Position, colour, and view and pixel of each training observation."""
    try:
        position, color = [float(f) for f in fields[1:4]], [int(f) for f in fields[4:7]]
        if len(fields) < 8 or len(fields) % 2 or not np.isfinite(position).all():
            raise ValueError(f"{len(fields)} fields")
        if not all(0 <= value <= 255 for value in color):
            raise ValueError(f"the colour {' '.join(fields[4:7])}")
        track = [_observation(*pair, keypoints) for pair in zip(fields[8::2], fields[9::2], strict=True)]
    except (ValueError, KeyError, IndexError, OverflowError) as cause:
        raise DatasetError(
            f"expected {_FIELDS} of images and keypoints that are there in {where}, got {cause}"
        ) from cause
    return position, color, [o for o in track if o is not None]


def _observation(image: str, index: str, keypoints: Keypoints) -> tuple[int, float, float] | None:
    view, fields = keypoints[image]
    start = 3 * int(index)
    x, y = float(fields[start]), float(fields[start + 1])
    return None if view is None else (view, x, y)


def _reprojection_errors(capture: Capture, points: Points) -> list[float]:
    """Mean distance of each point's observations from its projections, pixels; 0 without any."""
    miss = np.zeros(len(points.point))
    for number, view in enumerate(capture.views):
        here = points.view == number
        pixel = view.camera.project(points.positions[points.point[here]])[0]
        miss[here] = np.linalg.norm(pixel - points.pixel[here], axis=-1)
    sums = np.bincount(points.point, miss, len(points))
    return [float(e) for e in sums / np.maximum(points.views, 1)]


def _text(numbers: np.ndarray) -> str:
    return " ".join(repr(float(x)) for x in numbers)

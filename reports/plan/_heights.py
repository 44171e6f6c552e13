# SPDX-License-Identifier: Apache-2.0
"""The heights of lights and cameras, which a plan from above cannot show."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from graycard import Light, View
from graycard.reports._format import format_number
from graycard.reports.plan._light_pairs import local_lights, places_of
from graycard.reports.plan._marks import MARGIN, LightMark, round_length

COLUMN = 20.0
"""Width that an owner's marks have."""
LEFT = 40.0
"""Width of the numbers."""


@dataclass(frozen=True, slots=True)
class Heights:
    """A scale of heights beside a plan, in its units."""

    width: float
    height: float
    ticks: tuple[tuple[float, str], ...]
    cameras: tuple[float, ...]
    marks: tuple[LightMark, ...]


def lay_out_heights(
    height: float,
    views: Sequence[View],
    surfaces: np.ndarray,
    owners: Sequence[tuple[str, int, Sequence[Light]]],
) -> Heights:
    """Heights of lights in a column for each owner, those of cameras as strokes at the left.

    The scale holds what is seen, the cameras and the lights of the first owner.

    Args:
        height: Of the plan, in its units.
        views: All; lights on the camera are drawn for the test views.
        surfaces: Points that are seen, shape ``(N, 3)``, metres.
        owners: Name, shape of marks and lights; the truth first.
    """
    cameras = [v.camera for v in views if v.split == "test"]
    eyes = [float(v.camera.position[2]) for v in views]
    true = [float(p[2]) for light in local_lights(owners[0][2]) for p in places_of(light, cameras)]
    known = np.array([*eyes, *true, *surfaces[:, 2]])
    scale = _Scale(float(known.min()), float(known.max()), height) if known.size else _Scale(0.0, 1.0, height)
    marks = [
        _mark(owner, shape, LEFT + COLUMN * (column + 1.0), light.name, float(z), scale)
        for column, (owner, shape, lights) in enumerate(owners)
        for light in local_lights(lights)
        for z in places_of(light, cameras)[:, 2]
        if np.isfinite(z)
    ]
    return Heights(
        LEFT + COLUMN * (len(owners) + 1),
        height,
        tuple((scale.place(z), f"{format_number(z)} m") for z in _round_steps(scale.low, scale.high)),
        tuple(dict.fromkeys(scale.place(z) for z in eyes)),
        tuple(dict.fromkeys(marks)),
    )


@dataclass(frozen=True, slots=True)
class _Scale:
    """From world z in metres to the picture, up in the one as in the other."""

    low: float
    high: float
    height: float

    def place(self, z: float) -> float:
        span = max(self.high - self.low, 1e-6)
        return round(MARGIN + (self.high - z) / span * (self.height - 2 * MARGIN), 1)


def _mark(owner: str, shape: int, x: float, light: str, z: float, scale: _Scale) -> LightMark:
    place = scale.place(z)
    kept = min(max(place, MARGIN / 2), scale.height - MARGIN / 2)
    return LightMark(x, kept, shape, f"{owner}: {light}, {format_number(z)} m high", kept != place)


def _round_steps(low: float, high: float) -> list[float]:
    """Return three to seven round numbers between two others."""
    step = round_length(max(high - low, 1e-6) / 4)
    first = np.ceil(low / step - 1e-9)
    return [round(float(step * (first + i)), 6) for i in range(int((high - first * step) / step + 1e-9) + 1)]

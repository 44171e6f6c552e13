# SPDX-License-Identifier: Apache-2.0
"""The plan of a scene from above: surfaces, cameras, true lights and predicted ones, for an SVG."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

import graycard as gc
from graycard.reports._evidence import MethodEvidence, SceneEvidence
from graycard.reports._format import format_number, format_vector

SIZE = 420.0
"""Longer side of the plan in SVG units."""
MARGIN = 18.0
DOTS_PER_VIEW = 400
SHAPES = 6
"""Number of marker shapes, in the style sheet and templates; more methods take the same ones again."""


Owner = tuple[str, int, Sequence[gc.Light]]
"""Whose lights: a name, the shape of its marks, the lights."""


@dataclass(frozen=True, slots=True)
class LightMark:
    """A light in the plan."""

    x: float
    y: float
    shape: int
    """0 for the truth, then 1 to :data:`SHAPES` for the methods in turn."""
    label: str
    outside: bool
    """Whether it lies beyond the plan and is drawn at its border."""


@dataclass(frozen=True, slots=True)
class CameraMark:
    """A camera in the plan: a triangle whose blunt side looks into the scene."""

    points: str
    split: str
    label: str


@dataclass(frozen=True, slots=True)
class LightRow:
    """A light in the table beside the plan."""

    owner: str
    shape: int
    name: str
    kind: str
    position: str
    intensity: str


@dataclass(frozen=True, slots=True)
class Plan:
    """All that the SVG draws, in its units: x to the right, world y upwards."""

    width: float
    height: float
    dots: tuple[tuple[float, float], ...]
    outlines: tuple[str, ...]
    """Rectangles that shine, as SVG points."""
    cameras: tuple[CameraMark, ...]
    lights: tuple[LightMark, ...]
    metre_bar: float
    metre_text: str
    rows: tuple[LightRow, ...]
    silent: tuple[tuple[str, str], ...]
    """Methods without lights, and why."""


@dataclass(frozen=True, slots=True)
class _Frame:
    """From world x, y in metres to the plan."""

    left: float
    top: float
    scale: float
    width: float
    height: float

    def place(self, point: np.ndarray) -> tuple[float, float]:
        x = MARGIN + (float(point[0]) - self.left) * self.scale
        return round(x, 1), round(MARGIN + (self.top - float(point[1])) * self.scale, 1)

    def clamp(self, x: float, y: float) -> tuple[float, float]:
        inset = MARGIN / 2
        return min(max(x, inset), self.width - inset), min(max(y, inset), self.height - inset)


def build_plan(scene: SceneEvidence, methods: Sequence[MethodEvidence]) -> Plan:
    """The plan of a scene. A light on the camera is drawn once for each test camera."""
    dots = [surface_points(v, scene.layers[v.name].get("depth")) for v in scene.shown]
    owners: list[Owner] = [("ground truth", 0, scene.lights)]
    owners += [(m.method, 1 + i % SHAPES, m.lights) for i, m in enumerate(methods) if m.lights is not None]
    silent = tuple((m.method, _why_silent(m)) for m in methods if m.lights is None)
    return lay_out(scene.truth.views, dots, owners, silent)


def lay_out(
    views: Sequence[gc.View],
    surfaces: Sequence[np.ndarray],
    owners: Sequence[Owner],
    silent: tuple[tuple[str, str], ...] = (),
) -> Plan:
    """A plan of cameras, of surface points, each of shape ``(N, 3)``, and of lights by owner.

    The frame holds the lights of the first owner; those of the others may lie outside.
    """
    dots, first = np.concatenate([np.empty((0, 3)), *surfaces]), owners[0][2]
    test = [v for v in views if v.split == "test"]
    eyes = [v.camera.position for v in views]
    true = [p for light in _local(first) for p in _positions(light, test)]
    shining = [light for light in first if isinstance(light, gc.RectangleLight)]
    edges = [corner for light in shining for corner in _corners(light)]
    frame = _fit_frame(np.concatenate([dots, np.array(eyes + true + edges)]))
    metres = _round_length(0.25 * (frame.width - 2 * MARGIN) / frame.scale)
    return Plan(
        width=frame.width,
        height=frame.height,
        dots=tuple(dict.fromkeys(frame.place(p) for p in dots)),
        outlines=tuple(_outline(light, frame) for light in shining),
        cameras=tuple(_camera_mark(view, frame) for view in views),
        lights=tuple(mark for owner in owners for mark in _light_marks(*owner, test, frame)),
        metre_bar=round(metres * frame.scale, 1),
        metre_text=f"{format_number(metres)} m",
        rows=tuple(_light_row(name, shape, light) for name, shape, found in owners for light in found),
        silent=silent,
    )


def _why_silent(method: MethodEvidence) -> str:
    if method.fault:
        return "the job failed"
    return f"failed: {method.lights_fault}" if method.lights_fault else "not provided"


def _local(lights: Iterable[gc.Light]) -> list[gc.LocalLight]:
    return [light for light in lights if not isinstance(light, gc.EnvironmentLight)]


def _positions(light: gc.LocalLight, test: Sequence[gc.View]) -> list[np.ndarray]:
    if light.frame == "world":
        return [np.array(light.position)]
    return [gc.world_position(light, view.camera) for view in test]


def surface_points(view: gc.View, depth: np.ndarray | None) -> np.ndarray:
    """World points that a view sees, shape ``(N, 3)``, on a coarse grid of its pixels."""
    if depth is None:
        return np.empty((0, 3))
    step = max(1, round(np.sqrt(depth.size / DOTS_PER_VIEW)))
    rays = view.camera.rays()[step // 2 :: step, step // 2 :: step]
    along = depth[step // 2 :: step, step // 2 :: step].astype(np.float64) / (rays @ view.camera.forward)
    seen = np.isfinite(along) & (along > 0)
    return view.camera.position + along[seen][:, None] * rays[seen]


def _fit_frame(points: np.ndarray) -> _Frame:
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    span = np.maximum(high - low, 1e-6)
    scale = (SIZE - 2 * MARGIN) / span.max()
    width, height = np.maximum(span * scale, 0.4 * SIZE) + 2 * MARGIN  # a row of cameras is no strip
    spare = (np.array([width, height]) - 2 * MARGIN) / scale - span
    left, top = low[0] - spare[0] / 2, high[1] + spare[1] / 2
    return _Frame(float(left), float(top), float(scale), round(float(width), 1), round(float(height), 1))


def _camera_mark(view: gc.View, frame: _Frame) -> CameraMark:
    eye = np.array(frame.place(view.camera.position))
    ahead = view.camera.forward[:2] * (1, -1)
    length = np.linalg.norm(ahead)
    ahead = ahead / length if length > 1e-9 else np.array([0.0, -1.0])
    side = np.array([-ahead[1], ahead[0]])
    corners = eye, eye + 11 * ahead + 5.5 * side, eye + 11 * ahead - 5.5 * side
    return CameraMark(_points(corners), view.split, f"{view.split} camera {view.name}")


def _light_marks(
    owner: str, shape: int, lights: Sequence[gc.Light], test: Sequence[gc.View], frame: _Frame
) -> list[LightMark]:
    marks = []
    for light in _local(lights):
        for position in _positions(light, test):
            if not np.isfinite(position).all():
                continue
            place = frame.place(position)
            kept = frame.clamp(*place)
            marks.append(LightMark(*kept, shape, f"{owner}: {light.name}", kept != place))
    return marks


def _light_row(owner: str, shape: int, light: gc.Light) -> LightRow:
    kind = str(gc.light_to_json(light)["type"])
    if isinstance(light, gc.EnvironmentLight):
        return LightRow(owner, shape, light.name, kind, "infinitely far away", "–")
    axes = " from the camera" if light.frame == "camera" else ""
    intensity = format_vector(light.axial_intensity)
    return LightRow(owner, shape, light.name, kind, format_vector(light.position) + axes, intensity)


def _outline(light: gc.RectangleLight, frame: _Frame) -> str:
    return _points(frame.place(corner) for corner in _corners(light))


def _corners(light: gc.RectangleLight) -> list[np.ndarray]:
    centre, u, v = np.array(light.position), np.array(light.half_u), np.array(light.half_v)
    return [centre + a * u + b * v for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))]


def _points(points: Iterable[Sequence[float] | np.ndarray]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def _round_length(length: float) -> float:
    power = 10.0 ** np.floor(np.log10(length))
    return float(max(step * power for step in (1, 2, 5) if step * power <= length * (1 + 1e-9)))

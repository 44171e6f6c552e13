# SPDX-License-Identifier: Apache-2.0
"""The plan of a scene from above: surfaces, cameras, true lights and predicted ones, for an SVG."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from graycard import Camera, EnvironmentLight, Light, LocalLight, RectangleLight, View
from graycard.lights import light_to_json
from graycard.reports._evidence import MethodEvidence, SceneEvidence
from graycard.reports._format import format_number, format_vector
from graycard.reports.plan._heights import Heights, lay_out_heights
from graycard.reports.plan._light_pairs import Pairing, local_lights, pair_lights, places_of
from graycard.reports.plan._marks import MARGIN, LightMark, round_length

SIZE = 420.0
"""Longer side of the plan in SVG units."""
DOTS_PER_VIEW = 400
MARK = 9.0
"""Units within which marks of two lights touch."""
SHAPES = 6
"""Number of marker shapes, in the style sheet and templates; more methods take the same ones again."""


Owner = tuple[str, int, Sequence[Light]]
"""Whose lights: a name, the shape of its marks, the lights."""


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
    partner: str
    """Partner of a light: of a predicted one the true one, of a true one who lacks it."""


@dataclass(frozen=True, slots=True)
class Link:
    """From a predicted light to the true one that it stands for."""

    start: tuple[float, float]
    end: tuple[float, float]
    shape: int


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
    links: tuple[Link, ...]
    heights: Heights
    metre_bar: float
    metre_text: str
    rows: tuple[LightRow, ...]
    silent: tuple[tuple[str, str], ...]
    """Methods without lights, and why."""

    def apart(self, link: Link) -> str:
        """Return how far apart two lights are as seen from above; empty where their marks touch."""
        pixels = float(np.hypot(link.end[0] - link.start[0], link.end[1] - link.start[1]))
        metres = pixels / self.metre_bar * float(self.metre_text.split()[0]) if self.metre_bar else 0.0
        return f"{format_number(metres)} m" if pixels > MARK else ""


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
    """Return the plan of a scene. A light on the camera is drawn once for each test camera."""
    dots = [surface_points(v, scene.layers[v.name].get("depth")) for v in scene.shown]
    owners: list[Owner] = [("ground truth", 0, scene.lights)]
    owners += [(m.method, 1 + i % SHAPES, m.lights) for i, m in enumerate(methods) if m.lights is not None]
    silent = tuple((m.method, _why_silent(m)) for m in methods if m.lights is None)
    return lay_out(scene.truth.views, dots, owners, silent)


def lay_out(
    views: Sequence[View],
    surfaces: Sequence[np.ndarray],
    owners: Sequence[Owner],
    silent: tuple[tuple[str, str], ...] = (),
) -> Plan:
    """Return a plan of cameras, of surface points, each of shape ``(N, 3)``, and of lights by owner.

    The frame holds the lights of the first owner; those of the others may lie outside.
    """
    dots, first = np.concatenate([np.empty((0, 3)), *surfaces]), owners[0][2]
    test = [v.camera for v in views if v.split == "test"]
    eyes = [v.camera.position for v in views]
    true = [p for light in local_lights(first) for p in places_of(light, test)]
    outlines = [o for light in first if isinstance(light, RectangleLight) for o in _corners(light, test)]
    edges = [corner for outline in outlines for corner in outline]
    frame = _fit_frame(np.concatenate([dots, np.array(eyes + true + edges)]))
    metres = round_length(0.25 * (frame.width - 2 * MARGIN) / frame.scale)
    pairings = {owner[0]: pair_lights(owner[2], first, test) for owner in owners[1:]}
    return Plan(
        width=frame.width,
        height=frame.height,
        dots=tuple(dict.fromkeys(frame.place(p) for p in dots)),
        outlines=tuple(_points(frame.place(corner) for corner in outline) for outline in outlines),
        cameras=tuple(_camera_mark(view, frame) for view in views),
        lights=tuple(mark for owner in owners for mark in _light_marks(*owner, test, frame)),
        links=tuple(
            link for owner in owners[1:] for link in _links(pairings[owner[0]], owner[1], test, frame)
        ),
        heights=lay_out_heights(frame.height, views, dots, owners),
        metre_bar=round(metres * frame.scale, 1),
        metre_text=f"{format_number(metres)} m",
        rows=tuple(
            _light_row(name, shape, light, pairings) for name, shape, found in owners for light in found
        ),
        silent=silent,
    )


def _why_silent(method: MethodEvidence) -> str:
    if method.fault:
        return "the job failed"
    return f"failed: {method.lights_fault}" if method.lights_fault else "not provided"


def surface_points(view: View, depth: np.ndarray | None) -> np.ndarray:
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


def _camera_mark(view: View, frame: _Frame) -> CameraMark:
    eye = np.array(frame.place(view.camera.position))
    ahead = view.camera.forward[:2] * (1, -1)
    length = np.linalg.norm(ahead)
    ahead = ahead / length if length > 1e-9 else np.array([0.0, -1.0])
    side = np.array([-ahead[1], ahead[0]])
    corners = eye, eye + 11 * ahead + 5.5 * side, eye + 11 * ahead - 5.5 * side
    return CameraMark(_points(corners), view.split, f"{view.split} camera {view.name}")


def _light_marks(
    owner: str, shape: int, lights: Sequence[Light], test: Sequence[Camera], frame: _Frame
) -> list[LightMark]:
    marks = []
    for light in local_lights(lights):
        for position in places_of(light, test):
            if not np.isfinite(position).all():
                continue
            place = frame.place(position)
            kept = frame.clamp(*place)
            marks.append(LightMark(*kept, shape, f"{owner}: {light.name}", kept != place))
    return marks


def _links(pairing: Pairing, shape: int, test: Sequence[Camera], frame: _Frame) -> list[Link]:
    """Return a line for each pair; for a pair of which one is on the camera, for each test camera."""
    links = []
    for pair in pairing.pairs:
        ends = np.broadcast_arrays(places_of(pair.predicted, test), places_of(pair.true, test))
        for start, end in zip(*ends, strict=True):
            links.append(Link(frame.clamp(*frame.place(start)), frame.clamp(*frame.place(end)), shape))
    return links


def _light_row(owner: str, shape: int, light: Light, pairings: Mapping[str, Pairing]) -> LightRow:
    kind = str(light_to_json(light)["type"])
    if isinstance(light, EnvironmentLight):
        return LightRow(owner, shape, light.name, kind, "infinitely far away", "–", "")
    axes = " from the camera" if light.frame == "camera" else ""
    place, intensity = format_vector(light.position) + axes, format_vector(light.axial_intensity)
    own = pairings.get(owner)
    partner = _partner(light, own) if own else _missed(light, pairings)
    return LightRow(owner, shape, light.name, kind, place, intensity, partner)


def _partner(light: LocalLight, pairing: Pairing) -> str:
    for pair in pairing.pairs:
        if pair.predicted is light:
            return f"{pair.true.name}, {format_number(pair.distance)} m away"
    return "extra: no true light is left for it"


def _missed(light: LocalLight, pairings: Mapping[str, Pairing]) -> str:
    by = [name for name, pairing in pairings.items() if any(light is t for t in pairing.missing)]
    return f"missing in {', '.join(by)}" if by else ""


def _corners(light: RectangleLight, test: Sequence[Camera]) -> list[list[np.ndarray]]:
    """Return the four corners in the world, once, or on the camera once for each test camera."""
    turns = [np.eye(3)] if light.frame == "world" else [c.camera_to_world[:3, :3] for c in test]
    u, v = np.array(light.half_u), np.array(light.half_v)
    signs = ((1, 1), (1, -1), (-1, -1), (-1, 1))
    return [
        [centre + turn @ (a * u + b * v) for a, b in signs]
        for centre, turn in zip(places_of(light, test), turns, strict=True)
    ]


def _points(points: Iterable[Sequence[float] | np.ndarray]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)

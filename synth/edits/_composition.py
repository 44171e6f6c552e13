# SPDX-License-Identifier: Apache-2.0
"""An object of one scene put into another and lit by its lights: the picture a composition is judged by.

A method fits both captures, takes the object out of the one and puts it into the other; the truth of what it
should look like there, with its shadow and its light on what stands around, is rendered.
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from graycard import Camera, Composition, Donor, EnvironmentLight
from graycard.dataset import SECRET_SEEDS
from graycard.synth._mesh import Mesh, turn_about_z
from graycard.synth._scene import Ball, Geometry, Quad, Scene, Thing
from graycard.synth._spec import RenderSettings, SceneSpec, SecretSpec
from graycard.synth._stream import stream
from graycard.synth.edits._free_space import Obstacles, bounds, in_picture, obstacles
from graycard.synth.families import family_of, resolved_knobs

_SIZE = (0.18, 0.75)
"""Longest side of what is put into a scene, metres."""
_LEVEL = 0.02
"""Tolerance: what the same ground may differ by this in height, metres."""
_MARGIN = 0.03
"""Air around it, metres."""
_TURNS, _SPOTS = 8, 50
"""Number of tries."""
_LEAST_SEEN = 0.6
"""Share of the object that held-out views must see."""
_ROUNDS = 200_000
"""Number of hashes for one digest: about a tenth of a second."""
_SIGNS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])


@dataclass(frozen=True, slots=True)
class Composed:
    """The scene with the object in it, and where the object comes from."""

    record: Composition
    scene: Scene


def donor_of(seed: int) -> SceneSpec:
    """Return the scene that gives the object: things under an environment alone, of the same seed."""
    return SceneSpec("multilight", "objects", seed)


def donor_scene(donor: Donor) -> SceneSpec:
    """Return the scene that gives an object, to be rendered or found.

    Its name does not tell a secret seed.
    """
    names = donor.track, donor.family, donor.seed, donor.knobs
    if donor.seed in SECRET_SEEDS:
        return SecretSpec(*names, f"{donor.family}-secret-donor-{_slow_digest(donor.seed)}")
    return SceneSpec(*names)


@cache
def _slow_digest(seed: int) -> str:
    """Return a digest that is made so slowly that trying seeds until one fits is hopeless."""
    return hashlib.pbkdf2_hmac("sha256", str(seed).encode(), b"graycard-donor-1", _ROUNDS, 4).hex()


def composition(scene: Scene, seed: int, settings: RenderSettings) -> Composed | None:
    """Return an object put into a scene; None where the scene is not for it or has no room.

    It is for scenes with local lights that stand still and with nothing to be removed.

    Args:
        scene: The host.
        seed: Of the host.
        settings: How both are photographed.
    """
    frames = {light.frame for light in scene.lights if not isinstance(light, EnvironmentLight)}
    floor = _floor(scene)
    if scene.target or frames != {"world"} or floor is None:
        return None
    spec = donor_of(seed)
    donor = family_of(spec).build(spec.seed, settings)
    rng = stream(seed, "composition")
    for number in _movable(donor):
        thing = donor.things[number]
        placed = _best_place(scene, floor, thing.geometry, rng)
        if placed is not None:
            names = spec.track, spec.family, spec.seed, resolved_knobs(spec), thing.name
            return _composed(scene, Donor(*names, number + 1), thing, placed)
    return None


def _composed(scene: Scene, origin: Donor, thing: Thing, to_host: np.ndarray) -> Composed:
    guest = replace(thing, name=f"{thing.name} of another scene", geometry=moved(thing.geometry, to_host))
    record = Composition(origin, to_host, len(scene.things) + 1)
    return Composed(record, replace(scene, things=(*scene.things, guest)))


def _movable(donor: Scene) -> list[int]:
    """Places in the list of things of those that stand by themselves, the largest first.

    What lies on or under another thing is a part of something: a brick of a wall, the leaves of a plant.
    """
    shapes = {n: t.geometry for n, t in enumerate(donor.things) if not t.light}
    boxes = {n: bounds(shape) for n, shape in shapes.items() if not isinstance(shape, Quad)}
    sizes = {n: float((box[1] - box[0]).max()) for n, box in boxes.items()}
    small = [n for n, size in sizes.items() if size <= _SIZE[1]]
    alone = [
        n
        for n in small
        if sizes[n] >= _SIZE[0] and not any(_is_stacked(boxes[n], boxes[k]) for k in small if k != n)
    ]
    return sorted(alone, key=lambda n: -sizes[n])


def _is_stacked(box: np.ndarray, other: np.ndarray) -> bool:
    """Return whether two boxes that stand at different heights overlap, seen from above."""
    overlap = np.all((box[0] < other[1])[:2] & (box[1] > other[0])[:2])
    return bool(overlap) and abs(box[0, 2] - other[0, 2]) > _LEVEL


def _floor(scene: Scene) -> Quad | None:
    """Return the lowest surface that looks straight up."""
    quads = [t.geometry for t in scene.things if isinstance(t.geometry, Quad) and not t.light]
    level = [q for q in quads if np.cross(q.half_u, q.half_v)[2] > 0.999 * _area(q)]
    return min(level, key=lambda quad: quad.center[2], default=None)


def _area(quad: Quad) -> float:
    """Return a quarter of it."""
    return float(np.linalg.norm(np.cross(quad.half_u, quad.half_v)))


def _best_place(scene: Scene, floor: Quad, geometry: Geometry, rng: np.random.Generator) -> np.ndarray | None:
    """Return the free place that held-out views see best: a rigid motion, ``(4, 4)``; None where there is
    none.
    """
    solids = obstacles(scene)
    held_out = [view.camera for view in scene.views if view.split == "test"]
    best, placed = 0.0, None
    for to_host, box in _places(floor, geometry, rng):
        if _has_room(solids, box):
            seen = _shares_seen(solids, held_out, box)
            apart = [np.linalg.norm(camera.position - box.mean(axis=0)) for camera in held_out]
            size = float(np.mean(seen**2 / np.square(apart)))
            if seen.mean() > _LEAST_SEEN and size > best:
                best, placed = size, to_host
    return placed


def _places(
    floor: Quad, geometry: Geometry, rng: np.random.Generator
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Rigid motions that stand a shape somewhere on a floor, turned about the vertical, and its box then."""
    for _ in range(_TURNS):
        to_host = np.eye(4)
        # a ball is a centre and a radius: its texture cannot be turned
        to_host[:3, :3] = turn_about_z(0.0 if isinstance(geometry, Ball) else rng.uniform(0, 2 * np.pi))
        low, high = bounds(moved(geometry, to_host))
        foot = np.array([*((low + high) / 2)[:2], low[2]])
        for u, v in rng.uniform(-1, 1, size=(_SPOTS, 2)):
            shift = np.array(floor.center) + u * np.array(floor.half_u) + v * np.array(floor.half_v) - foot
            placed = to_host.copy()
            placed[:3, 3] = shift
            yield placed, np.stack([low, high]) + shift


def _has_room(solids: Obstacles, box: np.ndarray) -> bool:
    """Return whether a box touches no other and no wall but the floor that it stands on."""
    above = np.add(_corners(box), (0, 0, 1.01 * _MARGIN))
    return not solids.touch(box, _MARGIN) and solids.leave_free(above, _MARGIN)


def _shares_seen(solids: Obstacles, cameras: Sequence[Camera], box: np.ndarray) -> np.ndarray:
    """Share of the corners and of the centre of a box that each camera sees."""
    points = np.concatenate([_corners(box), [box.mean(axis=0)]])
    seen = [in_picture(c, points, -0.02) & ~solids.hide(c.position, points) for c in cameras]
    return np.mean(seen, axis=1)


def _corners(box: np.ndarray) -> np.ndarray:
    return box[0] + (box[1] - box[0]) * _SIGNS


def moved(geometry: Geometry, to_host: np.ndarray) -> Geometry:
    """Return a shape after a rigid motion.

    Args:
        geometry: A mesh, or a ball, which is moved and not turned.
        to_host: Shape ``(4, 4)``, a rotation about z and a shift in metres.

    Raises:
        ValueError: It is a quad: those are walls.
    """
    rotation, shift = to_host[:3, :3], to_host[:3, 3]
    match geometry:
        case Mesh() as mesh:
            vertices = mesh.vertices @ rotation.T + shift
            return replace(mesh, vertices=vertices, normals=mesh.normals @ rotation.T)
        case Ball(center, radius):
            x, y, z = (rotation @ np.array(center) + shift).tolist()
            return Ball((x, y, z), radius)
        case Quad():
            raise ValueError("expected a mesh or a ball to put into a scene, got a quad")

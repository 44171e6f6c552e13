# SPDX-License-Identifier: Apache-2.0
"""Scenes of surfels that Hypothesis makes up from recipes in words: few, nasty, and the same in every run."""

import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import hypothesis
import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from graycard import Camera
from graycard.methods import splat

NUDGES: dict[str, float] = {"opacity": 3e-6, "scale": 1e-6, "x": 1e-6, "y": 1e-6, "tilt": 1e-7}
"""Largest effects of rounding in float32: on alpha and size (relative), place (pixels), tilt (radians)."""

PLACES = ("in view", "border", "one pixel", "behind", "around", "far", "outside")
TURNS = ("any", "facing", "grazing", "edge-on")
SIZES = ("pixels", "tiny", "huge", "needle")
OPACITIES = ("any", "faint", "opaque", "one", "zero")
CHANNELS = (0, 1, 3, 7, 16, 40)
EDGES = (1, 2, 5, 15, 16, 17, 30, 33, 40, 47, 48, 49)
"""Widths and heights: around whole tiles of 16 pixels and blocks of 4, and between."""

Kind = tuple[str, str, str, str]


@dataclass(frozen=True)
class Recipe:
    """A scene in words."""

    kinds: tuple[Kind, ...]
    """Place, turn, size and opacity of each surfel."""
    width: int
    height: int
    channels: int
    seed: int
    twins: bool = False
    """Each surfel once more, at equal depth, with other features."""
    crowd: int = 0
    """Number of faint specks that are added in one pixel."""


ALWAYS = (
    Recipe((), 5, 4, 3, 1000),
    Recipe((("one pixel", "any", "pixels", "any"),) * 3, 1, 1, 1, 1001),
    Recipe((("in view", "any", "pixels", "any"),) * 4, 16, 32, 0, 1002),
    Recipe((("in view", "any", "pixels", "any"),) * 12, 33, 17, 40, 1003, twins=True),
    Recipe((("around", "grazing", "huge", "any"),) * 3, 20, 15, 3, 1004),
    Recipe((("border", "any", "needle", "one"),) * 5, 24, 24, 3, 1005),
    Recipe((("in view", "facing", "huge", "opaque"),) * 3, 9, 9, 3, 1006),
    Recipe((("in view", "edge-on", "pixels", "any"),) * 5, 15, 15, 3, 1007),
    Recipe((("behind", "any", "huge", "one"),) * 5, 15, 15, 3, 1008),
    Recipe((), 3, 3, 3, 1009, crowd=1000),
)
"""Scenes that are drawn in any case."""


def ill_conditioned(kind: Kind) -> bool:
    """True if float32 may lose digits: needles are thin against pixels, huge discs pass near the camera."""
    _place, turn, size, _opacity = kind
    return size == "needle" or (size == "huge" and turn != "facing")


def recipes(ill: bool) -> st.SearchStrategy[Recipe]:
    """Scenes without ill-conditioned discs, or with some."""
    every = itertools.product(PLACES, TURNS, SIZES, OPACITIES)
    kinds = st.sampled_from([kind for kind in every if ill or not ill_conditioned(kind)])
    any_size = st.builds(
        Recipe,
        kinds=st.lists(kinds, max_size=10).map(tuple),
        width=st.sampled_from(EDGES),
        height=st.sampled_from(EDGES),
        channels=st.sampled_from(CHANNELS),
        seed=st.integers(1000, 1999),
        twins=st.booleans(),
    )
    few = st.integers(1, 5)
    crowds = st.builds(_crowded, any_size, few, few)
    return st.one_of(any_size, any_size, any_size, crowds)


def _crowded(recipe: Recipe, width: int, height: int) -> Recipe:
    """A thousand specks in a pixel of a small image."""
    return replace(recipe, width=width, height=height, crowd=1000)


@dataclass(frozen=True)
class Scene:
    surfels: splat.Surfels
    camera: Camera
    offsets: torch.Tensor
    recipe: Recipe


def scene_of(recipe: Recipe) -> Scene:
    """The scene of a recipe, in float64: a camera somewhere, surfels placed as it sees them."""
    r = np.random.default_rng(recipe.seed)
    K = np.array([[24.0, 0.7, recipe.width / 2 + 0.3], [0, 27.0, recipe.height / 2 - 0.2], [0, 0, 1]])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.random(rng=r).as_matrix(), r.uniform(-2, 2, 3)
    camera = Camera(recipe.width, recipe.height, K, pose)
    specks = (("one pixel", "any", "tiny", "faint"),) * recipe.crowd
    rows = [_surfel(kind, camera, r) for kind in recipe.kinds + specks]
    rows += rows if recipe.twins else []
    centres, turns, scales, opacities = (
        np.array([row[k] for row in rows]).reshape(len(rows), *shape)
        for k, shape in enumerate([(3,), (4,), (2,), ()])
    )
    features = r.uniform(-1, 1, (len(rows), recipe.channels))
    tensors = [torch.from_numpy(v) for v in (centres, turns, scales, opacities, features)]
    offsets = torch.from_numpy(r.normal(0, 0.7, (len(rows), 2)))
    return Scene(splat.Surfels(*tensors), camera, offsets, recipe)


def _surfel(
    kind: Kind, camera: Camera, r: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    place, turn, size, opacity = kind
    pixel, z = _placed(place, np.array([camera.width, camera.height]), r)
    local = z * np.linalg.solve(camera.K, [*pixel, 1.0])
    rotation = _turned(turn, local, r)
    world = camera.camera_to_world[:3, :3]
    quaternion = Rotation.from_matrix(world @ rotation).as_quat(scalar_first=True) * r.choice([-1, 1])
    spread = np.exp(r.normal(0, 0.5, 2))
    scales = {
        "pixels": abs(z) / 25 * r.uniform(0.3, 8) * spread,
        "tiny": 1e-6 * spread,
        "huge": r.choice([10 * abs(z), 100]) * spread,
        "needle": abs(z) * r.choice([0.25, 4]) * spread * r.permutation([1, 1e-3]),
    }[size]
    value = {
        "any": r.uniform(0.05, 0.95),
        "faint": r.uniform(0.9, 6) / 255,
        "opaque": r.uniform(0.98, 1),
        "one": 1.0,
        "zero": 0.0,
    }[opacity]
    return world @ local + camera.position, quaternion, scales, float(value)


def _placed(place: str, size: np.ndarray, r: np.random.Generator) -> tuple[np.ndarray, float]:
    """Image coordinates and z-depth."""
    inside = r.uniform(0, 1, 2) * size
    edge = np.where(
        r.permutation([True, False]), r.choice([-1.0, 0, 1], 2) * 2 + r.choice([0, 1]) * size, inside
    )
    return {
        "in view": (inside, r.uniform(1, 4)),
        "border": (edge, r.uniform(1, 4)),
        "one pixel": (np.floor(size / 2) + r.uniform(0.1, 0.9, 2), r.uniform(1, 4)),
        "behind": (inside, r.uniform(-3, -0.05)),
        "around": (inside, r.uniform(0.02, 0.4)),
        "far": (inside, np.exp(r.uniform(3, 6.2))),
        "outside": (inside + 3 * size, r.uniform(1, 4)),
    }[place]


def _turned(turn: str, local: np.ndarray, r: np.random.Generator) -> np.ndarray:
    """Rotation matrix, disc to camera; edge-on means that the disc's plane holds the camera's centre."""
    if turn == "any":
        return Rotation.random(rng=r).as_matrix()
    view = local / np.linalg.norm(local)
    across = np.cross(view, r.normal(size=3))
    across /= np.linalg.norm(across)
    angle = {
        "facing": 0.0,
        "grazing": np.pi / 2 + r.choice([-1, 1]) * r.uniform(1e-3, 0.05),
        "edge-on": np.pi / 2 + r.choice([-1, 1]) * 1e-9,
    }
    normal = Rotation.from_rotvec(angle[turn] * across).apply(view)
    x = np.cross(normal, r.normal(size=3))
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(normal, x), normal], axis=1)


def nudged(scene: Scene, names: Iterable[str] = NUDGES) -> Iterator[Scene]:
    """The scene with one thing changed a little, one way and the other."""
    surfels = scene.surfels
    for name, amount in ((name, NUDGES[name]) for name in names):
        for step in (-amount, amount):
            by = {key: step if key == name else 0.0 for key in NUDGES}
            w, x, y, z = surfels.rotations.T
            tilted = surfels.rotations + by["tilt"] / 2 * torch.stack([-x - y, w - z, w + z, x - y], dim=1)
            changed = replace(
                surfels,
                opacities=(surfels.opacities * (1 + by["opacity"])).clamp(max=1),
                scales=surfels.scales * (1 + by["scale"]),
                rotations=tilted,
            )
            moved = scene.offsets + scene.offsets.new_tensor([by["x"], by["y"]])
            yield replace(scene, surfels=changed, offsets=moved)


def on_recipes(check: Callable[[Recipe], None], examples: int, ill: bool) -> None:
    """Run a check on recipes that are the same each time, and on those that must not be missed."""
    settings = hypothesis.settings(
        max_examples=examples,
        deadline=None,  # what compiles is slow once
        derandomize=True,
        suppress_health_check=[hypothesis.HealthCheck.too_slow],
    )
    for recipe in ALWAYS:
        if ill == any(ill_conditioned(kind) for kind in recipe.kinds):
            check(recipe)
    settings(given(recipes(ill))(check))()

# SPDX-License-Identifier: Apache-2.0
"""A tiny scene in closed form: a floor, a ball and a small red ball, on disk in a moment, without a renderer.

Tests stand on it, and `graycard test-method` does.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from graycard import __version__
from graycard._camera import Camera, look_at
from graycard._capture import POINTS, Capture, View
from graycard._truth import SceneObject, Truth
from graycard.dataset import open_truth, write_index
from graycard.io import Manifest, write_layers, write_manifest, write_rgb
from graycard.lights import Light, PointLight, world_position, write_lights
from graycard.points import Points, write_points

WIDTH, HEIGHT = 28, 24
DIAMETER = 4.0
RADIUS = 0.6
TARGET = 3
ALBEDO = {0: (0.0, 0.0, 0.0), 1: (0.55, 0.45, 0.30), 2: (0.20, 0.45, 0.60), TARGET: (0.6, 0.1, 0.1)}
LAMP = PointLight("lamp", (0.3, -0.1, 0.0), (12.0, 10.0, 8.0), "camera")
_ORIGIN = {"name": "graycard.tiny", "version": __version__}
_BACKGROUND = 0.02
"""Radiance where nothing is, W/m²/sr."""
_OBJECTS = SceneObject(1, "floor", False), SceneObject(2, "ball", False), SceneObject(TARGET, "target", False)
_SPACING = 3
"""Pixels from one sparse point to the next."""
_SEEN = 0.03
"""Difference of depths, m, up to which a view sees a point."""


def shade(camera: Camera, with_target: bool, lamp: PointLight = LAMP) -> dict[str, np.ndarray]:
    """Return the exact layers of a view under a light on the camera.

    Args:
        camera: Any camera outside of the balls.
        with_target: Whether the small ball is there.
        lamp: The light, in the frame of the camera.
    """
    distance, ids, normal = _hits(camera, with_target)
    rays, origin = camera.rays(), camera.position
    seen = ids > 0
    point = origin + np.where(seen, distance, 0)[..., None] * rays
    to_light = world_position(lamp, camera) - point
    square = (to_light**2).sum(-1)
    cosine = np.maximum((normal * to_light).sum(-1) / np.sqrt(square), 0)
    base = np.array([ALBEDO[i] for i in range(4)])[ids]
    texture = 1 + 0.3 * np.sin(9 * point[..., :1]) * np.sin(7 * point[..., 1:2])
    base = base * texture
    irradiance = np.array(lamp.intensity) * (cosine / square)[..., None]
    return {
        "radiance": np.where(seen[..., None], base / np.pi * irradiance, _BACKGROUND).astype(np.float32),
        "base_color": base.astype(np.float32),
        "normal": normal.astype(np.float32),
        "depth": (distance * (rays @ camera.forward)).astype(np.float32),
        "object_id": ids.astype(np.uint32),
    }


def _hits(camera: Camera, with_target: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return distances, numbers of objects (0: none) and normals at the pixels of a view."""
    balls = [(2, np.array([0, 0, RADIUS]), RADIUS)]
    balls += [(TARGET, np.array([0.9, -0.3, 0.3]), 0.3)] if with_target else []
    rays, origin = camera.rays(), camera.position
    floor = np.where(rays[..., 2] < 0, -origin[2] / np.minimum(rays[..., 2], -1e-9), np.inf)
    floor = np.where(np.linalg.norm((origin + floor[..., None] * rays)[..., :2], axis=-1) < 2, floor, np.inf)
    distance, ids = floor, np.where(np.isfinite(floor), 1, 0)
    normal = np.where(ids[..., None] > 0, np.array([0.0, 0.0, 1.0]), 0.0)
    for number, centre, radius in balls:
        b = rays @ (origin - centre)
        hit = b**2 - (origin - centre) @ (origin - centre) + radius**2
        t = np.where(hit > 0, -b - np.sqrt(np.maximum(hit, 0)), np.inf)
        closer = (t > 0) & (t < distance)
        distance, ids = np.where(closer, t, distance), np.where(closer, number, ids)
        point = origin + np.where(closer, t, 0)[..., None] * rays
        normal = np.where(closer[..., None], (point - centre) / radius, normal)
    return distance, ids, normal


def write_tiny_scene(
    dataset: Path,
    track: str = "dark",
    scene: str = "tiny-0000",
    train: int = 3,
    test: int = 2,
    *,
    sigma: float = 1e-3,
    size: tuple[int, int] = (WIDTH, HEIGHT),
    points: bool = False,
) -> Path:
    """Write the tiny scene as a whole dataset folder and return ``DATASET/<track>/<scene>``.

    Args:
        dataset: The dataset folder.
        track: On ``tabletop`` the small ball is the target.
        scene: Its name.
        train: Number of training views.
        test: Number of held-out views.
        sigma: Noise of the true radiance, W/m²/sr.
        size: Width and height, pixels.
        points: Whether the capture has sparse points.
    """
    folder = Path(dataset) / track / scene
    target = TARGET if track == "tabletop" else None
    views, noise = _views(train, test, size), np.random.default_rng(7)
    photographs = [
        photograph
        for view in views
        if (photograph := _write_view(folder, view, target, sigma, noise)) is not None
    ]
    exposure = float(1 / np.percentile(photographs, 99))
    capture = Capture(track, scene, views, exposure, light_on_camera=track == "dark", target=target)
    write_index(folder / "capture", capture)
    write_index(folder / "truth", Truth(track, scene, views, exposure, DIAMETER, _OBJECTS, target))
    if points:
        write_points(folder / "capture" / POINTS, _points(views, exposure))
    write_lights(folder / "truth" / "lights.json", (LAMP,))
    write_manifest(folder / "capture", Manifest("graycard-capture", 1, track, scene, _ORIGIN, {}, {}))
    _seal_truth(folder, track, scene)
    return folder


def add_materials(scene: Path) -> Path:
    """Add true materials to a tiny scene, all of them matte, and what is behind its target if it has one.

    Oracles then answer each ask of a method.

    Args:
        scene: ``DATASET/<track>/<scene>`` of :func:`write_tiny_scene`; its truth is changed.

    Returns:
        The same folder.
    """
    truth = open_truth(scene / "truth", check=False)
    for view in truth.views:
        layers = truth.layers(view)
        matte = _matte(layers["base_color"])
        added = matte | {"diffuse_reflectance": layers["base_color"], "metallic": 0 * matte["roughness"]}
        if truth.target is not None:
            behind = {**matte, "normal": shade(view.camera, with_target=False)["normal"]}
            behind["diffuse"] = layers["counterfactual.radiance"]
            added |= {f"counterfactual.{name}": values for name, values in behind.items()}
        write_layers(scene / "truth" / "views" / f"{view.name}.exr", {**layers, **added})
    _seal_truth(scene, truth.track, truth.scene)
    return scene


def _seal_truth(folder: Path, track: str, scene: str) -> None:
    """Write the manifest of the truth, with the hashes of its files."""
    write_manifest(folder / "truth", Manifest("graycard-truth", 1, track, scene, _ORIGIN, {"scene": 0}, {}))


def _matte(base: np.ndarray) -> dict[str, np.ndarray]:
    """Return specular layers of surfaces that have none."""
    return {"roughness": np.ones(base.shape[:2], np.float32), "f0": np.zeros_like(base)}


def brighter(lights: Sequence[Light], factor: float) -> tuple[Light, ...]:
    """Return point lights so many times as bright; others are left out."""
    return tuple(
        replace(light, intensity=tuple(factor * value for value in light.intensity))
        for light in lights
        if isinstance(light, PointLight)
    )


def _views(train: int, test: int, size: tuple[int, int]) -> tuple[View, ...]:
    """Return views on an arc around the ball; every second one is held out as long as any are left."""
    angles = np.linspace(0, 1.2, train + test)
    cameras = [
        Camera.from_fov(
            *size,
            50,
            look_at(np.array([3 * np.sin(a), -3 * np.cos(a), 1.6]), np.array([0, 0, 0.4])),
        )
        for a in angles
    ]
    splits = ["test" if i % 2 and i // 2 < test else "train" for i in range(train + test)]
    return tuple(
        View(f"{split}_{i:03d}", split, camera)  # pyright: ignore[reportArgumentType]
        for i, (split, camera) in enumerate(zip(splits, cameras, strict=True))
    )


def _write_view(
    folder: Path, view: View, target: int | None, sigma: float, noise: np.random.Generator
) -> np.ndarray | None:
    """Write the truth of a view, and of a training view its photograph, which is returned."""
    layers = shade(view.camera, with_target=True)
    layers["radiance.var"] = np.full_like(layers["radiance"], sigma**2)
    layers["radiance"] = layers["radiance"] + noise.normal(0, sigma, layers["radiance"].shape).astype(
        np.float32
    )
    if target:
        layers["counterfactual.radiance"] = shade(view.camera, with_target=False)["radiance"]
        layers["counterfactual.radiance.var"] = layers["radiance.var"]
    write_layers(folder / "truth" / "views" / f"{view.name}.exr", layers)
    if view.split != "train":
        return None
    write_rgb(folder / "capture" / "photographs" / f"{view.name}.exr", layers["radiance"])
    if target:
        mask = layers["object_id"] * (layers["object_id"] == target)
        write_layers(folder / "capture" / "masks" / "target" / f"{view.name}.exr", {"object_id": mask})
    return layers["radiance"]


def _points(views: Sequence[View], exposure: float) -> Points:
    """Return sparse points on the surfaces of training views, with the training views that see each."""
    train = [(number, view) for number, view in enumerate(views) if view.split == "train"]
    shaded = {number: shade(view.camera, with_target=True) for number, view in train}
    found, colours = [], []
    for number, view in train:
        layers, step = shaded[number], np.s_[1::_SPACING, 1::_SPACING]
        seen = layers["object_id"][step] > 0
        found.append(view.camera.unproject(layers["depth"])[step][seen])
        colours.append(layers["radiance"][step][seen] * exposure)
    positions, display = np.concatenate(found), np.clip(np.concatenate(colours), 0, 1) ** (1 / 2.2)
    tracks = [_sightings(positions, number, view, shaded[number]["depth"]) for number, view in train]
    point, view, pixel = (np.concatenate(parts) for parts in zip(*tracks, strict=True))
    return Points(positions, np.round(255 * display).astype(np.uint8), point, view, pixel)


def _sightings(
    positions: np.ndarray, number: int, view: View, depth: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which points a view sees, its number for each, and the pixels."""
    pixel, z = view.camera.project(positions)
    column, row = np.floor(pixel).astype(int).T
    within = (z > 0) & (column >= 0) & (row >= 0) & (column < view.camera.width) & (row < view.camera.height)
    there = depth[np.where(within, row, 0), np.where(within, column, 0)]
    point = np.flatnonzero(within & (np.abs(there - z) < _SEEN))
    return point, np.full(len(point), number), pixel[point]

# SPDX-License-Identifier: Apache-2.0
"""A tiny scene with closed-form truth, on disk, without a renderer: what most tests stand on."""

import os
import subprocess
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from graycard import (
    TRACKS,
    Camera,
    Capture,
    MethodError,
    PointLight,
    RenderError,
    SceneObject,
    Truth,
    View,
    __version__,
    look_at,
    world_position,
)
from graycard.dataset import write_index
from graycard.io import Manifest, write_layers, write_manifest, write_rgb
from graycard.lights import write_lights
from graycard.networks import HOME, LPIPS_VARIABLE, SETS, is_whole, weights_home

os.environ.setdefault("OMP_WAIT_POLICY", "passive")
"""Let threads of OpenMP sleep while they wait for work. With a test on each core they take the cores from
each other: a fit of 20 s takes 340 s. PyTorch and Numba, which read this, are not loaded yet."""

REAL_WEIGHTS = "GRAYCARD_TEST_WEIGHTS"
"""Environment variable that keeps where this machine's weights are; tests do not see them unless they ask."""
os.environ.setdefault(REAL_WEIGHTS, str(weights_home()))
os.environ[HOME] = os.path.join(os.path.dirname(__file__), "no-weights-here")
os.environ.pop(LPIPS_VARIABLE, None)

CHEAP = {"run_python", "loaded", "in_process", "world"}
"""Fixtures of a session that cost next to nothing."""

WIDTH, HEIGHT = 28, 24
DIAMETER = 4.0
RADIUS = 0.6
ALBEDO = {0: (0.0, 0.0, 0.0), 1: (0.55, 0.45, 0.30), 2: (0.20, 0.45, 0.60), 3: (0.6, 0.1, 0.1)}
LAMP = PointLight("lamp", (0.3, -0.1, 0.0), (12.0, 10.0, 8.0), "camera")


@pytest.hookimpl(tryfirst=True)  # xdist's own hook reads the marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Send tests that share a fixture to one worker of xdist: none is built twice. Begin with them.

    Those for a GPU share one worker, too: it has one card. Where there is none they are skipped.
    """
    for item in items:
        if any(item.iter_markers("gpu")):
            reason = without_gpu()
            item.add_marker(pytest.mark.skipif(bool(reason), reason=reason))
            item.add_marker(pytest.mark.xdist_group("gpu"))
            continue
        group = shared_fixture(item)
        if group:
            item.add_marker(pytest.mark.xdist_group(group))
    items.sort(key=lambda item: not any(item.iter_markers("xdist_group")))


@cache
def without_gpu() -> str:
    """Return why the back end ``cuda`` cannot run here; empty where it can."""
    from graycard.methods.splat.gpu import gsplat_kernels  # PyTorch takes long to import

    try:
        gsplat_kernels()
    except MethodError as cause:
        return str(cause)
    return ""


def shared_fixture(item: pytest.Item) -> str:
    """Return the fixture of a session, or else the file, that a test shares with others; empty if neither."""
    info = getattr(item, "_fixtureinfo", None)  # pytest has no public way to ask for the scope of a fixture
    found = [fixtures[-1] for fixtures in info.name2fixturedefs.values()] if info else []
    ours = [fixture for fixture in found if fixture.baseid not in ("", "tests")]  # not pytest's, nor of here
    session = sorted((f.baseid, f.argname) for f in ours if f.scope == "session" and f.argname not in CHEAP)
    if session:
        return "::".join(session[-1])  # of several the same one always, so that none is built by two workers
    return item.nodeid.partition("::")[0] if any(f.scope == "module" for f in ours) else ""


def shade(camera: Camera, with_target: bool) -> dict[str, np.ndarray]:
    """Exact layers of a floor, a ball and a small red target ball under a light on the camera."""
    balls = [(2, np.array([0, 0, RADIUS]), RADIUS)]
    balls += [(3, np.array([0.9, -0.3, 0.3]), 0.3)] if with_target else []
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
    seen = ids > 0
    point = origin + np.where(seen, distance, 0)[..., None] * rays
    to_light = world_position(LAMP, camera) - point
    square = (to_light**2).sum(-1)
    cosine = np.maximum((normal * to_light).sum(-1) / np.sqrt(square), 0)
    base = np.array([ALBEDO[i] for i in range(4)])[ids]
    texture = 1 + 0.3 * np.sin(9 * point[..., :1]) * np.sin(7 * point[..., 1:2])
    base = base * texture
    irradiance = np.array(LAMP.intensity) * (cosine / square)[..., None]
    return {
        "radiance": np.where(seen[..., None], base / np.pi * irradiance, 0.02).astype(np.float32),
        "base_color": base.astype(np.float32),
        "normal": normal.astype(np.float32),
        "depth": (distance * (rays @ camera.forward)).astype(np.float32),
        "object_id": ids.astype(np.uint32),
    }


def write_scene(
    dataset: Path,
    track: str = "dark",
    scene: str = "tiny-0000",
    train: int = 3,
    test: int = 2,
    sigma: float = 1e-3,
    size: tuple[int, int] = (WIDTH, HEIGHT),
) -> Path:
    """Write the tiny scene as a whole dataset folder and return ``DATASET/<track>/<scene>``."""
    folder = Path(dataset) / track / scene
    target = 3 if track == "tabletop" else None
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
    views = tuple(
        View(f"{split}_{i:03d}", split, camera)  # pyright: ignore[reportArgumentType]
        for i, (split, camera) in enumerate(zip(splits, cameras, strict=True))
    )
    noise = np.random.default_rng(7)
    photographs = []
    for view in views:
        layers = shade(view.camera, with_target=True)
        layers["radiance.var"] = np.full_like(layers["radiance"], sigma**2)
        layers["radiance"] = layers["radiance"] + noise.normal(0, sigma, layers["radiance"].shape).astype(
            np.float32
        )
        if target:
            layers["counterfactual.radiance"] = shade(view.camera, with_target=False)["radiance"]
            layers["counterfactual.radiance.var"] = layers["radiance.var"]
        write_layers(folder / "truth" / "views" / f"{view.name}.exr", layers)
        if view.split == "train":
            write_rgb(folder / "capture" / "photographs" / f"{view.name}.exr", layers["radiance"])
            photographs.append(layers["radiance"])
            if target:
                mask = layers["object_id"] * (layers["object_id"] == target)
                write_layers(
                    folder / "capture" / "masks" / "target" / f"{view.name}.exr", {"object_id": mask}
                )
    exposure = float(1 / np.percentile(photographs, 99))
    capture = Capture(track, scene, views, exposure, light_on_camera=track == "dark", target=target)
    objects = (
        SceneObject(1, "floor", False),
        SceneObject(2, "ball", False),
        SceneObject(3, "target", False),
    )
    truth = Truth(track, scene, views, exposure, DIAMETER, objects, target)
    write_index(folder / "capture", capture)
    write_index(folder / "truth", truth)
    write_lights(folder / "truth" / "lights.json", (LAMP,))
    origin = {"name": "tests", "version": __version__}
    write_manifest(folder / "capture", Manifest("graycard-capture", 1, track, scene, origin, {}, {}))
    write_manifest(folder / "truth", Manifest("graycard-truth", 1, track, scene, origin, {"scene": 0}, {}))
    return folder


@pytest.fixture
def make_scene(tmp_path: Path) -> Callable[..., Path]:
    """``make_scene(track="dark", scene="tiny-0000", train=3, test=2)`` writes one, gives its folder."""

    def make(**options: object) -> Path:
        return write_scene(tmp_path / "dataset", **options)  # pyright: ignore[reportArgumentType]

    return make


@pytest.fixture(scope="session")
def write_tiny() -> Callable[..., Path]:
    """``write_tiny(dataset, **options)`` writes the scene, for fixtures that outlive a test."""
    return write_scene


@pytest.fixture(scope="session")
def tiny_scenes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One scene folder a track, shared and not to be changed."""
    dataset = tmp_path_factory.mktemp("tiny")
    return {track: write_scene(dataset, track=track) for track in TRACKS}


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 256 KiB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", str(disk)]
    try:
        done = subprocess.run(mount, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        pytest.skip("there is no mount command")
    if done.returncode:
        pytest.skip(f"a small file system needs root: {done.stderr.strip()}")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


@pytest.fixture
def llvm() -> str:
    """The variant that works on whole images at once, in use; without LLVM the test is skipped."""
    from graycard.synth import use_renderer  # tests without a renderer need not wait for it
    from graycard.synth.renderer._variant import LLVM_RGB

    try:
        return use_renderer(variant=LLVM_RGB).variant
    except RenderError as reason:
        pytest.skip(str(reason))


@pytest.fixture
def real_weights(monkeypatch: pytest.MonkeyPatch) -> Path:
    """The fetched weights, in use; without all of them the test is skipped, but in CI it fails."""
    folder = Path(os.environ[REAL_WEIGHTS])
    monkeypatch.setenv(HOME, str(folder))
    lacking = [one.name for one in SETS if not all(is_whole(file.name) for file in one.files)]
    if lacking:
        reason = f"needs weights: run {' and '.join(f'`graycard weights {name}`' for name in lacking)}"
        (pytest.fail if os.environ.get("GRAYCARD_REQUIRE_WEIGHTS") else pytest.skip)(reason)
    return folder

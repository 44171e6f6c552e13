# SPDX-License-Identifier: Apache-2.0
"""Last steps after the rendered views: the capture, the index files, and the seals."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from graycard import Capture, EnvironmentLight, RenderError, Sensor, Truth, View, __version__
from graycard.colour import display_variance
from graycard.dataset import write_index
from graycard.io import (
    FORMAT_VERSION,
    Manifest,
    from_builtins,
    read_layers,
    read_rgb,
    write_json,
    write_layers,
    write_manifest,
    write_rgb,
)
from graycard.lights import write_lights
from graycard.points import write_points
from graycard.synth._scene import Scene
from graycard.synth._sky import recorded
from graycard.synth._spec import CaptureSettings, RenderSettings
from graycard.synth.dataset._identity import BANDS, NEEDED
from graycard.synth.dataset._photographs import photographed, sensor_of
from graycard.synth.dataset._renderings import Content
from graycard.synth.dataset._sparse import Sighting, sighting, sparse_points
from graycard.synth.dataset._store import Place, view_file


def finish(place: Place, content: Content, stamp: Mapping[str, Any]) -> None:
    """Derive everything else in a partial folder from its pictures, and seal it: truth last.

    Args:
        place: Where the scene is made; all pictures are there.
        content: What was rendered.
        stamp: What it was made from, with the renderer's variant.
    """
    root, scene = place.partial, content.scene
    render = from_builtins(RenderSettings, stamp["render"])
    settings, exposure = render.capture, _exposure(root, scene)
    sensor = sensor_of(settings, [v.name for v in _train(scene)], stamp["seed"])
    for view in _train(scene):
        _write_photograph(root, scene, view.name, exposure, sensor, stamp["seed"])
    _write_points(root, scene, exposure, settings, stamp["seed"])
    light_on_camera = any(getattr(light, "frame", "world") == "camera" for light in scene.lights)
    capture = Capture(
        place.track, place.scene, scene.views, exposure, light_on_camera, scene.target_id, sensor
    )
    truth = Truth(
        place.track,
        place.scene,
        scene.views,
        exposure,
        _diameter(root, scene),
        scene.objects(),
        scene.target_id,
        _noise_ceiling(root, _held_out(scene) if render.training_samples else scene.views, exposure),
        _noise_ceiling(root, _train(scene), exposure) if render.training_samples else None,
        tuple(edit.record for edit in content.edits),
    )
    write_index(root / "capture", capture)
    write_index(root / "truth", truth)
    _write_lights(root / "truth", scene)
    for edit in content.edits:
        _write_lights(root / "truth" / edit.record.folder, edit.scene)
    if content.composed is not None:
        write_json(root / "truth" / "composition" / "composition.json", content.composed.record)
    _seal(place, stamp)


def _train(scene: Scene) -> list[View]:
    return [view for view in scene.views if view.split == "train"]


def _held_out(scene: Scene) -> list[View]:
    return [view for view in scene.views if view.split == "test"]


def _exposure(root: Path, scene: Scene) -> float:
    """Return the factor that brings the 99th percentile of all training views to display white."""
    views = [read_layers(root / "truth" / view_file(view.name))["radiance"] for view in _train(scene)]
    brightest = float(np.percentile(views, 99))
    if brightest <= 0:
        raise RenderError(
            f"expected a scene with light in it, got black photographs for {scene.views[0].name} and all "
            "others. Turn up one of its light knobs"
        )
    return 1 / brightest


def _write_photograph(
    root: Path, scene: Scene, name: str, exposure: float, sensor: Sensor | None, seed: int
) -> None:
    """Write the photograph of a training view, and its target mask."""
    layers = read_layers(root / "truth" / view_file(name))
    photograph = layers["radiance"]
    if sensor is not None:
        photograph = photographed(photograph, name, exposure, sensor, seed)
    write_rgb(root / "capture" / "photographs" / f"{name}.exr", photograph)
    if scene.target_id is not None:
        ids = layers["object_id"]
        mask = np.where(ids == scene.target_id, ids, 0)
        write_layers(root / "capture" / "masks" / "target" / f"{name}.exr", {"object_id": mask})


def _noise_ceiling(root: Path, views: Sequence[View], exposure: float) -> float:
    """Return the PSNR, as displayed, of noise-free pictures of some views against the truth, dB."""
    found = [read_layers(root / "truth" / view_file(view.name)) for view in views]
    noise = [display_variance(v["radiance"], v["radiance.var"], exposure).mean() for v in found]
    return float(-10 * np.log10(max(np.mean(noise), 1e-12)))


def _write_points(root: Path, scene: Scene, exposure: float, settings: CaptureSettings, seed: int) -> None:
    """Write the sparse points of the training photographs."""
    seen = [_sighting(root, number, view, exposure) for number, view in enumerate(scene.views)]
    points = sparse_points([s for s in seen if s is not None], settings, seed)
    write_points(root / "capture" / "points.ply", points)


def _sighting(root: Path, number: int, view: View, exposure: float) -> Sighting | None:
    if view.split != "train":
        return None
    photograph = read_rgb(root / "capture" / "photographs" / f"{view.name}.exr")
    return sighting(number, view, photograph, exposure, read_layers(root / "truth" / view_file(view.name)))


def _diameter(root: Path, scene: Scene) -> float:
    """Diagonal of the box around the cameras and all points that they see, metres."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for view in scene.views:
        depth = read_layers(root / "truth" / view_file(view.name))["depth"].astype(np.float64)
        rays = view.camera.rays()
        seen = np.isfinite(depth)
        distance = depth[seen] / (rays[seen] @ view.camera.forward)
        points = view.camera.position + distance[:, None] * rays[seen]
        points = np.concatenate([points, view.camera.position[None]])
        low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
    return float(np.linalg.norm(high - low))


def _write_lights(folder: Path, scene: Scene) -> None:
    write_lights(folder / "lights.json", scene.lights)
    for light in scene.lights:
        if isinstance(light, EnvironmentLight) and scene.sky is not None:
            write_rgb(folder / light.image, recorded(scene.sky))


def _seal(place: Place, stamp: Mapping[str, Any]) -> None:
    generator = {"name": "graycard.synth", "version": __version__}
    origin = {**generator, "generator": stamp["generator"], "variant": stamp["variant"]}
    capture = Manifest("graycard-capture", FORMAT_VERSION, place.track, place.scene, generator, {}, {})
    settings = {name: stamp[name] for name in ("family", "knobs", "render", NEEDED, BANDS) if name in stamp}
    truth = Manifest(
        "graycard-truth",
        FORMAT_VERSION,
        place.track,
        place.scene,
        origin,
        {"scene": stamp["seed"]},
        settings,
    )
    write_manifest(place.partial / "capture", capture)
    write_manifest(place.partial / "truth", truth)

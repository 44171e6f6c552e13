# SPDX-License-Identifier: Apache-2.0
"""Pictures and surfaces rendered once more, another way. Import it only after ``use_renderer``.

Pictures come from Mitsuba's compiled ``path`` with other random numbers, where the truth comes from the
tracer of :mod:`graycard.synth.layers._separation`; surfaces from rays of :meth:`graycard.Camera.rays`, where
the truth comes from Mitsuba's sensor.
"""

from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from graycard import Camera, GaussianLight, PointLight, SpotLight, world_position
from graycard.synth._scene import Scene
from graycard.synth._spec import SUB_BUFFERS
from graycard.synth.edits._light_edits import scaled_light
from graycard.synth.layers._albedo import directional_albedo
from graycard.synth.layers._effects import effect_layers, target_footprint
from graycard.synth.layers._material_layers import material_layers
from graycard.synth.layers._separation import estimate
from graycard.synth.layers._views import light_images, radiance_images
from graycard.synth.renderer._mitsuba import load_scene, object_ids, shape_key
from graycard.synth.renderer._variant import SCALAR
from graycard.synth.verify._subject import Rebuilt

Color = tuple[float, float, float]

_OWN = 0x6AC4
"""Part of the seeds here, so that they are none of those that a scene is rendered with."""


def radiance_again(
    rebuilt: Rebuilt, number: int, subject: int, scene: Scene | None = None
) -> dict[str, np.ndarray]:
    """Return the radiance of a view with as many samples as the truth has, and other random numbers.

    Args:
        rebuilt: The scene, its seed and its settings.
        number: Of the view.
        subject: A number for what is rendered: others get other random numbers.
        scene: Instead of the scene itself.

    Returns:
        ``radiance``, ``radiance.var``, ``radiance.half_a`` and ``radiance.half_b``, each ``(H, W, 3)``,
        float32.
    """
    scene = scene or rebuilt.scene
    return _picture(load_scene(scene, scene.views[number].camera), rebuilt, number, subject)


def emptied_again(rebuilt: Rebuilt, number: int, subject: int) -> dict[str, np.ndarray]:
    """Return the same as :func:`radiance_again`, without the target."""
    scene = rebuilt.scene
    loaded = load_scene(scene, scene.views[number].camera, without=scene.target)
    return _picture(loaded, rebuilt, number, subject)


def albedo_again(rebuilt: Rebuilt, number: int, subject: int) -> np.ndarray:
    """Return the albedo of a view, ``(H, W, 3)``, from as many directions as the truth has, and other ones.

    Whole images at once: ``llvm_ad_rgb`` only.
    """
    view = rebuilt.scene.views[number]
    seed, *_ = _seeds(rebuilt, number, subject)
    directions = rebuilt.settings.directions(view.split)
    loaded = load_scene(rebuilt.scene, view.camera)
    return directional_albedo(loaded, view.camera, seed, directions)["albedo"]


def effects_again(rebuilt: Rebuilt, number: int, subject: int) -> dict[str, np.ndarray]:
    """Return the masks of what the target does, from other random numbers. ``llvm_ad_rgb`` only."""
    scene, settings = rebuilt.scene, rebuilt.settings
    camera, seeds = scene.views[number].camera, _seeds(rebuilt, number, subject)
    whole = load_scene(scene, camera)
    present = light_images(whole, camera, seeds, settings)
    absent = light_images(load_scene(scene, camera, without=scene.target), camera, seeds, settings)
    return effect_layers(present, absent, target_footprint(whole, scene, camera, seeds, settings))


def _picture(loaded: mi.Scene, rebuilt: Rebuilt, number: int, subject: int) -> dict[str, np.ndarray]:
    view, seeds = rebuilt.scene.views[number], _seeds(rebuilt, number, subject)
    settings = rebuilt.settings.for_split(view.split)
    return estimate("radiance", radiance_images(loaded, view.camera, seeds, settings))


def _seeds(rebuilt: Rebuilt, number: int, subject: int) -> list[int]:
    """Seeds of independent images, and of none that a scene is rendered with."""
    return [
        int(np.random.SeedSequence([rebuilt.spec.seed, number, _OWN, subject, k]).generate_state(1)[0])
        for k in range(SUB_BUFFERS)
    ]


def lit_by(scene: Scene, strengths: dict[str, Color]) -> Scene:
    """Return a scene whose lights are multiplied channel by channel; those without a strength stay as they
    are.

    A light of strength 0 is still sampled as often as before, so the noise of the others is the same.
    """
    lights = tuple(
        scaled_light(light, strengths[light.name]) if light.name in strengths else light
        for light in scene.lights
    )
    return replace(scene, lights=lights)


def surfaces_again(
    scene: Scene, camera: Camera, rows: np.ndarray, columns: np.ndarray
) -> dict[str, np.ndarray]:
    """Return what rays through pixel centres meet: ``object_id``, ``position``, ``normal`` and the material.

    The material is all layers of :func:`material_layers`, from the colour that the ray finds; there is
    ``visibility.<light>`` too of each light without extent: whether a ray reaches it.

    Args:
        scene: The scene.
        camera: The view.
        rows: Of the pixels, shape ``(N,)``.
        columns: Of the pixels, shape ``(N,)``.

    Returns:
        Shapes ``(N,)`` or ``(N, 3)``; 0 where nothing is met.
    """
    loaded = load_scene(scene, camera)
    directions = camera.rays()[rows, columns]
    at = {
        light.name: world_position(light, camera)
        for light in scene.lights
        if isinstance(light, PointLight | SpotLight | GaussianLight)
    }
    if mi.variant() == SCALAR:
        met = [_meet(loaded, scene, camera.position, d[None], at) for d in directions]
        found = {name: np.concatenate([one[name] for one in met]) for name in met[0]}
    else:
        found = _meet(loaded, scene, camera.position, directions, at)
    return found | material_layers(scene, found["object_id"], found.pop("color"))


def _meet(
    loaded: mi.Scene, scene: Scene, origin: np.ndarray, directions: np.ndarray, lights: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """All rays at once, or one ray in ``scalar_rgb``."""
    ray = mi.Ray3f(_point(np.broadcast_to(origin, directions.shape)), mi.Vector3f(_point(directions)))
    si: Any = loaded.ray_intersect(ray)
    valid = si.is_valid()
    color = dr.select(valid, _color(si, valid), mi.Color3f(0))
    ids = _ids(si, loaded, scene, len(directions))
    shading, geometric = (_array(v, len(directions)) for v in (si.sh_frame.n, si.n))
    found = {
        "object_id": ids,
        "position": np.where(ids[:, None] > 0, _array(si.p, len(directions)), 0),
        "normal": np.where(ids[:, None] > 0, _towards(shading, geometric, directions), 0),
        "color": np.where(ids[:, None] > 0, _array(color, len(directions)), 0),
    }
    for name, place in lights.items():
        target = _point(np.broadcast_to(place, directions.shape))
        blocked = loaded.ray_test(si.spawn_ray_to(target), valid)
        found[f"visibility.{name}"] = ~np.atleast_1d(np.array(blocked)) & (ids > 0)
    return found


def _color(si: Any, valid: Any) -> Any:
    if mi.variant() == SCALAR:
        return si.bsdf().eval_diffuse_reflectance(si) if valid else mi.Color3f(0)
    return si.bsdf().eval_diffuse_reflectance(si, valid)


def _point(values: np.ndarray) -> Any:
    if mi.variant() == SCALAR:
        return mi.Point3f([float(v) for v in values[0]])
    return mi.Point3f(np.ascontiguousarray(values.T, dtype=np.float32))


def _array(values: Any, count: int) -> np.ndarray:
    return np.array(values, dtype=np.float64).T.reshape(count, 3)


def _ids(si: Any, loaded: mi.Scene, scene: Scene, count: int) -> np.ndarray:
    if mi.variant() != SCALAR:
        index: Any = dr.reinterpret_array(mi.UInt32, si.shape)
        return object_ids(np.array(index).reshape(count), loaded, scene)
    numbers = {shape_key(n): n for n in range(1, len(scene.things) + 1)}
    return np.array([numbers[si.shape.id()] if si.is_valid() else 0], dtype=np.uint32)


def _towards(shading: np.ndarray, geometric: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Return the shading normal on the camera's side; the triangle's own where that one turns away."""
    turned = (shading * rays).sum(-1, keepdims=True) >= 0
    geometric = np.where((geometric * rays).sum(-1, keepdims=True) > 0, -geometric, geometric)
    return np.where(turned, geometric, shading)

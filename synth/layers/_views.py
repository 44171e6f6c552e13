# SPDX-License-Identifier: Apache-2.0
"""The true layers of one view. Import it only after ``use_renderer``."""

from typing import Any

import mitsuba as mi
import numpy as np

from graycard import Camera
from graycard.layers import LOBES
from graycard.synth._scene import Scene
from graycard.synth._spec import SUB_BUFFERS, TRAINING_DIRECTIONS, RenderSettings
from graycard.synth.layers._albedo import directional_albedo
from graycard.synth.layers._effects import effect_layers, target_footprint
from graycard.synth.layers._irradiance import light_layers
from graycard.synth.layers._material_layers import material_layers
from graycard.synth.layers._purity import pure_pixels
from graycard.synth.layers._separation import (
    estimate,
    lobe_light,
    mean_and_variance,
    named_layers,
    part_names,
    separated_images,
    whole_images,
)
from graycard.synth.renderer._mitsuba import centre_sensor, load, load_scene, object_ids, sensor
from graycard.synth.renderer._variant import SCALAR

_EMPTIED_SURFACE = ("normal", "f0", "roughness")
"""Layers of what is behind the target."""
_CENTRE_SEEDS = range(SUB_BUFFERS, 2 * SUB_BUFFERS + 1)
"""Numbers of the seeds of what is estimated at the pixel centres."""

_OF_DEPTH = ("distance", "position")
"""Layers that whoever reads a view has from its depth and camera."""

_EMPTIED_TRAINING = ("radiance", "diffuse", *_EMPTIED_SURFACE)
"""Layers without the target that priors are asked for."""

_BLOCK = 16
"""Pixels along the side of a render block; the automatic size depends on the number of threads."""


def render_view(
    scene: Scene, number: int, seed: int, settings: RenderSettings, images: np.ndarray | None = None
) -> dict[str, np.ndarray]:
    """All true layers of one view; a pure function of its arguments and of the renderer's variant.

    The counterfactual is rendered from the same random numbers: a pixel of which no path meets the target
    is equal in both, to the bit. ``scalar_rgb`` gives no parts of the radiance with or without the
    target, no effects and no visibility.

    Args:
        scene: What is there.
        number: Index of the view in ``scene.views``.
        seed: Of the scene.
        settings: Samples and depth of the light paths.
        images: Those of :func:`light_images`, where they are there already.

    Returns:
        Layers by name, each ``(H, W)`` or ``(H, W, 3)``, in the units of :func:`graycard.all_layers`.
    """
    camera = scene.views[number].camera
    seeds = sub_buffer_seeds(seed, number)
    whole = load_scene(scene, camera)
    if images is None:
        images = light_images(whole, camera, seeds, settings)
    layers = {**_light_layers(images, whole, scene), **surface_layers(whole, scene, camera)}
    layers["pure"] = pure_pixels(whole, scene, camera)
    if mi.variant() != SCALAR:
        layers |= _centre_layers(
            whole, scene, camera, [_seed_of(seed, number, k) for k in _CENTRE_SEEDS], settings
        )
    if scene.target:
        without = load_scene(scene, camera, scene.target)
        emptied = light_images(without, camera, seeds, settings)
        layers |= _emptied_layers(emptied, without, scene, camera)
        if mi.variant() != SCALAR:
            footprint = target_footprint(whole, scene, camera, seeds, settings)
            layers |= effect_layers(images, emptied, footprint)
    return layers


def render_training_view(
    scene: Scene, number: int, seed: int, settings: RenderSettings
) -> dict[str, np.ndarray]:
    """Return what methods, gauges and priors need of a training view; a pure function of its arguments.

    Its values are those of :func:`render_view`, but that fewer directions tell the albedo. Light is not split
    by source, so that neither parts, nor irradiance, visibility or effects of the target are there. Nor are
    halves, which ceilings of held-out views need, what follows from the depth
    (:func:`graycard.layers.with_geometry`), or the variance and the specular light of the scene without its
    target.

    Args:
        scene: What is there.
        number: Index of the view in ``scene.views``.
        seed: Of the scene.
        settings: Samples of training views, and depth of the light paths.

    Returns:
        Layers by name, each ``(H, W)`` or ``(H, W, 3)``, in the units of :func:`graycard.all_layers`.
    """
    camera = scene.views[number].camera
    seeds = sub_buffer_seeds(seed, number)
    whole = load_scene(scene, camera)
    layers = mean_and_variance("radiance", picture_images(whole, camera, seeds, settings))
    surfaces = surface_layers(whole, scene, camera)
    layers |= {name: values for name, values in surfaces.items() if name not in _OF_DEPTH}
    layers["pure"] = pure_pixels(whole, scene, camera)
    if mi.variant() != SCALAR:
        of_albedo = _seed_of(seed, number, _CENTRE_SEEDS[0])
        layers |= directional_albedo(whole, camera, of_albedo, TRAINING_DIRECTIONS)
    if scene.target:
        without = load_scene(scene, camera, scene.target)
        emptied = _emptied_layers(light_images(without, camera, seeds, settings), without, scene, camera)
        kept = [f"counterfactual.{name}" for name in _EMPTIED_TRAINING]
        layers |= {name: emptied[name] for name in kept if name in emptied}
    return layers


def _emptied_layers(
    images: np.ndarray, loaded: mi.Scene, scene: Scene, camera: Camera
) -> dict[str, np.ndarray]:
    """Return the view without the target: its light, by lobe too where the variant can, and what it is made
    of.
    """
    surfaces = surface_layers(loaded, scene, camera)
    found = estimate("radiance", images[:, 0]) | {name: surfaces[name] for name in _EMPTIED_SURFACE}
    if mi.variant() != SCALAR:
        found |= {lobe: lobe_light(images, lobe) for lobe in LOBES}
    return {f"counterfactual.{name}": values for name, values in found.items()}


def _centre_layers(
    loaded: mi.Scene, scene: Scene, camera: Camera, seeds: list[int], settings: RenderSettings
) -> dict[str, np.ndarray]:
    """Light at pixel centres: which arrives, which is blocked, which
    is returned.
    """
    first, *others = seeds
    return {
        **directional_albedo(loaded, camera, first),
        **light_layers(loaded, scene, camera, others, settings),
    }


def light_images(loaded: mi.Scene, camera: Camera, seeds: list[int], settings: RenderSettings) -> np.ndarray:
    """Independent images of the radiance, then of its parts where the variant can tell them apart."""
    if mi.variant() != SCALAR:
        return separated_images(loaded, camera, seeds, settings)
    return radiance_images(loaded, camera, seeds, settings)[:, None]


def picture_images(
    loaded: mi.Scene, camera: Camera, seeds: list[int], settings: RenderSettings
) -> np.ndarray:
    """Independent images of the radiance of a view and of nothing else, ``(images, H, W, 3)``, float64."""
    images = radiance_images if mi.variant() == SCALAR else whole_images
    return images(loaded, camera, seeds, settings)


def _light_layers(images: np.ndarray, loaded: mi.Scene, scene: Scene) -> dict[str, np.ndarray]:
    if mi.variant() != SCALAR:
        return named_layers(images, part_names(loaded, scene))
    return estimate("radiance", images[:, 0])


def sub_buffer_seeds(seed: int, view: int) -> list[int]:
    """One 32-bit seed for each independent image of a view."""
    return [_seed_of(seed, view, number) for number in range(SUB_BUFFERS)]


def _seed_of(seed: int, view: int, number: int) -> int:
    return int(np.random.SeedSequence([seed, view, number]).generate_state(1)[0])


def radiance_images(
    loaded: mi.Scene, camera: Camera, seeds: list[int], settings: RenderSettings
) -> np.ndarray:
    """Independent images of the radiance of a view by Mitsuba's ``path``, ``(images, H, W, 3)``, float64.

    With LLVM and samples that are no power of two, the last bits depend on the number of threads.
    """
    share = settings.samples // len(seeds)
    integrator = load({"type": "path", "max_depth": settings.max_depth, "block_size": _BLOCK})
    eye = sensor(camera, share)
    return np.stack([_image(loaded, eye, integrator, spp=share, seed=one) for one in seeds])


def surface_layers(loaded: mi.Scene, scene: Scene, camera: Camera) -> dict[str, np.ndarray]:
    """Material, normal, depth, distance, position and object id at the pixel centres, from one ray each."""
    aovs = "p:position,n:sh_normal,g:geo_normal,c:albedo,s:shape_index"
    caster = load({"type": "aov", "aovs": aovs, "block_size": _BLOCK})
    values = _image(loaded, centre_sensor(camera), caster, spp=1)
    position, shading, geometric, color = (values[..., 3 * k : 3 * k + 3] for k in range(4))
    ids = object_ids(values[..., 12], loaded, scene)
    seen = ids > 0
    from_camera = position - camera.position
    surface = {
        "normal": _facing(shading, geometric, camera),
        "position": position,
        **material_layers(scene, ids, color),
    }
    distances = {"depth": from_camera @ camera.forward, "distance": np.linalg.norm(from_camera, axis=-1)}
    return {
        **{name: _where_seen(seen, values, 0.0) for name, values in surface.items()},
        **{name: _where_seen(seen, values, np.inf) for name, values in distances.items()},
        "object_id": ids,
    }


def _where_seen(seen: np.ndarray, values: np.ndarray, otherwise: float) -> np.ndarray:
    seen = seen if values.ndim == 2 else seen[..., None]
    return np.where(seen, values, otherwise).astype(np.float32)


def _image(loaded: mi.Scene, eye: mi.Sensor, integrator: mi.Integrator, **options: Any) -> np.ndarray:
    """One rendered image of shape ``(H, W, channels)``, float64."""
    return np.array(mi.render(loaded, sensor=eye, integrator=integrator, **options), dtype=np.float64)


def _facing(shading: np.ndarray, geometric: np.ndarray, camera: Camera) -> np.ndarray:
    """Return unit normals that face the camera.

    Where an interpolated normal of a mesh turns away at its outline, the triangle's own one is right.
    """
    rays = camera.rays()
    turned = ((shading * rays).sum(-1) >= 0)[..., None]
    normal = np.where(turned, geometric, shading).astype(np.float64)
    normal = np.where((normal * rays).sum(-1, keepdims=True) > 0, -normal, normal)
    return normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-30)

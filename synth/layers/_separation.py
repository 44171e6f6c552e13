# SPDX-License-Identifier: Apache-2.0
"""Radiance split by light, by lobe and by bounce, in one pass. Import it only after ``use_renderer``.

A path tracer with multiple importance sampling that takes the same random numbers in the same order as
Mitsuba's ``path`` (the estimator is Veach 1997, section 9.2 and 10.3, balance of squares), and books each
contribution under the light that it comes from, under the lobe that the camera's hit reflects it with, and
under direct (one bounce) or indirect (more). Kernels over whole images: ``llvm_ad_rgb`` only.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from graycard import Camera
from graycard.synth._scene import Scene
from graycard.synth._spec import RenderSettings
from graycard.synth.renderer._mitsuba import sensor, shape_key
from graycard.synth.renderer._scattering import Response, as_it_is
from graycard.synth.renderer._wavefront import Band, PrimaryRays, box_rays, mean_image

PARTS = ("direct.diffuse", "direct.specular", "indirect.diffuse", "indirect.specular")
"""Parts of the light of one source."""

_TOTAL, _EMITTED = 0, 1
FIRST_PART = 2
"""Index where the parts of the first light begin in the tracer's images, after total and emitted."""

_ROULETTE_DEPTH = 5
"""Mitsuba's own default."""


def named_layers(images: np.ndarray, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Layers from the tracer's images, by layer.

    Args:
        images: Of :func:`separated_images`.
        names: Of all but the total, as :func:`part_names` gives them.

    Returns:
        Those of :func:`estimate` for ``radiance``, ``emitted`` (light of sources that the camera sees) and
        ``<part>.<light>`` for each of :data:`PARTS`; each ``(H, W, 3)``, float32, W/m²/sr. ``emitted`` and
        the parts of all lights add up to ``radiance``.
    """
    parts = images[:, _EMITTED:].mean(axis=0).astype(np.float32)
    return estimate("radiance", images[:, _TOTAL]) | dict(zip(names, parts, strict=True))


def lobe_light(images: np.ndarray, lobe: str) -> np.ndarray:
    """All light of a lobe at the camera's hit, however often it bounced, ``(H, W, 3)``, float32, W/m²/sr.

    Args:
        images: Of :func:`separated_images`.
        lobe: ``diffuse`` or ``specular``.
    """
    mine = [part.endswith(lobe) for part in PARTS]
    places = [n for n in range(FIRST_PART, images.shape[1]) if mine[(n - FIRST_PART) % len(PARTS)]]
    return images[:, places].sum(axis=1).mean(axis=0).astype(np.float32)


def estimate(name: str, images: np.ndarray) -> dict[str, np.ndarray]:
    """Estimates that images tell of a layer.

    Args:
        name: Of the layer.
        images: Shape ``(images, H, W, 3)``, an even number.

    Returns:
        Those of :func:`mean_and_variance`, and ``<name>.half_a`` and ``<name>.half_b``, the means of either
        half.
    """
    half = len(images) // 2
    halves = {"half_a": images[:half].mean(axis=0), "half_b": images[half:].mean(axis=0)}
    named = {f"{name}.{end}": values.astype(np.float32) for end, values in halves.items()}
    return mean_and_variance(name, images) | named


def mean_and_variance(name: str, images: np.ndarray) -> dict[str, np.ndarray]:
    """Return the mean of images as a layer, and how well it is known.

    Args:
        name: Of the layer.
        images: Shape ``(images, H, W, 3)``.

    Returns:
        The mean ``<name>``, and ``<name>.var``, the unbiased variance of this mean, ``Var(images) / n``,
        whatever the sampler does inside one image; each ``(H, W, 3)``, float32.
    """
    variance = images.var(axis=0, ddof=1) / len(images)
    return {name: images.mean(axis=0).astype(np.float32), f"{name}.var": variance.astype(np.float32)}


def part_names(loaded: mi.Scene, scene: Scene) -> list[str]:
    """Return ``emitted`` and the parts of all lights, in the order of the tracer's images."""
    return ["emitted", *(f"{part}.{light}" for light in light_names(loaded, scene) for part in PARTS)]


def light_names(loaded: mi.Scene, scene: Scene) -> list[str]:
    """Our names of Mitsuba's emitters, in Mitsuba's order."""
    surfaces = {shape_key(number): thing.light for number, thing in enumerate(scene.things, start=1)}
    # the id of an area light is "emitter", whatever the shape that it belongs to
    shapes = [(emitter, emitter.get_shape()) for emitter in loaded.emitters()]
    return [surfaces[s.id()] if s is not None else e.id().removeprefix("light-") for e, s in shapes]


def separated_images(
    loaded: mi.Scene,
    camera: Camera,
    seeds: list[int],
    settings: RenderSettings,
    rays: PrimaryRays = box_rays,
    response: Response | None = None,
) -> np.ndarray:
    """Independent images of total, emitted and all parts, ``(images, 2 + 4 lights, H, W, 3)``, float64.

    All samples of one band of an image are in memory at once: 12 (2 + 4 lights) bytes each.
    """
    eye, response = sensor(camera, settings.samples // len(seeds)), response or as_it_is
    tracer = _Tracer(list(loaded.emitters()), settings.max_depth, rays, response)
    return np.stack([_image(loaded, eye, seed, tracer) for seed in seeds])


def whole_images(loaded: mi.Scene, camera: Camera, seeds: list[int], settings: RenderSettings) -> np.ndarray:
    """Independent images of the radiance alone, ``(images, H, W, 3)``, float64.

    The same bits with any number of threads: Mitsuba's own film adds the samples of a pixel in the order of
    the threads where its blocks of samples end within the pixel.
    """
    eye = sensor(camera, settings.samples // len(seeds))
    tracer = _Tracer([], settings.max_depth, box_rays, as_it_is)
    return np.stack([_image(loaded, eye, seed, tracer)[_TOTAL] for seed in seeds])


class _Tracer(NamedTuple):
    """Request: what light paths are to be followed, and by which lights they are to be told apart."""

    emitters: list[Any]
    max_depth: int
    rays: PrimaryRays
    response: Response


def _image(loaded: mi.Scene, eye: mi.Sensor, seed: int, tracer: _Tracer) -> np.ndarray:
    def traced(band: Band, sampler: mi.Sampler) -> list[Any]:
        ray = tracer.rays(band, sampler)
        return _trace(loaded, sampler, ray, tracer.emitters, tracer.max_depth, tracer.response)

    return mean_image(eye, seed, traced)


@dr.syntax
def _trace(scene, sampler, ray, emitters, max_depth: int, response):
    """Light along each ray: total, emitted, and :data:`PARTS` of each emitter, as ``Color3f``."""
    sums = [mi.Color3f(0) for _ in range(FIRST_PART + len(PARTS) * len(emitters))]
    ray, depth, active = mi.Ray3f(ray), mi.UInt32(0), mi.Bool(True)
    throughput, diffuse_share = mi.Color3f(1), mi.Color3f(1)
    before, density, delta = dr.zeros(mi.Interaction3f), mi.Float(1), mi.Bool(True)
    while active:
        si = scene.ray_intersect(ray, active)
        light, seen = _emission(scene, si, before, density, delta, active)
        sums = _book(sums, emitters, light, throughput * seen, throughput * seen * diffuse_share, depth)
        active &= si.is_valid() & (depth + 1 < max_depth)

        bsdf = si.bsdf(ray)
        lit = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        ds, arriving = scene.sample_emitter_direction(si, sampler.next_2d(), True, lit)
        lit &= ds.pdf != 0
        samples, first = (sampler.next_1d(), sampler.next_2d()), depth == 0
        scattering = response(bsdf, si, si.to_local(ds.d), samples, first, active)
        weight = dr.select(ds.delta, 1, _balance(ds.pdf, scattering.density))
        reflected = dr.select(lit, throughput * arriving * weight * scattering.value, 0)
        share = dr.select(first, scattering.diffuse, diffuse_share)
        sums = _book(sums, emitters, ds.emitter, reflected, reflected * share, depth + 1)

        ray = si.spawn_ray(si.to_world(scattering.sample.wo))
        throughput *= scattering.weight
        diffuse_share = dr.select(first, scattering.diffuse_share, diffuse_share)
        before, density = mi.Interaction3f(si), scattering.sample.pdf
        delta = mi.has_flag(scattering.sample.sampled_type, mi.BSDFFlags.Delta)
        depth += 1
        survival = dr.minimum(dr.max(throughput), 0.95)
        tested = depth >= _ROULETTE_DEPTH
        survives = sampler.next_1d() < survival
        throughput = dr.select(tested, throughput / survival, throughput)
        active &= (~tested | survives) & (survival > 0)
    return sums


def _emission(scene: Any, si: Any, before: Any, density: Any, delta: Any, active: Any) -> tuple[Any, Any]:
    """Return the light that a ray has met by chance, and its radiance weighted against sampling
    this light.
    """
    ds = mi.DirectionSample3f(scene, si, before)
    active = active & (density > 0)
    by_light = scene.pdf_emitter_direction(before, ds, active & ~delta)
    radiance = ds.emitter.eval(si, active) * _balance(density, by_light)
    return ds.emitter, dr.select(active & (ds.emitter != None), radiance, 0)  # noqa: E711 (Dr.Jit's null test)


def _balance(density: Any, other: Any) -> Any:
    """Veach's power heuristic with exponent 2."""
    squared = density * density
    weight = squared / (squared + other * other)
    return dr.select(dr.isfinite(weight), weight, 0)


def _book(sums: list[Any], emitters: list[Any], light: Any, value: Any, diffuse: Any, bounces: Any) -> list:
    """Return sums with a contribution of ``light`` after a number of bounces, of which ``diffuse`` by that
    lobe.
    """
    sums = list(sums)
    sums[_TOTAL] = sums[_TOTAL] + value
    sums[_EMITTED] = sums[_EMITTED] + dr.select(bounces == 0, value, 0)
    for k, emitter in enumerate(emitters):
        place = FIRST_PART + len(PARTS) * k
        mine = light == mi.EmitterPtr(emitter)
        for at, is_meant in ((place, bounces == 1), (place + 2, bounces > 1)):
            sums[at] = sums[at] + dr.select(mine & is_meant, diffuse, 0)
            sums[at + 1] = sums[at + 1] + dr.select(mine & is_meant, value - diffuse, 0)
    return sums

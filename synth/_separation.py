# SPDX-License-Identifier: Apache-2.0
"""Radiance split by light, by lobe and by bounce, in one pass. Import it only after ``use_renderer``.

A path tracer with multiple importance sampling that takes the same random numbers in the same order as
Mitsuba's ``path`` (the estimator is Veach 1997, section 9.2 and 10.3, balance of squares), and books each
contribution under the light that it comes from, under the lobe that the camera's hit reflects it with, and
under direct (one bounce) or indirect (more). Kernels over whole images: ``llvm_ad_rgb`` only.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

import graycard as gc
from graycard.synth._mitsuba import sensor, shape_key
from graycard.synth._scene import Scene
from graycard.synth._spec import RenderSettings

PARTS = ("direct.diffuse", "direct.specular", "indirect.diffuse", "indirect.specular")
"""What the light of one source is split into."""

_TOTAL, _EMITTED = 0, 1
FIRST_PART = 2
"""Where the parts of the first light begin in the tracer's images, after total and emitted."""

_ROULETTE_DEPTH = 5
"""Mitsuba's own default."""


class Scattering(NamedTuple):
    """What a surface does with light: towards a light that was sampled, and along the path's next ray."""

    value: Any
    """Of the material towards the light, times the cosine."""
    diffuse: Any
    """Share of ``value`` that the diffuse lobe has."""
    density: Any
    """Of sampling the light's direction by the material."""
    sample: Any
    """The next direction, a ``BSDFSample3f``."""
    weight: Any
    """Material times cosine over density, of the next direction."""
    diffuse_share: Any
    """Share of ``weight`` that the diffuse lobe has, 0 to 1."""


Response = Callable[[Any, Any, Any, Any, Any, Any], Scattering]
"""``(bsdf, si, wo, (sample1, sample2), first, active)``; ``first`` is where the camera's own hit is."""

PrimaryRays = Callable[[mi.Sensor, mi.Sampler, int], Any]
"""``(sensor, sampler, samples)``: rays of all pixels, the ``samples`` of a pixel side by side."""


def separated_radiance(
    loaded: mi.Scene,
    scene: Scene,
    camera: gc.Camera,
    seeds: list[int],
    settings: RenderSettings,
) -> dict[str, np.ndarray]:
    """The radiance of a view and its parts, means over independent images, box-filtered.

    Args:
        loaded: Mitsuba's scene of ``scene``.
        scene: Whose lights name the parts.
        camera: The view.
        seeds: One for each independent image.
        settings: Samples in all, and depth of the light paths.

    Returns:
        Those of :func:`estimate` for ``radiance``, ``emitted`` (light of sources that the camera sees) and
        ``<part>.<light>`` for each of :data:`PARTS`; each ``(H, W, 3)``, float32, W/m²/sr. ``emitted`` and
        the parts of all lights add up to ``radiance``.
    """
    images = separated_images(loaded, camera, seeds, settings)
    return named_layers(images, part_names(loaded, scene))


def named_layers(images: np.ndarray, names: Sequence[str]) -> dict[str, np.ndarray]:
    """The layers of :func:`separated_radiance` from the tracer's images and the names of its parts."""
    parts = images[:, _EMITTED:].mean(axis=0).astype(np.float32)
    return estimate("radiance", images[:, _TOTAL]) | dict(zip(names, parts, strict=True))


def estimate(name: str, images: np.ndarray) -> dict[str, np.ndarray]:
    """What independent images tell of a layer.

    Args:
        name: Of the layer.
        images: Shape ``(images, H, W, 3)``, an even number.

    Returns:
        The mean ``<name>``; ``<name>.var``, the unbiased variance of this mean, ``Var(images) / n``, whatever
        the sampler does inside one image; and ``<name>.half_a``, ``<name>.half_b``, the means of either half.
    """
    half = len(images) // 2
    layers = {
        name: images.mean(axis=0),
        f"{name}.var": images.var(axis=0, ddof=1) / len(images),
        f"{name}.half_a": images[:half].mean(axis=0),
        f"{name}.half_b": images[half:].mean(axis=0),
    }
    return {name: values.astype(np.float32) for name, values in layers.items()}


def part_names(loaded: mi.Scene, scene: Scene) -> list[str]:
    """``emitted`` and the parts of all lights, in the order of the tracer's images."""
    return ["emitted", *(f"{part}.{light}" for light in light_names(loaded, scene) for part in PARTS)]


def light_names(loaded: mi.Scene, scene: Scene) -> list[str]:
    """Our names of Mitsuba's emitters, in Mitsuba's order."""
    surfaces = {shape_key(number): thing.light for number, thing in enumerate(scene.things, start=1)}
    # the id of an area light is "emitter", whatever the shape that it belongs to
    shapes = [(emitter, emitter.get_shape()) for emitter in loaded.emitters()]
    return [surfaces[s.id()] if s is not None else e.id().removeprefix("light-") for e, s in shapes]


def box_rays(eye: mi.Sensor, sampler: mi.Sampler, samples: int) -> Any:
    """Rays through random points of the pixels, as Mitsuba's box filter takes them."""
    pixel = _pixels(eye, samples)
    return _rays(eye, pixel + sampler.next_2d())


def centre_rays(eye: mi.Sensor, sampler: mi.Sampler, samples: int) -> Any:
    """Rays through the pixel centres."""
    del sampler
    return _rays(eye, _pixels(eye, samples) + 0.5)


def _pixels(eye: mi.Sensor, samples: int) -> Any:
    width, height = (int(v) for v in eye.film().crop_size())
    pixel = dr.arange(mi.UInt32, width * height * samples) // samples
    return mi.Point2f(mi.Float(pixel % width), mi.Float(pixel // width))


def _rays(eye: Any, position: Any) -> Any:
    width, height = (int(v) for v in eye.film().crop_size())
    scaled = position * mi.Vector2f(1 / width, 1 / height)
    return eye.sample_ray_differential(eye.shutter_open(), 0.5, scaled, mi.Point2f(0.5))[0]


def separated_images(
    loaded: mi.Scene,
    camera: gc.Camera,
    seeds: list[int],
    settings: RenderSettings,
    rays: PrimaryRays = box_rays,
    response: Response | None = None,
) -> np.ndarray:
    """Independent images of total, emitted and all parts, ``(images, 2 + 4 lights, H, W, 3)``, float64.

    All samples of one image are in memory at once: 12 (2 + 4 lights) bytes each.
    """
    eye = sensor(camera, settings.samples // len(seeds))
    response = response or as_it_is
    return np.stack([_image(loaded, eye, seed, settings.max_depth, rays, response) for seed in seeds])


def _image(
    loaded: mi.Scene, eye: mi.Sensor, seed: int, max_depth: int, rays: PrimaryRays, response: Response
) -> np.ndarray:
    sampler, samples = seeded_sampler(eye, seed)
    ray = rays(eye, sampler, samples)
    sums = _trace(loaded, sampler, ray, list(loaded.emitters()), max_depth, response)
    return pixel_means(sums, eye, samples)


def seeded_sampler(eye: mi.Sensor, seed: int) -> tuple[Any, int]:
    """The sampler of all pixels at once, and its number of samples per pixel."""
    width, height = (int(v) for v in eye.film().crop_size())
    sampler: Any = eye.sampler().clone()
    samples = sampler.sample_count()
    sampler.set_samples_per_wavefront(samples)
    sampler.seed(dr.opaque(mi.UInt32, seed), width * height * samples)
    return sampler, samples


def pixel_means(sums: list[Any], eye: mi.Sensor, samples: int) -> np.ndarray:
    """Colours of all samples to means over the pixels, ``(colours, H, W, 3)``, float64."""
    width, height = (int(v) for v in eye.film().crop_size())
    dr.eval(sums)  # one kernel for all channels: unevaluated, each sum below would trace all paths anew
    # sums of neighbours in a fixed order; scattering into pixels would add in the order of the threads
    pixels = [np.array(dr.block_sum(channel, samples)) for color in sums for channel in color]
    image = np.stack(pixels).reshape(len(sums), 3, height, width).astype(np.float64)
    return image.transpose(0, 2, 3, 1) / samples


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
    """The light that a ray has met by chance, and its radiance weighted against sampling this light."""
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
    """Sums with a contribution of ``light`` after a number of bounces, of which ``diffuse`` by that lobe."""
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


def as_it_is(bsdf: Any, si: Any, wo: Any, samples: Any, first: Any, active: Any) -> Scattering:
    """What the material does, split by lobes where ``first``."""
    value, density, sample, weight = bsdf.eval_pdf_sample(mi.BSDFContext(), si, wo, *samples, active)
    first = first & active
    towards_light, onwards = _diffuse_values(bsdf, si, (wo, sample.wo), first)
    return Scattering(
        value,
        _share(towards_light, value),
        density,
        sample,
        weight,
        _share(onwards, weight * sample.pdf),
    )


def white_first(bsdf: Any, si: Any, wo: Any, samples: Any, first: Any, active: Any) -> Scattering:
    """What the material does, with a white Lambertian one in its place where ``first``."""
    value, density, sample, weight = bsdf.eval_pdf_sample(mi.BSDFContext(), si, wo, *samples, active)
    front = mi.Frame3f.cos_theta(si.wi) > 0
    cosine = dr.select(front, dr.maximum(mi.Frame3f.cos_theta(wo), 0), 0) * dr.inv_pi
    cosine_wo = mi.warp.square_to_cosine_hemisphere(samples[1])
    sample.wo = dr.select(first, cosine_wo, sample.wo)
    sample.pdf = dr.select(first, mi.Frame3f.cos_theta(cosine_wo) * dr.inv_pi, sample.pdf)
    diffuse = mi.UInt32(int(mi.BSDFFlags.DiffuseReflection))
    sample.sampled_type = dr.select(first, diffuse, sample.sampled_type)
    return Scattering(
        dr.select(first, mi.Color3f(cosine), value),
        mi.Color3f(1),
        dr.select(first, cosine, density),
        sample,
        dr.select(first, mi.Color3f(dr.select(front, 1.0, 0.0)), weight),
        mi.Color3f(1),
    )


def _share(part: Any, whole: Any) -> Any:
    return dr.select(whole > 0, dr.clip(part / dr.select(whole > 0, whole, 1), 0, 1), 0)


def _diffuse_values(bsdf: Any, si: Any, directions: tuple[Any, ...], active: Any) -> list[Any]:
    """The diffuse lobe of any material towards each direction, times the cosine.

    Mitsuba's ``principled`` ignores which lobes a context asks for; it alone has an attribute ``specular``.
    """
    principled = active & bsdf.has_attribute("specular", active)
    others = active & ~principled
    context = mi.BSDFContext()
    context.type_mask = mi.BSDFFlags.DiffuseReflection
    disney = _disney(bsdf, si, principled)
    return [
        dr.select(principled, _disney_diffuse(disney, si.wi, wo), bsdf.eval(context, si, wo, others))
        for wo in directions
    ]


class _Disney(NamedTuple):
    """What the diffuse lobe of the principled material depends on."""

    reflectance: Any
    roughness: Any


def _disney(bsdf: Any, si: Any, active: Any) -> _Disney:
    metallic = bsdf.eval_attribute_1("metallic", si, active)
    color = bsdf.eval_attribute("base_color", si, active)
    return _Disney((1 - metallic) * color, bsdf.eval_attribute_1("roughness", si, active))


def _disney_diffuse(material: _Disney, wi: Any, wo: Any) -> Any:
    """Diffuse lobe with retro-reflection, times the cosine (Burley 2015, section 3, without sheen)."""
    cos_i, cos_o = mi.Frame3f.cos_theta(wi), mi.Frame3f.cos_theta(wo)
    grazing_i, grazing_o = _grazing(cos_i), _grazing(cos_o)
    retro = 2 * material.roughness * dr.square(dr.dot(dr.normalize(wi + wo), wo))
    lambert = (1 - 0.5 * grazing_i) * (1 - 0.5 * grazing_o)
    back = retro * (grazing_o + grazing_i + grazing_o * grazing_i * (retro - 1))
    value = material.reflectance * dr.inv_pi * cos_o * (lambert + back)
    return dr.select((cos_i > 0) & (cos_o > 0), value, 0)


def _grazing(cosine: Any) -> Any:
    """Schlick's weight of the grazing reflectance."""
    return dr.power(dr.clip(1 - cosine, 0, 1), 5)

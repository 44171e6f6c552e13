# SPDX-License-Identifier: Apache-2.0
"""What reaches the points that are seen straight from each light. Import it only after ``use_renderer``.

Whole images at once: ``llvm_ad_rgb`` only.
"""

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

import graycard as gc
from graycard.synth._mitsuba import sensor
from graycard.synth._separation import centre_rays

SAMPLES = 36
"""Points on each light in each independent image, stratified."""


class DirectLight(NamedTuple):
    """Irradiance at the pixel centres straight from each light, in Mitsuba's order of lights."""

    sent: np.ndarray
    """As if nothing stood in the way, ``(images, lights, H, W, 3)``, W/m²."""
    arriving: np.ndarray
    """What is not blocked of it, of the same shape."""

    def visibility(self) -> np.ndarray:
        """Share of the irradiance from each light that nothing blocks, ``(lights, H, W)``, 0 to 1.

        From the same samples with and without the shadow test, so it is exactly 0 or 1 for a light without
        extent. It is 0 on a side that faces away from the light and outside its cone.
        """
        sent, arriving = (luminance(values.mean(axis=0)) for values in self)
        return np.where(sent > 0, arriving / np.where(sent > 0, sent, 1), 0)


def luminance(color: np.ndarray) -> np.ndarray:
    """Relative luminance of linear Rec.709, ``(..., 3)`` to ``(...)``."""
    return color @ np.array([0.2126, 0.7152, 0.0722])


def direct_light(
    loaded: mi.Scene, camera: gc.Camera, seeds: list[int], samples: int = SAMPLES
) -> DirectLight:
    """Irradiance straight from each light at the pixel centres; exact for lights without extent.

    Args:
        loaded: Mitsuba's scene.
        camera: The view.
        seeds: One for each independent image.
        samples: Points on each light in each image; a square.
    """
    eye = sensor(camera, samples)
    images = [_image(loaded, eye, seed, samples) for seed in seeds]
    sent, arriving = (np.stack(kind) for kind in zip(*images, strict=True))
    return DirectLight(sent, arriving)


def _image(loaded: mi.Scene, eye: Any, seed: int, samples: int) -> tuple[np.ndarray, np.ndarray]:
    width, height = (int(v) for v in eye.film().crop_size())
    sampler: Any = eye.sampler().clone()
    sampler.set_samples_per_wavefront(samples)
    sampler.seed(dr.opaque(mi.UInt32, seed), width * height * samples)
    si = loaded.ray_intersect(centre_rays(eye, sampler, samples))
    pairs = [_irradiances(loaded, emitter, si, sampler) for emitter in loaded.emitters()]
    dr.eval(pairs)  # else the points are found anew for each light
    pixels = [[[np.array(dr.block_sum(c, samples)) for c in color] for color in pair] for pair in pairs]
    image = np.array(pixels).reshape(len(pairs), 2, 3, height, width).astype(np.float64) / samples
    sent, arriving = image.transpose(1, 0, 3, 4, 2)
    return sent, arriving


def _irradiances(loaded: mi.Scene, emitter: mi.Emitter, si: Any, sampler: Any) -> tuple[Any, Any]:
    """Irradiance that a light sends to each point, and what of it arrives."""
    radiance: Any
    ds, radiance = emitter.sample_direction(si, sampler.next_2d(), si.is_valid())
    facing = si.is_valid() & (mi.Frame3f.cos_theta(si.wi) > 0) & (ds.pdf > 0)
    cosine = dr.maximum(mi.Frame3f.cos_theta(si.to_local(ds.d)), 0)
    sent = dr.select(facing, radiance * cosine, 0)
    blocked = loaded.ray_test(si.spawn_ray_to(ds.p), dr.any(sent > 0))
    return sent, dr.select(blocked, 0, sent)

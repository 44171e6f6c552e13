# SPDX-License-Identifier: Apache-2.0
"""Direct light: what reaches the points that are seen straight from each light. Import it only after
``use_renderer``.

Whole images at once: ``llvm_ad_rgb`` only.
"""

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from graycard import Camera, luminance
from graycard.synth.renderer._mitsuba import sensor
from graycard.synth.renderer._wavefront import Band, centre_rays, mean_image

SAMPLES = 36
"""Points on each light in each independent image, stratified."""


class DirectLight(NamedTuple):
    """Irradiance at the pixel centres straight from each light, in Mitsuba's order of lights."""

    sent: np.ndarray
    """Light as if nothing stood in the way, ``(images, lights, H, W, 3)``, W/m²."""
    arriving: np.ndarray
    """Share that is not blocked, of the same shape."""

    def visibility(self) -> np.ndarray:
        """Share of the irradiance from each light that nothing blocks, ``(lights, H, W)``, 0 to 1.

        From the same samples with and without the shadow test, so it is exactly 0 or 1 for a light without
        extent. It is 0 on a side that faces away from the light and outside its cone.
        """
        sent, arriving = (luminance(values.mean(axis=0)) for values in self)
        return np.where(sent > 0, arriving / np.where(sent > 0, sent, 1), 0)


def direct_light(loaded: mi.Scene, camera: Camera, seeds: list[int], samples: int = SAMPLES) -> DirectLight:
    """Irradiance straight from each light at the pixel centres; exact for lights without extent.

    Args:
        loaded: Mitsuba's scene.
        camera: The view.
        seeds: One for each independent image.
        samples: Points on each light in each image; a square.
    """
    eye = sensor(camera, samples)
    images = [_image(loaded, eye, seed) for seed in seeds]
    sent, arriving = (np.stack(kind) for kind in zip(*images, strict=True))
    return DirectLight(sent, arriving)


def _image(loaded: mi.Scene, eye: mi.Sensor, seed: int) -> tuple[np.ndarray, np.ndarray]:
    def traced(band: Band, sampler: mi.Sampler) -> list[Any]:
        si = loaded.ray_intersect(centre_rays(band, sampler))
        pairs = [_irradiances(loaded, emitter, si, sampler) for emitter in loaded.emitters()]
        return [color for pair in pairs for color in pair]

    means = mean_image(eye, seed, traced)
    return means[0::2], means[1::2]


def _irradiances(loaded: mi.Scene, emitter: mi.Emitter, si: Any, sampler: Any) -> tuple[Any, Any]:
    """Irradiance that a light sends to each point, and what of it arrives."""
    radiance: Any
    ds, radiance = emitter.sample_direction(si, sampler.next_2d(), si.is_valid())
    facing = si.is_valid() & (mi.Frame3f.cos_theta(si.wi) > 0) & (ds.pdf > 0)
    cosine = dr.maximum(mi.Frame3f.cos_theta(si.to_local(ds.d)), 0)
    sent = dr.select(facing, radiance * cosine, 0)
    blocked = loaded.ray_test(si.spawn_ray_to(ds.p), dr.any(sent > 0))
    return sent, dr.select(blocked, 0, sent)

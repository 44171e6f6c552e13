# SPDX-License-Identifier: Apache-2.0
"""Camera rays of all pixels at once, and what comes of them per pixel. Import it only after ``use_renderer``.

Kernels over whole images: ``llvm_ad_rgb`` only.
"""

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

PrimaryRays = Callable[[mi.Sensor, mi.Sampler, int], Any]
"""``(sensor, sampler, samples)``: rays of all pixels, the ``samples`` of a pixel side by side."""


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


def seeded_sampler(eye: mi.Sensor, seed: int) -> tuple[Any, int]:
    """Return the sampler of all pixels at once, and its number of samples per pixel."""
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

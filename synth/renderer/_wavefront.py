# SPDX-License-Identifier: Apache-2.0
"""Camera rays of all pixels at once, and what comes of them per pixel. Import it only after ``use_renderer``.

Kernels over whole images: ``llvm_ad_rgb`` only.
"""

from collections.abc import Callable
from math import ceil
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from graycard.synth._spec import MOST_PATHS

_SEED_STEP = 0x9E3779B9
"""Difference between the seeds of two passes: far from those of other pictures, which are near each other."""

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


def mean_image(eye: mi.Sensor, seed: int, trace: Callable[[mi.Sampler, int], list[Any]]) -> np.ndarray:
    """Mean over the samples of each pixel, ``(colours, H, W, 3)``, float64.

    Pictures of more than :data:`MOST_PATHS` samples are traced in passes, each with stratified samples of its
    own. Up to there, all samples of a pixel are one set.

    Args:
        eye: The view; its sampler says how many samples a pixel has at least.
        seed: Of the random numbers.
        trace: ``(sampler, samples)`` to colours, in which the ``samples`` of a pixel lie side by side.
    """
    width, height = (int(v) for v in eye.film().crop_size())
    wanted = eye.sampler().sample_count()
    passes = ceil(width * height * wanted / MOST_PATHS)
    total, count = 0.0, 0
    for number in range(passes):
        sampler: Any = eye.sampler().clone()
        if passes > 1:
            sampler.set_sample_count(ceil(wanted / passes))  # it may take a few more, to fill its strata
        samples = sampler.sample_count()
        sampler.set_samples_per_wavefront(samples)
        sampler.seed(dr.opaque(mi.UInt32, (seed + number * _SEED_STEP) % 2**32), width * height * samples)
        total = total + _pixel_sums(trace(sampler, samples), (height, width), samples)
        count += samples
    return np.asarray(total) / count


def _pixel_sums(sums: list[Any], shape: tuple[int, int], samples: int) -> np.ndarray:
    """Colours of all samples to sums over the pixels, ``(colours, H, W, 3)``, float64."""
    dr.eval(sums)  # one kernel for all channels: unevaluated, each sum below would trace all paths anew
    # sums of neighbours in a fixed order; scattering into pixels would add in the order of the threads
    pixels = [np.array(dr.block_sum(channel, samples)) for color in sums for channel in color]
    return np.stack(pixels).reshape(len(sums), 3, *shape).astype(np.float64).transpose(0, 2, 3, 1)

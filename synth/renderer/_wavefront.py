# SPDX-License-Identifier: Apache-2.0
"""Camera rays of all pixels, and what comes of them per pixel. Import it only after ``use_renderer``.

Kernels over bands of an image: ``llvm_ad_rgb`` only.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from graycard.synth._spec import MOST_PATHS

_SEED_STEP = 0x9E3779B9
"""Difference between the seeds of two bands: far from those of other pictures, which are near each other."""


@dataclass(frozen=True, slots=True)
class Band:
    """Rows of a picture whose light paths are followed at once."""

    eye: mi.Sensor
    samples: int
    """Samples of a pixel."""
    first: int
    """Number of the first pixel."""
    pixels: int
    """Number of pixels, of whole rows."""

    @property
    def paths(self) -> int:
        """Number of light paths."""
        return self.pixels * self.samples


PrimaryRays = Callable[[Band, mi.Sampler], Any]
"""Rays of all pixels of a band, the samples of a pixel side by side."""


def box_rays(band: Band, sampler: mi.Sampler) -> Any:
    """Rays through random points of the pixels, as Mitsuba's box filter takes them."""
    pixel = _pixels(band)
    return _rays(band.eye, pixel + sampler.next_2d())


def centre_rays(band: Band, sampler: mi.Sampler) -> Any:
    """Rays through the pixel centres."""
    del sampler
    return _rays(band.eye, _pixels(band) + 0.5)


def _pixels(band: Band) -> Any:
    width, _ = _size(band.eye)
    pixel = dr.arange(mi.UInt32, band.paths) // band.samples + dr.opaque(mi.UInt32, band.first)
    return mi.Point2f(mi.Float(pixel % width), mi.Float(pixel // width))


def _rays(eye: Any, position: Any) -> Any:
    width, height = _size(eye)
    scaled = position * mi.Vector2f(1 / width, 1 / height)
    return eye.sample_ray_differential(eye.shutter_open(), 0.5, scaled, mi.Point2f(0.5))[0]


def _size(eye: mi.Sensor) -> tuple[int, int]:
    width, height = (int(v) for v in eye.film().crop_size())
    return width, height


def bands(eye: mi.Sensor) -> list[Band]:
    """Return the bands of a picture: one, or more where ``MOST_PATHS`` asks for it, of a row or more each."""
    width, height = _size(eye)
    samples = eye.sampler().sample_count()
    rows = max(1, min(height, MOST_PATHS // (width * samples)))
    return [
        Band(eye, samples, start * width, min(rows, height - start) * width)
        for start in range(0, height, rows)
    ]


def mean_image(eye: mi.Sensor, seed: int, trace: Callable[[Band, mi.Sampler], list[Any]]) -> np.ndarray:
    """Mean over the samples of each pixel, ``(colours, H, W, 3)``, float64.

    Args:
        eye: The view; its sampler says how many samples a pixel has.
        seed: Of the random numbers; bands after the first have seeds that follow from it.
        trace: Colours of all samples of a band.
    """
    width, height = _size(eye)
    made = bands(eye)
    sums = [_pixel_sums(trace(band, _seeded(band, seed, number)), band) for number, band in enumerate(made)]
    image = np.concatenate(sums, axis=-1).reshape(-1, 3, height, width).astype(np.float64)
    return image.transpose(0, 2, 3, 1) / made[0].samples


def _seeded(band: Band, seed: int, number: int) -> mi.Sampler:
    """Return the sampler of all pixels of a band."""
    sampler: Any = band.eye.sampler().clone()
    sampler.set_samples_per_wavefront(band.samples)
    sampler.seed(dr.opaque(mi.UInt32, (seed + number * _SEED_STEP) % 2**32), band.paths)
    return sampler


def _pixel_sums(sums: list[Any], band: Band) -> np.ndarray:
    """Colours of all samples to sums over the pixels, ``(3 colours, pixels)``, float32."""
    dr.eval(sums)  # one kernel for all channels: unevaluated, each sum below would trace all paths anew
    # sums of neighbours in a fixed order; scattering into pixels would add in the order of the threads
    return np.stack([np.array(dr.block_sum(channel, band.samples)) for color in sums for channel in color])

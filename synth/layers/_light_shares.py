# SPDX-License-Identifier: Apache-2.0
"""Shares of lights in a picture: a picture, so that pictures under fewer or other lights are sums of it.

Light adds up: with a light switched off or recoloured a picture is another weighted sum of the same images.
Import it only after ``use_renderer``. Whole images at once: ``llvm_ad_rgb`` only.
"""

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from graycard import Camera
from graycard.synth._spec import RenderSettings
from graycard.synth.layers._separation import FIRST_PART, PARTS
from graycard.synth.renderer._mitsuba import sensor
from graycard.synth.renderer._wavefront import Band, box_rays, mean_image


def light_shares(
    loaded: mi.Scene, camera: Camera, seeds: list[int], settings: RenderSettings, images: np.ndarray
) -> np.ndarray:
    """Light that light alone gives to the independent images of a view, seen directly and reflected.

    Args:
        loaded: Mitsuba's scene.
        camera: The view.
        seeds: Those of ``images``.
        settings: Those of ``images``.
        images: Of :func:`separated_images`, with rays through random points of the pixels.

    Returns:
        Shape ``(images, lights, H, W, 3)``, float64, lights in the order of :func:`light_names`. Their sum
        over the lights is the total.
    """
    emitted = emitted_images(loaded, camera, seeds, settings)
    shape = len(images), emitted.shape[1], len(PARTS), *images.shape[2:]
    return emitted + images[:, FIRST_PART:].reshape(shape).sum(axis=2)


def emitted_images(
    loaded: mi.Scene, camera: Camera, seeds: list[int], settings: RenderSettings
) -> np.ndarray:
    """Light of each source that the camera sees itself, ``(images, lights, H, W, 3)``, float64.

    The rays are those of :func:`separated_images` for the same seeds.
    """
    eye = sensor(camera, settings.samples // len(seeds))
    return np.stack([_emitted_image(loaded, eye, seed) for seed in seeds])


def _emitted_image(loaded: mi.Scene, eye: mi.Sensor, seed: int) -> np.ndarray:
    def traced(band: Band, sampler: mi.Sampler) -> list[Any]:
        si: Any = loaded.ray_intersect(box_rays(band, sampler))
        light: Any = mi.DirectionSample3f(loaded, si, dr.zeros(mi.Interaction3f)).emitter
        radiance = dr.select(light != None, light.eval(si), 0)  # noqa: E711 (Dr.Jit's null test)
        mine = [light == mi.EmitterPtr(emitter) for emitter in loaded.emitters()]
        return [dr.select(is_mine, radiance, 0) for is_mine in mine]

    return mean_image(eye, seed, traced)

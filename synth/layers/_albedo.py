# SPDX-License-Identifier: Apache-2.0
"""The share of light that what is seen returns. Import it only after ``use_renderer``.

Whole images at once: ``llvm_ad_rgb`` only.
"""

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from graycard import Camera
from graycard.synth._spec import DIRECTIONS
from graycard.synth.renderer._mitsuba import sensor
from graycard.synth.renderer._wavefront import Band, centre_rays, mean_image


def directional_albedo(
    loaded: mi.Scene, camera: Camera, seed: int, samples: int = DIRECTIONS
) -> dict[str, np.ndarray]:
    """Directional-hemispherical reflectance towards the camera, at the pixel centres.

    The integral of material times cosine over all directions of the light, for the direction of the camera:
    the mean weight of directions that the material samples itself. By reciprocity it is as well the share of
    light along the camera's ray that the surface scatters anywhere.

    Args:
        loaded: Mitsuba's scene.
        camera: The view.
        seed: Of the directions.
        samples: A square.

    Returns:
        ``albedo``, shape ``(H, W, 3)``, float32; 0 where nothing is seen and on the back of a surface.
    """
    eye = sensor(camera, samples)

    def traced(band: Band, sampler: mi.Sampler) -> list[Any]:
        return [_weights(loaded.ray_intersect(centre_rays(band, sampler)), sampler)]

    (albedo,) = mean_image(eye, seed, traced)
    return {"albedo": albedo.astype(np.float32)}


def _weights(si: Any, sampler: Any) -> Any:
    """Material times cosine over density of sampled directions, summed over the lobes."""
    lobe, direction = sampler.next_1d(), sampler.next_2d()
    bsdf = si.bsdf()
    principled = si.is_valid() & bsdf.has_attribute("specular", si.is_valid())
    total = mi.Color3f(0)
    for lobes, active in (
        (mi.BSDFFlags.All, principled),
        (mi.BSDFFlags.DiffuseReflection, si.is_valid() & ~principled),
        (mi.BSDFFlags.GlossyReflection, si.is_valid() & ~principled),
    ):
        context = mi.BSDFContext()
        context.type_mask = lobes
        _, weight = bsdf.sample(context, si, lobe, direction, active)
        total += dr.select(active, weight, 0)
    return total

# SPDX-License-Identifier: Apache-2.0
"""The light that arrives at what is seen, at the pixel centres. Import it only after ``use_renderer``.

At one point, not averaged over a pixel, the identity L = albedo x shading of a Lambertian surface is exact.
Kernels over whole images: ``llvm_ad_rgb`` only.
"""

from dataclasses import replace

import mitsuba as mi
import numpy as np

from graycard import Camera
from graycard.synth._scene import Scene
from graycard.synth._spec import RenderSettings
from graycard.synth.layers._direct_light import DirectLight, direct_light
from graycard.synth.layers._separation import FIRST_PART, PARTS, light_names, separated_images
from graycard.synth.renderer._scattering import white_first
from graycard.synth.renderer._wavefront import centre_rays


def light_layers(
    loaded: mi.Scene, scene: Scene, camera: Camera, seeds: list[int], settings: RenderSettings
) -> dict[str, np.ndarray]:
    """Irradiance of what is seen, from all lights and from each, and what of the lights is in sight.

    Light that comes straight from a source is found from samples on each source, so it has no noise where
    the source has no extent. Bounced light is what paths of two and more bounces bring.

    Args:
        loaded: Mitsuba's scene of ``scene``.
        scene: Whose lights name the layers.
        camera: The view.
        seeds: One for each independent image.
        settings: Samples at the centres, and depth of the light paths.

    Returns:
        ``shading`` (irradiance / pi, W/m²/sr) with its ``shading.var``, and for each light
        ``irradiance.<light>`` and its part ``direct.irradiance.<light>``, W/m²: those of all lights add up to
        pi x shading. Each ``(H, W, 3)``. ``visibility.<light>``, ``(H, W)``. All float32; 0 where nothing is
        seen and on the back of a surface.
    """
    direct = direct_light(loaded, camera, seeds)
    if settings.max_depth < 2:  # no path goes on where it meets a surface
        direct = DirectLight(direct.sent, 0 * direct.arriving)
    irradiance = direct.arriving + bounced_irradiance(loaded, camera, seeds, settings)
    shading = irradiance.sum(axis=1) / np.pi
    layers = {"shading": shading.mean(axis=0), "shading.var": shading.var(axis=0, ddof=1) / len(seeds)}
    names = light_names(loaded, scene)
    for stem, values in (
        ("irradiance", irradiance.mean(axis=0)),
        ("direct.irradiance", direct.arriving.mean(axis=0)),
        ("visibility", direct.visibility()),
    ):
        layers |= {f"{stem}.{name}": value for name, value in zip(names, values, strict=True)}
    return {name: values.astype(np.float32) for name, values in layers.items()}


def bounced_irradiance(
    loaded: mi.Scene, camera: Camera, seeds: list[int], settings: RenderSettings
) -> np.ndarray:
    """Irradiance at the pixel centres by light of each source that other surfaces scatter there.

    The camera's own hit is made white and Lambertian, all else stays as it is; its reflected radiance is
    irradiance / pi then.

    Returns:
        Independent images, ``(images, lights, H, W, 3)``, W/m², in Mitsuba's order of lights.
    """
    settings = replace(settings, samples=settings.centre_samples)
    images = separated_images(loaded, camera, seeds, settings, centre_rays, white_first)
    return np.pi * images[:, FIRST_PART + PARTS.index("indirect.diffuse") :: len(PARTS)]

# SPDX-License-Identifier: Apache-2.0
"""How much of each light reaches the points that are seen. Import it only after ``use_renderer``.

Whole images at once: ``llvm_ad_rgb`` only.
"""

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

import graycard as gc
from graycard.synth._mitsuba import sensor
from graycard.synth._scene import Scene
from graycard.synth._separation import centre_rays, light_names

SAMPLES = 64
"""Points on each light, stratified: penumbras are known to about 1/100."""


def visibility_layers(
    loaded: mi.Scene, scene: Scene, camera: gc.Camera, seed: int, samples: int = SAMPLES
) -> dict[str, np.ndarray]:
    """Share of the irradiance from each light that nothing blocks, at the pixel centres.

    The quotient of two irradiances from the same samples, with and without the shadow test; so it is exactly
    0 or 1 for a point or spot light. It is 0 on a side that faces away from the light and outside its cone.

    Args:
        loaded: Mitsuba's scene of ``scene``.
        scene: Whose lights name the layers.
        camera: The view.
        seed: Of the samples on the lights.
        samples: A square.

    Returns:
        ``visibility.<light>``, each ``(H, W)``, float32, 0 to 1.
    """
    eye = sensor(camera, samples)
    sampler: Any = eye.sampler().clone()
    sampler.set_samples_per_wavefront(samples)
    sampler.seed(dr.opaque(mi.UInt32, seed), camera.width * camera.height * samples)
    si = loaded.ray_intersect(centre_rays(eye, sampler, samples))
    pairs = [_irradiances(loaded, emitter, si, sampler) for emitter in loaded.emitters()]
    dr.eval(pairs)  # else the points are found anew for each light
    lights = light_names(loaded, scene)
    shape = camera.height, camera.width
    return {
        f"visibility.{light}": _quotient(*(np.array(dr.block_sum(e, samples)) for e in pair)).reshape(shape)
        for light, pair in zip(lights, pairs, strict=True)
    }


def _irradiances(loaded: mi.Scene, emitter: mi.Emitter, si: Any, sampler: Any) -> tuple[Any, Any]:
    """Irradiance (of all channels) that a light sends to each point, and what of it arrives."""
    radiance: Any
    ds, radiance = emitter.sample_direction(si, sampler.next_2d(), si.is_valid())
    facing = si.is_valid() & (mi.Frame3f.cos_theta(si.wi) > 0) & (ds.pdf > 0)
    cosine = dr.maximum(mi.Frame3f.cos_theta(si.to_local(ds.d)), 0)
    sent = dr.select(facing, mi.luminance(radiance) * cosine, 0)
    blocked = loaded.ray_test(si.spawn_ray_to(ds.p), sent > 0)
    return sent, dr.select(blocked, 0, sent)


def _quotient(sent: np.ndarray, arriving: np.ndarray) -> np.ndarray:
    share = arriving.astype(np.float64) / np.where(sent > 0, sent, 1)
    return np.where(sent > 0, share, 0).astype(np.float32)

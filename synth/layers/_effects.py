# SPDX-License-Identifier: Apache-2.0
"""Effects: where a target changes the picture, and by which way of light. Import it only after
``use_renderer``.

Two renders of the same random numbers, with and without the target, differ only by paths that meet it.
So a pixel in which nothing differs is untouched for certain, and the noise of a difference is that of those
paths alone. Whole images at once: ``llvm_ad_rgb`` only.
"""

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.ndimage import uniform_filter

from graycard import Camera
from graycard.synth._scene import Scene
from graycard.synth._spec import RenderSettings
from graycard.synth.layers._separation import FIRST_PART, PARTS
from graycard.synth.renderer._mitsuba import sensor, shape_key
from graycard.synth.renderer._wavefront import Band, box_rays, mean_image

TAU = 0.02
"""Least share of the radiance that a change is counted from: less is hardly seen."""

SIGMAS = 4.0
"""Least multiple of its own standard deviation that a change is counted from."""

_POOL = 3
"""Pixels along the side of the box over which variances are pooled."""


def effect_layers(present: np.ndarray, absent: np.ndarray, footprint: np.ndarray) -> dict[str, np.ndarray]:
    """Masks of what the target does outside its own picture.

    A part of the light counts as changed where its mean over the images differs, in any channel, by more than
    :data:`TAU` of the brighter picture's radiance and by more than :data:`SIGMAS` standard deviations.

    Args:
        present: Images with the target, ``(images, 2 + 4 lights, H, W, 3)``: total, emitted and parts.
        absent: Images of the same seeds without it.
        footprint: Where the target itself is seen, ``(H, W)``, bool.

    Returns:
        ``effect.untouched``, ``effect.footprint``, and outside the footprint ``effect.shadow`` (less direct
        diffuse light), ``effect.mirror`` (other direct or indirect specular light) and ``effect.bleeding``
        (other indirect diffuse light, as a mean over 3 x 3 pixels: it varies slowly, and single pixels of it
        are noise); each ``(H, W)``, float32, 0 or 1. They may overlap.
    """
    outside = ~footprint
    changes = {part: _of_part(present, part) - _of_part(absent, part) for part in PARTS}
    changes["indirect.diffuse"] = _local_mean(changes["indirect.diffuse"], outside)
    radiance = np.maximum(*(images[:, 0].mean(axis=(0, -1)) for images in (present, absent)))
    more, less = ({part: _exceeds(s * changes[part], radiance, outside) for part in PARTS} for s in (1, -1))
    other = {part: more[part] | less[part] for part in PARTS}
    masks = {
        "untouched": (present == absent).all(axis=(0, 1, -1)) & outside,
        "footprint": footprint,
        "shadow": less["direct.diffuse"],
        "mirror": other["direct.specular"] | other["indirect.specular"],
        "bleeding": other["indirect.diffuse"],
    }
    return {f"effect.{name}": mask.astype(np.float32) for name, mask in masks.items()}


def target_footprint(
    loaded: mi.Scene, scene: Scene, camera: Camera, seeds: list[int], settings: RenderSettings
) -> np.ndarray:
    """Pixels of which any camera ray that was traced meets the target first, ``(H, W)``, bool.

    The rays are those of :func:`graycard.synth.layers._separation.separated_images` for the same arguments.
    """
    eye = sensor(camera, settings.samples // len(seeds))
    key = shape_key(scene.id_of(scene.target))
    target = mi.ShapePtr(next(shape for shape in loaded.shapes() if shape.id() == key))
    return np.any([_share(loaded, eye, target, seed) > 0 for seed in seeds], axis=0)


def _share(loaded: Any, eye: mi.Sensor, target: Any, seed: int) -> np.ndarray:
    def traced(band: Band, sampler: mi.Sampler) -> list[Any]:
        met = loaded.ray_intersect_preliminary(box_rays(band, sampler)).shape == target
        return [mi.Color3f(dr.select(met, mi.Float(1), 0))]

    return mean_image(eye, seed, traced)[0, ..., 0]


def _of_part(images: np.ndarray, part: str) -> np.ndarray:
    """One part of the light of all sources, ``(images, H, W, 3)``."""
    return images[:, FIRST_PART + PARTS.index(part) :: len(PARTS)].sum(axis=1)


def _exceeds(change: np.ndarray, radiance: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """Return where a change is positive, worth seeing, and certain, ``(H, W)``."""
    mean, deviation = change.mean(axis=0), np.sqrt(_variance_of_mean(change, outside))
    certain = (mean > TAU * radiance[..., None]) & (mean > SIGMAS * deviation)
    return certain.any(axis=-1) & outside


def _variance_of_mean(change: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """Variance of the mean over the images, ``(H, W, 3)``.

    The spread of four images alone has three degrees of freedom, and by chance is so small that noise passes
    for a change of four deviations once in 35 (Student's t). A mean of variances over the neighbours
    outside the footprint has some 27, and is never far too small where neighbours are alike; the pixel's own
    value is taken where it is larger, since at an edge of an effect they are not.
    """
    own = change.var(axis=0, ddof=1) / len(change)
    return np.maximum(own, _local_mean(own[None], outside)[0])


def _local_mean(images: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """Mean of images ``(images, H, W, 3)`` over each pixel's neighbours outside the footprint."""
    box = {"size": (1, _POOL, _POOL, 1), "mode": "constant"}
    weight = outside.astype(np.float64)[None, :, :, None]
    return uniform_filter(images * weight, **box) / np.maximum(uniform_filter(weight, **box), 1e-9)

# SPDX-License-Identifier: Apache-2.0
"""Purity: which pixels show one surface of one colour. Import it only after ``use_renderer``."""

import mitsuba as mi
import numpy as np

from graycard import Camera
from graycard.synth._scene import Conductor, Scene
from graycard.synth.renderer._mitsuba import centre_sensor, load, object_ids

GRID = 4
"""Points along the side of a pixel that are looked at."""

COLOR_RANGE = 0.05
"""Most that the base colour may vary within a pure pixel, in any channel."""


def pure_pixels(loaded: mi.Scene, scene: Scene, camera: Camera) -> np.ndarray:
    """Return where a regular grid of points in the pixel sees one object and nearly one base colour.

    There a mean over the pixel and a value at its centre may be compared, and the mean of albedo times
    shading is the product of their means.

    Returns:
        Shape ``(H, W)``, float32, 1 where it is so, else 0.
    """
    values = _fine(loaded, camera)
    ids = object_ids(values[..., 3], loaded, scene)
    color = np.where(_one_colored(scene)[ids][..., None], 0, values[..., :3])
    values = np.concatenate([color, ids[..., None]], axis=-1)
    low, high = values.min(axis=(1, 3)), values.max(axis=(1, 3))
    one_object = low[..., 3] == high[..., 3]
    one_color = (high - low)[..., :3].max(axis=-1) <= COLOR_RANGE
    return (one_object & one_color).astype(np.float32)


def _one_colored(scene: Scene) -> np.ndarray:
    """For each object id, whether it has one colour, whatever the renderer says of it: bool.

    Of a conductor Mitsuba gives a value of its lobe towards the camera in the place of a colour.
    """
    return np.array([False, *(isinstance(thing.material, Conductor) for thing in scene.things)])


def _fine(loaded: mi.Scene, camera: Camera) -> np.ndarray:
    """Return base colour and index of the shape on a finer grid, ``(H, GRID, W, GRID, 4)``."""
    fine = Camera(
        camera.width * GRID,
        camera.height * GRID,
        camera.K * np.array([[GRID], [GRID], [1.0]]),
        camera.camera_to_world,
    )
    caster = load({"type": "aov", "aovs": "c:albedo,s:shape_index"})
    image = np.array(mi.render(loaded, sensor=centre_sensor(fine), integrator=caster, spp=1))
    return image.reshape(camera.height, GRID, camera.width, GRID, 4)

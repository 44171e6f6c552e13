# SPDX-License-Identifier: Apache-2.0
"""A point light whose intensity is a mixture of spherical Gaussians, as a Mitsuba emitter.

Import it only after ``use_renderer``. It runs in every variant with the same values; it can be sampled from
a surface, as path tracers from the camera do, but not traced from the light.
"""

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from graycard import Camera, GaussianLight, world_position
from graycard.synth.renderer._plugin import register_plugin
from graycard.synth.renderer._variant import SCALAR

PLUGIN = "spherical_gaussians"


def gaussian_emitter(light: GaussianLight, camera: Camera, weight: dict[str, float]) -> dict[str, Any]:
    """Mitsuba's dictionary of a light while ``camera`` looks.

    Args:
        light: Its lobes' axes are brought to unit length in float64: in float32 a sharp lobe would be off.
        camera: Where a light of the ``camera`` frame is mounted.
        weight: ``sampling_weight`` of the emitter.
    """
    _register()
    content: dict[str, Any] = {"type": PLUGIN, "position": world_position(light, camera).tolist()}
    for number, lobe in enumerate(light.lobes):
        axis = np.array(lobe.axis) / np.linalg.norm(lobe.axis)
        axis = camera.camera_to_world[:3, :3] @ axis if light.frame == "camera" else axis
        content[f"axis_{number}"] = axis.tolist()
        content[f"sharpness_{number}"] = float(lobe.sharpness)
        content[f"amplitude_{number}"] = {"type": "rgb", "value": [float(a) for a in lobe.amplitude]}
    return content | {"lobes": len(light.lobes)} | weight


def _register() -> None:
    methods = {
        "__init__": _initialise,
        "sample_direction": _sample_direction,
        "pdf_direction": _pdf_direction,
        "eval_direction": _eval_direction,
        "eval": _eval,
        "bbox": _bbox,
        "to_string": _to_string,
    }
    register_plugin(PLUGIN, "Emitter", methods)


def _initialise(self: Any, properties: Any) -> None:
    mi.Emitter.__init__(self, properties)
    self.position = mi.ScalarPoint3f(properties["position"])
    self.lobes = [
        (
            mi.ScalarVector3f(properties[f"axis_{number}"]),
            float(properties[f"sharpness_{number}"]),
            mi.ScalarColor3f(properties[f"amplitude_{number}"]),
        )
        for number in range(properties.get("lobes", 0))
    ]
    self.m_flags = mi.EmitterFlags.DeltaPosition
    self.m_needs_sample_3 = False


def _sample_direction(self: Any, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
    """Return the one direction from a point to the light, and the irradiance from there: I / distance²."""
    del sample
    ds: Any = mi.DirectionSample3f()
    ds.p = mi.Point3f(self.position)
    ds.n = mi.Normal3f(0.0)
    ds.uv = mi.Point2f(0.0)
    ds.time = it.time
    ds.pdf = 1.0
    ds.delta = mi.Bool(True)
    ds.emitter = self if mi.variant() == SCALAR else mi.EmitterPtr(self)
    ds.d = ds.p - it.p
    ds.dist = dr.norm(ds.d)
    ds.d = ds.d / ds.dist
    irradiance = _intensity(self, -ds.d) / dr.square(ds.dist)
    return ds, dr.select(active, irradiance, 0.0)


def _intensity(self: Any, direction: Any) -> Any:
    """For unit vectors ``w . m - 1 = -|w - m|² / 2``, which float32 knows better where a lobe is sharp."""
    total = mi.Color3f(0.0)
    for axis, sharpness, amplitude in self.lobes:
        aside = dr.squared_norm(direction - mi.Vector3f(axis))
        total += mi.Color3f(amplitude) * dr.exp(-0.5 * sharpness * aside)
    return total


def _pdf_direction(self: Any, it: Any, ds: Any, active: Any = True) -> Any:
    """No direction that is chosen at random meets a point."""
    del self, it, ds, active
    return mi.Float(0.0)


def _eval_direction(self: Any, it: Any, ds: Any, active: Any = True) -> Any:
    del it
    return dr.select(active, _intensity(self, -ds.d) / dr.square(ds.dist), 0.0)


def _eval(self: Any, si: Any, active: Any = True) -> Any:
    """No ray meets a point."""
    del self, si, active
    return mi.Color3f(0.0)


def _bbox(self: Any) -> Any:
    return mi.ScalarBoundingBox3f(self.position, self.position)


def _to_string(self: Any) -> str:
    return f"SphericalGaussians[{len(self.lobes)} lobes at {self.position}]"

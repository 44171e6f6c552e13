# SPDX-License-Identifier: Apache-2.0
"""Mitsuba as the tracer's peer: its shape ``ellipsoids`` (Embree) and its integrator ``volprim_rf_basic``.

To be imported after :func:`graycard.synth.use_renderer`. The discs become ellipsoids with a thin third axis;
Mitsuba takes them in the order in which a ray enters them, and ends a ray at a transmittance of 0.01.
"""

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from graycard.methods.splat import Rays, Surfels

THICKNESS = 0.05
"""Third axis, as a share of the smaller of the other two."""
SH_0 = 0.28209479177387814
"""The constant spherical harmonic; the integrator adds 0.5 to the sum."""
GRADIENTS = ("splats.data", "splats.opacities", "splats.sh_coeffs")


class EllipsoidTracer:
    """The same surfels, rays and three channels in Mitsuba."""

    def __init__(self, surfels: Surfels, rays: Rays) -> None:
        self._scene = mi.load_dict({"type": "scene", "splats": _shape(surfels)})
        integrator: Any = mi.load_dict(
            {"type": "volprim_rf_basic", "max_depth": -1, "srgb_primitives": False}
        )
        self._integrator, self._parameters = integrator, mi.traverse(self._scene)
        self._sampler: Any = mi.load_dict({"type": "independent"})
        self._rays = len(rays)
        self._sampler.seed(0, self._rays)
        origins, directions = (_float32(part).T for part in (rays.origins, rays.directions))
        self._ray = mi.Ray3f(mi.Point3f(origins), mi.Vector3f(directions))
        dr.eval(self._ray)

    def forward(self) -> np.ndarray:
        """Trace, and wait; ``(R, 3)``."""
        with dr.suspend_grad():
            radiance, _ = self._sample()
        dr.eval(radiance)
        dr.sync_thread()
        return np.array(radiance).T

    def both(self) -> list[np.ndarray]:
        """Trace and trace back the gradients of the sum of all channels, to everything but the rays."""
        for name in GRADIENTS:
            dr.enable_grad(self._parameters[name])
            dr.set_grad(self._parameters[name], 0)
        with dr.suspend_grad():  # the integrator resumes where it differentiates
            _, state = self._sample()
            self._integrator.sample(
                mode=dr.ADMode.Backward, scene=self._scene, sampler=self._sampler, ray=self._ray,
                **{"δL": mi.Spectrum(dr.ones(mi.Float, self._rays))}, state_in=state, active=mi.Bool(True),
            )  # fmt: skip
        gradients = [dr.grad(self._parameters[name]) for name in GRADIENTS]
        dr.eval(gradients)
        dr.sync_thread()
        return [np.array(gradient) for gradient in gradients]

    def _sample(self) -> tuple[Any, Any]:
        """Radiance, and what the backward pass needs of it."""
        radiance, _, _, state = self._integrator.sample(
            mode=dr.ADMode.Primal, scene=self._scene, sampler=self._sampler, ray=self._ray,
            **{"δL": None}, state_in=None, active=mi.Bool(True),
        )  # fmt: skip
        return radiance, state


def _shape(surfels: Surfels) -> dict[str, Any]:
    centres, scales = _float32(surfels.centres), _float32(surfels.scales)
    thin = THICKNESS * scales.min(axis=1, keepdims=True)
    quaternions = _float32(surfels.rotations)[:, [1, 2, 3, 0]]
    data = {
        "centers": centres,
        "scales": np.concatenate([scales, thin], axis=1),
        "quaternions": quaternions,
        "opacities": _float32(surfels.opacities)[:, None],
        "sh_coeffs": (_float32(surfels.features) - 0.5) / SH_0,
    }
    return {"type": "ellipsoids", **{name: mi.TensorXf(values) for name, values in data.items()}}


def _float32(values: Any) -> np.ndarray:
    return np.ascontiguousarray(values.detach().numpy(), np.float32)

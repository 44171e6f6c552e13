# SPDX-License-Identifier: Apache-2.0
"""Layers that follow from which object is seen and from its base colour: exact, and without a renderer."""

import numpy as np

from graycard.synth._scene import Conductor, Glossy, LambertGGX, Material, Matte, Scene


def material_layers(scene: Scene, object_id: np.ndarray, color: np.ndarray) -> dict[str, np.ndarray]:
    """Parameters of the materials that are seen.

    ``diffuse_reflectance`` is ``(1 - metallic) base_color`` and ``f0`` is ``(1 - metallic) d + metallic
    base_color`` with the material's reflectance ``d`` of a dielectric (Burley 2012). A matte material has
    roughness 1 and f0 0; where nothing is seen, all are 0.

    Args:
        scene: What is seen.
        object_id: Shape ``(H, W)``.
        color: The colour parameter at the same points, shape ``(H, W, 3)``; not read where a conductor is
            seen, which has none: its base colour is its reflectance at normal incidence.

    Returns:
        ``roughness``, ``alpha`` and ``metallic`` of shape ``(H, W)``; ``base_color``,
        ``diffuse_reflectance`` and ``f0`` of shape ``(H, W, 3)``; float32.
    """
    base_color = np.array(color, dtype=np.float64)
    for number, thing in enumerate(scene.things, start=1):
        if isinstance(thing.material, Conductor):
            base_color[object_id == number] = thing.material.f0
    table = np.array([(0.0, 0.0, 0.0), *(_parameters(thing.material) for thing in scene.things)])
    roughness, metallic, dielectric = np.moveaxis(table[object_id], -1, 0)
    diffuse = (1 - metallic)[..., None] * base_color
    f0 = ((1 - metallic) * dielectric)[..., None] + metallic[..., None] * base_color
    layers = {"roughness": roughness, "alpha": roughness**2, "metallic": metallic}
    return {
        name: values.astype(np.float32)
        for name, values in (
            layers | {"base_color": base_color, "diffuse_reflectance": diffuse, "f0": f0}
        ).items()
    }


def _parameters(material: Material) -> tuple[float, float, float]:
    """Roughness, metallic, and reflectance of the dielectric part at normal incidence."""
    match material:
        case Matte():
            return 1.0, 0.0, 0.0
        case Glossy(_, roughness, metallic, specular):
            return roughness, metallic, 0.08 * specular
        case LambertGGX(_, roughness, metallic):
            return roughness, metallic, 0.04
        case Conductor(roughness=roughness):
            return roughness, 1.0, 0.0

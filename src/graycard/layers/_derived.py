# SPDX-License-Identifier: Apache-2.0
"""True layers that are in no file of a dataset, as they follow from those that are."""

from collections.abc import Mapping

import numpy as np

from graycard._camera import Camera
from graycard.layers._shares import with_sums

GLOSSY_ROUGHNESS = 0.5
"""Roughness below which reflections of things are seen in a surface."""


def with_derived(layers: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the true layers of a view, with the sums of light and with ``glossy``.

    ``glossy`` needs ``object_id``, ``roughness`` and ``f0`` of one height and width; it is left out without
    them, and stays where it is there already. See :func:`with_sums` for the sums.

    Args:
        layers: By name, each ``(H, W)`` or ``(H, W, 3)``, of the truth.
    """
    found = with_sums(layers)
    needed = [layers[name] for name in ("object_id", "roughness", "f0") if name in layers]
    if "glossy" in layers or len(needed) < 3 or len({values.shape[:2] for values in needed}) > 1:
        return found
    return found | {"glossy": glossy_mask(*needed)}


def with_geometry(layers: Mapping[str, np.ndarray], camera: Camera) -> dict[str, np.ndarray]:
    """Return the layers of a view with ``distance`` and ``position``, which follow from ``depth`` and camera.

    They are left out without ``depth``, and stay where they are there already.

    Args:
        layers: By name, each ``(H, W)`` or ``(H, W, 3)``, of the size of the camera.
        camera: That of the view.
    """
    if "depth" not in layers or {"distance", "position"} <= layers.keys():
        return dict(layers)
    depth = layers["depth"].astype(np.float64)
    seen = np.isfinite(depth)
    position = camera.unproject(np.where(seen, depth, 0))
    distance = np.where(seen, np.linalg.norm(position - camera.position, axis=-1), depth)
    position = np.where(seen[..., None], position, 0)
    return {"distance": distance.astype(np.float32), "position": position.astype(np.float32), **layers}


def glossy_mask(object_id: np.ndarray, roughness: np.ndarray, f0: np.ndarray) -> np.ndarray:
    """Return where reflections of things are seen in a surface: it has a specular lobe, and that is narrow.

    Args:
        object_id: Shape ``(H, W)``; 0 where nothing is seen.
        roughness: Shape ``(H, W)``, square root of the GGX alpha; below :data:`GLOSSY_ROUGHNESS` is glossy.
        f0: Shape ``(H, W, 3)``; 0 where there is no specular lobe.

    Returns:
        Shape ``(H, W)``, float32: 1 where it is so, else 0.

    Examples:
        >>> import numpy as np
        >>> glossy_mask(np.array([[1, 1, 0]]), np.array([[0.2, 0.5, 0.2]]), np.full((1, 3, 3), 0.04)).tolist()
        [[1.0, 0.0, 0.0]]
    """
    return ((object_id > 0) & (roughness < GLOSSY_ROUGHNESS) & (f0 > 0).any(axis=-1)).astype(np.float32)

# SPDX-License-Identifier: Apache-2.0
"""Bounds for one visibility vector a point, as GS-ID has it (Du et al., ICCV 2025).

A reading turns the cosine between the vector and the direction to a light into the share of that light which
arrives. The vector that a fit could find at best is looked for, point by point, among directions that cover
the sphere evenly; what is left is the error of the reading itself.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from graycard import DatasetError, EnvironmentLight, LocalLight, Truth, View, open_truth, world_position
from graycard.methods.gsid import VECTOR_FORMS, vector_visibility

POINTS = 2000
"""That are looked at in a scene."""
VECTORS = 1500
"""That are tried at each: any other lies within 3.5° of one."""
_AT_A_TIME = 100
"""Points, for memory."""


@dataclass(frozen=True, slots=True)
class VectorBound:
    """Least errors in one scene."""

    scene: str
    lights: int
    """Local ones."""
    points: int
    """With a light that they face."""
    errors: Mapping[str, float]
    """Root mean squared error of the share of light that arrives, by reading, over points and the lights that
    they face; ``none``: everything arrives."""


def vector_bound(scene: Path, seed: int = 0) -> VectorBound:
    """Return the error of each reading in a scene, its best vector at each point.

    Args:
        scene: ``DATASET/<track>/<scene>``, with truth.
        seed: Of the choice of points.

    Raises:
        DatasetError: The truth is missing or damaged, there is no local light, nothing faces one, or a view
            does not tell what is in the way of one.
    """
    truth = open_truth(scene / "truth")
    lights = [light for light in truth.lights() if not isinstance(light, EnvironmentLight)]
    if not lights:
        raise DatasetError(f"expected local lights in {scene}, got none. Take a scene with lamps")
    parts = [_seen(truth, view, lights) for view in truth.views]
    toward, arrives, facing = (np.concatenate(part) for part in zip(*parts, strict=True))
    count = min(POINTS, len(toward))
    if not count:
        raise DatasetError(f"expected a view of {scene} that sees something which faces a lamp, got none")
    chosen = np.random.default_rng(seed).choice(len(toward), count, replace=False)
    errors = best_vector_errors(toward[chosen], arrives[chosen], facing[chosen])
    return VectorBound(f"{truth.track}/{truth.scene}", len(lights), count, errors)


def best_vector_errors(toward: np.ndarray, arrives: np.ndarray, facing: np.ndarray) -> dict[str, float]:
    """Root mean squared errors of what arrives, by reading.

    Args:
        toward: Shape ``(P, K, 3)``, unit, from points to lights.
        arrives: Shape ``(P, K)``, 0 to 1.
        facing: Shape ``(P, K)``, bool: which of them count.
    """
    vectors = _sphere(VECTORS)
    squares = dict.fromkeys(VECTOR_FORMS, 0.0)
    for start in range(0, len(toward), _AT_A_TIME):
        part = slice(start, start + _AT_A_TIME)
        ways = torch.from_numpy(toward[part]).float()[:, None]
        known, counts = torch.from_numpy(arrives[part]).float(), torch.from_numpy(facing[part])
        for form in VECTOR_FORMS:
            told = vector_visibility(form, vectors, ways)
            wrong = ((told - known[:, None]) ** 2 * counts[:, None]).sum(dim=-1)
            squares[form] += float(wrong.amin(dim=1).sum())
    squares["none"] = float(((1 - arrives) ** 2 * facing).sum())
    total = max(int(facing.sum()), 1)
    return {form: float(np.sqrt(square / total)) for form, square in squares.items()}


def _seen(
    truth: Truth, view: View, lights: Sequence[LocalLight]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Geometry of points that a view sees and that face a light: ways to the lights, what arrives, which they
    face.

    Raises:
        DatasetError: It is not known what is in the way of a light.
    """
    layers, camera = truth.layers(view), view.camera
    unknown = [light.name for light in lights if f"visibility.{light.name}" not in layers]
    if unknown:
        raise DatasetError(
            f"expected layers visibility.<light> in view {view.name} of {truth.track}/{truth.scene}, got "
            f"none of {', '.join(unknown)}. Render the scene with LLVM (`graycard doctor`)"
        )
    rays = camera.rays()
    seen = np.isfinite(layers["depth"])
    along = rays / (rays @ camera.forward)[..., None]
    points = camera.position + along * np.where(seen, layers["depth"], 1.0)[..., None]
    ways = np.array([world_position(light, camera) for light in lights]) - points[..., None, :]
    ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
    facing = (ways * layers["normal"][..., None, :]).sum(axis=-1) > 0
    arrives = np.stack([layers[f"visibility.{light.name}"] for light in lights], axis=-1)
    kept = seen & facing.any(axis=-1)
    return ways[kept], arrives[kept], facing[kept]


def _sphere(count: int) -> torch.Tensor:
    """Directions that cover the sphere evenly (a Fibonacci lattice), shape ``(count, 3)``."""
    number = np.arange(count) + 0.5
    height, angle = 1 - 2 * number / count, number * np.pi * (3 - np.sqrt(5))
    radius = np.sqrt(1 - height**2)
    places = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1)
    return torch.from_numpy(places).float()

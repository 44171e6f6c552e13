# SPDX-License-Identifier: Apache-2.0
"""Errors of networks in normals: bumps, a turned frame, soft edges, and light taken for relief."""

from dataclasses import dataclass

import numpy as np

from graycard import Camera
from graycard.methods.priors._draws import blurred, draws_of, relief, smooth_field

SLOPES_OF_DEPTH = "slopes-of-depth"
ALGORITHMS = ("surface", SLOPES_OF_DEPTH)
"""Ways in which the oracle tells normals: true ones made wrong, or the slopes of its own depth."""
FINE, COARSE = 0.03, 0.2
"""Scales between which light is taken for relief; as for depth, but a slope needs a wider look."""


@dataclass(frozen=True, slots=True)
class NormalErrors:
    """Errors of normals."""

    waves: float = 0.0
    """Standard deviation of a smooth random field in each coordinate."""
    turn: float = 0.0
    """Standard deviation of a view's rotation about a random axis, degrees."""
    kappa: float = 0.0
    """Log depth of the relief that is seen for each natural log by which the image's light stands out."""
    blur: float = 0.0
    """Softness of edges, a share of the width."""
    flip: float = 0.0
    """Other than 0: y and z of the camera's axes are the other way round, as in OpenGL. Never by severity."""


LEVELS = (
    NormalErrors(),
    NormalErrors(0.03, 0.5, 0.002, 0.003),
    NormalErrors(0.05, 1.0, 0.005, 0.005),
    NormalErrors(0.10, 2.0, 0.010, 0.008),
    NormalErrors(0.20, 3.5, 0.015, 0.013),
    NormalErrors(0.30, 5.0, 0.030, 0.020),
)
"""By severity. The relief is a tenth of that of depth: it is differentiated."""


def corrupt_normal(
    normal: np.ndarray, light: np.ndarray, camera: Camera, errors: NormalErrors, seed: int, view: str
) -> np.ndarray:
    """Return what a network would say about normals when it is shown an image in some light.

    A smooth random field is added, and the slope of the relief that the image seems to have: depth times
    ``exp(-kappa B)`` adds ``-kappa (fx dB/du, fy dB/dv, 0)`` to a normal along the camera's axes.

    Args:
        normal: shape ``(H, W, 3)``, world, unit length; zero where there is nothing, and stays so.
        light: shape ``(H, W, 3)``, of :func:`log_light`: what the network takes for relief.
        camera: Of the view.
        errors: How wrong.
        seed: Of the draws.
        view: Name of the view.

    Returns:
        Shape ``(H, W, 3)``, world, unit length, float64.
    """
    from scipy.spatial.transform import Rotation  # SciPy takes long to import

    draws = draws_of(seed, "normal", view)
    waves = smooth_field(draws, normal.shape[:2], 3)
    turn = Rotation.from_rotvec(np.radians(errors.turn) * draws.standard_normal(3) / np.sqrt(3)).as_matrix()
    seen = np.linalg.norm(normal, axis=-1) > 0
    to_world = camera.camera_to_world[:3, :3]
    local = blurred(normal.astype(np.float64) @ to_world, errors.blur, seen)
    down, across = np.gradient(relief(light, FINE, COARSE))
    slopes = np.stack([camera.K[0, 0] * across, camera.K[1, 1] * down, np.zeros_like(down)], axis=-1)
    local = (local + errors.waves * waves - errors.kappa * slopes) @ turn.T
    if errors.flip:
        local = local * [1, -1, -1]
    lengths = np.linalg.norm(local, axis=-1, keepdims=True)
    return np.where(seen[..., None], local / np.maximum(lengths, 1e-12), 0.0) @ to_world.T

# SPDX-License-Identifier: Apache-2.0
"""Move surfels, and put them into another scene."""

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from graycard.methods.splat.fit._parameters import CENTRES, ROTATIONS, Parameters


def moved_surfels(
    parameters: Mapping[str, torch.Tensor], motion: np.ndarray, directions: Sequence[str] = ()
) -> dict[str, torch.Tensor]:
    """Surfels after a rigid motion.

    Args:
        parameters: Of N surfels by name, as :attr:`Parameters.surfels`.
        motion: Shape ``(4, 4)``: a rotation and a shift in metres.
        directions: Names of those parameters that are vectors of the world, shape ``(N, 3)``: they turn too.

    Raises:
        ValueError: The motion is not rigid.
    """
    turn, shift = np.asarray(motion)[:3, :3], np.asarray(motion)[:3, 3]
    if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-6) or np.linalg.det(turn) < 0:
        raise ValueError(f"expected a rotation in the motion, got {turn.tolist()}")
    centres, quaternions = parameters[CENTRES], parameters[ROTATIONS]
    rotation = torch.from_numpy(turn).to(centres.dtype)
    turned = Rotation.from_matrix(turn) * Rotation.from_quat(quaternions.numpy(), scalar_first=True)
    rotations = torch.from_numpy(turned.as_quat(scalar_first=True)).to(quaternions.dtype)
    places = centres @ rotation.T + torch.from_numpy(shift).to(centres.dtype)
    vectors = {name: parameters[name] @ rotation.T for name in directions}
    return {**parameters, **vectors, CENTRES: places, ROTATIONS: rotations}


def joined_surfels(scene: Parameters, guests: Mapping[str, torch.Tensor]) -> Parameters:
    """Return a scene with further surfels in it.

    Args:
        scene: What is no surfel's stays as it is.
        guests: By the same names as the scene's surfels.

    Raises:
        ValueError: The names differ.
    """
    if scene.surfels.keys() != guests.keys():
        raise ValueError(f"expected surfels with {sorted(scene.surfels)}, got {sorted(guests)}")
    surfels = {name: torch.cat([values, guests[name]]) for name, values in scene.surfels.items()}
    return Parameters(surfels, scene.shared)

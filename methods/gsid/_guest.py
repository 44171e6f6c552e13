# SPDX-License-Identifier: Apache-2.0
"""An object of another scene among the surfels of this one."""

from dataclasses import replace

import numpy as np

from graycard.methods._contract import Guest
from graycard.methods.gsid._model import OPEN, SHADOW, lit_normals
from graycard.methods.shading import sky_visibility
from graycard.methods.splat import Parameters, joined_surfels, moved_surfels, share_inside, surfels_of

LEAST_INSIDE = 0.5
"""A surfel is of an object if this share of what it gives to pictures lies in the masks of the object."""


def with_guest(
    host: Parameters, donor: Parameters, guest: Guest, motion: np.ndarray, extent: float | None
) -> Parameters:
    """Return a scene with the surfels of an object of another one, their materials as they were found there.

    Args:
        host: The scene.
        donor: The other one.
        guest: Which of its surfels are the object, by masks.
        motion: Shape ``(4, 4)``, from the donor's world to the host's, rigid, metres.
        extent: Of the host, metres; None: the sky is not hidden by anything.
    """
    names = list(guest.cameras)
    views = [guest.cameras[name] for name in names], [guest.masks[name] for name in names]
    inside = share_inside(surfels_of(donor.surfels), *views) >= LEAST_INSIDE
    moved = dict(moved_surfels(donor.take(inside).surfels, motion, [SHADOW]))
    moved[SHADOW] = -lit_normals(moved)  # its vectors know the lamps at home: here all is lit, but for rays
    parameters = joined_surfels(host, moved)
    if extent is None:
        return parameters
    opened = sky_visibility(surfels_of(parameters.surfels), lit_normals(parameters.surfels), extent)
    return replace(parameters, surfels={**parameters.surfels, OPEN: opened})

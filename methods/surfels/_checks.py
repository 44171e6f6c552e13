# SPDX-License-Identifier: Apache-2.0
"""Captures that no fit can take apart, refused before any time is spent."""

import numpy as np

from graycard import Capture, MethodError
from graycard.methods.splat import scene_extent
from graycard.methods.splat.stages import NEAR


def check_places(capture: Capture) -> None:
    """Refuse a capture in which nothing moves, or all is too near to be drawn.

    Raises:
        MethodError: All training views are taken from one place, or within the nearest depth that is drawn.
    """
    extent = scene_extent([view.camera for view in capture.train])
    if 0 < extent < NEAR:
        raise MethodError(
            f"expected training views {NEAR} units or more apart in {capture.scene}, got {extent:.2g}: what "
            "is nearer than that is not drawn. Scale cameras and points before you import them"
        )
    if extent == 0:
        raise MethodError(
            f"expected training views from different places in {capture.scene}, got all from one. "
            "Depth is not to be seen from one place"
        )


def check_lamp_on_camera(capture: Capture) -> None:
    """Refuse a capture whose light stays where it is.

    Raises:
        MethodError: The light is not on the camera.
    """
    if not capture.light_on_camera:
        raise MethodError(
            f"expected a capture whose light moves with the camera, got {capture.scene} whose does not. "
            "Fit it with another method, or import it with its light on the camera"
        )


def check_photographs(capture: Capture) -> None:
    """Refuse photographs that show nothing, or hold what is no number.

    Raises:
        MethodError: All of them are black, or one is not finite.
    """
    brightest = 0.0
    for view in capture.train:
        photograph = capture.photograph(view)
        if not np.isfinite(photograph).all():
            raise MethodError(
                f"expected finite photographs in {capture.scene}, got {view.name} with a value that is not. "
                "Import it anew"
            )
        brightest = max(brightest, float(photograph.max()))
    if brightest <= 0:
        raise MethodError(
            f"expected light in the photographs of {capture.scene}, got black ones. Look whether they were "
            "imported with the right exposure"
        )

# SPDX-License-Identifier: Apache-2.0
"""Units of a capture: structure from motion does not know what is a metre, but a fit has lengths in metres.

Learning rates, first sizes and densification go with the extent of the cameras. The planes between which
distortion maps depth, and the nearest depth that is drawn, are lengths (Huang et al. 2024). So a tiny scene
lost 1.2 to 1.6 dB in units of ten metres, 5 to 10 dB in units of a hundred, 0.4 dB at most in smaller ones.
"""

from dataclasses import dataclass, replace
from math import ceil, log, log2

from graycard import Camera, Capture
from graycard.methods.splat import CENTRES, LOG_SCALES, Parameters, scene_extent
from graycard.points import Points

LEAST = 0.5
"""Extent of the training cameras, in units of the capture, below which a fit takes smaller units."""


@dataclass(frozen=True, slots=True)
class _Enlarged(Capture):
    """A capture in smaller units."""

    factor: float = 1.0
    """Number of them in one unit of the capture."""

    def points(self) -> Points:
        """Return the sparse points in these units."""
        found = Capture.points(self)
        return replace(found, positions=found.positions * self.factor)


def enlarged(capture: Capture) -> tuple[Capture, float]:
    """Return a capture in which the extent of the training cameras is half a unit or more.

    Args:
        capture: Cameras at two places or more.

    Returns:
        The capture itself and 1 if it is so; else one whose lengths are larger by a power of two, which
        changes no bit of a direction, and that power.
    """
    extent = scene_extent([view.camera for view in capture.train])
    if extent >= LEAST:
        return capture, 1.0
    factor = 2.0 ** ceil(log2(1 / extent))
    views = tuple(replace(view, camera=_moved(view.camera, factor)) for view in capture.views)
    known = capture.exposure, capture.light_on_camera, capture.target, capture.sensor, capture.root
    return _Enlarged(capture.track, capture.scene, views, *known, factor), factor


def shrunk(parameters: Parameters, factor: float) -> Parameters:
    """Return surfels of an enlarged capture in the units of the capture; of a factor of 1 the very same."""
    if factor == 1:
        return parameters
    surfels = dict(parameters.surfels)
    surfels[CENTRES] = surfels[CENTRES] / factor
    surfels[LOG_SCALES] = surfels[LOG_SCALES] - log(factor)
    return replace(parameters, surfels=surfels)


def _moved(camera: Camera, factor: float) -> Camera:
    pose = camera.camera_to_world.copy()
    pose[:3, 3] *= factor
    return Camera(camera.width, camera.height, camera.K, pose)

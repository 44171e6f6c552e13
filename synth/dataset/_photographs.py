# SPDX-License-Identifier: Apache-2.0
"""Photographs as a camera would take them of the rendered light: in the order in which light becomes a file.

Exposure decides how many electrons a pixel counts, so that a short exposure is a noisy one; the sensor
saturates; the levels that are left are encoded and rounded. Each cause draws from a stream of its own.
"""

from collections.abc import Sequence

import numpy as np

from graycard import Sensor, srgb_decode, srgb_encode
from graycard.synth._spec import CaptureSettings
from graycard.synth._stream import stream


def sensor_of(settings: CaptureSettings, views: Sequence[str], seed: int) -> Sensor | None:
    """Return the camera of a capture; None for one without faults, which keeps radiance as it was rendered.

    Args:
        settings: Its faults.
        views: Names of the training views.
        seed: Of the scene.
    """
    faults = settings.bits, settings.shot_noise, settings.read_noise, settings.exposure_spread
    if not any(faults):
        return None
    return Sensor(*faults[:3], _exposures(settings.exposure_spread, views, seed))


def photographed(radiance: np.ndarray, view: str, exposure: float, sensor: Sensor, seed: int) -> np.ndarray:
    """Return what a camera makes of a picture.

    Args:
        radiance: Shape ``(H, W, 3)``, W/m²/sr, linear.
        view: Name of the view.
        exposure: The capture's factor to display range, 1/(W/m²/sr).
        sensor: The camera.
        seed: Of the scene.

    Returns:
        Shape ``(H, W, 3)``, float32, W/m²/sr: at most ``1 / (exposure × the view's factor)``.
    """
    white = 1 / (exposure * sensor.exposure(view))
    level = _counted(radiance.astype(np.float64) / white, view, sensor, seed)
    return (_rounded(np.clip(level, 0, 1), sensor.bits) * white).astype(np.float32)


def _exposures(spread: float, views: Sequence[str], seed: int) -> dict[str, float]:
    if not spread:
        return {}
    return {v: float(2 ** (spread * stream(seed, f"photograph.exposure.{v}").uniform(-1, 1))) for v in views}


def _counted(level: np.ndarray, view: str, sensor: Sensor, seed: int) -> np.ndarray:
    """Levels in shares of white after they were counted in electrons and read."""
    if not sensor.shot_noise:
        return level
    light = np.maximum(level, 0) * sensor.shot_noise
    electrons = stream(seed, f"photograph.shot.{view}").poisson(light)
    error = stream(seed, f"photograph.read.{view}").normal(0, 1, level.shape)
    return (electrons + sensor.read_noise * error) / sensor.shot_noise


def _rounded(level: np.ndarray, bits: int) -> np.ndarray:
    if not bits:
        return level
    steps = 2**bits - 1
    return srgb_decode(np.rint(srgb_encode(level) * steps) / steps)

# SPDX-License-Identifier: Apache-2.0
"""Checks of what a method is given against the truth: photographs, masks, exposure, index."""

from collections.abc import Iterator

import numpy as np

from graycard import Sensor
from graycard.colour import srgb_slope
from graycard.synth.verify._check import Check
from graycard.synth.verify._subject import Subject, TruePicture

_SIGMAS = 6.0
"""Bound of the mean of a photograph's noise: a false alarm in a thousand million views."""


def check_capture(subject: Subject, picture: TruePicture) -> Iterator[Check]:
    """Check the photograph and the mask of a training view."""
    if picture.view.split != "train":
        return
    photograph = subject.capture.photograph(picture.view).astype(float)
    radiance = picture.layers["radiance"].astype(float)
    if subject.capture.sensor is None:
        scale = max(float(np.abs(radiance).max()), 1e-30)
        off = float(np.abs(photograph - radiance).max()) / scale
        told = "a photograph is the radiance of its view; looks like another filter, encoding, noise or view"
        yield picture.at.judge("photograph is the radiance", off, 1e-6, "of the brightest", told)
    else:
        white = subject.capture.exposure * subject.capture.sensor.exposure(picture.view.name)
        yield from _check_sensor(picture, radiance * white, photograph * white, subject.capture.sensor)
    if subject.truth.target is not None:
        seen = picture.layers["object_id"] == subject.truth.target
        wrong = int((subject.capture.target_mask(picture.view) != seen).sum())
        told = "the mask is where object_id is the target; looks like the mask of another object"
        yield picture.at.judge("mask of the target", wrong, 0, "pixels", told)


def _check_sensor(
    picture: TruePicture, level: np.ndarray, found: np.ndarray, sensor: Sensor
) -> Iterator[Check]:
    """Check that a photograph differs from the radiance as much as noise and bits of its camera say.

    Args:
        picture: The view.
        level: Radiance as a share of white.
        found: The photograph, likewise.
        sensor: The camera.
    """
    name, variance = "photograph of its camera", _variance(level, sensor)
    if not variance.any():
        off = float(np.abs(found - np.clip(level, 0, 1)).max())
        told = "without noise a photograph is the radiance up to white; looks like another exposure or view"
        yield picture.at.judge(name, off, 1e-5, "of white", told)
        return
    reach = 4 * np.sqrt(variance)
    known = (level - reach > 0.02) & (level + reach < 0.98)  # far from where the sensor cuts off
    if known.sum() < 300:
        yield picture.at.skip(name, "few values are between black and white")
        return
    off, variance = (found - level)[known], variance[known]
    ratio = float((off**2 / variance).mean())
    told = f"the noise of a photograph is that of capture.json's sensor; it is {ratio:.2f} times as large"
    yield picture.at.judge(name, abs(ratio - 1), 0.3, "relative", told)
    z = float((off / np.sqrt(variance)).sum() / np.sqrt(off.size))
    told = f"a photograph is as bright as the radiance; it is {100 * off.mean() / level[known].mean():+.2f} %"
    yield picture.at.judge("photograph's exposure", abs(z), _SIGMAS, "σ", told)


def _variance(level: np.ndarray, sensor: Sensor) -> np.ndarray:
    """Variance of a level, from counting and reading electrons and from rounding its sRGB code evenly."""
    variance = np.zeros_like(level)
    if sensor.shot_noise:
        variance += np.maximum(level, 0) / sensor.shot_noise + (sensor.read_noise / sensor.shot_noise) ** 2
    if sensor.bits:
        slope = np.maximum(srgb_slope(level), 1e-9)
        variance += ((2**sensor.bits - 1) * slope) ** -2.0 / 12
    return variance


def check_exposure(subject: Subject, training: list[np.ndarray]) -> Iterator[Check]:
    """1 / exposure is the 99th percentile of the training views, in both index files."""
    if len(training) < sum(view.split == "train" for view in subject.truth.views) or not training:
        yield subject.at.skip("exposure", "a training view has no radiance")
        return
    brightest = float(np.percentile(np.concatenate(training), 99))
    for content, name in ((subject.capture, "capture.json"), (subject.truth, "truth.json")):
        off = abs(content.exposure * brightest - 1)
        told = (
            f"{name}: exposure x 99th percentile of the training views = 1; looks like an exposure of others"
        )
        yield subject.at.judge("exposure", off, 1e-6, "relative", told)


def check_index(subject: Subject) -> Iterator[Check]:
    """Both index files speak of the same target and of a light on the camera where there is one."""
    targets = subject.capture.target == subject.truth.target
    mounted = any(getattr(light, "frame", "world") == "camera" for light in subject.lights)
    faults = [
        *([] if targets else ["the target of capture.json is not that of truth.json"]),
        *(
            []
            if mounted == subject.capture.light_on_camera
            else ["light_on_camera is not as lights.json says"]
        ),
    ]
    yield subject.at.judge("index files agree", len(faults), 0, "faults", "; ".join(faults))

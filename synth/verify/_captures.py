# SPDX-License-Identifier: Apache-2.0
"""Checks of what a method is given against the truth: photographs, masks, exposure, index."""

from collections.abc import Iterator

import numpy as np

from graycard.synth.verify._check import Check
from graycard.synth.verify._subject import Picture, Subject


def check_capture(subject: Subject, picture: Picture) -> Iterator[Check]:
    """The photograph and the mask of a training view."""
    if picture.view.split != "train":
        return
    photograph = subject.capture.photograph(picture.view).astype(float)
    radiance = picture.layers["radiance"].astype(float)
    scale = max(float(np.abs(radiance).max()), 1e-30)
    off = float(np.abs(photograph - radiance).max()) / scale
    told = "a photograph is the radiance of its view; looks like another filter, encoding, noise or view"
    yield picture.at.judge("photograph is the radiance", off, 1e-6, "of the brightest", told)
    if subject.truth.target is not None:
        seen = picture.layers["object_id"] == subject.truth.target
        wrong = int((subject.capture.target_mask(picture.view) != seen).sum())
        told = "the mask is where object_id is the target; looks like the mask of another object"
        yield picture.at.judge("mask of the target", wrong, 0, "pixels", told)


def check_exposure(subject: Subject, training: list[np.ndarray]) -> Iterator[Check]:
    """1 / exposure is the 99th percentile of the training views, in both index files."""
    brightest = float(np.percentile(training, 99))
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

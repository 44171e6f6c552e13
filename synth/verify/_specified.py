# SPDX-License-Identifier: Apache-2.0
"""Checks of the index files against the scene that the spec describes, built anew: no renderer is needed."""

from collections.abc import Iterator

import numpy as np

from graycard.io import to_builtins
from graycard.lights import light_to_json
from graycard.synth._sky import recorded
from graycard.synth.verify._check import Check
from graycard.synth.verify._subject import Rebuilt, Subject

SPECIFIED = ("lights of the spec", "cameras of the spec", "objects of the spec", "environment of the spec")


def check_specified(subject: Subject, rebuilt: Rebuilt) -> Iterator[Check]:
    """Lights, cameras, objects and surroundings are those of the spec, to the last digit that JSON keeps."""
    at, scene = subject.at, rebuilt.scene
    found, wanted = ([light_to_json(light) for light in lights] for lights in (subject.lights, scene.lights))
    wrong = [light["name"] for light in found if light not in to_builtins(wanted)]
    told = f"lights.json is that of the spec; other ones are {', '.join(wrong) or 'missing'}"
    yield at.judge("lights of the spec", len(wrong) + abs(len(found) - len(wanted)), 0, "lights", told)
    pairs = zip(subject.truth.views, scene.views, strict=False)
    moved = [mine.name for mine, built in pairs if mine != built]
    told = f"cameras are those of the spec; looks like swapped or moved views: {', '.join(moved[:4])}"
    count = len(moved) + abs(len(subject.truth.views) - len(scene.views))
    yield at.judge("cameras of the spec", count, 0, "views", told)
    others = set(subject.truth.objects) ^ set(scene.objects())
    names = sorted(thing.name for thing in others)
    told = f"objects are those of the spec; looks like other ids, names or flags of {names}"
    yield at.judge("objects of the spec", len(others), 0, "objects", told)
    if scene.sky is not None and subject.sky is not None:
        yield _check_sky(subject, recorded(scene.sky), subject.sky)


def _check_sky(subject: Subject, wanted: np.ndarray, found: np.ndarray) -> Check:
    told = "environment.exr is that of the spec; "
    if wanted.shape != found.shape:
        return subject.at.fail("environment of the spec", f"{told}expected {wanted.shape}, got {found.shape}")
    off = float(np.abs(found - wanted).max() / max(float(wanted.max()), 1e-30))
    told += _turned(found, wanted)
    return subject.at.judge("environment of the spec", off, 1e-5, "of the brightest", told)


def _turned(found: np.ndarray, wanted: np.ndarray) -> str:
    for name, image in (("mirrored", wanted[:, ::-1]), ("upside down", wanted[::-1])):
        if np.allclose(found, image, rtol=1e-4):
            return f"looks like one that is {name}"
    columns = wanted.shape[1]
    for shift in range(1, columns):
        if np.allclose(found, np.roll(wanted, shift, axis=1), rtol=1e-4):
            return f"looks like one that is turned by {360 * shift / columns:g}°"
    return "looks like another environment"

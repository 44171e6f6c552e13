# SPDX-License-Identifier: Apache-2.0
"""Checks of the pictures under changed lights: the lights of each, and the light that is taken away."""

from collections.abc import Iterator, Mapping

import numpy as np

from graycard import EnvironmentLight
from graycard.io import read_rgb, to_builtins
from graycard.lights import light_to_json
from graycard.synth._sky import recorded
from graycard.synth.edits._light_edits import Edit, light_edits
from graycard.synth.verify._check import Check
from graycard.synth.verify._comparison import largest_relative
from graycard.synth.verify._subject import Rebuilt, Subject, TruePicture
from graycard.synth.verify._values import ESTIMATES, PARTS

_LIGHTS_OF = "lights of the edits"


def edits_of(rebuilt: Rebuilt) -> tuple[Edit, ...]:
    """Return the changes of the lights that the spec asks for."""
    return light_edits(rebuilt.scene, rebuilt.spec.seed) if rebuilt.settings.relighting else ()


def check_edits(subject: Subject, rebuilt: Rebuilt) -> Iterator[Check]:
    """Check that edits and their lights are those of the spec, to the last digit that JSON keeps."""
    edits = edits_of(rebuilt)
    others = set(subject.truth.edits) ^ {edit.record for edit in edits}
    names = sorted({record.name for record in others})
    told = f"the edits are those of the spec; looks like others or other words: {', '.join(names[:4])}"
    yield subject.at.judge("edits of the spec", len(others), 0, "edits", told)
    shared = [edit for edit in edits if edit.record in subject.truth.edits]
    wrong = [edit.record.name for edit in shared if not _has_its_lights(subject, edit)]
    told = f"lights.json of an edit holds the lights after it; other ones are of {', '.join(wrong[:4])}"
    yield subject.at.judge(_LIGHTS_OF, len(wrong), 0, "edits", told)


def _has_its_lights(subject: Subject, edit: Edit) -> bool:
    found = subject.truth.relit_lights(edit.record.name)
    if [to_builtins(light_to_json(light)) for light in found] != to_builtins(
        [light_to_json(light) for light in edit.scene.lights]
    ):
        return False
    beside = subject.folder / "truth" / edit.record.folder
    images = [light.image for light in found if isinstance(light, EnvironmentLight)]
    return all(_is_the_sky(read_rgb(beside / image), edit.scene.sky) for image in images)


def _is_the_sky(found: np.ndarray, sky: np.ndarray | None) -> bool:
    """Return whether an image of surroundings is that of a scene, to the rounding of its making."""
    if sky is None or found.shape != (wanted := recorded(sky)).shape:
        return False
    return bool(np.abs(found - wanted).max() <= 1e-5 * wanted.max())


def check_relit(subject: Subject, rebuilt: Rebuilt, picture: TruePicture) -> Iterator[Check]:
    """Light adds up: with a light switched off or recoloured, only the parts of that light change.

    The surface of a light shines itself, so the law is for the pixels in which none is seen.
    """
    if picture.view.split != "test":
        return
    for edit in edits_of(rebuilt):
        if edit.record not in subject.truth.edits:
            continue
        relit = subject.truth.relit(edit.record.name, picture.view)
        missing = sorted(set(ESTIMATES) - relit.keys())
        told = f"{edit.record.name} holds radiance, its variance and its halves; missing are {missing}"
        yield picture.at.judge("relit layers", len(missing), 0, "layers", told)
        if not missing:
            yield from _check_one(subject, picture, edit, relit)


def _check_one(
    subject: Subject, picture: TruePicture, edit: Edit, relit: Mapping[str, np.ndarray]
) -> Iterator[Check]:
    name, found = edit.record.name, relit["radiance"].astype(float)
    half = (relit["radiance.half_a"].astype(float) + relit["radiance.half_b"]) / 2
    told = f"the halves of {name} average to it; looks like halves of another edit"
    yield picture.at.judge(
        "relit halves average", largest_relative(half - found, found), 1e-5, "relative", told
    )
    if edit.factors is None or not subject.is_separated:
        return
    if not picture.has(*(f"{part}.{light}" for part in PARTS for light in edit.factors)):
        yield picture.at.skip("relit by its parts", f"the lights of the spec have other names: {name}")
        return
    wanted = picture.layers["radiance"].astype(float)
    for light, factor in edit.factors.items():
        part = np.sum([picture.layers[f"{part}.{light}"] for part in PARTS], axis=0, dtype=float)
        wanted = wanted + (np.array(factor) - 1) * part
    dark = picture.layers["emitted"].max(axis=-1) == 0
    off = largest_relative(found - wanted, picture.layers["radiance"], dark)
    told = (
        f"{name} differs from the view by the parts of the light that is changed; looks like the picture of "
        "another edit, or of other light"
    )
    yield picture.at.judge("relit by its parts", off, 1e-4, "relative", told)

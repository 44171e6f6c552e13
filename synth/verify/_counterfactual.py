# SPDX-License-Identifier: Apache-2.0
"""Checks of the picture without the target against the picture with it."""

from collections.abc import Iterator

import numpy as np

from graycard.synth.verify._check import Check
from graycard.synth.verify._subject import Picture, Subject

_MASKS = ("effect.footprint", "effect.shadow", "effect.mirror")
"""Of single pixels; bleeding is a mean over neighbours, some of which may be untouched."""

_UNALIKE = 0.7
"""One minus the agreement in sign of the noise of both pictures: 0 where they are made from the same random
numbers and nothing changed, 1 where they are made from others. The table scenes have 0.2 or less."""


def check_counterfactual(subject: Subject, picture: Picture) -> Iterator[Check]:
    """Both pictures are made from the same random numbers; they differ where the target is seen, of course,
    and are equal where it has no effect.
    """
    if not picture.has("counterfactual.radiance", "counterfactual.radiance.half_a"):
        return
    noise = [_noise(picture, name) for name in ("radiance", "counterfactual.radiance")]
    some = (noise[0] != 0) & (noise[1] != 0)
    agree = float((np.sign(noise[0]) * np.sign(noise[1]))[some].mean()) if some.any() else 1.0
    told = "both pictures share their random numbers; looks like a counterfactual with another seed"
    yield picture.at.judge("counterfactual's random numbers", 1 - agree, _UNALIKE, "1", told)
    yield _check_removed(subject, picture)
    yield from _check_masks(picture)


def _check_removed(subject: Subject, picture: Picture) -> Check:
    seen = picture.layers["object_id"] == (subject.truth.target or -1)
    if not seen.any():
        return picture.at.skip("target removed", "the target is not seen")
    same = (picture.layers["radiance"] == picture.layers["counterfactual.radiance"]).all(axis=-1)
    told = "where the target is seen the counterfactual shows something else; looks like a target still there"
    return picture.at.judge("target removed", float(same[seen].mean()), 0.01, "of its pixels", told)


def _noise(picture: Picture, name: str) -> np.ndarray:
    a, b = (picture.layers[f"{name}.half_{end}"].astype(float) for end in "ab")
    return a - b


def _check_masks(picture: Picture) -> Iterator[Check]:
    """Where ``effect.untouched`` is 1 both pictures are equal to the bit, and no effect is marked there."""
    if not picture.has("effect.untouched"):
        return
    untouched = picture.layers["effect.untouched"] > 0
    changed = (picture.layers["radiance"] != picture.layers["counterfactual.radiance"]).any(axis=-1)
    told = "untouched pixels are equal to the bit; looks like another seed, or a mask of another view"
    yield picture.at.judge("untouched pixels", float((changed & untouched).sum()), 0, "pixels", told)
    names = [name for name in _MASKS if picture.has(name)]
    marked = np.any([picture.layers[name] > 0 for name in names], axis=0) if names else np.zeros(1, bool)
    told = "no effect of the target is marked where no path meets it; looks like masks of another view"
    yield picture.at.judge("effects where touched", float((marked & untouched).sum()), 0, "pixels", told)

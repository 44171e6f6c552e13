# SPDX-License-Identifier: Apache-2.0
"""Checks of the picture without the target against the picture with it."""

from collections.abc import Iterator

import numpy as np
from scipy import ndimage

from graycard.layers import with_sums
from graycard.synth.verify._check import Check
from graycard.synth.verify._subject import Subject, TruePicture
from graycard.synth.verify._values import EFFECTS, EMPTIED_LOBES, EMPTIED_SURFACE

_MASKS = ("effect.footprint", "effect.shadow", "effect.mirror")
"""Bound of single pixels; bleeding is a mean over neighbours, some of which may be untouched."""

_UNALIKE = 0.7
"""One minus the agreement in sign of the noise of both pictures: 0 where they are made from the same random
numbers and nothing changed, 1 where they are made from others. The table scenes have 0.2 or less."""

_FEW = 0.02
"""Allowed share of a mask: outlines that no centre of a pixel meets; in the table scenes there are none."""

_ROUNDING = 1e-6
"""Change, over the radiance, that float32 hardly resolves: beside it a pixel can be equal and yet touched."""

_UNMARKED, _FEW_UNMARKED = 0.02, 5
"""Allowed share of the pixels that differ clearly in radiance, and some more: a pixel may differ so in the
whole and in no part for certain. In the table scenes at most 4 of a dozen do, and 2 of hundreds."""


def check_counterfactual(subject: Subject, picture: TruePicture) -> Iterator[Check]:
    """Both pictures are made from the same random numbers; they differ where the target is seen, of course,
    and are equal where it has no effect.
    """
    if not picture.has("counterfactual.radiance"):
        return
    yield _check_numbers(picture)
    yield _check_removed(subject, picture)
    yield from _check_surfaces(subject, picture)
    yield from _check_masks(subject, picture)


def _check_numbers(picture: TruePicture) -> Check:
    """Check that noise without the target is that with it, which halves of both pictures tell."""
    name, pictures = "counterfactual's random numbers", ("radiance", "counterfactual.radiance")
    if not picture.has(*(f"{of}.half_{end}" for of in pictures for end in "ab")):
        return picture.at.skip(name, "it has no halves")
    noise = [_noise(picture, of) for of in pictures]
    some = (noise[0] != 0) & (noise[1] != 0)
    agree = float((np.sign(noise[0]) * np.sign(noise[1]))[some].mean()) if some.any() else 1.0
    told = "both pictures share their random numbers; looks like a counterfactual with another seed"
    return picture.at.judge(name, 1 - agree, _UNALIKE, "1", told)


def _check_removed(subject: Subject, picture: TruePicture) -> Check:
    seen = picture.layers["object_id"] == (subject.truth.target or -1)
    if not seen.any():
        return picture.at.skip("target removed", "the target is not seen")
    same = (picture.layers["radiance"] == picture.layers["counterfactual.radiance"]).all(axis=-1)
    told = "where the target is seen the counterfactual shows something else; looks like a target still there"
    return picture.at.judge("target removed", float(same[seen].mean()), 0.01, "of its pixels", told)


def _noise(picture: TruePicture, name: str) -> np.ndarray:
    a, b = (picture.layers[f"{name}.half_{end}"].astype(float) for end in "ab")
    return a - b


def _check_masks(subject: Subject, picture: TruePicture) -> Iterator[Check]:
    """Check that where ``effect.untouched`` is 1 both pictures are equal to the bit, and no effect is
    marked there.
    """
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
    if picture.has(*EFFECTS):
        yield from _check_footprint(subject, picture)
        yield from _check_marked(picture)
        yield from _check_lobes(picture)


def _check_footprint(subject: Subject, picture: TruePicture) -> Iterator[Check]:
    """Check that the footprint is where pixel centres see the target, and the pixels at its outline."""
    footprint = picture.layers["effect.footprint"] > 0
    centre = picture.layers["object_id"] == (subject.truth.target or -1)
    around = ndimage.maximum_filter(centre, size=3) > 0
    lost = (centre & ~footprint).sum() / max(int(centre.sum()), 1)
    told = "the footprint holds all pixels whose object_id is the target; looks like a mask that is lost"
    yield picture.at.judge("footprint of the target", float(lost), _FEW, "of its pixels", told)
    beyond = (footprint > around).sum() / max(int(footprint.sum()), 1)
    told = "the footprint ends a pixel beyond the target; looks like the mask of another object or view"
    yield picture.at.judge("footprint at the target", float(beyond), _FEW, "of its pixels", told)


def _check_marked(picture: TruePicture) -> Iterator[Check]:
    """Check that what is equal in both pictures is marked as untouched, and what differs clearly as an
    effect.
    """
    footprint = picture.layers["effect.footprint"] > 0
    ends = ("", ".var", ".half_a", ".half_b")
    pairs = [(picture.layers[f"radiance{e}"], picture.layers[f"counterfactual.radiance{e}"]) for e in ends]
    equal = np.all([(a == b).all(axis=-1) for a, b in pairs], axis=0) & ~footprint
    missed = equal & (picture.layers["effect.untouched"] == 0) & ~_beside_rounding(picture, equal | footprint)
    lost = float(missed.sum() / max(int(equal.sum()), 1))
    told = "pixels that are equal in both pictures are marked as untouched; looks like a mask that is lost"
    yield picture.at.judge("untouched pixels marked", lost, _FEW, "of the equal pixels", told)
    clear = _differs_clearly(picture) & (ndimage.maximum_filter(footprint, size=3) == 0)
    if clear.sum() < 10:
        yield picture.at.skip("effects marked", "fewer than 10 pixels differ clearly")
        return
    marked = np.any([picture.layers[f"effect.{n}"] > 0 for n in ("shadow", "mirror", "bleeding")], axis=0)
    told = "what differs clearly is a shadow, a mirror image or bleeding; looks like masks that are lost"
    share, bound = float((clear & ~marked).sum() / clear.sum()), _UNMARKED + _FEW_UNMARKED / clear.sum()
    yield picture.at.judge("effects marked", share, float(bound), "of the changed pixels", told)


def _beside_rounding(picture: TruePicture, left_out: np.ndarray) -> np.ndarray:
    """Return where a pixel or a neighbour changes by less than float32 resolves well, ``(H, W)``."""
    before, after = (picture.layers[f"{stem}radiance"].astype(float) for stem in ("", "counterfactual."))
    tiny = np.abs(before - after).max(axis=-1) < _ROUNDING * before.max(axis=-1)
    return ndimage.maximum_filter(tiny & ~left_out, size=3)


def _check_lobes(picture: TruePicture) -> Iterator[Check]:
    """Either lobe without the target is light of it; specular light differs in mirror images."""
    present = with_sums(picture.layers).get("specular")
    if present is None or not picture.has(*EMPTIED_LOBES):
        return
    footprint, untouched, mirror = (
        picture.layers[f"effect.{name}"] > 0 for name in ("footprint", "untouched", "mirror")
    )
    diffuse, specular = (picture.layers[name].astype(float) for name in EMPTIED_LOBES)
    radiance = picture.layers["radiance"].max(axis=-1).astype(float)
    scale = radiance + 1e-2 * float(radiance.mean())
    sums = np.abs(picture.layers["emitted"] + diffuse + specular - picture.layers["counterfactual.radiance"])
    off = float((sums.max(axis=-1) / scale)[~footprint].max(initial=0))
    told = (
        "emitted and both lobes add up to the radiance without the target; looks like a lobe of another view"
    )
    yield picture.at.judge("lobes without the target", off, 1e-4, "relative", told)
    change = np.abs(present - specular).max(axis=-1)
    told = f"{EMPTIED_LOBES[1]} is specular where the target has no effect; looks like the other lobe"
    largest = float((change / scale)[untouched].max(initial=0))
    yield picture.at.judge("specular light of untouched pixels", largest, 1e-4, "relative", told)
    if mirror.sum() < 10:
        yield picture.at.skip("specular light of mirror images", "the mirror image has fewer than 10 pixels")
        return
    same = float((change <= 1e-3 * radiance)[mirror].mean())
    told = f"{EMPTIED_LOBES[1]} has no mirror image of the target; looks like the light with the target"
    yield picture.at.judge("specular light of mirror images", same, _FEW, "of their pixels", told)


def _check_surfaces(subject: Subject, picture: TruePicture) -> Iterator[Check]:
    """Check that what is seen without the target is what is seen with it, but where the target is."""
    if not picture.has(*EMPTIED_SURFACE):
        return
    seen = picture.layers["object_id"] == (subject.truth.target or -1)
    pairs = [(picture.layers[name], picture.layers[name.partition(".")[2]]) for name in EMPTIED_SURFACE]
    equal = np.all([(a == b).reshape(*seen.shape, -1).all(axis=-1) for a, b in pairs], axis=0)
    told = "surfaces that the target does not hide are the same without it; looks like another view"
    yield picture.at.judge("surfaces beside the target", float((~equal)[~seen].sum()), 0, "pixels", told)
    if not seen.any():
        yield picture.at.skip("surfaces behind the target", "the target is not seen")
        return
    told = "what is behind the target is not the target; looks like a target still there"
    yield picture.at.judge(
        "surfaces behind the target", float(equal[seen].mean()), 0.5, "of its pixels", told
    )


def _differs_clearly(picture: TruePicture) -> np.ndarray:
    """Return where the pictures differ by a tenth and by eight times the noise of their difference, ``(H,
    W)``.
    """
    change, one, other = (
        picture.layers[f"radiance{e}"].astype(float) - picture.layers[f"counterfactual.radiance{e}"]
        for e in ("", ".half_a", ".half_b")
    )
    square = ndimage.uniform_filter(((one - other) / 2) ** 2, size=3, axes=(0, 1))
    brighter = np.maximum(picture.layers["radiance"], picture.layers["counterfactual.radiance"])
    large = np.abs(change) > 0.1 * brighter.mean(axis=-1, keepdims=True)
    return (large & (change**2 > 64 * square)).any(axis=-1)

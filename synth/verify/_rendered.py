# SPDX-License-Identifier: Apache-2.0
"""Checks against a second rendering. Import it only after ``use_renderer``."""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy import ndimage

from graycard import Camera, EnvironmentLight, luminance
from graycard.synth.edits._light_edits import Edit
from graycard.synth.verify._check import At, Check
from graycard.synth.verify._closed_forms import unblocked_irradiance
from graycard.synth.verify._comparison import Pair, compare
from graycard.synth.verify._relit import edits_of
from graycard.synth.verify._second_rendering import (
    albedo_again,
    effects_again,
    emptied_again,
    lit_by,
    radiance_again,
    surfaces_again,
)
from graycard.synth.verify._subject import Rebuilt, Subject, TruePicture
from graycard.synth.verify._values import ESTIMATES, PARTS

_POINTS = 4096
"""Most pixels of a view whose rays are cast again; one at a time in ``scalar_rgb``, so it takes fewer."""

_COLOR = 3e-3
"""Tolerance of a reflectance: a fine texture multiplies the rounding of its coordinates."""

_TOLERANCES = {
    "position": 1e-3,
    "normal": 1e-3,
    **dict.fromkeys(("base_color", "diffuse_reflectance", "f0"), _COLOR),
    **dict.fromkeys(("roughness", "alpha", "metallic"), 1e-5),
}
"""Metres; components; reflectances; and parameters that are the same all over an object."""

_ALBEDO_APART = 0.1
"""Tolerance of two albedos of one point, each of 256 directions: seven times what the principled material
needs."""

_AT_EDGES, _FEW_EDGES = 0.005, 3
"""Share of pixels, and some of a small picture, whose centre is on an edge: rounding decides what is seen."""

_FEW_MARKED = 60
"""Pixels of two masks below which the chance of single ones is most of what they differ by."""

_APART = {"footprint": 0.05, "untouched": 0.5, "mirror": 0.5, "shadow": 0.8, "bleeding": 0.8}
"""Share of two masks that may be in one alone: at the rims of shadows, and of bleeding, noise decides; there
are 0.01, 0.2, 0.15, 0.42 and 0.52 in the table scenes with 64 light paths a pixel, less with more."""

_INSIDE, _INSIDE_UNTOUCHED, _FEW_INSIDE, _LEAST_INSIDE = 0.05, 0.2, 3, 10
"""Share of a mask without its rim that may be missing in another one, and some pixels of a small one; and the
pixels from which it is judged. In the table scenes it is 0.04 or less, and of untouched pixels 0.07: a single
path that meets the target ends one."""

_RIM = 1e-3
"""Share of a light's largest irradiance in a view above which a point is lit for certain."""

_LIGHTS, _PICTURE, _EMPTIED, _ALBEDO, _RELIT, _EFFECTS = range(6)
"""Subjects of the seeds."""

Again = tuple[dict[str, np.ndarray], dict[str, np.ndarray]]
"""Layers at some pixels: as they are stored, and as they are found again."""


def check_rendered(
    subject: Subject, rebuilt: Rebuilt, pictures: Sequence[TruePicture], points: int = _POINTS
) -> Iterator[Check]:
    """Pictures, counterfactuals, lights and surfaces of some views against another rendering of them."""
    radiances = [_pair(p, "radiance", radiance_again(rebuilt, p.number, _PICTURE)) for p in pictures]
    yield from compare("radiance again", radiances, subject.at)
    if rebuilt.scene.target:
        name = "counterfactual.radiance"
        emptied = [_pair(p, name, emptied_again(rebuilt, p.number, _EMPTIED)) for p in pictures]
        yield from compare("counterfactual again", emptied, subject.at)
        yield from _check_effects(rebuilt, _middle_split(pictures))
    yield from _check_lights(subject, rebuilt, _middle_split(pictures))
    yield from _check_albedo(subject, rebuilt, pictures)
    yield from _check_relit(subject, rebuilt)
    for picture in pictures:
        yield from check_surfaces(subject, rebuilt, picture, points)


def _pair(picture: TruePicture, name: str, again: dict[str, np.ndarray]) -> Pair:
    """Return a stored picture and the same one rendered again, with their halves, or else variances."""

    def of_both(*ends: str) -> tuple[np.ndarray, ...]:
        if not picture.has(*(f"{name}.{end}" for end in ends)):
            return ()
        return tuple(
            [picture.layers[f"{name}.{end}"] for end in ends] + [again[f"radiance.{end}"] for end in ends]
        )

    halves = of_both("half_a", "half_b")
    variances = () if halves else of_both("var")
    return Pair(picture.at, picture.layers[name], again["radiance"], halves, variances)


def _middle_split(pictures: Sequence[TruePicture]) -> TruePicture:
    """Return the picture in the middle of those whose light is told apart; of all where none is."""
    found = [picture for picture in pictures if picture.is_split] or pictures
    return found[len(found) // 2]


def _check_effects(rebuilt: Rebuilt, picture: TruePicture) -> Iterator[Check]:
    """Masks of the target's effects against those from other light paths: alike but for their rims."""
    if not picture.is_split:
        yield picture.at.skip("effects again", "its light is not told apart")
        return
    for name, again in effects_again(rebuilt, picture.number, _EFFECTS).items():
        a, b = picture.layers[name] > 0, again > 0
        if a.sum() + b.sum() < _FEW_MARKED:
            continue
        told = f"{name} is where another rendering has it; looks like masks that are lost, swapped or older"
        apart = float((a ^ b).sum() / (a.sum() + b.sum()))
        yield picture.at.judge(
            "effects again", apart, _APART[name.removeprefix("effect.")], "of the marked pixels", told
        )
        yield from _check_inside(picture, name, a, b)


def _check_inside(picture: TruePicture, name: str, stored: np.ndarray, again: np.ndarray) -> Iterator[Check]:
    """Judge two masks without the pixels at their rims, which chance decides: neither lacks a part."""
    for mask, other, told in (
        (again, stored, f"{name} is whole; looks like a part of the mask that is lost"),
        (stored, again, f"{name} has no more than another rendering; looks like the mask of another effect"),
    ):
        inside = ndimage.minimum_filter(mask, size=3)
        if (count := int(inside.sum())) >= _LEAST_INSIDE:
            lost = float((inside & ~other).sum() / count)
            bound = (_INSIDE_UNTOUCHED if name == "effect.untouched" else _INSIDE) + _FEW_INSIDE / count
            yield picture.at.judge("effects again: inside", lost, bound, "of the pixels off the rim", told)


def _check_lights(subject: Subject, rebuilt: Rebuilt, picture: TruePicture) -> Iterator[Check]:
    """Superposition: the parts of each light are what a picture shows in which that light alone is on.

    One picture serves for three lights: one is on in red, one in green, one in blue. The environment stays
    on in all channels, since its sampling would change with its colour.
    """
    if not picture.is_split:
        yield picture.at.skip("lights again: tiles", "its light is not told apart")
        return
    local = [light.name for light in subject.lights if not isinstance(light, EnvironmentLight)]
    always = [light.name for light in subject.lights if isinstance(light, EnvironmentLight)]
    dark = ndimage.maximum_filter(picture.layers["emitted"].max(axis=-1), size=3) == 0
    pairs = []
    for first in range(0, max(len(local), 1), 3):
        strengths = {name: _channel(k - first) for k, name in enumerate(local)}
        lit = lit_by(rebuilt.scene, strengths)
        again = radiance_again(rebuilt, picture.number, _LIGHTS + 10 * (first + 1), lit)["radiance"]
        stored = _parts(picture, dict.fromkeys(always, (1.0, 1.0, 1.0)) | strengths)
        pairs.append(Pair(picture.at, stored * dark[..., None], again * dark[..., None]))
    yield from compare("lights again", pairs, subject.at)


def _channel(number: int) -> tuple[float, float, float]:
    red, green, blue = (float(number == k) for k in range(3))
    return red, green, blue


def _parts(picture: TruePicture, strengths: dict[str, tuple[float, float, float]]) -> np.ndarray:
    """Sum of the parts of all lights, each times its strength in each channel."""
    return np.sum(
        [picture.layers[f"{part}.{name}"] * np.array(s) for name, s in strengths.items() for part in PARTS],
        axis=0,
    )


def _check_relit(subject: Subject, rebuilt: Rebuilt) -> Iterator[Check]:
    """One held-out view under each change whose light is no sum of what was there."""
    number = next((k for k, view in enumerate(subject.truth.views) if view.split == "test"), None)
    edits = [e for e in edits_of(rebuilt) if e.record in subject.truth.edits and not _is_a_sum(subject, e)]
    if number is None or not edits:
        yield subject.at.skip("relit again: level", "all changes of the lights are sums of their parts")
        return
    view, pairs = subject.truth.views[number], []
    for k, edit in enumerate(edits, start=1):
        at = At(subject.at.scene, f"{view.name} {edit.record.name}")
        relit = TruePicture(at, number, view, subject.truth.relit(edit.record.name, view), is_split=False)
        if relit.has(*ESTIMATES):  # else it failed for that before
            again = radiance_again(rebuilt, number, _RELIT + 10 * k, edit.scene)
            pairs.append(_pair(relit, "radiance", again))
    if pairs:
        yield from compare("relit again", pairs, subject.at)


def _is_a_sum(subject: Subject, edit: Edit) -> bool:
    """Return whether a picture under changed lights was judged by the parts of the light already."""
    return subject.is_separated and edit.factors is not None


def _check_albedo(subject: Subject, rebuilt: Rebuilt, pictures: Sequence[TruePicture]) -> Iterator[Check]:
    """Check the light that surfaces return, from other directions of the light, and its largest deviation."""
    if not subject.is_separated:
        yield subject.at.skip("albedo again: level", "a scene of scalar_rgb holds no albedo")
        return
    pairs = [Pair(p.at, p.layers["albedo"], albedo_again(rebuilt, p.number, _ALBEDO)) for p in pictures]
    yield from compare("albedo again", pairs, subject.at)
    for pair in pairs:
        off = (np.abs(pair.stored.astype(float) - pair.again).max(axis=-1) > _ALBEDO_APART).mean()
        told = "the albedo is what materials return; looks like another material, or a lobe left out"
        yield pair.at.judge("albedo again", float(off), _AT_EDGES, "of the pixels", told)


def check_surfaces(
    subject: Subject, rebuilt: Rebuilt, picture: TruePicture, points: int = _POINTS
) -> Iterator[Check]:
    """Objects, positions, normals, colours and shadows where rays are cast once more."""
    step = max(int(np.ceil(picture.seen.size / points)), 1)
    rows, columns = (index[::step] for index in np.nonzero(np.ones_like(picture.seen)))
    camera = rebuilt.scene.views[picture.number].camera
    found = surfaces_again(rebuilt.scene, camera, rows, columns)
    stored = {name: picture.layers[name][rows, columns] for name in found if name in picture.layers}
    same = stored["object_id"] == found["object_id"]
    bound = _AT_EDGES + _FEW_EDGES / len(rows)
    told = "rays cast again meet the same objects; looks like shifted ids, another camera or swapped views"
    yield picture.at.judge("object_id again", float((~same).mean()), bound, "of the pixels", told)
    for name, tolerance in _TOLERANCES.items():
        off = np.abs(stored[name] - found[name])[same] > tolerance
        off = off.any(axis=-1) if off.ndim == 2 else off
        told = f"rays cast again meet the same {name}, to {tolerance:g}; looks like a layer of another scene"
        share = float(off.mean()) if off.size else 0.0
        yield picture.at.judge(f"{name} again", share, bound, "of the pixels", told)
    if picture.is_split:
        yield from _check_shadows(rebuilt, camera, picture, (stored, found), bound)


def _check_shadows(
    rebuilt: Rebuilt, camera: Camera, picture: TruePicture, again: Again, bound: float
) -> Iterator[Check]:
    """Check that a light without extent is visible where a ray reaches it and it shines, and only there."""
    stored, found = again
    lights = [light for light in rebuilt.scene.lights if f"visibility.{light.name}" in found]
    for light in lights:
        name = f"visibility.{light.name}"
        blocked = (stored[name] > 0) & ~found[name]
        told = (
            f"where {name} is 1 a ray reaches the light; looks like a visibility that is inverted or swapped"
        )
        yield picture.at.judge("shadows again", float(blocked.mean()), bound, "of the pixels", told)
        sent = unblocked_irradiance(light, camera, found["position"], found["normal"], None)
        free = found[name] & _is_lit(sent)
        told = f"where {name} is 0 something is in the way; looks like a light that is lost, or swapped"
        share = float((free & (stored[name] == 0)).mean())
        yield picture.at.judge("light again", share, bound, "of the pixels", told)


def _is_lit(sent: np.ndarray | None) -> np.ndarray:
    """Return where a light sends more than what rounding leaves at the rim of its cone and at grazing
    angles.
    """
    level = np.zeros(1) if sent is None else luminance(sent)
    return level > _RIM * level.max(initial=0)

# SPDX-License-Identifier: Apache-2.0
"""Checks against a second rendering. Import it only after ``use_renderer``."""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy import ndimage

import graycard as gc
from graycard.synth.verify._again import emptied_again, lit_by, radiance_again, surfaces_again
from graycard.synth.verify._check import Check
from graycard.synth.verify._comparison import Pair, compare
from graycard.synth.verify._subject import Picture, Rebuilt, Subject
from graycard.synth.verify._values import PARTS

_POINTS = 4096
"""Most pixels of a view whose rays are cast again; one at a time in ``scalar_rgb``, so it takes fewer."""

_TOLERANCES = {"position": 1e-3, "normal": 1e-3, "base_color": 3e-3}
"""Metres; components; and reflectance, since a fine texture multiplies the rounding of its coordinates."""

_AT_EDGES, _FEW_EDGES = 0.005, 3
"""Share of pixels, and some of a small picture, whose centre is on an edge: rounding decides what is seen."""

_LIGHTS, _PICTURE, _EMPTIED = range(3)
"""Subjects of the seeds."""


def check_rendered(
    subject: Subject, rebuilt: Rebuilt, pictures: Sequence[Picture], points: int = _POINTS
) -> Iterator[Check]:
    """Pictures, counterfactuals, lights and surfaces of some views against another rendering of them."""
    radiances = [_pair(p, "radiance", radiance_again(rebuilt, p.number, _PICTURE)) for p in pictures]
    yield from compare("radiance again", radiances, subject.at)
    if rebuilt.scene.target:
        name = "counterfactual.radiance"
        emptied = [_pair(p, name, emptied_again(rebuilt, p.number, _EMPTIED)) for p in pictures]
        yield from compare("counterfactual again", emptied, subject.at)
    yield from _check_lights(subject, rebuilt, pictures[len(pictures) // 2])
    for picture in pictures:
        yield from check_surfaces(rebuilt, picture, points)


def _pair(picture: Picture, name: str, again: dict[str, np.ndarray]) -> Pair:
    """A stored picture and the same one rendered again, with their halves."""
    ends = ("half_a", "half_b")
    halves = [picture.layers[f"{name}.{end}"] for end in ends] + [again[f"radiance.{end}"] for end in ends]
    return Pair(picture.at, picture.layers[name], again["radiance"], tuple(halves))


def _check_lights(subject: Subject, rebuilt: Rebuilt, picture: Picture) -> Iterator[Check]:
    """Superposition: the parts of each light are what a picture shows in which that light alone is on.

    One picture serves for three lights: one is on in red, one in green, one in blue. The environment stays
    on in all channels, since its sampling would change with its colour.
    """
    if not subject.is_separated:
        yield picture.at.skip("lights again: tiles", "a scene of scalar_rgb holds no parts of the light")
        return
    local = [light.name for light in subject.lights if not isinstance(light, gc.EnvironmentLight)]
    always = [light.name for light in subject.lights if isinstance(light, gc.EnvironmentLight)]
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


def _parts(picture: Picture, strengths: dict[str, tuple[float, float, float]]) -> np.ndarray:
    """Sum of the parts of all lights, each times its strength in each channel."""
    return np.sum(
        [picture.layers[f"{part}.{name}"] * np.array(s) for name, s in strengths.items() for part in PARTS],
        axis=0,
    )


def check_surfaces(rebuilt: Rebuilt, picture: Picture, points: int = _POINTS) -> Iterator[Check]:
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
        off = np.abs(stored[name] - found[name]).max(axis=-1)[same] > tolerance
        told = f"rays cast again meet the same {name}, to {tolerance:g}; looks like a layer of another scene"
        share = float(off.mean()) if off.size else 0.0
        yield picture.at.judge(f"{name} again", share, bound, "of the pixels", told)
    yield from _check_shadows(picture, stored, found, bound)


def _check_shadows(
    picture: Picture, stored: dict[str, np.ndarray], found: dict[str, np.ndarray], bound: float
) -> Iterator[Check]:
    """Rays reach lights without extent where they are visible; elsewhere they are blocked or behind."""
    for name in (name for name in stored if name.startswith("visibility.")):
        blocked = (stored[name] > 0) & ~found[name]
        told = (
            f"where {name} is 1 a ray reaches the light; looks like a visibility that is inverted or swapped"
        )
        share = float(blocked.mean())
        yield picture.at.judge("shadows again", share, bound, "of the pixels", told)

# SPDX-License-Identifier: Apache-2.0
"""Checks of object ids and of the materials' parameters against one another."""

from collections.abc import Iterator

import numpy as np

from graycard.synth.verify._check import Check
from graycard.synth.verify._subject import Subject, TruePicture

_EXACT = 2e-6
"""Rounding of a product of two float32 in [0, 1]."""


def check_objects(subject: Subject, picture: TruePicture) -> Iterator[Check]:
    """Each id that is seen is one of truth.json; the surfaces of lights are black and shine."""
    ids = picture.layers["object_id"]
    named = {thing.id for thing in subject.truth.objects}
    unknown = sorted(set(np.unique(ids).tolist()) - named - {0})
    told = f"truth.json names no object {unknown[:4]}; looks like ids that were shifted"
    yield picture.at.judge("object ids named", len(unknown), 0, "ids", told)
    yield _check_emitters(subject, picture)


def _check_emitters(subject: Subject, picture: TruePicture) -> Check:
    """Check that what is flagged as an emitter reflects nothing, and emits wherever all of the pixel shows
    it.
    """
    emits = np.isin(picture.layers["object_id"], list(subject.truth.emitter_ids()))
    if not emits.any():
        return picture.at.skip("emitters flagged", "no surface of a light is seen")
    wrong = emits & (picture.layers["base_color"].max(axis=-1) > 0)
    told = "the surface of a light is black; looks like ids or flags that were shifted"
    return picture.at.judge("emitters flagged", float(wrong.sum()), 0, "pixels", told)


def check_materials(picture: TruePicture) -> Iterator[Check]:
    """Relations between base colour, metallic, diffuse reflectance, f0, roughness and alpha."""
    at = picture.at
    layers = {name: values.astype(float) for name, values in picture.layers.items() if name in _PARAMETERS}
    metallic, base = layers["metallic"][..., None], layers["base_color"]
    diffuse = np.abs(layers["diffuse_reflectance"] - (1 - metallic) * base).max()
    told = "diffuse reflectance = (1 - metallic) x base colour; looks like a metal's colour taken for diffuse"
    yield at.judge("diffuse reflectance", float(diffuse), _EXACT, "1", told)
    yield at.judge("alpha of roughness", _alpha_error(layers), _EXACT, "1", _alpha_told(layers))
    rest = layers["f0"] - metallic * base
    dielectric = (1 - metallic) * 0.08
    off = np.maximum(-rest, rest - dielectric).max()
    told = "f0 = metallic x base colour + (1 - metallic) x at most 0.08; looks like another f0, or metallic"
    yield at.judge("f0 of the material", float(off), _EXACT, "1", told)
    spread = np.ptp(rest, axis=-1).max()
    told = "the dielectric share of f0 has no colour; looks like a tinted f0"
    yield at.judge("f0 without a tint", float(spread), 2 * _EXACT, "1", told)


_PARAMETERS = ("base_color", "diffuse_reflectance", "f0", "roughness", "alpha", "metallic")


def _alpha_error(layers: dict[str, np.ndarray]) -> float:
    return float(np.abs(layers["alpha"] - layers["roughness"] ** 2).max())


def _alpha_told(layers: dict[str, np.ndarray]) -> str:
    swapped = np.abs(layers["roughness"] - layers["alpha"] ** 2).max() <= _EXACT
    return "alpha = roughness²; looks like " + ("the two swapped" if swapped else "another convention")

# SPDX-License-Identifier: Apache-2.0
"""Checks of each layer by itself: there, finite, in its range, and stored in full precision."""

from collections.abc import Iterator

import numpy as np

from graycard import View, find_layer
from graycard.layers import LOBES, find_fault
from graycard.synth.verify._check import Check
from graycard.synth.verify._subject import Subject, TruePicture

HALVES = ("radiance.half_a", "radiance.half_b")
ESTIMATES = ("radiance", "radiance.var", *HALVES)
SURFACE = (
    "base_color",
    "diffuse_reflectance",
    "f0",
    "roughness",
    "alpha",
    "metallic",
    "normal",
    "depth",
    "distance",
    "position",
    "object_id",
    "pure",
)
COUNTERFACTUAL = tuple(f"counterfactual.{name}" for name in ESTIMATES)
EFFECTS = tuple(f"effect.{name}" for name in ("untouched", "footprint", "shadow", "mirror", "bleeding"))
"""Only of views whose renderer tells the parts of the light apart, as are the next."""
EMPTIED_LOBES = tuple(f"counterfactual.{lobe}" for lobe in LOBES)
EMPTIED_SURFACE = tuple(f"counterfactual.{name}" for name in ("normal", "f0", "roughness"))
SEPARATED = ("emitted", "shading", "shading.var")
PARTS = ("direct.diffuse", "direct.specular", "indirect.diffuse", "indirect.specular")
PER_LIGHT = (*PARTS, "visibility", "irradiance", "direct.irradiance")

_NOT_NEEDED = {*HALVES, *COUNTERFACTUAL[1:], EMPTIED_LOBES[1]}
"""Layers that training views lack which hold no more than is needed."""

HALF_SHARE = 0.1
"""Share of different values that half precision represents exactly, above which a layer was stored in it. By
chance one value in 8192 is, and coordinates of planes such as z = 0.75 are: in whole scenes 0.01 at most."""

_FEW = 100
"""Values below which a share says nothing."""

_DUST = 1e-4
"""Share of a layer's largest value below which values may be what a subtraction left over."""

_UNIT_RANGE = {"normal": (-1.0, 1.0), "counterfactual.normal": (-1.0, 1.0), "albedo": (0.0, 2.0)}
"""Layers of unit 1 that are no share; Disney's material returns up to 1.44 of the light at grazing angles."""


def expected_layers(subject: Subject, view: View) -> set[str]:
    """Return the names of all layers that are known of a view of a scene.

    ``distance`` and ``position`` of a training view that holds no more than is needed follow from its depth.
    """
    split, separated = subject.is_split(view), subject.is_separated
    names = {*ESTIMATES, *SURFACE, *({"albedo"} if separated else ())}
    if split:
        names |= {*SEPARATED, *(f"{stem}.{light.name}" for stem in PER_LIGHT for light in subject.lights)}
    if subject.truth.target is not None:
        names |= {*COUNTERFACTUAL, *EMPTIED_SURFACE, *(EMPTIED_LOBES if separated else ())}
        names |= {*EFFECTS} if split else set()
    return names - _NOT_NEEDED if subject.is_reduced(view) else names


def check_values(subject: Subject, picture: TruePicture) -> Iterator[Check]:
    """Presence, finiteness, range and precision of the layers of a view."""
    at, layers = picture.at, picture.layers
    missing = sorted(expected_layers(subject, picture.view) - layers.keys())
    yield at.judge(
        "layers present",
        len(missing),
        0,
        "layers",
        f"missing are {', '.join(missing[:4])}: a part was dropped",
    )
    height, width = picture.camera.height, picture.camera.width
    faults = [fault for name in layers if (fault := find_fault(name, layers[name], height, width))]
    yield at.judge("values finite", len(faults), 0, "layers", "; ".join(faults[:3]))
    outside = [told for name, values in layers.items() if (told := _outside(name, values))]
    yield at.judge("values in range", len(outside), 0, "layers", "; ".join(outside[:3]))
    yield _precision(picture)


def _outside(name: str, values: np.ndarray) -> str:
    """Return what lies outside the range of a layer, in words; empty where nothing does."""
    low, high = _range(name)
    bad = (values < low) | (values > high)
    if not bad.any():
        return ""
    return (
        f"expected {name} in [{low:g}, {high:g}], got {float(values[bad][0]):.4g} in {int(bad.sum())} values"
    )


def _range(name: str) -> tuple[float, float]:
    layer = find_layer(name)
    if name == "position":
        return -np.inf, np.inf
    if layer.unit == "1" or layer.unit.startswith("1,"):
        return _UNIT_RANGE.get(name, (0.0, 1.0))
    return 0.0, np.inf


def _precision(picture: TruePicture) -> Check:
    """Return the layer with the largest share of values that survive a way through half precision."""
    shares = {
        name: _half_share(values)
        for name, values in picture.layers.items()
        # what a matte surface reflects specularly is the rounding of a difference
        if values.dtype.kind == "f" and not name.startswith((*PARTS, *EMPTIED_LOBES))
    }
    name = max(shares, key=lambda name: shares[name])
    meaning = f"of {name} half precision represents so many values: it was stored as float16 on the way"
    return picture.at.judge("values in float32", shares[name], HALF_SHARE, "of the values", meaning)


def _half_share(values: np.ndarray) -> float:
    """Share of values with a significand of 11 bits among those that are not of a few discrete ones."""
    values = values[np.isfinite(values)].astype(np.float32)
    visible = np.abs(values) > _DUST * np.abs(values).max(initial=0)
    distinct = np.unique(values[visible])
    if len(distinct) < _FEW or len(distinct) < 0.02 * values.size:
        return 0.0  # masks, shares of a few samples and parameters of a few materials
    mantissa, _ = np.frexp(distinct)
    scaled = mantissa * 2.0**11
    return float((scaled == np.round(scaled)).mean())

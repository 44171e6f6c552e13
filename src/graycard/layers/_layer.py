# SPDX-License-Identifier: Apache-2.0
"""The named images of a decomposition, each with its channels, unit and meaning."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from graycard._errors import UnknownNameError

RGB, XYZ = ("R", "G", "B"), ("X", "Y", "Z")
RADIANCE = "W/m²/sr, scene-linear Rec.709"


@dataclass(frozen=True, slots=True)
class Layer:
    """Contents of a named image.

    ``name`` may end in ``.<light>``: then there is one such image for each light of the scene.
    """

    name: str
    channels: tuple[str, ...]
    """Suffixes of the EXR channels, ``<name>.<suffix>``."""
    unit: str
    meaning: str
    dtype: Literal["float32", "uint32"] = "float32"
    may_be_infinite: bool = False
    """True if +inf has a meaning (a depth where there is nothing)."""


def _rgb(name: str, unit: str, meaning: str) -> Layer:
    return Layer(name, RGB, unit, meaning)


def _mask(name: str, meaning: str) -> Layer:
    return Layer(name, ("Y",), "1", f"1 where {meaning}, else 0")


_ESTIMATES = {
    "var": ("({unit})²", "variance of the mean of {stem}"),
    "half_a": ("{unit}", "{stem} from one half of its samples"),
    "half_b": ("{unit}", "{stem} from the other half of its samples"),
}
"""Suffixes of layer names, each with its unit and its meaning."""

_TABLE = (
    _rgb("radiance", RADIANCE, "light that arrives at the camera, averaged over the pixel (box filter)"),
    _rgb("base_color", "1", "colour parameter of the material, whatever its metallic share"),
    _rgb("diffuse_reflectance", "1", "share of light that is scattered diffusely; 0 for a metal"),
    _rgb("albedo", "1", "directional-hemispherical reflectance towards the camera"),
    _rgb("f0", "1", "specular reflectance at normal incidence"),
    Layer("roughness", ("Y",), "1", "square root of the GGX alpha; 1 for a matte surface"),
    Layer("alpha", ("Y",), "1", "GGX alpha, the square of roughness"),
    Layer("metallic", ("Y",), "1", "0 dielectric, 1 metal"),
    _mask("glossy", "reflections of things are seen in the surface"),
    Layer("normal", XYZ, "1, unit length", "surface normal in the world, outward"),
    Layer(
        "depth", ("Z",), "m", "distance along the optical axis; +inf where there is nothing", "float32", True
    ),
    Layer("distance", ("Z",), "m", "distance along the ray; +inf where there is nothing", "float32", True),
    Layer("position", XYZ, "m", "point in the world"),
    Layer("object_id", ("ID",), "index", "which object is seen; 0 where there is none", "uint32"),
    Layer("pure", ("Y",), "1", "1 where the pixel shows one object of nearly one base colour, else 0"),
    _rgb("shading", RADIANCE, "radiance divided by albedo for a Lambertian surface: irradiance / pi"),
    _rgb(
        "irradiance.<light>",
        "W/m²",
        "light of one source that arrives at the surface, bounced light included",
    ),
    _rgb(
        "direct.irradiance.<light>", "W/m²", "share of irradiance.<light> that comes straight from the source"
    ),
    _rgb("radiance.<light>", RADIANCE, "share of one source in the radiance"),
    Layer("visibility.<light>", ("Y",), "1", "share of the irradiance from one source that nothing blocks"),
    _rgb("direct.diffuse", RADIANCE, "one bounce, diffuse lobe"),
    _rgb("direct.specular", RADIANCE, "one bounce, specular lobe"),
    _rgb("indirect.diffuse", RADIANCE, "more bounces, diffuse lobe at the camera's hit"),
    _rgb("indirect.specular", RADIANCE, "more bounces, specular lobe at the camera's hit"),
    _rgb("diffuse", RADIANCE, "all light of the diffuse lobe at the camera's hit, however often it bounced"),
    _rgb(
        "specular", RADIANCE, "all light of the specular lobe at the camera's hit, however often it bounced"
    ),
    _rgb("emitted", RADIANCE, "light of sources that the camera sees itself, averaged over the pixel"),
    _rgb("direct.diffuse.<light>", RADIANCE, "share of one source in direct.diffuse"),
    _rgb("direct.specular.<light>", RADIANCE, "share of one source in direct.specular"),
    _rgb("indirect.diffuse.<light>", RADIANCE, "share of one source in indirect.diffuse"),
    _rgb("indirect.specular.<light>", RADIANCE, "share of one source in indirect.specular"),
    _rgb("counterfactual.radiance", RADIANCE, "radiance of the same view without the target object"),
    _rgb("counterfactual.diffuse", RADIANCE, "diffuse of the same view without the target object"),
    _rgb("counterfactual.specular", RADIANCE, "specular of the same view without the target object"),
    Layer(
        "counterfactual.normal", XYZ, "1, unit length", "normal of the same view without the target object"
    ),
    _rgb("counterfactual.f0", "1", "f0 of the same view without the target object"),
    Layer("counterfactual.roughness", ("Y",), "1", "roughness of the same view without the target object"),
    _mask(
        "effect.untouched",
        "the target is not seen and the picture without it is equal to the bit, sample by sample",
    ),
    _mask("effect.footprint", "the target itself is seen, in the whole pixel or in a part of it"),
    _mask("effect.shadow", "the target takes direct light away from what is seen"),
    _mask("effect.mirror", "the target is seen by reflection in what is seen"),
    _mask(
        "effect.bleeding",
        "what is seen scatters other bounced light diffusely: the target's own, or light that it blocks",
    ),
)
_BY_NAME = {find_layer.name: find_layer for find_layer in _TABLE}


def all_layers() -> tuple[Layer, ...]:
    """All layers of the vocabulary, in the order of the documentation."""
    return _TABLE


def find_layer(name: str) -> Layer:
    """Return the layer of a name, as in ``"base_color"``, ``"visibility.lamp"`` or ``"radiance.var"``.

    ``<layer>.var`` is the variance of the mean, in the unit of the layer squared; ``<layer>.half_a`` and
    ``<layer>.half_b`` are the means of two independent halves of its samples, whose product with a
    prediction's error is free of the truth's own noise.

    Raises:
        UnknownNameError: There is no such layer.
    """
    if name in _BY_NAME:
        return _BY_NAME[name]
    stem, _, tail = name.rpartition(".")
    if tail in _ESTIMATES:
        of, (unit, meaning) = find_layer(stem), _ESTIMATES[tail]
        return Layer(name, of.channels, unit.format(unit=of.unit), meaning.format(stem=stem))
    if tail and f"{stem}.<light>" in _BY_NAME:
        per_light = _BY_NAME[f"{stem}.<light>"]
        return Layer(name, per_light.channels, per_light.unit, f"{per_light.meaning} ({tail})")
    raise UnknownNameError("layer", name, _BY_NAME)


def shape_of(name: str, height: int, width: int) -> tuple[int, ...]:
    """Return the shape of a layer's array: ``(height, width, 3)``, or ``(height, width)`` for one channel."""
    channels = len(find_layer(name).channels)
    return (height, width) if channels == 1 else (height, width, channels)


def find_fault(
    name: str,
    values: np.ndarray,
    height: int,
    width: int,
    *,
    within: np.ndarray | None = None,
    bad: np.ndarray | None = None,
) -> str | None:
    """Return the fault of an array that is meant to be a layer, as "expected …, got …"; None without one.

    Args:
        name: Of the layer.
        values: The array.
        height: Rows that it should have.
        width: Columns that it should have.
        within: shape ``(H, W)``, bool: pixels that have to be finite; all if None.
        bad: What :func:`not_meant` marks, where the caller has asked it; asked here if None.
    """
    expected = shape_of(name, height, width)
    if values.shape != expected:
        return f"expected {name} of shape {expected}, got {values.shape}"
    bad = not_meant(name, values) if bad is None else bad
    if within is not None and bad.any():
        bad = bad & within.reshape(within.shape + (1,) * (values.ndim - 2))
    if not bad.any():
        return None
    where = tuple(int(i) for i in np.argwhere(bad)[0])
    axes = ", ".join(("row", "column", "channel")[: bad.ndim])
    among = values.size if within is None else int(within.sum()) * (values.size // within.size)
    kind = f"{int(bad.sum())} of {among} values are not, the first at {where}: {axes}"
    return f"expected finite values in {name}, got {values[where]} ({kind})"


def find_codes(name: str, values: np.ndarray) -> str | None:
    """Return the fault of whole numbers in place of measured ones, as "expected …, got …. Do …"; else None.

    An image of 0 to 255 would be taken for one of 0 to 1. A layer of ids is whole numbers, and 0 and 1 are
    the same in any type: neither is a fault.

    Args:
        name: Of the layer.
        values: The array.
    """
    if values.dtype.kind not in "iu" or find_layer(name).dtype == "uint32" or not values.size:
        return None
    far = np.abs(values.astype(np.float64) - 0.5)
    if far.max() <= 0.5:
        return None
    where = tuple(int(i) for i in np.unravel_index(far.argmax(), values.shape))
    axes = ", ".join(("row", "column", "channel")[: values.ndim])
    return (
        f"expected {name} in floating point, got {values.dtype}, as {values[where]} at {where}: {axes}. "
        "Divide codes of 0 to 255 by 255 and undo their sRGB curve (graycard.srgb_decode), or convert values "
        "that are linear already by .astype(np.float32)"
    )


def not_meant(name: str, values: np.ndarray) -> np.ndarray:
    """Mark values that mean nothing in a layer, same shape, bool: NaN and infinities, but a depth of +inf."""
    if values.dtype.kind != "f":
        return np.zeros(values.shape, bool)
    bad = ~np.isfinite(values)
    return bad & ~np.isposinf(values) if find_layer(name).may_be_infinite else bad

# SPDX-License-Identifier: Apache-2.0
"""One layer of one view as rows of pictures: the truth, each method, and where it is wrong."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from graycard import View, find_layer
from graycard.reports._evidence import MethodEvidence, SceneEvidence, usable_layer
from graycard.reports._format import format_name, format_number
from graycard.reports.pictures._colour_maps import STEPS, ColourMap
from graycard.reports.pictures._error_images import (
    NOISE_HIGH,
    error_image,
    error_unit,
    noise_ratio_image,
    shared_scale,
)
from graycard.reports.pictures._pictures import (
    NUMBERS,
    STEP,
    PagePicture,
    direction_picture,
    light_picture,
    map_picture,
    number_picture,
    share_picture,
    shrink,
)

MAX_SIDE = 128
"""Pixels of a picture; larger ones are averaged down by a whole factor."""
GRAY_CARD = 0.18
"""Reflectance under which light that arrives at a surface is shown: as radiance it would mostly be white."""

_TITLES = {"counterfactual.radiance": "Radiance without the target object", "normal": "Normal, world axes"}
_UNITS = {"base_color": "reflectance, 1 is white", "normal": "X, Y, Z as R, G, B"}


@dataclass(frozen=True, slots=True)
class Tile:
    """A place for a picture, or the words that stand there instead."""

    picture: PagePicture | None = None
    missing: str = ""
    """``not provided`` or ``failed``."""
    note: str = ""


@dataclass(frozen=True, slots=True)
class Scale:
    """A colour bar and the numbers at its ends."""

    colours: ColourMap
    low: str
    high: str
    unit: str


@dataclass(frozen=True, slots=True)
class LayerRow:
    """One layer of one view: a tile for the truth, two for each method, three where the truth has noise."""

    title: str
    unit: str
    truth: Tile
    predictions: tuple[Tile, ...]
    errors: tuple[Tile, ...]
    noise_ratios: tuple[Tile, ...]
    """Errors in units of the truth's noise; empty where it is exact."""
    error_scale: Scale
    noise_scale: Scale
    value_scale: Scale | None
    """For a layer that is shown through a colour map."""
    layer: str = ""
    """Its name in the vocabulary."""
    values: str = ""
    """Unit of a value under the pointer."""
    precision: str = ""
    """Largest error of such a value, and of an error, by their codes alone."""


@dataclass(frozen=True, slots=True)
class JudgedLayer:
    """A layer of a scene with all that its pictures share."""

    name: str
    exposure: float
    errors: Mapping[tuple[str, str], np.ndarray]
    """By view and method."""
    ratios: Mapping[tuple[str, str], np.ndarray]
    """Ratio of error to noise, by view and method; empty where the truth is exact."""
    error_high: float
    low: float
    high: float
    title: str = ""
    """In the place of the name of the layer."""
    side: int = MAX_SIDE
    """Pixels of a picture; larger ones are averaged down by a whole factor."""


def title_of(layer: str) -> str:
    """Return a layer in words."""
    return _TITLES.get(layer, format_name(layer))


def judged_layer(name: str, scene: SceneEvidence, methods: Sequence[MethodEvidence]) -> JudgedLayer:
    """Return a layer held against the truth in every shown view."""
    errors: dict[tuple[str, str], np.ndarray] = {}
    ratios: dict[tuple[str, str], np.ndarray] = {}
    for view in scene.shown:
        true, mask = scene.layers[view.name][name], scene.mask(name, view)
        variance = scene.layers[view.name].get(f"{name}.var")
        for method in methods:
            values, _ = usable_layer(method, view, name, mask)
            if values is None:
                continue
            errors[view.name, method.method] = error_image(name, values, true, mask, scene.truth.exposure)
            if variance is not None:
                ratios[view.name, method.method] = noise_ratio_image(values, true, variance, mask)
    given = [m.layer(v.name, name) for m in methods for v in scene.shown] if _is_number(name) else []
    true = [scene.layers[v.name][name] for v in scene.shown]
    low, high = _value_range(true)
    if name not in ("depth", "distance"):
        low, high = _value_range([*true, *(image for image in given if image is not None)])
    scale = shared_scale(list(errors.values()))
    return JudgedLayer(name, scene.truth.exposure, errors, ratios, scale, low, high)


def _value_range(images: Sequence[np.ndarray]) -> tuple[float, float]:
    finite = np.concatenate([i[np.isfinite(i)] for i in images])
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)


def layer_row(
    layer: JudgedLayer, view: View, scene: SceneEvidence, methods: Sequence[MethodEvidence]
) -> LayerRow:
    """Return the pictures of a layer in one view."""
    title = layer.title or title_of(layer.name)
    truth = _show(layer, scene.layers[view.name][layer.name], f"{title}, {view.name}: truth")
    ratios = tuple(_noise_ratio(layer, view, method, title) for method in methods) if layer.ratios else ()
    unit = find_layer(layer.name).unit
    return LayerRow(
        title,
        _unit_of(layer.name),
        Tile(truth),
        tuple(_prediction(layer, view, method, scene.mask(layer.name, view), title) for method in methods),
        tuple(_error(layer, view, method, title) for method in methods),
        ratios,
        _scale("error", 0, layer.error_high, error_unit(layer.name), "≥ "),
        _scale("error", 0, NOISE_HIGH, "standard deviations of the truth; 1 is noise alone", "≥ "),
        _scale("depth", layer.low, layer.high, unit, "") if _is_number(layer.name) else None,
        layer.name,
        _values_of(layer.name),
        _precision_of(layer),
    )


def bare_row(
    name: str, view: View, exposure: float, methods: Sequence[MethodEvidence], side: int = MAX_SIDE
) -> LayerRow:
    """Return the pictures of a layer in one view, of which no truth is known: no error is shown."""
    title, mask = title_of(name), np.ones((view.camera.height, view.camera.width), bool)
    found = [usable_layer(method, view, name, mask)[0] for method in methods]
    low, high = _value_range([values for values in found if values is not None] or [np.zeros(1)])
    layer = JudgedLayer(name, exposure, {}, {}, 1.0, low, high, side=side)
    return LayerRow(
        title,
        _unit_of(name),
        Tile(missing="no truth"),
        tuple(_prediction(layer, view, method, mask, title) for method in methods),
        (),
        (),
        _scale("error", 0, 1, "", ""),
        _scale("error", 0, 1, "", ""),
        _scale("depth", low, high, find_layer(name).unit, "") if _is_number(name) else None,
        name,
        _values_of(name),
        _precision_of(layer),
    )


def _unit_of(name: str) -> str:
    if name in _UNITS:
        return _UNITS[name]
    if _reflected(name) < 1:
        return "as displayed on a gray card"
    unit = find_layer(name).unit
    return "as displayed" if "sr" in unit else "" if unit == "1" else unit


def _values_of(name: str) -> str:
    """Return the unit of a value under the pointer."""
    unit = find_layer(name).unit
    if name == "normal":
        return "x, y, z"
    return "" if unit == "1" else unit if _is_number(name) else "1 is display white"


def _precision_of(layer: JudgedLayer) -> str:
    """Return the largest error of such a value, and of an error, by their codes alone."""
    if layer.name == "normal":
        values = f"± {1 / 255:.3f}"
    elif _is_number(layer.name):
        values = f"± {format_number((layer.high - layer.low) / (2 * NUMBERS))}"
    else:
        values = "± 0.005" if find_layer(layer.name).unit == "1" else f"± {100 * STEP / 2:g} %"
    return f"values to {values}, errors to {100 / (2 * (STEPS - 1)):.1f} % of their scale"


def _is_number(name: str) -> bool:
    return len(find_layer(name).channels) == 1


def _reflected(name: str) -> float:
    """By what a layer of light is shown as radiance; below 1 where it arrives at a surface."""
    if "irradiance" in name:
        return GRAY_CARD / np.pi
    return GRAY_CARD if name == "shading" else 1.0


def _prediction(layer: JudgedLayer, view: View, method: MethodEvidence, mask: np.ndarray, title: str) -> Tile:
    values, note = usable_layer(method, view, layer.name, mask)
    if values is None:
        status, _, reason = note.partition(": ")
        return Tile(missing=status, note=reason)
    return Tile(_show(layer, values, f"{title}, {view.name}: {method.method}"), note=note)


def _error(layer: JudgedLayer, view: View, method: MethodEvidence, title: str) -> Tile:
    error = layer.errors.get((view.name, method.method))
    if error is None:
        return Tile()
    typical = float(np.nanmean(error)) if np.isfinite(error).any() else float("nan")
    alt = f"error of {title}, {view.name}: {method.method}, mean {format_number(typical)}"
    return Tile(map_picture(shrink(error, layer.side), layer.error_high, alt))


def _noise_ratio(layer: JudgedLayer, view: View, method: MethodEvidence, title: str) -> Tile:
    ratio = layer.ratios.get((view.name, method.method))
    if ratio is None:
        return Tile()
    seen = ratio[~np.isnan(ratio)]
    within = f"{(seen <= 2).mean():.0%} of the pixels within 2" if seen.size else "no pixel is judged"
    alt = f"error to noise of {title}, {view.name}: {method.method}, {within}"
    small = shrink(np.minimum(ratio, 2 * NOISE_HIGH), layer.side)  # one wild pixel must not fill its block
    return Tile(map_picture(small, NOISE_HIGH, alt), note=within)


def _show(layer: JudgedLayer, values: np.ndarray, alt: str) -> PagePicture:
    small = shrink(values.astype(np.float64), layer.side)
    if layer.name == "normal":
        return direction_picture(small, alt)
    if _is_number(layer.name):
        return number_picture(np.where(np.isfinite(small), small, np.nan), layer.low, layer.high, alt)
    if find_layer(layer.name).unit == "1" and _reflected(layer.name) == 1:
        return share_picture(small, alt)
    return light_picture(small * layer.exposure * _reflected(layer.name), alt)


def _scale(colours: ColourMap, low: float, high: float, unit: str, more: str) -> Scale:
    return Scale(colours, format_number(low), more + format_number(high), unit)

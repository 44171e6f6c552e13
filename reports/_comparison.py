# SPDX-License-Identifier: Apache-2.0
"""The pictures of a scene: the truth, what each method says instead, and where that is wrong."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

import graycard as gc
from graycard.reports._error_images import error_image, error_unit, shared_scale
from graycard.reports._evidence import MethodEvidence, SceneEvidence
from graycard.reports._format import format_name, format_number
from graycard.reports._pictures import (
    Picture,
    colour_bar,
    display_picture,
    linear_picture,
    mapped_picture,
    shrink,
)

SHOWN_LAYERS = ("radiance", "counterfactual.radiance", "base_color", "normal", "depth")
MAX_SIDE = 128
"""Pixels of a picture; larger ones are averaged down by a whole factor."""
THUMBNAIL_SIDE = 64
MAX_THUMBNAILS = 6

_TITLES = {"counterfactual.radiance": "Radiance without the target object", "normal": "Normal, world axes"}
_UNITS = {"base_color": "reflectance, 1 is white", "normal": "X, Y, Z as R, G, B", "depth": "m"}


@dataclass(frozen=True, slots=True)
class Tile:
    """A place for a picture, or the words that stand there instead."""

    picture: Picture | None = None
    missing: str = ""
    """``not provided`` or ``failed``."""
    note: str = ""


@dataclass(frozen=True, slots=True)
class Scale:
    """A colour bar and the numbers at its ends."""

    bar: Picture
    low: str
    high: str
    unit: str


@dataclass(frozen=True, slots=True)
class LayerRow:
    """One layer of one view: a tile for the truth, two for each method."""

    title: str
    unit: str
    truth: Tile
    predictions: tuple[Tile, ...]
    errors: tuple[Tile, ...]
    error_scale: Scale
    value_scale: Scale | None
    """For a layer that is shown through a colour map."""


@dataclass(frozen=True, slots=True)
class ViewPictures:
    """All layers of one test view."""

    name: str
    rows: tuple[LayerRow, ...]


@dataclass(frozen=True, slots=True)
class _Layer:
    """A layer of a scene with all that its pictures share."""

    name: str
    exposure: float
    errors: dict[tuple[str, str], np.ndarray]
    """By view and method."""
    error_high: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Gallery:
    """All pictures of a scene."""

    thumbnails: tuple[Picture, ...]
    views: tuple[ViewPictures, ...]

    def pictures(self) -> Iterator[Picture]:
        """The pictures of light and layers, colour bars and errors left out."""
        yield from self.thumbnails
        tiles = (t for view in self.views for row in view.rows for t in (row.truth, *row.predictions))
        yield from (tile.picture for tile in tiles if tile.picture)


def build_gallery(scene: SceneEvidence, methods: Sequence[MethodEvidence]) -> Gallery:
    """The pictures of a scene, with one error scale a layer for all methods and views.

    Raises:
        DatasetError: A training photograph is missing or broken.
    """
    photographs = _spread(scene.capture.train, MAX_THUMBNAILS)
    every = [set(scene.layers[v.name]) for v in scene.shown]
    names = [name for name in SHOWN_LAYERS if every and all(name in present for present in every)]
    layers = [_prepare(name, scene, methods) for name in names]
    views = tuple(
        ViewPictures(view.name, tuple(_row(layer, view, scene, methods) for layer in layers))
        for view in scene.shown
    )
    return Gallery(tuple(_thumbnail(scene, view) for view in photographs), views)


def usable_layer(
    method: MethodEvidence, view: gc.View, name: str
) -> tuple[np.ndarray, str] | tuple[None, str]:
    """A predicted layer that can be shown, the gauge applied; else None and why."""
    if method.fault or view.name in method.faults:
        return None, "failed"
    values = method.layer(view.name, name)
    if values is None:
        return None, "not provided"
    fault = gc.find_fault(name, values, view.camera.height, view.camera.width)
    if fault:
        return None, f"failed: {fault}"
    if name == "base_color" and method.gauge:
        return values * np.array(method.gauge), "× " + " ".join(f"{g:.3g}" for g in method.gauge)
    return values, ""


def _prepare(name: str, scene: SceneEvidence, methods: Sequence[MethodEvidence]) -> _Layer:
    errors: dict[tuple[str, str], np.ndarray] = {}
    for view in scene.shown:
        true, mask = scene.layers[view.name][name], scene.mask(name, view)
        for method in methods:
            values, _ = usable_layer(method, view, name)
            if values is not None:
                errors[view.name, method.method] = error_image(name, values, true, mask, scene.truth.exposure)
    low, high = _value_range([scene.layers[v.name][name] for v in scene.shown])
    return _Layer(name, scene.truth.exposure, errors, shared_scale(list(errors.values())), low, high)


def _row(layer: _Layer, view: gc.View, scene: SceneEvidence, methods: Sequence[MethodEvidence]) -> LayerRow:
    title = _TITLES.get(layer.name, format_name(layer.name))
    truth = _show(layer, scene.layers[view.name][layer.name], f"{title}, {view.name}: truth")
    depth = layer.name == "depth"
    return LayerRow(
        title,
        _UNITS.get(layer.name, "as displayed"),
        Tile(truth),
        tuple(_prediction(layer, view, method, title) for method in methods),
        tuple(_error(layer, view, method, title) for method in methods),
        _scale("error", 0, layer.error_high, error_unit(layer.name), "≥ "),
        _scale("depth", layer.low, layer.high, "m", "") if depth else None,
    )


def _prediction(layer: _Layer, view: gc.View, method: MethodEvidence, title: str) -> Tile:
    values, note = usable_layer(method, view, layer.name)
    if values is None:
        status, _, reason = note.partition(": ")
        return Tile(missing=status, note=reason)
    return Tile(_show(layer, values, f"{title}, {view.name}: {method.method}"), note=note)


def _error(layer: _Layer, view: gc.View, method: MethodEvidence, title: str) -> Tile:
    error = layer.errors.get((view.name, method.method))
    if error is None:
        return Tile()
    typical = float(np.nanmean(error)) if np.isfinite(error).any() else float("nan")
    alt = f"error of {title}, {view.name}: {method.method}, mean {format_number(typical)}"
    return Tile(mapped_picture(shrink(error, MAX_SIDE), 0, layer.error_high, "error", alt))


def _show(layer: _Layer, values: np.ndarray, alt: str) -> Picture:
    small = shrink(values.astype(np.float64), MAX_SIDE)
    match layer.name:
        case "normal":
            return display_picture((small + 1) / 2, alt)
        case "depth":
            small = np.where(np.isfinite(small), small, np.nan)
            return mapped_picture(small, layer.low, layer.high, "depth", alt)
        case "base_color":
            return display_picture(gc.srgb_encode(small), alt)
        case _:
            return linear_picture(small * layer.exposure, alt)


def _scale(name: str, low: float, high: float, unit: str, more: str) -> Scale:
    ends = format_number(low), more + format_number(high)
    colours = "depth" if name == "depth" else "error"
    return Scale(colour_bar(colours, f"colour bar from {ends[0]} to {ends[1]} {unit}"), *ends, unit)


def _value_range(images: Sequence[np.ndarray]) -> tuple[float, float]:
    finite = np.concatenate([i[np.isfinite(i)] for i in images])
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)


def _thumbnail(scene: SceneEvidence, view: gc.View) -> Picture:
    small = shrink(scene.capture.photograph(view), THUMBNAIL_SIDE)
    return linear_picture(small * scene.capture.exposure, f"training photograph {view.name}")


def _spread(views: Sequence[gc.View], most: int) -> list[gc.View]:
    """At most ``most`` views, evenly chosen from first to last."""
    if len(views) <= most:
        return list(views)
    return [views[round(i)] for i in np.linspace(0, len(views) - 1, most)]

# SPDX-License-Identifier: Apache-2.0
"""The pictures of a scene: the truth, what each method says instead, and where that is wrong."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

import graycard as gc
from graycard.reports._error_images import error_image, noise_ratio_image, shared_scale
from graycard.reports._evidence import MethodEvidence, SceneEvidence, usable_layer
from graycard.reports._layer_rows import JudgedLayer, LayerRow, layer_row
from graycard.reports._pictures import Picture, linear_picture, shrink

SHOWN_LAYERS = ("radiance", "counterfactual.radiance", "base_color", "normal", "depth")
"""Shown of every scene that has them; after them what else a competing method hands in."""
NEVER_SHOWN = ("object_id", "position", "distance", "pure")
"""Not part of what a method takes apart, or the same as another layer."""
THUMBNAIL_SIDE = 64
MAX_THUMBNAILS = 6


@dataclass(frozen=True, slots=True)
class ViewPictures:
    """All layers of one test view."""

    name: str
    rows: tuple[LayerRow, ...]


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
    layers = [_judge(name, scene, methods) for name in _shown_names(scene, methods)]
    views = tuple(
        ViewPictures(view.name, tuple(layer_row(layer, view, scene, methods) for layer in layers))
        for view in scene.shown
    )
    return Gallery(tuple(_thumbnail(scene, view) for view in photographs), views)


def _shown_names(scene: SceneEvidence, methods: Sequence[MethodEvidence]) -> list[str]:
    if not scene.shown:
        return []
    true = set.intersection(*(set(scene.layers[v.name]) for v in scene.shown))
    given = {name for m in methods if m.competes for layers in m.layers.values() for name in layers}
    more = sorted(n for n in true & given if n not in (*SHOWN_LAYERS, *NEVER_SHOWN) and _is_value(n))
    return [name for name in SHOWN_LAYERS if name in true] + more


def _is_value(name: str) -> bool:
    """Whether a layer is a quantity of its own, no statistic of another."""
    return not name.endswith((".var", ".half_a", ".half_b"))


def _judge(name: str, scene: SceneEvidence, methods: Sequence[MethodEvidence]) -> JudgedLayer:
    errors: dict[tuple[str, str], np.ndarray] = {}
    ratios: dict[tuple[str, str], np.ndarray] = {}
    for view in scene.shown:
        true, mask = scene.layers[view.name][name], scene.mask(name, view)
        variance = scene.layers[view.name].get(f"{name}.var")
        for method in methods:
            values, _ = usable_layer(method, view, name)
            if values is None:
                continue
            errors[view.name, method.method] = error_image(name, values, true, mask, scene.truth.exposure)
            if variance is not None:
                ratios[view.name, method.method] = noise_ratio_image(values, true, variance, mask)
    low, high = _value_range([scene.layers[v.name][name] for v in scene.shown])
    scale = shared_scale(list(errors.values()))
    return JudgedLayer(name, scene.truth.exposure, errors, ratios, scale, low, high)


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

# SPDX-License-Identifier: Apache-2.0
"""The pictures of a scene: the truth, what each method says instead, and where that is wrong."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from graycard import View
from graycard.reports._evidence import MethodEvidence, SceneEvidence
from graycard.reports.pictures._changed_pictures import changed_rows
from graycard.reports.pictures._layer_rows import LayerRow, judged_layer, layer_row
from graycard.reports.pictures._pictures import PagePicture, light_picture, shrink

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

    thumbnails: tuple[PagePicture, ...]
    views: tuple[ViewPictures, ...]


def build_gallery(scene: SceneEvidence, methods: Sequence[MethodEvidence]) -> Gallery:
    """Return the pictures of a scene, with one error scale a layer for all methods and views.

    Raises:
        DatasetError: A training photograph is missing or broken.
    """
    photographs = _spread(scene.capture.train, MAX_THUMBNAILS)
    layers = [judged_layer(name, scene, methods) for name in _shown_names(scene, methods)]
    changed = changed_rows(scene, methods)
    views = tuple(
        ViewPictures(
            view.name,
            tuple(layer_row(layer, view, scene, methods) for layer in layers) + (() if i else changed),
        )
        for i, view in enumerate(scene.shown)
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
    """Return whether a layer is a quantity of its own, no statistic of another."""
    return not name.endswith((".var", ".half_a", ".half_b"))


def _thumbnail(scene: SceneEvidence, view: View) -> PagePicture:
    small = shrink(scene.capture.photograph(view), THUMBNAIL_SIDE)
    return light_picture(small * scene.capture.exposure, f"training photograph {view.name}")


def _spread(views: Sequence[View], most: int) -> list[View]:
    """At most ``most`` views, evenly chosen from first to last."""
    if len(views) <= most:
        return list(views)
    return [views[round(i)] for i in np.linspace(0, len(views) - 1, most)]

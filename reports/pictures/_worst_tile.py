# SPDX-License-Identifier: Apache-2.0
"""Worst tile: where each method is most wrong in a scene: one square of one view, enlarged, and what
explains it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from graycard import View, srgb_encode
from graycard.reports._evidence import MethodEvidence, SceneEvidence, usable_layer
from graycard.reports._explanations import Explanation, explain, scene_properties
from graycard.reports._format import format_number
from graycard.reports.pictures._error_images import error_image, error_unit, shared_scale
from graycard.reports.pictures._layer_rows import title_of
from graycard.reports.pictures._pictures import (
    PagePicture,
    coloured_picture,
    shrink,
    sketch_picture,
)

TILED_LAYERS = ("base_color", "radiance", "counterfactual.radiance", "normal")
LEAST_SIDE = 8
MAX_REGION = 64
"""Pixels of an enlarged picture; larger ones are averaged down."""


@dataclass(frozen=True, slots=True)
class Tile:
    """A square of a view with the largest mean error."""

    row: int
    column: int
    side: int
    """Pixels."""
    mean: float
    """Mean of the error over its pixels inside the mask, in the unit of the error."""

    def region(self, shape: tuple[int, ...]) -> tuple[slice, slice]:
        """Rows and columns of the tile and of one more side all around, as far as the picture goes."""
        starts = max(self.row - self.side, 0), max(self.column - self.side, 0)
        ends = min(self.row + 2 * self.side, shape[0]), min(self.column + 2 * self.side, shape[1])
        return slice(starts[0], ends[0]), slice(starts[1], ends[1])


@dataclass(frozen=True, slots=True)
class WorstTile:
    """The worst square of a method in one layer, with the pictures of its surroundings."""

    method: str
    title: str
    """Name of the layer."""
    where: str
    how_wrong: str
    reason: str
    """Explanation of the error, or that nothing explains it."""
    truth: PagePicture
    prediction: PagePicture
    error: PagePicture
    explanation: PagePicture | None
    frame: tuple[float, float, float]
    """Left, top and side of the tile in the pictures, as shares of their width."""


@dataclass(frozen=True, slots=True)
class MethodTiles:
    """The worst tiles of a method; none where it is exact or hands in no such layer."""

    method: str
    tiles: tuple[WorstTile, ...]


@dataclass(frozen=True, slots=True)
class _Found:
    """The worst tile so far."""

    view: str
    tile: Tile
    times: float
    """Its mean error over that of the view."""
    explanation: Explanation | None
    truth: np.ndarray
    prediction: np.ndarray
    error: np.ndarray
    """All three of the whole view."""


def worst_tile(error: np.ndarray) -> Tile | None:
    """Return the square with the largest mean error; of an exact prediction None.

    Its side is an eighth of the picture's shorter one. Squares less than half inside the mask do not
    enter: their mean is over too few pixels.

    Args:
        error: shape ``(H, W)``; NaN outside the mask.
    """
    side = min(max(min(error.shape) // 8, LEAST_SIDE), *error.shape)
    judged = np.isfinite(error)
    counts, sums = _box_sums(judged.astype(np.float64), side), _box_sums(np.where(judged, error, 0.0), side)
    means = np.where(counts >= side * side / 2, sums / np.maximum(counts, 1), 0.0)
    row, column = np.unravel_index(int(means.argmax()), means.shape)
    mean = float(means[row, column])
    return Tile(int(row), int(column), side, mean) if mean > 1e-6 else None


def find_worst_tiles(scene: SceneEvidence, methods: Sequence[MethodEvidence]) -> tuple[MethodTiles, ...]:
    """Return the worst tile of each method in each layer that is scored, over all test views.

    A layer that is exact everywhere, or not provided, has none.

    Raises:
        DatasetError: The truth of a view is missing or broken.
    """
    found: dict[tuple[str, str], _Found] = {}
    for view in scene.test:
        here = scene.at(view)
        properties = scene_properties(here.layers[view.name], view)
        for method in methods:
            for layer, candidate in _candidates(here, method.at(view), view, properties):
                best = found.get((method.method, layer))
                if best is None or candidate.tile.mean > best.tile.mean:
                    found[method.method, layer] = candidate
    highs = {n: shared_scale([f.error for (_, of), f in found.items() if of == n]) for n in TILED_LAYERS}
    return tuple(
        MethodTiles(
            method.method,
            tuple(
                _draw(method.method, name, found[method.method, name], scene, highs[name])
                for name in TILED_LAYERS
                if (method.method, name) in found
            ),
        )
        for method in methods
    )


def _candidates(
    scene: SceneEvidence, method: MethodEvidence, view: View, properties: Mapping[str, np.ndarray]
) -> Iterator[tuple[str, _Found]]:
    """Yield the worst tile of each layer in one view."""
    for name in TILED_LAYERS:
        true = scene.layers[view.name].get(name)
        values, _ = usable_layer(method, view, name, scene.mask(name, view))
        if true is None or values is None:
            continue
        error = error_image(name, values, true, scene.mask(name, view), scene.truth.exposure)
        tile = worst_tile(error)
        if tile:
            cause = explain(error, properties, tile.region(error.shape))
            times = tile.mean / float(np.nanmean(error))
            yield name, _Found(view.name, tile, times, cause, true, values, error)


def _draw(method: str, name: str, found: _Found, scene: SceneEvidence, high: float) -> WorstTile:
    tile, region = found.tile, found.tile.region(found.error.shape)
    size = region[0].stop - region[0].start, region[1].stop - region[1].start
    title, width = title_of(name), size[1]
    where = f"{found.view}, row {tile.row}, column {tile.column}, {tile.side} × {tile.side} pixels"
    cause, reason = found.explanation, _reason(found.explanation)
    return WorstTile(
        method,
        title,
        where,
        f"mean error {format_number(tile.mean)} {error_unit(name)}, {found.times:.1f} × that of the view",
        reason,
        _enlarge(name, found.truth[region], scene, f"{title}, worst tile of {method}: truth"),
        _enlarge(name, found.prediction[region], scene, f"{title}, worst tile of {method}"),
        _map(found.error[region], 0, high, f"error of {title}, worst tile of {method}, up to {high:g}"),
        None if cause is None else _range_map(cause.values[region], f"{cause.name}, worst tile of {method}"),
        (
            (tile.column - region[1].start) / width,
            (tile.row - region[0].start) / width,
            tile.side / width,
        ),
    )


def _reason(cause: Explanation | None) -> str:
    if cause is None:
        return "no layer explains it"
    way = "rises" if cause.correlation > 0 else "falls"
    return f"{way} with: {cause.name} (rank correlation {cause.correlation:+.2f})".replace("-", "−")


def _enlarge(name: str, values: np.ndarray, scene: SceneEvidence, alt: str) -> PagePicture:
    small = shrink(values.astype(np.float64), MAX_REGION)
    if name == "normal":
        return sketch_picture((small + 1) / 2, alt)
    exposure = scene.truth.exposure if "radiance" in name else 1.0
    return sketch_picture(srgb_encode(small * exposure), alt)


def _map(values: np.ndarray, low: float, high: float, alt: str) -> PagePicture:
    return coloured_picture(shrink(values, MAX_REGION), low, high, "error", alt)


def _range_map(values: np.ndarray, alt: str) -> PagePicture:
    finite = values[np.isfinite(values)]
    return coloured_picture(
        shrink(values, MAX_REGION), float(finite.min()), float(finite.max()), "depth", alt
    )


def _box_sums(values: np.ndarray, side: int) -> np.ndarray:
    """Sum over each square of a side, shape ``(H - side + 1, W - side + 1)``, by a summed-area table."""
    table = np.pad(values.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    return table[side:, side:] - table[:-side, side:] - table[side:, :-side] + table[:-side, :-side]

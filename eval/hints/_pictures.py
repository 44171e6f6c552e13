# SPDX-License-Identifier: Apache-2.0
"""Hints about whole pictures: mirrored, moved, exchanged, rounded, clipped, or the wrong part removed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import NamedTuple

import numpy as np

from graycard import PredictionError, luminance, srgb_encode
from graycard.eval.scoring._readings import PredictedView, TrueView

_RATIO = 0.4
_HALF_RATIO = 0.6
"""For moves: half a pixel cannot be undone exactly."""
_CROP = 192
"""Side in pixels of the middle of the picture in which moves are looked for."""
_GRID = 8
"""Cells along each side of the thumbnails by which views are told apart."""
_FLIPS = {"left and right": np.s_[:, ::-1], "top and bottom": np.s_[::-1]}


_LAYERS = ("base_color", "normal", "depth", "roughness", "metallic")
"""Layers that are looked at beside radiance; the first tells views apart where there is no radiance."""
_SIDE = 48
"""Rows and columns, about, of the small pictures by which views are told apart without radiance."""
_ORDER = "views in their order: --order name, or a file with their names"


class Stamp(NamedTuple):
    """A small picture of a layer: predicted, true, and where it is judged."""

    layer: str
    predicted: np.ndarray
    true: np.ndarray
    mask: np.ndarray


@dataclass(frozen=True, slots=True)
class Looks:
    """Evidence of one view on mistakes with whole pictures."""

    view: str
    thumbnails: tuple[np.ndarray, np.ndarray] | None = None
    """Predicted and true, each ``(8, 8)``, less for a tiny picture; None without radiance."""
    flips: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    """By layer: the error as it is, and mirrored in each way."""
    moves: tuple[tuple[tuple[float, float], float], ...] = ()
    """Error after each move (down, right) in pixels."""
    says: tuple[tuple[str, str], ...] = ()
    """Layer and hint of what a view tells by itself."""
    stamp: Stamp | None = None
    """Picture of a layer, where there is no radiance."""


def look(predicted: PredictedView, true: TrueView, exposure: float) -> Looks:
    """Look at one view; what is not fit to be scored is passed over."""
    says = tuple(
        _rounded("base_color", predicted, true) + _clipped(predicted, true) + _inverted(predicted, true)
    )
    flips = {layer: found for layer in _LAYERS if (found := _mirrored(layer, predicted, true))}
    p = _fit(predicted, true, "radiance")
    if p is None or "radiance" not in true.layers:
        stamps = (_stamp(layer, predicted, true) for layer in _LAYERS)
        stamp = next((stamp for stamp in stamps if stamp is not None), None)
        return Looks(true.view.name, flips=flips, says=says, stamp=stamp)
    a, b = (srgb_encode(luminance(image) * exposure) for image in (p, true.take("radiance")))
    flips = {"radiance": tuple(_rms(a[way] - b) for way in (np.s_[:, :], *_FLIPS.values())), **flips}
    return Looks(true.view.name, (_thumbnail(a), _thumbnail(b)), flips, _moves(a, b), says)


def picture_hints(looks: Sequence[Looks]) -> list[tuple[str, str, str]]:
    """Layer, hint, and what to declare instead, where most of the views say the same."""
    seen = [x for x in looks if x.thumbnails is not None]
    found = [("radiance", says, _ORDER) for says in _exchanged(seen)] if seen else []
    found = found or _exchanged_layers([x for x in looks if x.stamp is not None])
    if not found:
        found = _flipped(looks)
    if seen and not any(layer == "radiance" for layer, _, _ in found):
        found += [("radiance", says, "") for says in _moved(seen)]
    candidates = dict.fromkeys(says for x in looks for says in x.says)
    return found + [(*says, "") for says in candidates if sum(says in x.says for x in looks) > len(looks) / 2]


def _raw(layer: str, predicted: PredictedView, true: TrueView) -> tuple[np.ndarray, np.ndarray] | None:
    """Return a layer as predicted, 0 where it is not finite, and its mask; None where it has another size."""
    values = predicted.layers.get(layer)
    if values is None or layer not in true.layers or values.shape != true.layers[layer].shape:
        return None
    mask = true.mask(layer)
    found = np.nan_to_num(values.astype(np.float64), nan=0.0, posinf=0.0, neginf=0.0)
    return (found, mask) if mask.any() else None


def _mirrored(layer: str, predicted: PredictedView, true: TrueView) -> tuple[float, ...]:
    """Return the error of a layer as it is, and mirrored in each way, where it is judged."""
    seen = _raw(layer, predicted, true)
    if seen is None:
        return ()
    values, mask = seen
    t = true.take(layer)[mask]
    return tuple(_rms(values[way][mask] - t) for way in (np.s_[:, :], *_FLIPS.values()))


def _stamp(layer: str, predicted: PredictedView, true: TrueView) -> Stamp | None:
    """Return every n-th pixel of a layer, by which views are told apart."""
    seen = _raw(layer, predicted, true)
    if seen is None:
        return None
    values, mask = seen
    step = np.s_[:: max(1, mask.shape[0] // _SIDE), :: max(1, mask.shape[1] // _SIDE)]
    return Stamp(layer, values[step], true.take(layer)[step], mask[step])


def _fit(predicted: PredictedView, true: TrueView, layer: str) -> np.ndarray | None:
    """Return a layer that is fit to be scored, ``(H, W)`` or ``(H, W, 3)``, float64; None without one."""
    if layer not in predicted.layers:
        return None
    try:
        return np.asarray(predicted.take(layer, true.mask(layer)), np.float64)
    except PredictionError:
        return None


def _exchanged(looks: Sequence[Looks]) -> list[str]:
    """Return views whose prediction is far closer to what another view sees."""
    pairs = [x.thumbnails for x in looks if x.thumbnails is not None]
    return _named([x.view for x in looks], np.array([[_rms(p - t) for _, t in pairs] for p, _ in pairs]))


def _exchanged_layers(looks: Sequence[Looks]) -> list[tuple[str, str, str]]:
    """Return the same by another layer than radiance."""
    stamps = [x.stamp for x in looks if x.stamp is not None]
    if not stamps or len({stamp.layer for stamp in stamps}) > 1:
        return []
    costs = np.array([[_cost(a, b) for b in stamps] for a in stamps])
    return [(stamps[0].layer, says, _ORDER) for says in _named([x.view for x in looks], costs)]


def _cost(one: Stamp, other: Stamp) -> float:
    """Return the error of a view's prediction against what another sees."""
    if one.predicted.shape != other.true.shape or not other.mask.any():
        return np.inf
    return _rms((one.predicted - other.true)[other.mask])


def _named(views: Sequence[str], costs: np.ndarray) -> list[str]:
    """Say which view shows which, by the error of each prediction (row) against each truth (column)."""
    other = costs.argmin(axis=1)
    wrong = [i for i, j in enumerate(other) if costs[i, j] < _RATIO * costs[i, i]]
    if 2 * len(wrong) < len(views) or len(wrong) < 2 or len({other[i] for i in wrong}) < len(wrong):
        return []  # a picture that is the same for all views is close to one of them
    named = ", ".join(f"{views[i]} shows {views[other[i]]}" for i in wrong[:3])
    return [f"views look exchanged: {named}"]


def _flipped(looks: Sequence[Looks]) -> list[tuple[str, str, str]]:
    """Layers that are mirrored; the others are not named where the pictures are."""
    found = []
    for layer in ("radiance", *_LAYERS):
        errors = np.array([x.flips[layer] for x in looks if layer in x.flips])
        if not len(errors):
            continue
        mean = errors.mean(axis=0)
        ways = [way for way, error in zip(_FLIPS, mean[1:], strict=True) if error < _RATIO * mean[0]]
        declare = {"top and bottom": "bottom-up, or leave it out"}
        found += [(layer, way, declare.get(way, "")) for way in ways[:1]]
    if any(layer == "radiance" for layer, _, _ in found):
        found = [entry for entry in found if entry[0] == "radiance"]
    return [
        (
            layer,
            f"{'pictures look' if layer == 'radiance' else f'{layer} looks'} mirrored: {way} are exchanged",
            d,
        )
        for layer, way, d in found
    ]


def _moved(looks: Sequence[Looks]) -> list[str]:
    errors: dict[tuple[float, float], float] = {}
    for moves in (x.moves for x in looks):
        for move, error in moves:
            errors[move] = errors.get(move, 0.0) + error
    if not errors:
        return []
    best = min(errors, key=lambda move: errors[move])
    if not errors[best] < _HALF_RATIO * errors[0.0, 0.0]:
        return []
    down, right = (0.0 - step for step in best)
    return [
        f"pictures look moved by {down:g} pixels down and {right:g} right: the centre of pixel (i, j) is at "
        "x = j + 0.5, y = i + 0.5"
    ]


def _moves(a: np.ndarray, b: np.ndarray) -> tuple[tuple[tuple[float, float], float], ...]:
    """Errors of ``a``, moved by up to a pixel, against ``b``; both blurred to make halves comparable."""
    middle = tuple(slice(max(0, (n - _CROP) // 2), max(0, (n - _CROP) // 2) + _CROP) for n in a.shape)
    a, b = a[middle], b[middle]
    if min(a.shape) < _GRID:
        return ()
    still = _along(_along(b, 0, 0.0), 1, 0.0)
    steps = (-1.0, -0.5, 0.0, 0.5, 1.0)
    return tuple(((d, r), _rms(_along(_along(a, 0, d), 1, r) - still)) for d, r in product(steps, steps))


def _along(image: np.ndarray, axis: int, step: float) -> np.ndarray:
    """Return the image without two pixels at both ends, moved along an axis by linear interpolation.

    Whole steps are blurred by (1, 2, 1) / 4, half ones by (1, 1) / 2: half a pixel that was lost by linear
    interpolation and half a pixel won back so are the former together.
    """
    n = image.shape[axis]

    def at(offset: int) -> np.ndarray:
        return np.take(image, range(2 - offset, n - 2 - offset), axis=axis)

    if step % 1:
        return (at(int(step - 0.5)) + at(int(step + 0.5))) / 2
    whole = int(step)
    return (at(whole - 1) + 2 * at(whole) + at(whole + 1)) / 4


def _thumbnail(image: np.ndarray) -> np.ndarray:
    """Return the means over the cells of a grid, shape ``(8, 8)``; less where there are fewer pixels."""
    down, right = (min(_GRID, size) for size in image.shape)
    rows = np.array_split(image, down, axis=0)
    return np.array([[cell.mean() for cell in np.array_split(row, right, axis=1)] for row in rows])


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _rounded(layer: str, predicted: PredictedView, true: TrueView) -> list[tuple[str, str]]:
    """Return a hint if all values are whole numbers of 255, which the true ones are not."""
    values = _fit(predicted, true, layer)
    if values is None or layer not in true.layers:
        return []
    mask = true.mask(layer)
    ways: dict[str, Callable[[np.ndarray], np.ndarray]] = {"": np.asarray, ", sRGB-encoded": srgb_encode}
    for name, encode in ways.items():
        codes = encode(values[mask]) * 255
        if not _whole(codes) or len(np.unique(np.round(codes))) < 8:
            continue
        if not _whole(encode(true.take(layer)[mask]) * 255):
            return [(layer, f"{layer} looks rounded to 8 bits{name}: write floating point")]
    return []


def _whole(codes: np.ndarray) -> bool:
    return bool((np.abs(codes - np.round(codes)) < 0.01).all())


def _clipped(predicted: PredictedView, true: TrueView) -> list[tuple[str, str]]:
    """Return a hint if radiance ends at exactly 1 where the true one goes on."""
    values = _fit(predicted, true, "radiance")
    if values is None or "radiance" not in true.layers or abs(float(values.max()) - 1) > 1e-6:
        return []
    top = values >= values.max()
    above = true.take("radiance")[top] > 1
    if top.sum() < 10 or above.mean() < 0.9:
        return []
    return [("radiance", "radiance looks clipped at 1: write what is brighter, too")]


def _inverted(predicted: PredictedView, true: TrueView) -> list[tuple[str, str]]:
    """Return a hint if the object is kept as it is and all else was changed."""
    layer = "counterfactual.radiance"
    values = _fit(predicted, true, layer)
    if values is None or not {layer, "effect.footprint"} <= true.layers.keys():
        return []
    inside = true.take("effect.footprint") > 0.5
    o, c = true.take("radiance"), true.take(layer)
    if not inside.any() or inside.all():
        return []
    kept = _rms(values[inside] - o[inside]) < 0.25 * _rms(values[inside] - c[inside])
    spoilt = _rms(values[~inside] - c[~inside]) > 2 * _rms((o - c)[~inside])
    if not (kept and spoilt):
        return []
    return [(layer, f"{layer} keeps the object and changes the rest: is the mask inverted?")]

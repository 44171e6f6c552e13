# SPDX-License-Identifier: Apache-2.0
"""Hints about whole pictures: mirrored, moved, exchanged, rounded, clipped, or the wrong part removed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

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


@dataclass(frozen=True, slots=True)
class Looks:
    """Evidence of one view on mistakes with whole pictures."""

    view: str
    thumbnails: tuple[np.ndarray, np.ndarray] | None = None
    """Predicted and true, each ``(8, 8)``, less for a tiny picture; None without radiance."""
    flips: tuple[float, ...] = ()
    """Error as it is, and mirrored in each way."""
    moves: tuple[tuple[tuple[float, float], float], ...] = ()
    """Error after each move (down, right) in pixels."""
    says: tuple[tuple[str, str], ...] = ()
    """Layer and hint of what a view tells by itself."""


def look(predicted: PredictedView, true: TrueView, exposure: float) -> Looks:
    """Look at one view; what is not fit to be scored is passed over."""
    says = tuple(
        _rounded("base_color", predicted, true) + _clipped(predicted, true) + _inverted(predicted, true)
    )
    p = _fit(predicted, true, "radiance")
    if p is None or "radiance" not in true.layers:
        return Looks(true.view.name, says=says)
    a, b = (srgb_encode(luminance(image) * exposure) for image in (p, true.take("radiance")))
    flips = tuple(_rms(a[way] - b) for way in (np.s_[:, :], *_FLIPS.values()))
    return Looks(true.view.name, (_thumbnail(a), _thumbnail(b)), flips, _moves(a, b), says)


def picture_hints(looks: Sequence[Looks]) -> list[tuple[str, str]]:
    """Layer and hint, where most of the views say the same."""
    seen = [x for x in looks if x.thumbnails is not None]
    found = [*_exchanged(seen), *_flipped(seen)] if seen else []
    if seen and not found:
        found += _moved(seen)
    candidates = dict.fromkeys(says for x in looks for says in x.says)
    return [("radiance", says) for says in found] + [
        says for says in candidates if sum(says in x.says for x in looks) > len(looks) / 2
    ]


def _fit(predicted: PredictedView, true: TrueView, layer: str) -> np.ndarray | None:
    """Return a layer that is fit to be scored, ``(H, W)`` or ``(H, W, 3)``, float64; None without one."""
    if layer not in predicted.layers:
        return None
    try:
        return np.asarray(predicted.take(layer, true.mask(layer)), np.float64)
    except PredictionError:
        return None


def _exchanged(looks: Sequence[Looks]) -> list[str]:
    """Views whose prediction is far closer to what another view sees."""
    pairs = [x.thumbnails for x in looks if x.thumbnails is not None]
    costs = np.array([[_rms(p - t) for _, t in pairs] for p, _ in pairs])
    other = costs.argmin(axis=1)
    wrong = [i for i, j in enumerate(other) if costs[i, j] < _RATIO * costs[i, i]]
    if 2 * len(wrong) < len(looks) or len(wrong) < 2 or len({other[i] for i in wrong}) < len(wrong):
        return []  # a picture that is the same for all views is close to one of them
    named = ", ".join(f"{looks[i].view} shows {looks[other[i]].view}" for i in wrong[:3])
    return [f"views look exchanged: {named}"]


def _flipped(looks: Sequence[Looks]) -> list[str]:
    errors = np.array([x.flips for x in looks]).mean(axis=0)
    ways = [way for way, error in zip(_FLIPS, errors[1:], strict=True) if error < _RATIO * errors[0]]
    return [f"pictures look mirrored: {way} are exchanged" for way in ways[:1]]


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
    """The image without two pixels at both ends, moved along an axis by linear interpolation.

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

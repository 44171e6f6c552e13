# SPDX-License-Identifier: Apache-2.0
"""Declare one layer of other code's outputs: where its files are, and the convention of their values."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from graycard._errors import PredictionError, UnknownNameError
from graycard.layers import Layer, find_layer

Axes = Literal["world", "world-y-up", "camera-opencv", "camera-opengl"]
Along = Literal["z", "distance", "inverse"]
DEPTH, NORMALS = "depth", ("normal", "counterfactual.normal")

_WORDS: Mapping[str, Mapping[str, Any]] = {
    "linear": {"curve": "linear"},
    "srgb": {"curve": "srgb"},
    "exposed": {"exposed": True},
    "world": {"axes": "world"},
    "world-y-up": {"axes": "world-y-up"},
    "camera-opencv": {"axes": "camera-opencv"},
    "camera-opengl": {"axes": "camera-opengl"},
    "coded": {"coded": True},
    "z": {"along": "z"},
    "distance": {"along": "distance"},
    "inverse": {"along": "inverse"},
    "bottom-up": {"bottom_up": True},
    "codes": {"codes": True},
    "bgr": {"bgr": True},
    "channels-first": {"channels_first": True},
    "drop-alpha": {"drop_alpha": True},
}
"""Words that may follow a pattern, with what each sets."""
MEANINGS = {
    "linear, srgb, gamma2.2": "curve of the values; any number may follow gamma",
    "exposed": "radiance was multiplied by the scene's exposure, as the photographs of `graycard export` are",
    "world, world-y-up": "axes of normals: the scene's own (z up), or those with y up",
    "camera-opencv, camera-opengl": "axes of normals: the camera's, y and z down and forward, or up and back",
    "coded": "normals are stored as (n + 1) / 2",
    "z, distance, inverse": "depth is along the optical axis, along the ray, or 1 / z",
    "times=0.001": "multiply the values first, as for millimetres or another unit of the world",
    "codes": "whole numbers are values, and no share of the largest code",
    "bottom-up": "the first row is the lowest one",
    "bgr, channel=0": "order of colours; or which channel holds a layer of one channel",
    "panel=1/3": "the picture is the first of three, side by side in one file",
    "channels-first": "arrays are (C, H, W), as PyTorch has them",
    "drop-alpha": "leave out an alpha channel that is not opaque",
    "key=albedo": "name of the array in an NPZ, or of the layer in an EXR; may hold {view}",
}
"""Words as a reader is told them."""
_GAMMA = re.compile(r"gamma(\d+(?:\.\d+)?)")
_PANEL = re.compile(r"(\d+)/(\d+)")
_ROUND = 1e-4
"""Share by which a factor that was found may differ from the short number that it is told as."""
_COLON = re.compile(r":(?![^{}]*\})")
"""A colon that stands outside of braces."""


@dataclass(frozen=True, slots=True)
class LayerMap:
    """Place and convention of a layer of other code."""

    layer: str
    """Name in graycard."""
    pattern: str
    """Path below the folder, with ``{view}``, ``{index}``, ``{split}`` and ``*``."""
    curve: str = ""
    """``linear``, ``srgb``, ``gamma2.2`` and the like; empty where nothing was declared."""
    exposed: bool = False
    axes: Axes | Literal[""] = ""
    coded: bool = False
    along: Along | Literal[""] = ""
    times: float = 1.0
    codes: bool = False
    bottom_up: bool = False
    bgr: bool = False
    channel: int | None = None
    panel: tuple[int, int] = (1, 1)
    channels_first: bool = False
    drop_alpha: bool = False
    key: str = ""
    words: tuple[str, ...] = ()
    """Words of the declaration."""

    @property
    def kind(self) -> Layer:
        """The layer that is meant."""
        return find_layer(self.layer)

    def __str__(self) -> str:
        return f"{self.layer}={':'.join((self.pattern, *self.words))}"


def parse_map(text: str) -> LayerMap:
    """Return what ``LAYER=PATTERN:WORD:…`` declares.

    Raises:
        PredictionError: It is malformed, or a word does not go with the layer.
        UnknownNameError: There is no such layer or word.
    """
    layer, equals, rest = text.partition("=")
    if not equals or not layer:
        raise PredictionError(
            f"expected LAYER=PATTERN:WORD…, got {text!r}. Write as base_color=albedo/{{view}}.png:srgb"
        )
    kind = find_layer(layer)
    if kind.dtype != "float32":
        raise PredictionError(f"expected a layer of measured values, got {layer}: ids are not scored")
    pattern, *words = _COLON.split(rest)
    found = LayerMap(layer, pattern, words=tuple(words))
    for word in words:
        found = replace(found, **_meaning(word, text))
    _check_words(found)
    return found


def times_word(declared: LayerMap, factor: float) -> str:
    """Return the word that brings a factor to a layer as it was adopted, in the place of a ``times=`` there.

    Args:
        declared: Declaration by which it was adopted.
        factor: On the layer's values: metres, reflectance, or components of normals.

    Returns:
        Empty where none does, as the values are decoded after they were multiplied.
    """
    if declared.curve.startswith("gamma"):
        on_values = abs(factor) ** (1 / float(declared.curve.removeprefix("gamma")))
    else:
        on_values = 1 / factor if declared.along == "inverse" else factor
    if declared.curve == "srgb" or declared.coded:
        return ""
    product = declared.times * on_values
    short = float(f"{product:.3g}")
    product = short if abs(short - product) < _ROUND * abs(product) else product
    return "the same without times" if product == 1 else f"times={product:.6g}"


def _meaning(word: str, text: str) -> Mapping[str, Any]:
    """Return the fields that one word sets."""
    lower = word.casefold()
    if lower in _WORDS:
        return _WORDS[lower]
    if gamma := _GAMMA.fullmatch(lower):
        if float(gamma[1]) <= 0:
            raise PredictionError(f"expected a gamma above 0 in {text!r}, got {word}")
        return {"curve": lower}
    name, equals, value = word.partition("=")
    if equals and name in _VALUES:
        try:
            return {name: _VALUES[name](value)}
        except ValueError as cause:
            raise PredictionError(f"expected {_EXAMPLES[name]} in {text!r}, got {word!r}: {cause}") from cause
    raise UnknownNameError("word of --map", word, [*_WORDS, "gamma2.2", *_EXAMPLES.values()])


def _factor(value: str) -> float:
    number = float(value)
    if not math.isfinite(number) or number == 0:
        raise ValueError("the factor is finite and not 0")
    return number


def _channel(value: str) -> int:
    if not value.isdecimal() or int(value) > 3:
        raise ValueError("channels are 0 to 3")
    return int(value)


def _panel(value: str) -> tuple[int, int]:
    match = _PANEL.fullmatch(value)
    if match is None or not 1 <= int(match[1]) <= int(match[2]) <= 64:
        raise ValueError("the first number is 1 up to the second")
    return int(match[1]), int(match[2])


def _key(value: str) -> str:
    if not value:
        raise ValueError("the name is not empty")
    return value


_VALUES: Mapping[str, Callable[[str], Any]] = {
    "times": _factor, "channel": _channel, "panel": _panel, "key": _key,
}  # fmt: skip
_EXAMPLES = {"times": "times=0.001", "channel": "channel=0", "panel": "panel=1/3", "key": "key=albedo"}


def _check_words(found: LayerMap) -> None:
    """Refuse words that say nothing about a layer, and layers whose convention nobody can guess.

    Raises:
        PredictionError: There is one.
    """
    is_normal, is_depth = found.layer in NORMALS, found.layer == DEPTH
    if (found.axes or found.coded) and not is_normal:
        raise PredictionError(f"expected axes and coded for normals alone, got them in '{found}'")
    if found.along and not is_depth:
        raise PredictionError(f"expected z, distance or inverse for depth alone, got one in '{found}'")
    if found.curve not in ("", "linear") and (is_normal or is_depth):
        raise PredictionError(f"expected {found.layer} without a curve, got {found.curve} in '{found}'")
    if found.exposed and not found.kind.unit.startswith("W/m²"):
        raise PredictionError(f"expected exposed for light alone, got it in '{found}'")
    if found.bgr and len(found.kind.channels) != 3:
        raise PredictionError(f"expected bgr for colours alone, got it in '{found}'")
    if found.channel is not None and len(found.kind.channels) != 1:
        raise PredictionError(f"expected channel= for a layer of one channel, got it in '{found}'")
    if is_normal and not found.axes:
        raise PredictionError(
            f"expected the axes of normals in '{found}', got none. Add world, world-y-up, camera-opencv or "
            "camera-opengl"
        )
    if is_depth and not found.along:
        raise PredictionError(
            f"expected the kind of depth in '{found}', got none. Add z, distance or inverse"
        )

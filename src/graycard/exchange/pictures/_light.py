# SPDX-License-Identifier: Apache-2.0
"""From stored pixels to linear light of Rec.709, upright or as stored."""

from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np

from graycard._errors import DatasetError
from graycard.colour import srgb_decode
from graycard.exchange.pictures._pixels import LINEAR, Curve, Note, Pixels
from graycard.exchange.pictures._profiles import to_rec709
from graycard.io import REC709

Background = Literal["none", "black", "white"]
"""Light behind transparent pixels; with none they are an error."""


def to_light(pixels: Pixels, path: Path, background: Background) -> tuple[np.ndarray, tuple[Note, ...]]:
    """Return linear light of Rec.709, shape ``(H, W, 3)``, float32, and notes on what was done to it.

    Args:
        pixels: As stored.
        path: Of the file, for messages.
        background: What is put behind transparent pixels, in linear light.

    Raises:
        DatasetError: Light is not finite, pixels are transparent and there is no background, or primaries
            span no colour space.
    """
    alpha, notes = _transparency(pixels, path, background)
    if alpha is None:
        light = _decoded(pixels.values, pixels.encoding.curve)
    else:
        light, lost = _on(background, alpha, pixels)
        notes += lost
    if pixels.bits == 0:
        light = _finite(light, path)
    if light.ndim == 2:
        light = np.repeat(light[..., None], 3, axis=-1)
    if pixels.encoding.primaries != REC709:
        try:
            matrix = to_rec709(pixels.encoding.primaries)
        except ValueError as cause:
            raise DatasetError(f"{cause}, in {path}. Write the right ones or none") from cause
        light = (light @ matrix.T.astype(np.float32)).astype(np.float32)
    if pixels.bits == 0 or pixels.encoding.primaries != REC709:
        light, below = _without_negative(light)
        notes += below
    return light, notes


def _decoded(values: np.ndarray, curve: Curve) -> np.ndarray:
    """Return linear light of stored values of any shape, float32."""
    if values.dtype.kind == "u":
        return _table(values.dtype.str, curve)[values]
    if curve == 1:
        return values
    return (srgb_decode(values) if curve is None else np.clip(values, 0, 1) ** curve).astype(np.float32)


@lru_cache(maxsize=8)
def _table(dtype: str, curve: Curve) -> np.ndarray:
    """Return the light of each value that an integer type has."""
    levels = np.arange(2 ** (8 * np.dtype(dtype).itemsize))
    levels = levels / levels[-1]
    return (srgb_decode(levels) if curve is None else levels**curve).astype(np.float32)


def _transparency(
    pixels: Pixels, path: Path, background: Background
) -> tuple[np.ndarray | None, tuple[Note, ...]]:
    """Return alpha in [0, 1] where it matters, and what is said of it."""
    if pixels.alpha is None:
        return None, ()
    if (pixels.alpha >= pixels.top).all():
        return None, (Note("alpha", "opaque everywhere, left out"),)
    if background == "none":
        share = float((pixels.alpha < pixels.top).mean())
        raise DatasetError(
            f"expected an opaque photograph, got {path} with transparency in {share:.1%} of its pixels. "
            "Remove its alpha, or say what is behind it: --background black or white"
        )
    alpha = np.clip(np.nan_to_num(pixels.alpha.astype(np.float32) / np.float32(pixels.top)), 0, 1)
    return alpha, (Note("alpha", f"transparent pixels are laid on {background}"),)


def _on(background: Background, alpha: np.ndarray, pixels: Pixels) -> tuple[np.ndarray, tuple[Note, ...]]:
    """Return linear light before a background, of which alpha hides a share.

    Light that is multiplied by alpha is what there is, also where alpha is 0, as of a glow: it is added.
    """
    cover = alpha if pixels.values.ndim == 2 else alpha[..., None]
    behind = (1 - cover) * np.float32(background == "white")
    if not pixels.premultiplied:
        light = _decoded(pixels.values, pixels.encoding.curve) * cover
        return (light + behind).astype(np.float32), ()
    stored = pixels.values / np.float32(pixels.top)
    if pixels.encoding.curve == LINEAR:
        return (stored + behind).astype(np.float32), ()
    values = np.divide(stored, cover, out=np.zeros(stored.shape, np.float32), where=cover > 0)
    light = _decoded(values, pixels.encoding.curve) * cover
    lost = (Note("alpha", "light where alpha is 0 was left out", warns=True),)
    return (light + behind).astype(np.float32), lost if (stored * (cover == 0)).any() else ()


def _finite(light: np.ndarray, path: Path) -> np.ndarray:
    if not np.isfinite(light).all():
        bad = int((~np.isfinite(light)).sum())
        raise DatasetError(f"expected finite light in {path}, got {bad} values that are not. Repair it")
    return light


def _without_negative(light: np.ndarray) -> tuple[np.ndarray, tuple[Note, ...]]:
    """Return light of 0 or more: there is no other, but wider primaries and filters give some."""
    if light.min(initial=0) >= 0:
        return light, ()
    return np.maximum(light, 0), (Note("light", "values below 0 became 0", warns=True),)

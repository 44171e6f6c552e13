# SPDX-License-Identifier: Apache-2.0
"""Turn an array of other code into a layer as graycard has it, by what was declared of it."""

import numpy as np

from graycard._camera import Camera
from graycard._errors import PredictionError
from graycard.adoption._declared import DEPTH, NORMALS, LayerMap

_OPENGL = np.array([1.0, -1.0, -1.0])
_KNEE = 0.04045
"""Display value where the sRGB curve changes from a line to a power (IEC 61966-2-1:1999)."""


def to_layer(
    values: np.ndarray, declared: LayerMap, camera: Camera, exposure: float, where: str
) -> np.ndarray:
    """Return the values of a layer, ``(H, W)`` or ``(H, W, 3)``, float32, in graycard's conventions.

    Args:
        values: One view of a file, as it was read.
        declared: Its declaration.
        camera: Of the view.
        exposure: Of the scene.
        where: The file, for messages.

    Raises:
        PredictionError: It has another size or other channels, or whole numbers of unknown meaning.
    """
    picture = _panel(_plain(values, declared, where), declared, where)
    if picture.shape[:2] != (camera.height, camera.width):
        raise PredictionError(
            f"expected {where} to be {camera.width}x{camera.height} pixels, as its view is, got "
            f"{picture.shape[1]}x{picture.shape[0]}. Render it at the size of its camera"
        )
    picture = picture[::-1] if declared.bottom_up else picture
    numbers = _numbers(_channels(picture, declared, where), declared, where) * declared.times
    if declared.layer in NORMALS:
        found = _world_normals(numbers, declared, camera)
    elif declared.layer == DEPTH:
        found = _z(numbers, declared, camera)
    else:
        found = _linear(numbers, declared.curve) / (exposure if declared.exposed else 1.0)
    return np.ascontiguousarray(found, np.float32)


def _plain(values: np.ndarray, declared: LayerMap, where: str) -> np.ndarray:
    """Return rows, columns and, where there are several, channels; axes of one entry at either end go."""
    if declared.channels_first and values.ndim >= 3:
        values = np.moveaxis(values, -3, -1)
    while values.ndim > 3 and values.shape[0] == 1:
        values = values[0]
    if values.ndim == 3 and values.shape[-1] == 1:
        values = values[..., 0]
    if values.ndim == 3 and values.shape[-1] > 4 >= values.shape[0]:
        raise PredictionError(
            f"expected rows, columns, channels in {where}, got shape {values.shape}. Add channels-first"
        )
    if values.ndim not in (2, 3):
        raise PredictionError(f"expected one picture in {where}, got an array of shape {values.shape}")
    return values


def _panel(picture: np.ndarray, declared: LayerMap, where: str) -> np.ndarray:
    number, of = declared.panel
    if picture.shape[1] % of:
        raise PredictionError(
            f"expected {of} pictures side by side in {where}, got {picture.shape[1]} columns. Mend panel="
        )
    width = picture.shape[1] // of
    return picture[:, (number - 1) * width : number * width]


def _channels(picture: np.ndarray, declared: LayerMap, where: str) -> np.ndarray:
    """Return the channels that the layer has, in its order."""
    count, wanted = (1 if picture.ndim == 2 else picture.shape[-1]), len(declared.kind.channels)
    if declared.channel is not None:
        if declared.channel >= count:
            raise PredictionError(
                f"expected channel {declared.channel} in {where}, got {count} channels. Mend channel="
            )
        return picture if picture.ndim == 2 else picture[..., declared.channel]
    if count in (2, 4):
        picture, count = _opaque(picture, declared, where), count - 1
    if wanted == count:
        return picture[..., ::-1] if declared.bgr else picture
    if wanted == 1 and (picture == picture[..., :1]).all():
        return picture[..., 0]
    advice = f"Name one by channel=, or leave out {declared.layer}" if wanted == 1 else "Write all of them"
    raise PredictionError(
        f"expected {wanted} channel{'s' * (wanted > 1)} of {declared.layer} in {where}, got {count}"
        f"{' that differ' * (wanted == 1)}. {advice}"
    )


def _opaque(picture: np.ndarray, declared: LayerMap, where: str) -> np.ndarray:
    """Return a picture without its alpha; grey with alpha loses the channel axis."""
    alpha = picture[..., -1]
    full = np.iinfo(alpha.dtype).max if alpha.dtype.kind == "u" else 1
    if not declared.drop_alpha and not (alpha == full).all():
        share = float((alpha != full).mean())
        raise PredictionError(
            f"expected an opaque picture at {where}, got alpha in {share:.0%} of it. Add drop-alpha if the "
            "colours are not multiplied by it, or write the picture on black"
        )
    return picture[..., 0] if picture.shape[-1] == 2 else picture[..., :-1]


def _numbers(picture: np.ndarray, declared: LayerMap, where: str) -> np.ndarray:
    """Return floating point: codes of 8 or 16 bits as shares of the largest, unless they are values."""
    if picture.dtype.kind == "f":
        return picture.astype(np.float64)
    if declared.codes or picture.dtype == np.bool_:
        return picture.astype(np.float64)
    if picture.dtype not in (np.uint8, np.uint16):
        raise PredictionError(
            f"expected floating point, or 8 or 16 bits, in {where}, got {picture.dtype}. Add codes if the "
            "whole numbers are values"
        )
    _check_codes(declared, picture.dtype, where)
    return picture / np.float64(np.iinfo(picture.dtype).max)


def _check_codes(declared: LayerMap, kind: np.dtype, where: str) -> None:
    """Refuse codes whose meaning nobody declared.

    Raises:
        PredictionError: They are of normals that are not coded, depths, or colours without a curve.
    """
    if declared.layer in NORMALS and not declared.coded:
        raise PredictionError(
            f"expected coded for normals in whole numbers, which have no sign, got {kind} in {where}. Add "
            "coded"
        )
    if declared.layer == DEPTH and declared.times == 1:
        raise PredictionError(
            f"expected times= or codes for depth in whole numbers, got {kind} in {where}. Add "
            "codes:times=0.001 for millimetres, or times= for the depth of the largest code"
        )
    if len(declared.kind.channels) == 3 and declared.layer not in NORMALS and not declared.curve:
        raise PredictionError(
            f"expected a curve for colours in whole numbers, got {kind} in {where}. Add srgb, linear or "
            "gamma2.2"
        )


def _linear(values: np.ndarray, curve: str) -> np.ndarray:
    """Undo a curve; what lies beyond 1 goes on along it, and nothing is cut off."""
    if curve == "srgb":
        power = ((np.maximum(values, _KNEE) + 0.055) / 1.055) ** 2.4
        return np.where(values <= _KNEE, values / 12.92, power)
    if curve.startswith("gamma"):
        return np.sign(values) * np.abs(values) ** float(curve.removeprefix("gamma"))
    return values


def _world_normals(values: np.ndarray, declared: LayerMap, camera: Camera) -> np.ndarray:
    normals = 2 * values - 1 if declared.coded else values
    if declared.axes == "world-y-up":
        return normals[..., [0, 2, 1]] * np.array([1.0, -1.0, 1.0])
    if declared.axes == "world":
        return normals
    local = normals * _OPENGL if declared.axes == "camera-opengl" else normals
    return local @ camera.camera_to_world[:3, :3].T


def _z(values: np.ndarray, declared: LayerMap, camera: Camera) -> np.ndarray:
    if declared.along == "distance":
        return values * (camera.rays() @ camera.forward)
    if declared.along == "inverse":
        return np.divide(1.0, values, out=np.full_like(values, np.inf), where=values > 0)
    return values

# SPDX-License-Identifier: Apache-2.0
"""Mistakes of one layer that can be undone pixel by pixel, each with the inverse that proves it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from graycard import angles, srgb_decode, srgb_encode


@dataclass(frozen=True, slots=True)
class Sight:
    """Camera and exposure, which a mistake may depend on, at the pixels that are looked at."""

    exposure: float
    camera_to_world: np.ndarray
    """Shape ``(3, 3)``: camera axes to the world's."""
    cosine: np.ndarray
    """Cosine of the angle between the ray and the optical axis, shape ``(N, 1)``."""


Values = np.ndarray
"""Shape ``(N, C)``: a layer at the pixels that are looked at."""


@dataclass(frozen=True, slots=True)
class Suspicion:
    """One mistake that can be undone."""

    layer: str
    undo: Callable[[Values, Sight], Values]
    error: Callable[[Values, Values, Sight], float]
    limit: float
    """The error that must be undercut after the inverse."""
    says: str
    declare: str = ""
    """Word for `graycard adopt` to declare instead; empty where it cannot undo the mistake."""


def shape_error(predicted: Values, true: Values, sight: Sight) -> float:
    """Root of the relative square error after the best factor for each channel: no gain matters."""
    square = np.maximum((predicted**2).sum(axis=0), 1e-12)
    scaled = predicted * (predicted * true).sum(axis=0) / square
    return relative_error(scaled, true, sight)


def relative_error(predicted: Values, true: Values, sight: Sight) -> float:
    """Root of the square error over that of a black prediction."""
    return float(np.sqrt(((predicted - true) ** 2).sum() / max((true**2).sum(), 1e-12)))


def display_error(predicted: Values, true: Values, sight: Sight) -> float:
    """Root mean square error as displayed."""
    p, t = (srgb_encode(values * sight.exposure) for values in (predicted, true))
    return float(np.sqrt(np.mean((p - t) ** 2)))


def angle_error(predicted: Values, true: Values, sight: Sight) -> float:
    """Mean angle, degrees."""
    return float(angles(predicted, true).mean())


def median_ratio_error(predicted: Values, true: Values, sight: Sight) -> float:
    """Median of |p - t| / t: a few holes do not matter."""
    return float(np.median(np.abs(predicted - true) / true))


def absolute_error(predicted: Values, true: Values, sight: Sight) -> float:
    """Mean of |p - t|."""
    return float(np.abs(predicted - true).mean())


def _flip(*signs: float) -> Callable[[Values, Sight], Values]:
    return lambda p, sight: p * np.array(signs)


def _times(factor: float) -> Callable[[Values, Sight], Values]:
    return lambda p, sight: p * factor


def _group(
    layer: str,
    error: Callable[[Values, Values, Sight], float],
    limit: float,
    undone: Mapping[str, tuple[Callable[[Values, Sight], Values], str]],
) -> list[Suspicion]:
    return [
        Suspicion(layer, undo, error, limit, f"{layer} {says}", declare)
        for says, (undo, declare) in undone.items()
    ]


def _by_camera(*signs: float) -> Callable[[Values, Sight], Values]:
    """Take normals as those of the camera, after signs, and turn them to the world."""
    return lambda p, sight: (p * signs) @ sight.camera_to_world.T


def _exchanged_camera_axes(p: Values, sight: Sight) -> Values:
    """Turn normals back to the camera, exchange its two conventions, and turn them to the world again."""
    return (p @ sight.camera_to_world * (1, -1, -1)) @ sight.camera_to_world.T


def _undecoded(*signs: float) -> Callable[[Values, Sight], Values]:
    """Undo 2 n - 1 of normals that were turned from the camera, after signs, to the world."""

    def undo(p: Values, sight: Sight) -> Values:
        local = p @ sight.camera_to_world * signs
        return (local + 1) / 2 * signs @ sight.camera_to_world.T

    return undo


_TWICE = "looks decoded twice: it was linear already"
_SRGB, _LINEAR = "srgb", "linear"

SUSPICIONS: tuple[Suspicion, ...] = (
    *_group("base_color", shape_error, 0.3, {
        "looks sRGB-encoded: write linear values": (lambda p, sight: srgb_decode(p), _SRGB),
        _TWICE: (lambda p, sight: srgb_encode(p), _LINEAR),
        "looks like B, G, R: write R, G, B": (lambda p, sight: p[:, ::-1], "bgr, or leave it out"),
    }),
    *_group("base_color", relative_error, 0.15, {
        "looks divided by π: write the reflectance itself": (_times(np.pi), "times=3.14159265"),
        "looks multiplied by π: write the reflectance itself": (_times(1 / np.pi), "times=0.31830989"),
        "looks like 0 to 255: write 0 to 1": (_times(1 / 255), "times=0.0039215686"),
    }),
    *_group("radiance", display_error, 0.1, {
        "looks as displayed (sRGB, exposed): write linear W/m²/sr":
            (lambda p, sight: srgb_decode(p) / sight.exposure, "srgb:exposed"),
        "looks sRGB-encoded: write linear values": (lambda p, sight: srgb_decode(p), _SRGB),
        _TWICE: (lambda p, sight: srgb_encode(p), _LINEAR),
        "looks decoded twice, before the exposure: it was linear already":
            (lambda p, sight: srgb_encode(p * sight.exposure) / sight.exposure, "linear:exposed"),
        "looks sRGB-encoded, then divided by the exposure: write linear W/m²/sr":
            (lambda p, sight: srgb_decode(p * sight.exposure) / sight.exposure, "srgb:exposed"),
        "looks sRGB-encoded, then divided by an exposure that it never had: write linear W/m²/sr":
            (lambda p, sight: srgb_decode(p * sight.exposure), _SRGB),
        "looks decoded twice, and exposed: write linear W/m²/sr":
            (lambda p, sight: srgb_encode(p) / sight.exposure, "linear:exposed"),
        "looks decoded twice, then divided by an exposure that it never had: it was as it should be":
            (lambda p, sight: srgb_encode(p * sight.exposure), _LINEAR),
        "looks multiplied by the exposure: write W/m²/sr": (lambda p, sight: p / sight.exposure, "exposed"),
        "looks divided by the exposure twice: write W/m²/sr":
            (lambda p, sight: p * sight.exposure, "the same without exposed"),
        "looks divided by π: write radiance": (_times(np.pi), "times=3.14159265"),
        "looks multiplied by π: write radiance": (_times(1 / np.pi), "times=0.31830989"),
        "looks like B, G, R: write R, G, B": (lambda p, sight: p[:, ::-1], "bgr, or leave it out"),
    }),
    *_group("normal", angle_error, 20.0, {
        "looks mirrored in x: try (-x, y, z)": (_flip(-1, 1, 1), ""),
        "looks mirrored in y: try (x, -y, z)": (_flip(1, -1, 1), ""),
        "looks mirrored in z: try (x, y, -z)": (_flip(1, 1, -1), ""),
        "looks turned inward: try -n": (_flip(-1, -1, -1), "times=-1"),
        "looks like y up: try (x, -z, y)": (lambda p, sight: p[:, [0, 2, 1]] * (1, -1, 1), "world-y-up"),
        "looks like z up taken for y up: it was as it should be": (
            lambda p, sight: p[:, [0, 2, 1]] * (1, 1, -1), "world"),
        "looks like camera axes (x right, y down): rotate to the world":
            (_by_camera(1, 1, 1), "camera-opencv"),
        "looks like camera axes (x right, y up): rotate to the world":
            (_by_camera(1, -1, -1), "camera-opengl"),
        "looks rotated from the camera (x right, y down), but was in world axes: leave it there":
            (lambda p, sight: p @ sight.camera_to_world, "world"),
        "looks rotated from the camera (x right, y up), but was in world axes: leave it there":
            (lambda p, sight: p @ sight.camera_to_world * (1, -1, -1), "world"),
        "looks rotated from the other kind of camera axes: exchange y up and y down": (
            _exchanged_camera_axes, "camera-opencv for camera-opengl, or the reverse"),
        "looks encoded as (n + 1) / 2: write n": (lambda p, sight: 2 * p - 1, "coded"),
        "looks decoded by 2 n - 1, but was in -1 to 1: write n":
            (lambda p, sight: (p + 1) / 2, "the same without coded"),
        "looks decoded by 2 n - 1 in camera axes (x right, y down), but was in -1 to 1: write n":
            (_undecoded(1, 1, 1), "the same without coded"),
        "looks decoded by 2 n - 1 in camera axes (x right, y up), but was in -1 to 1: write n":
            (_undecoded(1, -1, -1), "the same without coded"),
        "looks like camera axes (x right, y down), encoded as (n + 1) / 2: write n of the world":
            (lambda p, sight: (2 * p - 1) @ sight.camera_to_world.T, "camera-opencv:coded"),
        "looks like camera axes (x right, y up), encoded as (n + 1) / 2: write n of the world":
            (lambda p, sight: ((2 * p - 1) * (1, -1, -1)) @ sight.camera_to_world.T, "camera-opengl:coded"),
    }),
    *_group("depth", median_ratio_error, 0.1, {
        "looks like distance along the ray: write z": (lambda p, sight: p * sight.cosine, "distance"),
        "looks like z that was taken for distance: write z": (lambda p, sight: p / sight.cosine, "z"),
        "looks like 1 / z: write z": (lambda p, sight: 1 / np.maximum(p, 1e-9), "inverse, or z for inverse"),
        "looks like millimetres: write metres": (_times(1e-3), "times=0.001"),
        "looks like centimetres: write metres": (_times(1e-2), "times=0.01"),
        "looks like kilometres: write metres": (_times(1e3), "times=1000"),
    }),
    *_group("roughness", absolute_error, 0.1, {
        "looks like alpha: write its square root":
            (lambda p, sight: np.sqrt(np.maximum(p, 0)), "gamma0.5"),
        "looks squared twice over: write the square root of alpha": (lambda p, sight: p**2, "gamma2"),
        "looks like glossiness: write 1 - p": (lambda p, sight: 1 - p, ""),
    }),
)  # fmt: skip

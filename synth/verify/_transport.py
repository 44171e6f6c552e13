# SPDX-License-Identifier: Apache-2.0
"""Checks of light transport: parts, halves, and the diffuse light that irradiance implies."""

from collections.abc import Iterator

import numpy as np

from graycard.synth._spec import SUB_BUFFERS
from graycard.synth.verify._check import Check
from graycard.synth.verify._comparison import largest_relative
from graycard.synth.verify._statistics import bound_of, z_of_shares
from graycard.synth.verify._subject import Subject, TruePicture
from graycard.synth.verify._values import PARTS

_DIFFUSE = 0.01
"""Tolerance of a sum of light over a view, beside its noise: a value at a pixel's centre stands for its
mean."""

_SIGMAS = 6.0
"""Factor of the noise of a sum over a view."""

_FAINT = 1e-2
"""Share of all diffuse light of a view: what is less is judged as a share of this."""

_ROUNDING = 1e-6
"""Relative noise below which float32 hides how far halves are apart, as in a sky that is seen directly."""

_OUTLINE = 0.05
"""Share of pixels at the outline of a mesh where its interpolated normal turns away from the camera: what is
seen reflects nothing there."""


def check_halves(picture: TruePicture, views: int) -> Iterator[Check]:
    """Check that the halves average to the picture, and differ as much as the variance of the mean says."""
    for name in ("radiance", "counterfactual.radiance"):
        if picture.has(name, f"{name}.half_a", f"{name}.half_b", f"{name}.var"):
            mean, var, a, b = (
                picture.layers[f"{name}{end}"].astype(float) for end in ("", ".var", ".half_a", ".half_b")
            )
            off = largest_relative((a + b) / 2 - mean, mean)
            told = f"the halves of {name} average to it; looks like halves of another picture"
            yield picture.at.judge("halves average", off, 1e-5, "relative", told)
            var = np.where(var > (_ROUNDING * mean) ** 2, var, 0)
            yield _check_variance(picture, name, a - b, var, 2 * views)


def _check_variance(picture: TruePicture, name: str, apart: np.ndarray, var: np.ndarray, tests: int) -> Check:
    """Correction: of n images the two halves take 1 / (n - 1) of the spread, on average, whatever its
    distribution.

    Any way to part the images into halves is as likely; n - 1 of them are orthogonal contrasts that share the
    sum of squares. So ``r = (a - b)² / (4 (n - 1) var)`` is in [0, 1] with the mean ``1 / (n - 1)``, and
    Hoeffding's bound for the mean of independent values in [0, 1] holds.
    """
    noisy = (var > 0).all(axis=-1)
    if not noisy.any():
        return picture.at.skip("variance of the mean", f"{name} has no noise")
    r = (apart[noisy] ** 2 / (4 * (SUB_BUFFERS - 1) * var[noisy])).mean(axis=-1)
    expected = 1 / (SUB_BUFFERS - 1)
    z = z_of_shares(r, expected)
    factor = expected / max(float(r.mean()), 1e-30)
    told = f"{name}.var is the variance of the mean, as its halves tell; {_variance_told(factor)}"
    return picture.at.judge("variance of the mean", z, bound_of(tests), "σ", told)


def _variance_told(factor: float) -> str:
    if factor > 1e3:
        return "looks like identical halves"
    if abs(factor / SUB_BUFFERS - 1) < 0.3:
        return "looks like the variance of one image instead of that of their mean"
    return f"it is {factor:.2f} times as large"


def check_parts(
    subject: Subject, picture: TruePicture, lambertian: frozenset[int] = frozenset()
) -> Iterator[Check]:
    """Check that emitted and all parts add up to radiance, and the diffuse parts are what irradiance implies.

    Args:
        subject: The scene.
        picture: One of its views.
        lambertian: Ids of objects whose diffuse lobe is Lambertian beside another lobe; matte ones are known
            by their layers.
    """
    if not picture.is_split:
        for name in ("parts add up", "diffuse light"):
            yield picture.at.skip(name, "its light is not told apart")
        return
    layers, lights = picture.layers, [light.name for light in subject.lights]
    total = layers["emitted"].astype(float)
    for part in PARTS:
        total = total + np.sum([layers[f"{part}.{name}"] for name in lights], axis=0)
    off = largest_relative(total - layers["radiance"], layers["radiance"])
    told = "emitted and the parts of all lights add up to radiance; looks like a light or lobe left out"
    yield picture.at.judge("parts add up", off, 1e-4, "relative", told)
    yield from _check_matte(subject, picture, lambertian)


def _check_matte(subject: Subject, picture: TruePicture, lambertian: frozenset[int]) -> Iterator[Check]:
    """Check that, where a pixel shows one matte surface, L = albedo x shading, in sum and for each light."""
    layers = picture.layers
    matte = (layers["roughness"] == 1) & (layers["f0"].max(axis=-1) == 0) & (layers["base_color"].max(-1) > 0)
    off = np.abs(layers["albedo"] - layers["diffuse_reflectance"]).max(axis=-1)[matte]
    told = "the albedo of a matte surface is its diffuse reflectance; looks like another convention"
    if matte.any():
        share = float((off > 1e-3).mean())
        yield picture.at.judge("albedo of matte surfaces", share, _OUTLINE, "of the pixels", told)
    bright = float((layers["albedo"].max(axis=-1) > 1.02)[picture.seen].mean()) if picture.seen.any() else 0.0
    told = "surfaces return no more light than they get"
    yield picture.at.judge("energy", bright, 0.01, "of the pixels", told)
    pure = (matte | np.isin(layers["object_id"], list(lambertian))) & (layers["pure"] > 0)
    if pure.sum() < 100:
        yield picture.at.skip("diffuse light", "fewer than 100 pure pixels of Lambertian surfaces are seen")
        return
    yield from _check_diffuse(subject, picture, pure)


def _check_diffuse(subject: Subject, picture: TruePicture, pure: np.ndarray) -> Iterator[Check]:
    """Check the diffuse light of all lights together, then what is direct and what is bounced of
    each light.
    """
    layers, lights = picture.layers, [light.name for light in subject.lights]
    reflectance = layers["diffuse_reflectance"][pure].astype(float)
    direct, bounced = (
        {name: layers[f"{part}.diffuse.{name}"][pure].astype(float) for name in lights}
        for part in ("direct", "indirect")
    )
    whole = np.sum([*direct.values(), *bounced.values()], axis=0)
    wanted = reflectance * layers["shading"][pure]
    quotients = np.round(whole.sum(axis=0) / np.maximum(wanted.sum(axis=0), 1e-30), 3).tolist()
    told = "the diffuse light of pure, Lambertian pixels is diffuse_reflectance x shading; "
    told += f"the channels' quotients are {quotients}"
    yield _judge_sums(picture, "diffuse light", whole, wanted, wanted, told)
    for name in lights:
        straight = layers[f"direct.irradiance.{name}"][pure].astype(float)
        around = layers[f"irradiance.{name}"][pure] - straight
        for part, found, arriving in (("direct", direct, straight), ("indirect", bounced, around)):
            told = (
                f"{part}.diffuse.{name} is reflectance x the {part} irradiance of {name} / pi; looks like "
                "swapped lights, or direct light taken for bounced light"
            )
            implied = reflectance * arriving / np.pi
            yield _judge_sums(picture, f"{part} diffuse light", found[name], implied, wanted, told)


def _judge_sums(
    picture: TruePicture, name: str, found: np.ndarray, implied: np.ndarray, of: np.ndarray, told: str
) -> Check:
    """Means over pixels against values at their centres, in sum, each ``(N, 3)``.

    The differences of single pixels, by noise and by shadows that cross a pixel, tell how far a sum may be
    off: where they are symmetric, it stays below six times the root of the sum of their squares.
    """
    off = found - implied
    spread = np.sqrt((off**2).sum(axis=0))
    scale = np.maximum(np.maximum(found, implied).sum(axis=0), _FAINT * of.sum(axis=0)) + 1e-30
    beyond = (np.abs(off.sum(axis=0)) - _SIGMAS * spread) / scale
    return picture.at.judge(name, max(float(beyond.max()), 0.0), _DIFFUSE, f"beyond {_SIGMAS:g} σ", told)

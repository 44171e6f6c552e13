# SPDX-License-Identifier: Apache-2.0
"""Checks of irradiance and visibility against the lights that lights.json describes."""

from collections.abc import Iterator

import numpy as np

from graycard import EnvironmentLight, GaussianLight, Light, PointLight, SpotLight, luminance
from graycard.synth.verify._check import Check
from graycard.synth.verify._closed_forms import sky_towards, unblocked_irradiance
from graycard.synth.verify._subject import Subject, TruePicture

_POINTS, _SKY_POINTS = 1024, 400
"""About how many pixels of a view integrals over lights are computed at: a sky has thousands of pixels."""

_EXACT = 1e-3
"""Relative, of 99 % of the pixels: float32 normals and positions, at grazing angles too."""

_PIXELS_APART = 0.05
"""Tolerance of the RMS of a background: a pixel of up to 1.5° is seen by its centre alone, at a window's
edge too."""

_ESTIMATED = 0.02
"""Relative, of half of the pixels that a light with an extent lights: 0.0052 at most in the claims suite."""

_ESTIMATED_MOST = 0.075
"""Relative, of 90 % of them: beside clutter a visibility of some fifty samples is noise, up to 0.05 there."""

_SKY = 0.05
"""RMS, relative: 144 samples on a sky, against 0.016 at most in the scenes of this package; a turned or
mirrored sky has 0.11 and more."""


def check_irradiance(subject: Subject, picture: TruePicture) -> Iterator[Check]:
    """Each light's direct irradiance is what its formula gives times its visibility; all of them add up."""
    if not picture.is_split:
        for name in ("irradiances add up", "direct light of the formula"):
            yield picture.at.skip(name, "its light is not told apart")
        return
    yield from _check_sums(subject, picture)
    for light in subject.lights:
        yield _check_shadow(picture, light)
        yield from _check_formula(subject, picture, light)


def _check_sums(subject: Subject, picture: TruePicture) -> Iterator[Check]:
    layers, names = picture.layers, [light.name for light in subject.lights]
    total = np.sum([layers[f"irradiance.{name}"].astype(float) for name in names], axis=0)
    wanted = np.pi * layers["shading"].astype(float)
    told = f"the irradiances of all lights add up to pi x shading; looks like {_factor(total, wanted)}"
    yield picture.at.judge("irradiances add up", _relative(total, wanted), 1e-4, "relative", told)
    for name in names:
        above = layers[f"direct.irradiance.{name}"].astype(float) - layers[f"irradiance.{name}"]
        scale = max(float(layers[f"irradiance.{name}"].mean()), 1e-30)
        told = (
            f"direct.irradiance.{name} is a part of irradiance.{name}; looks like lights that were permuted"
        )
        yield picture.at.judge(
            "direct part of irradiance", float(above.max()) / scale, 1e-4, "of the mean", told
        )


def _factor(found: np.ndarray, wanted: np.ndarray) -> str:
    """In words, the factor between two images."""
    factor = found.sum() / max(float(wanted.sum()), 1e-30)
    for value, name in ((1 / np.pi, "a shading without 1/pi"), (np.pi, "irradiance divided by pi")):
        if abs(factor / value - 1) < 0.01:
            return name
    return f"a light left out or counted twice (factor {factor:.4f})"


def _relative(found: np.ndarray, wanted: np.ndarray) -> float:
    """Largest difference, relative to the value there and a little of the mean."""
    scale = np.abs(wanted) + 1e-2 * np.abs(wanted).mean() + 1e-30
    return float((np.abs(found - wanted) / scale).max())


def _check_shadow(picture: TruePicture, light: Light) -> Check:
    """Check that a light is visible exactly where it gives direct light."""
    visible = picture.layers[f"visibility.{light.name}"] > 0
    lit = picture.layers[f"direct.irradiance.{light.name}"].max(axis=-1) > 0
    told = (
        f"visibility.{light.name} is 0 exactly where direct.irradiance.{light.name} is; looks like a "
        "visibility that is inverted, or of another light"
    )
    wrong = float((visible != lit)[picture.seen].mean()) if picture.seen.any() else 0.0
    return picture.at.judge("visible where lit", wrong, 1e-3, "of the pixels", told)


def _check_formula(subject: Subject, picture: TruePicture, light: Light) -> Iterator[Check]:
    """Direct irradiance = visibility x formula, and nothing where the formula gives nothing."""
    name = "direct light of the formula"
    rows, columns = _sample(picture, _SKY_POINTS if isinstance(light, EnvironmentLight) else _POINTS)
    points, normals = (picture.layers[k][rows, columns].astype(float) for k in ("position", "normal"))
    sent = unblocked_irradiance(light, picture.camera, points, normals, subject.sky)
    if sent is None:
        yield picture.at.skip(name, f"there is no formula for the light {light.name}")
        return
    visible = picture.layers[f"visibility.{light.name}"][rows, columns].astype(float)
    found = picture.layers[f"direct.irradiance.{light.name}"][rows, columns].astype(float)
    where = visible > 0
    if where.sum() < 30:
        yield picture.at.skip(name, f"{light.name} lights fewer than 30 of the pixels looked at")
        return
    yield from _judge_formula(picture, light, found[where], sent[where], visible[where])
    if not isinstance(light, EnvironmentLight):
        yield from _judge_color(picture, light, found, sent, visible)


def _sample(picture: TruePicture, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of pixels that show something, evenly over the picture."""
    rows, columns = np.nonzero(picture.seen)
    step = max(len(rows) // points, 1)
    return rows[::step], columns[::step]


def _judge_formula(
    picture: TruePicture, light: Light, found: np.ndarray, sent: np.ndarray, visible: np.ndarray
) -> Iterator[Check]:
    """Visibility is a share of luminance, so luminance is what is compared."""
    got, wanted = luminance(found), visible * luminance(sent)
    told = (
        f"direct.irradiance.{light.name} is visibility x what lights.json says at this position and normal; "
        "looks like swapped lights, another frame, axis, angle or unit"
    )
    name = "direct light of the formula"
    if isinstance(light, EnvironmentLight):
        figure = float(np.sqrt(((got - wanted) ** 2).mean() / max(float((got**2).mean()), 1e-30)))
        yield picture.at.judge(name, figure, _SKY, "relative", told)
        return
    off = np.abs(got - wanted) / np.maximum(np.maximum(got, wanted), 1e-30)
    if isinstance(light, PointLight | SpotLight | GaussianLight):
        yield picture.at.judge(name, float(np.quantile(off, 0.99)), _EXACT, "relative", told)
        return
    yield picture.at.judge(name, float(np.median(off)), _ESTIMATED, "relative", told)
    most = "direct light of the formula at most points"
    yield picture.at.judge(most, float(np.quantile(off, 0.9)), _ESTIMATED_MOST, "relative", told)


def _judge_color(
    picture: TruePicture, light: Light, found: np.ndarray, sent: np.ndarray, visible: np.ndarray
) -> Iterator[Check]:
    """Check that, where nothing is in the way, the channels have the proportions that lights.json says."""
    free = visible > 0.999
    if free.sum() < 30:
        return
    quotient = found[free].sum(axis=0) / np.maximum(sent[free].sum(axis=0), 1e-30)
    tint = quotient / max(float(quotient.mean()), 1e-30)
    told = f"the colour of {light.name} is that of lights.json; it is tinted by {np.round(tint, 4).tolist()}"
    yield picture.at.judge("colour of direct light", float(np.abs(tint - 1).max()), 0.01, "relative", told)


def check_background(subject: Subject, picture: TruePicture) -> Iterator[Check]:
    """Check that, where no object is seen, the radiance is that of the environment in the ray's direction."""
    name = "background is the environment"
    far = ~picture.seen
    far &= ~_beside(picture.seen)
    if subject.sky is None or far.sum() < 30:
        why = "there is no environment" if subject.sky is None else "fewer than 30 pixels show the background"
        yield picture.at.skip(name, why)
        return
    wanted = sky_towards(subject.sky, picture.rays[far])
    found = picture.layers["radiance"][far].astype(float)
    off = float(np.sqrt(((found - wanted) ** 2).mean() / max(float((wanted**2).mean()), 1e-30)))
    told = (
        "the background is environment.exr as docs/reference/formats.md maps it; looks like one "
        "turned or mirrored"
    )
    yield picture.at.judge(name, off, _PIXELS_APART, "of its RMS", told)


def _beside(seen: np.ndarray) -> np.ndarray:
    """Pixels that touch one in which an object is seen."""
    padded = np.pad(seen, 1)
    height, width = seen.shape
    return np.any([padded[i : i + height, j : j + width] for i in range(3) for j in range(3)], axis=0)

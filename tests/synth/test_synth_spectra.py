# SPDX-License-Identifier: Apache-2.0
"""Colours against published values."""

import numpy as np
import pytest

from graycard import srgb_encode
from graycard.synth import _spectra as spectra

PUBLISHED = {
    "dark skin": (115, 82, 68),
    "light skin": (194, 150, 130),
    "blue sky": (98, 122, 157),
    "foliage": (87, 108, 67),
    "blue flower": (133, 128, 177),
    "bluish green": (103, 189, 170),
    "orange": (214, 126, 44),
    "purplish blue": (80, 91, 166),
    "moderate red": (193, 90, 99),
    "purple": (94, 60, 108),
    "yellow green": (157, 188, 64),
    "orange yellow": (224, 163, 46),
    "blue": (56, 61, 150),
    "green": (70, 148, 73),
    "red": (175, 54, 60),
    "yellow": (231, 199, 31),
    "magenta": (187, 86, 149),
    "white 9.5": (243, 243, 242),
    "neutral 8": (200, 200, 200),
    "neutral 6.5": (160, 160, 160),
    "neutral 5": (122, 122, 121),
    "neutral 3.5": (85, 85, 85),
    "black 2": (52, 52, 52),
}
"""8-bit sRGB as printed by the maker (X-Rite). Cyan is left out: it lies outside sRGB."""

REC709_TO_XYZ = np.array(
    [[0.4123908, 0.3575843, 0.1804808], [0.2126390, 0.7151687, 0.0721923], [0.0193308, 0.1191948, 0.9505322]]
)


@pytest.mark.parametrize("name", PUBLISHED)
def test_patches_agree_with_the_published_srgb(name: str) -> None:
    found = 255 * srgb_encode(np.array(spectra.chart_patches()[name]))
    # the maker's figures are adapted from D50, and saturated blue differs most
    np.testing.assert_allclose(found, PUBLISHED[name], atol=15 if name == "blue" else 10)
    assert np.abs(found - PUBLISHED[name]).mean() < 6.5


def test_the_chart_is_whole_and_within_gamut() -> None:
    patches = spectra.chart_patches()
    assert len(patches) == spectra.CHART_ROWS * spectra.CHART_COLUMNS
    values = np.array(list(patches.values()))
    assert values.min() >= 0
    assert values.max() < 1


def test_grays_are_gray_and_in_order() -> None:
    grays = np.array(list(spectra.chart_patches().values()))[18:]
    assert (np.diff(grays.mean(axis=1)) < 0).all()
    assert (np.ptp(grays, axis=1) < 0.06 * grays.mean(axis=1)).all()


def test_the_chart_cannot_be_changed_from_outside() -> None:
    spectra.chart_patches().clear()
    assert len(spectra.chart_patches()) == 24


def test_paint_is_a_patch_and_an_unknown_one_is_refused() -> None:
    assert spectra.paint("orange") == spectra.chart_patches()["orange"]
    with pytest.raises(ValueError, match="expected a ColorChecker patch, got 'mauve'"):
        spectra.paint("mauve")


@pytest.mark.parametrize(("kelvin", "xy"), [(2856, (0.4476, 0.4074)), (6500, (0.3135, 0.3237))])
def test_black_bodies_have_the_published_chromaticity(kelvin: float, xy: tuple[float, float]) -> None:
    XYZ = REC709_TO_XYZ @ np.array(spectra.blackbody(kelvin))
    np.testing.assert_allclose(XYZ[:2] / XYZ.sum(), xy, atol=5e-4)
    assert XYZ[1] == pytest.approx(1, abs=1e-4)


def test_d65_is_white_and_a_is_warm() -> None:
    np.testing.assert_allclose(spectra.illuminant("D65"), (1, 1, 1), atol=2e-3)
    r, g, b = spectra.illuminant("A")
    assert r > 1.5 * g > 3 * b


def test_bad_lights_are_refused() -> None:
    with pytest.raises(ValueError, match="expected a temperature of 1000 to 40000 K, got 12"):
        spectra.blackbody(12)
    with pytest.raises(ValueError, match="expected a CIE illuminant, got 'D66'"):
        spectra.illuminant("D66")


def test_scaled() -> None:
    assert spectra.scaled((1, 2, 3), 0.5) == (0.5, 1, 1.5)

# SPDX-License-Identifier: Apache-2.0
"""CIEDE2000 against colour-science and the published pairs."""

import warnings
from types import ModuleType

import numpy as np
import pytest

import graycard.eval as ge
from graycard.eval.measures._colour_difference import REC709_TO_XYZ, lab

RNG = np.random.default_rng(12)
COLORS = RNG.uniform(-0.05, 1.3, (500, 3))


def colour_science() -> ModuleType:
    """The library, which warns about plotting when it is imported."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    return colour


def test_lab_agrees_with_colour_science() -> None:
    colour = colour_science()
    white = colour.XYZ_to_xy(REC709_TO_XYZ.sum(axis=1))
    expected = colour.XYZ_to_Lab(COLORS @ REC709_TO_XYZ.T, white)
    assert lab(COLORS) == pytest.approx(expected, abs=1e-6)


def test_the_matrix_is_that_of_the_primaries() -> None:
    colour = colour_science()
    space = colour.RGB_COLOURSPACES["ITU-R BT.709"]
    derived = colour.normalised_primary_matrix(space.primaries, np.array([0.3127, 0.3290]))
    assert pytest.approx(derived, abs=1e-9) == REC709_TO_XYZ


def test_grays_have_no_colour() -> None:
    grays = np.linspace(0, 2, 30)[:, None] * np.ones(3)
    assert lab(grays)[:, 1:] == pytest.approx(0, abs=1e-12)
    assert lab(np.ones(3))[0] == pytest.approx(100)


def test_equal_colours_and_symmetry() -> None:
    other = COLORS[::-1]
    assert (ge.ciede2000(COLORS, COLORS) == 0).all()
    assert ge.ciede2000(COLORS, other) == pytest.approx(ge.ciede2000(other, COLORS), abs=1e-9)


def test_a_just_visible_difference_is_about_one() -> None:
    gray = np.full((1, 3), 0.18)
    assert 0.5 < ge.ciede2000(gray, gray * 1.06).item() < 1.5


def test_shapes_are_kept() -> None:
    image = RNG.random((4, 5, 3))
    assert ge.ciede2000(image, image).shape == (4, 5)

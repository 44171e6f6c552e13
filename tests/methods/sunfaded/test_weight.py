# SPDX-License-Identifier: Apache-2.0
"""Weight of a pixel in the scene without the lamp."""

import numpy as np
import pytest

from graycard.methods.sunfaded import SunFadedSettings
from graycard.methods.sunfaded._weight import FAINT, unlit_weight


def picture(width: int = 40) -> np.ndarray:
    """A step from 1 % to 100 % of white in the middle, so wide that a small blur leaves both ends alone."""
    row = np.where(np.arange(width) < width // 2, 0.01, 1.0)
    return np.broadcast_to(row[None, :, None], (8, width, 3))


def test_the_logarithm_goes_from_one_to_exp_of_minus_beta():
    weight = unlit_weight(picture(), SunFadedSettings(weight="log_minmax", blur=0.02, least_weight=0.0))
    assert weight.dtype == np.float32
    assert weight.shape == (8, 40)
    np.testing.assert_allclose(weight[:, 0], 1, rtol=1e-6)
    np.testing.assert_allclose(weight[:, -1], np.exp(-10), rtol=1e-5)


def test_the_linear_one_keeps_what_is_dark_but_not_darkest():
    weight = unlit_weight(picture(), SunFadedSettings(weight="linear_max", blur=0.02, least_weight=0.0))
    np.testing.assert_allclose(weight[:, 0], np.exp(-10 * (0.01 + FAINT) / (1 + FAINT)), rtol=1e-5)
    np.testing.assert_allclose(weight[:, -1], np.exp(-10), rtol=1e-5)


def test_beta_is_the_exponent():
    one, four = (
        unlit_weight(picture(), SunFadedSettings(beta=beta, blur=0.02, least_weight=0.0)).astype(float)
        for beta in (1.0, 4.0)
    )
    np.testing.assert_allclose(four, one**4, rtol=1e-5)


@pytest.mark.parametrize("kind", ["log_minmax", "linear_max"])
def test_pixels_of_a_small_weight_are_left_out(kind: str):
    every, some = (
        unlit_weight(picture(), SunFadedSettings(weight=kind, least_weight=least))  # pyright: ignore[reportArgumentType]
        for least in (0.0, 0.05)
    )
    assert 0 < (every < 0.05 * every.max()).mean() < 1
    np.testing.assert_array_equal(some, np.where(every < 0.05 * every.max(), 0, every))


def test_a_blur_takes_out_texture():
    fine = np.where(np.arange(64) % 2 == 0, 0.1, 1.0)[None, :, None] * np.ones((64, 1, 3))
    weight = unlit_weight(fine * picture(64).mean() + 0.2, SunFadedSettings(beta=1.0, blur=0.1))
    sharp = unlit_weight(fine * picture(64).mean() + 0.2, SunFadedSettings(beta=1.0, blur=0.001))
    inner = np.s_[:, 20:-20]
    assert np.abs(np.diff(weight[inner], axis=1)).max() < 0.1 * np.abs(np.diff(sharp[inner], axis=1)).max()


@pytest.mark.parametrize("kind", ["log_minmax", "linear_max"])
def test_an_even_picture_has_an_even_weight(kind: str):
    weight = unlit_weight(np.full((6, 9, 3), 0.3), SunFadedSettings(weight=kind))  # pyright: ignore[reportArgumentType]
    assert np.ptp(weight) < 1e-7
    assert np.all(unlit_weight(picture(), SunFadedSettings(weight="none")) == 1)

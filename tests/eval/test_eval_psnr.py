# SPDX-License-Identifier: Apache-2.0
"""PSNR against scikit-image, closed forms, and simulated noise."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skimage.metrics import mean_squared_error, peak_signal_noise_ratio

import graycard.eval as ge
from graycard import srgb_encode
from graycard.colour import display_variance

RNG = np.random.default_rng(11)
PREDICTED, TRUE = RNG.random((2, 20, 18, 3))
EVERYWHERE = np.ones((20, 18), bool)


def test_psnr_agrees_with_scikit_image() -> None:
    ours = ge.psnr(ge.mean_square_error(PREDICTED, TRUE, EVERYWHERE))
    assert ours == pytest.approx(peak_signal_noise_ratio(TRUE, PREDICTED, data_range=1), abs=1e-10)


def test_the_mask_selects_pixels_and_does_not_multiply() -> None:
    mask = np.zeros((20, 18), bool)
    mask[3:9, 4:10] = True
    inside = mean_squared_error(TRUE[3:9, 4:10], PREDICTED[3:9, 4:10])
    assert ge.mean_square_error(PREDICTED, TRUE, mask) == pytest.approx(inside, rel=1e-12)
    multiplied = ge.psnr(float(np.mean(((PREDICTED - TRUE) * mask[..., None]) ** 2)))
    gain = -10 * math.log10(mask.mean())
    assert multiplied - ge.psnr(inside) == pytest.approx(gain, abs=1e-9), "what multiplying would add"
    assert gain > 9


@given(st.floats(-1e3, 1e3), st.integers(0, 99))
def test_the_background_changes_nothing(value: float, seed: int) -> None:
    mask = np.random.default_rng(seed).random((20, 18)) < 0.4
    changed = np.where(mask[..., None], PREDICTED, value)
    assert ge.mean_square_error(changed, TRUE, mask) == ge.mean_square_error(PREDICTED, TRUE, mask)


def test_no_error_is_infinite() -> None:
    assert ge.psnr(ge.mean_square_error(TRUE, TRUE, EVERYWHERE)) == math.inf
    assert ge.psnr(0.001) == pytest.approx(30)


def test_float32_images_are_summed_in_float64() -> None:
    true = np.full((400, 400, 3), 1000, np.float32)
    error = ge.mean_square_error(true + np.float32(0.25), true, np.ones((400, 400), bool))
    assert error == 0.0625


@pytest.mark.parametrize(
    ("predicted", "mask"),
    [
        (np.zeros((20, 17, 3)), EVERYWHERE),
        (np.zeros((20, 18)), EVERYWHERE),
        (PREDICTED, EVERYWHERE[:-1]),
        (PREDICTED, EVERYWHERE.astype(float)),
    ],
)
def test_shapes_that_do_not_fit(predicted: np.ndarray, mask: np.ndarray) -> None:
    with pytest.raises(ValueError, match="expected two images of one shape and a boolean mask"):
        ge.mean_square_error(predicted, TRUE, mask)


def test_an_empty_mask() -> None:
    with pytest.raises(ValueError, match="expected a mask with pixels in it, got an empty one"):
        ge.mean_square_error(PREDICTED, TRUE, ~EVERYWHERE)


def test_display_variance_is_that_of_simulated_noise() -> None:
    radiance, exposure, sigma = np.array([0.001, 0.05, 0.3, 1.1, 1.9]), 0.5, 2e-3
    noisy = radiance + RNG.normal(0, sigma, (200_000, 5))
    simulated = srgb_encode(noisy * exposure).var(axis=0)
    predicted = display_variance(radiance, np.full(5, sigma**2), exposure)
    assert predicted[1:] == pytest.approx(simulated[1:], rel=0.02)
    assert predicted[0] > simulated[0], "black clips half of the noise away"


def test_display_variance_is_zero_where_the_display_clips() -> None:
    assert display_variance(np.array([3.0]), np.array([1.0]), 0.5) == 0


def test_judged_mask_leaves_background_and_emitters_out() -> None:
    ids = np.array([[0, 1], [2, 3]], np.uint32)
    assert ge.judged_mask(ids).tolist() == [[False, True], [True, True]]
    assert ge.judged_mask(ids, {1, 3}).tolist() == [[False, False], [True, False]]

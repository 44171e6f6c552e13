# SPDX-License-Identifier: Apache-2.0
"""SSIM against the published formula, written out with scipy filters."""

import numpy as np
import pytest
from scipy.ndimage import convolve

import graycard.eval as ge
from graycard import DatasetError

RNG = np.random.default_rng(5)
TRUE = RNG.random((30, 26, 3))
PREDICTED = np.clip(TRUE + RNG.normal(0, 0.2, TRUE.shape), 0, 1)
EVERYWHERE = np.ones((30, 26), bool)


def reference_map(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Wang et al. 2004, equation 13, with an 11x11 Gaussian of sigma 1.5, one channel."""
    x = np.arange(-5, 6)
    bell = np.exp(-(x**2) / (2 * 1.5**2))
    window = np.outer(bell, bell) / bell.sum() ** 2

    def mean(values: np.ndarray) -> np.ndarray:
        return convolve(values, window)

    c1, c2 = 0.01**2, 0.03**2
    ma, mb = mean(a), mean(b)
    va, vb, cov = mean(a * a) - ma**2, mean(b * b) - mb**2, mean(a * b) - ma * mb
    return (2 * ma * mb + c1) * (2 * cov + c2) / ((ma**2 + mb**2 + c1) * (va + vb + c2))


def test_it_is_the_mean_of_the_map_where_the_window_lies_inside() -> None:
    maps = np.stack([reference_map(PREDICTED[..., c], TRUE[..., c]) for c in range(3)], axis=-1)
    expected = maps[5:-5, 5:-5].mean()
    assert ge.ssim(PREDICTED, TRUE, EVERYWHERE) == pytest.approx(expected, abs=1e-12)
    assert expected < 0.9


def test_it_is_one_for_equal_images_and_symmetric() -> None:
    assert ge.ssim(TRUE, TRUE, EVERYWHERE) == 1
    assert ge.ssim(PREDICTED, TRUE, EVERYWHERE) == pytest.approx(ge.ssim(TRUE, PREDICTED, EVERYWHERE))


def test_the_background_changes_nothing() -> None:
    mask = np.zeros((30, 26), bool)
    mask[4:24, 3:21] = True
    changed = np.where(mask[..., None], PREDICTED, 1 - PREDICTED)
    assert ge.ssim(changed, TRUE, mask) == ge.ssim(PREDICTED, TRUE, mask)
    assert ge.ssim(PREDICTED, TRUE, mask) != ge.ssim(PREDICTED, TRUE, EVERYWHERE)


def test_an_equal_background_does_not_raise_the_score() -> None:
    """Multiplying both images by the mask would: most windows would see nothing but black."""
    mask = np.zeros((30, 26), bool)
    mask[8:22, 6:20] = True
    black = mask[..., None]
    multiplied = ge.ssim(PREDICTED * black, TRUE * black, EVERYWHERE)
    assert ge.ssim(PREDICTED, TRUE, mask) < multiplied - 0.05


def test_a_mask_narrower_than_the_window_is_used_as_it_is() -> None:
    mask = np.zeros((30, 26), bool)
    mask[10:14, 8:12] = True
    framed = np.where(mask[..., None], PREDICTED, TRUE)
    maps = np.stack([reference_map(framed[..., c], TRUE[..., c]) for c in range(3)], axis=-1)
    assert ge.ssim(PREDICTED, TRUE, mask) == pytest.approx(maps[mask].mean(), abs=1e-12)
    changed = np.where(mask[..., None], PREDICTED, 0)
    assert ge.ssim(changed, TRUE, mask) == ge.ssim(PREDICTED, TRUE, mask)


def test_images_smaller_than_the_window() -> None:
    small = TRUE[:10]
    with pytest.raises(DatasetError, match=r"at least 11x11 pixels for SSIM, got 26x10\. Render"):
        ge.ssim(small, small, EVERYWHERE[:10])


@pytest.mark.parametrize(("top", "left", "size"), [(0, 0, 14), (60, 51, 25), (30, 2, 6)])
def test_what_is_computed_around_the_mask_is_what_the_whole_picture_says(
    top: int, left: int, size: int
) -> None:
    predicted, true = np.random.default_rng(8).random((2, 80, 70, 3))
    mask = np.zeros((80, 70), bool)
    mask[top : top + size, left : left + size] = True
    framed = np.where(mask[..., None], predicted, true)
    maps = np.stack([reference_map(framed[..., c], true[..., c]) for c in range(3)], axis=-1)
    inside = np.zeros_like(mask)
    inside[top + 5 : top + size - 5, left + 5 : left + size - 5] = size > 10
    inside[:5], inside[-5:], inside[:, :5], inside[:, -5:] = False, False, False, False
    expected = maps[inside if inside.any() else mask].mean()
    assert ge.ssim(predicted, true, mask) == pytest.approx(expected, abs=1e-12)

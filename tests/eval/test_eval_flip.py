# SPDX-License-Identifier: Apache-2.0
"""FLIP against the formula of its paper, which is closed for images of one colour."""

import itertools

import numpy as np
import pytest
from flip_evaluator import evaluate
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

import graycard.eval as ge

RNG = np.random.default_rng(3)
PREDICTED, TRUE = RNG.random((2, 32, 30, 3))
EVERYWHERE = np.ones((32, 30), bool)
COLOURS = ((0, 0, 0), (1, 1, 1), (0.5, 0.5, 0.5), (0.9, 0.2, 0.1), (0.1, 0.3, 0.8))
XYZ_OF_RGB = np.array(
    [
        [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
        [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
        [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
    ]
)


def hunt_lab(display: np.ndarray) -> np.ndarray:
    """CIELAB (D65) with chroma scaled by lightness, of sRGB display values, shape ``(3,)``."""
    linear = np.where(display <= 0.04045, display / 12.92, ((display + 0.055) / 1.055) ** 2.4)
    ratio = XYZ_OF_RGB @ linear / XYZ_OF_RGB.sum(axis=1)
    f = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio / (3 * (6 / 29) ** 2) + 4 / 29)
    lightness = 116 * f[1] - 16
    a, b = 500 * (f[0] - f[1]), 200 * (f[1] - f[2])
    return np.array([lightness, 0.01 * lightness * a, 0.01 * lightness * b])


def hyab(a: np.ndarray, b: np.ndarray) -> float:
    return abs(a[0] - b[0]) + float(np.hypot(a[1] - b[1], a[2] - b[2]))


def flip_of_colours(a: np.ndarray, b: np.ndarray) -> float:
    """Andersson et al. 2020, section 4.1: nothing but the colour term is left without any structure."""
    largest = hyab(hunt_lab(np.array([0.0, 1, 0])), hunt_lab(np.array([0.0, 0, 1]))) ** 0.7
    difference, knee = hyab(hunt_lab(a), hunt_lab(b)) ** 0.7, 0.4 * largest
    if difference < knee:
        return 0.95 / knee * difference
    return 0.95 + (difference - knee) / (largest - knee) * 0.05


@pytest.mark.parametrize(
    ("a", "b"),
    list(itertools.combinations(COLOURS, 2)),
)
def test_images_of_one_colour(a: tuple[float, ...], b: tuple[float, ...]) -> None:
    first, second = np.broadcast_to(np.array(a, float), (2, 24, 24, 3)).copy()
    second[:] = b
    mask = np.ones((24, 24), bool)
    expected = flip_of_colours(np.array(a, float), np.array(b, float))
    assert ge.flip(first, second, mask) == pytest.approx(expected, abs=1e-4)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000))
def test_identity_symmetry_and_range(seed: int) -> None:
    a, b = np.random.default_rng(seed).random((2, 16, 15, 3))
    mask = np.ones((16, 15), bool)
    error = ge.flip_map(a, b, mask)
    assert error.shape == (16, 15)
    assert (error >= 0).all()
    assert (error <= 1).all()
    assert np.array_equal(error, ge.flip_map(b, a, mask))
    assert ge.flip(a, a, mask) == 0


def test_the_background_changes_nothing_not_even_through_the_filters() -> None:
    mask = np.zeros((32, 30), bool)
    mask[8:24, 8:22] = True
    changed = np.where(mask[..., None], PREDICTED, 1 - TRUE)
    assert ge.flip(changed, TRUE, mask) == ge.flip(PREDICTED, TRUE, mask)


def test_it_is_the_mean_over_the_mask() -> None:
    mask = np.zeros((32, 30), bool)
    mask[:, :15] = True
    error = ge.flip_map(PREDICTED, TRUE, mask)
    assert ge.flip(PREDICTED, TRUE, mask) == pytest.approx(error[:, :15].mean())
    assert error[:, 28:].max() == 0, "far from the mask both images show the truth"


def test_it_says_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    ge.flip(PREDICTED, TRUE, EVERYWHERE)
    assert capfd.readouterr() == ("", "")


def test_values_that_no_display_shows() -> None:
    with pytest.raises(ValueError, match=r"expected display values in \[0, 1\], got"):
        ge.flip(PREDICTED + 0.5, TRUE, EVERYWHERE)


@pytest.mark.parametrize("corner", [(0, 0), (40, 50), (70, 5), (89, 79)])
def test_what_is_computed_around_the_mask_is_what_the_whole_picture_says(corner: tuple[int, int]) -> None:
    rng = np.random.default_rng(6)
    predicted, true = rng.random((2, 90, 80, 3))
    mask = np.zeros((90, 80), bool)
    mask[corner[0] : corner[0] + 12, corner[1] : corner[1] + 9] = True
    shown = np.where(mask[..., None], predicted, true)
    whole = ge.flip_map(shown, true, np.ones(mask.shape, bool))
    assert ge.flip_map(predicted, true, mask) == pytest.approx(whole, abs=1e-12)
    assert whole[~mask].max() > 0.01, "the filters reach beyond the mask"


def pictures() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Pairs of images that leave no part of FLIP alone: grain, shapes, edges, points, flat colours."""
    rng = np.random.default_rng(11)
    grain = rng.random((90, 80, 3))
    shapes, others = np.clip(0.5 + 3 * gaussian_filter(rng.normal(size=(2, 90, 80, 3)), (0, 4, 4, 0)), 0, 1)
    # On black the library's float32 rounds L*, 116 times a number near 0 after 16 was taken away, to 1e-3.
    flat, points = np.full((60, 60, 3), 0.5), np.where(rng.random((60, 60, 1)) > 0.9, np.ones(3), 0.1)
    step = flat + 0.1 * (np.arange(60)[:, None, None] > 30) * (1, 0, 0)
    return {
        "grain": (grain, rng.random((90, 80, 3))),
        "a little grain": (grain, np.clip(grain + rng.normal(0, 0.02, grain.shape), 0, 1)),
        "shapes": (shapes, others),
        "darker shapes": (shapes, 0.9 * shapes),
        "blurred": (shapes, gaussian_filter(shapes, (1, 1, 0))),
        "without blue": (shapes, shapes * (1, 1, 0)),
        "an edge": (flat, step),
        "points": (np.full((60, 60, 3), 0.1), points),
        "smaller than the filters": (grain[:7, :5], shapes[:7, :5]),
    }


@pytest.mark.parametrize("name", pictures())
def test_each_pixel_is_that_of_the_authors_library(name: str) -> None:
    true, predicted = pictures()[name]
    images = np.ascontiguousarray(true, np.float32), np.ascontiguousarray(predicted, np.float32)
    theirs = evaluate(*images, "LDR", applyMagma=False, computeMeanError=False)[0][..., 0]
    ours = ge.flip_map(predicted, true, np.ones(true.shape[:2], bool))
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-4)
    assert theirs.max() > 0.02, "the images differ"

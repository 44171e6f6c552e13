# SPDX-License-Identifier: Apache-2.0
"""Holes filled in from around them: constants, slopes, what is out of reach, and OpenCV's own rules."""

import cv2
import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt, gaussian_filter

from graycard import MethodError
from graycard.methods.priors._filling import ALGORITHMS, RADIUS, filled

SIZE = (40, 100)
REACH = 3
"""Pixels that Telea's algorithm looks at on pictures of this width."""
Y, X = np.mgrid[: SIZE[0], : SIZE[1]].astype(float)
HOLES = {
    "inside": (Y >= 12) & (Y < 27) & (X >= 40) & (X < 58),
    "at the left": (Y >= 12) & (Y < 27) & (X < 12),
    "at the right": (Y >= 12) & (Y < 27) & (X >= 88),
    "at the top": (Y < 12) & (X >= 40) & (X < 55),
    "in a corner": (Y < 12) & (X < 12),
    "two": ((Y - 12) ** 2 + (X - 20) ** 2 < 30) | ((Y - 30) ** 2 + (X - 60) ** 2 < 40),
}


def texture(channels: int = 3) -> np.ndarray:
    random = np.random.default_rng(1000)
    return 0.5 + 3 * gaussian_filter(random.normal(size=(*SIZE, channels)), (4, 4, 0))


def away(hole: np.ndarray) -> np.ndarray:
    """Pixels to the hole; 0 in it."""
    return np.asarray(distance_transform_edt(~hole))


@pytest.mark.parametrize("place", HOLES)
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_around_a_hole_nothing_is_touched_and_in_it_nothing_is_read(place: str, algorithm: str):
    hole = HOLES[place]
    image = texture()
    first = filled(np.where(hole[..., None], np.nan, image), hole, algorithm)
    second = filled(np.where(hole[..., None], 1e6, image), hole, algorithm)
    assert np.array_equal(first, second)
    assert np.array_equal(first[~hole], image[~hole])
    assert first.dtype == np.float64
    assert (first[hole] != image[hole]).all()


@pytest.mark.parametrize("place", HOLES)
@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("value", [0.0, 0.3, -7.0, 2000.0])
def test_a_constant_goes_on_exactly(place: str, algorithm: str, value: float):
    even = np.full(SIZE, value)
    found = filled(np.where(HOLES[place], np.nan, even), HOLES[place], algorithm)
    np.testing.assert_allclose(found, even, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_channels_are_filled_each_by_itself(algorithm: str):
    image, hole = texture(), HOLES["inside"]
    together = filled(image, hole, algorithm)
    for channel in range(3):
        assert np.array_equal(together[..., channel], filled(image[..., channel], hole, algorithm))


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_without_a_hole_it_is_the_image_and_all_hole_is_refused(algorithm: str):
    image = texture()
    assert np.array_equal(filled(image, None, algorithm), image)
    assert np.array_equal(filled(image, np.zeros(SIZE, bool), algorithm), image)
    with pytest.raises(MethodError, match="expected a hole with something around it"):
        filled(image, np.ones(SIZE, bool), algorithm)


def test_telea_follows_a_slope_in_steps():
    """Means of what is near do not go on with a slope; a biharmonic function does."""
    hole = HOLES["inside"]
    for slope in (X + 0 * Y, Y + 0 * X, X + Y, X - Y):
        rise = np.ptp(slope[hole])
        error = np.abs(filled(slope, hole, "telea") - slope)[hole]
        assert 0.01 * rise < error.mean() < 0.2 * rise  # one value for all would be off by a quarter
        assert np.abs(filled(slope, hole, "biharmonic") - slope)[hole].max() < 1e-6


def test_telea_stays_within_the_values_around_the_hole():
    for hole in HOLES.values():
        image = texture(1)[..., 0]
        rim = image[~hole & (away(hole) <= REACH)]
        found = filled(image, hole, "telea")[hole]
        assert rim.min() <= found.min()
        assert found.max() <= rim.max()
        assert np.ptp(found) > 0.2 * np.ptp(rim)


def test_telea_looks_no_farther_than_its_radius():
    assert round(RADIUS * SIZE[1]) == REACH
    image, hole = texture(1)[..., 0], HOLES["inside"]
    far = away(hole) > REACH + 2
    lit = np.where(far, 1e4, image)  # a lamp in the picture
    assert np.array_equal(filled(lit, hole, "telea")[hole], filled(image, hole, "telea")[hole])
    near = away(hole) <= REACH
    assert not np.array_equal(filled(np.where(near, 1, image), hole, "telea"), filled(image, hole, "telea"))


def test_telea_has_no_unit():
    """Radiance, depth in metres, and roughness are filled in alike: OpenCV adds a step of a fixed size."""
    image, hole = texture(1)[..., 0], HOLES["in a corner"]
    one = filled(image, hole, "telea")
    for scale, offset in ((1e-4, 0), (1e4, 0), (1, 100), (0.01, -3)):
        other = (filled(scale * image + offset, hole, "telea") - offset) / scale
        np.testing.assert_allclose(other, one, atol=2e-4 * np.ptp(image))


def test_telea_is_opencv_s_on_bytes_but_for_the_rounding():
    """The bound is in 255 levels: OpenCV's bytes are rounded at each pixel of the march, from the ones
    before."""
    hole = HOLES["inside"]
    near = ~hole & (away(hole) <= REACH)
    image = texture(1)[..., 0]
    image = np.round(255 * np.clip((image - image[near].min()) / np.ptp(image[near]), 0, 1))
    theirs = cv2.inpaint(image.astype(np.uint8), hole.astype(np.uint8), REACH, cv2.INPAINT_TELEA)
    ours = filled(image, hole, "telea")
    assert np.abs(ours - theirs)[hole].mean() < 2.5
    assert (ours[hole] != np.round(ours[hole])).mean() > 0.9


def test_opencv_keeps_floats_as_they_are_outside_the_hole():
    """The algorithm is built on this: 4.9 and before added half a unit to floats."""
    noise = np.random.default_rng(1000).random(SIZE).astype(np.float32)
    hole = HOLES["inside"].astype(np.uint8)
    found = cv2.inpaint(noise, hole, REACH, cv2.INPAINT_TELEA)
    assert found.dtype == np.float32
    assert np.array_equal(found[hole == 0], noise[hole == 0])
    even = np.full(SIZE, 0.5, np.float32)
    assert np.array_equal(cv2.inpaint(even, hole, REACH, cv2.INPAINT_TELEA), even)

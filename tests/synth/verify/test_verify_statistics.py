# SPDX-License-Identifier: Apache-2.0
"""The tests of two noisy pictures: their false alarms and power, on noise that is anything but normal."""

import numpy as np
import pytest

from graycard.synth.verify import _comparison as comparison
from graycard.synth.verify import _statistics as statistics
from graycard.synth.verify._check import At

AT = At("dark/made-up")
SIDE = 112


def picture(rng: np.random.Generator, gain: float = 1.0) -> tuple[np.ndarray, ...]:
    """A smooth picture under the noise of a path tracer: log-normal, with fireflies; and its halves."""
    rows = np.linspace(0.2, 1.0, SIDE)[:, None, None] * np.array([1.0, 0.6, 0.3])
    level = gain * np.broadcast_to(rows, (SIDE, SIDE, 3)) * (1.3 + np.sin(np.arange(SIDE) / 5))[:, None]
    halves = []
    for _ in range(2):
        noise = np.exp(rng.normal(-0.005, 0.1, level.shape))
        fireflies = 20 * (rng.random((SIDE, SIDE, 1)) < 2e-3)
        halves.append(level * (noise + fireflies))
    return (halves[0] + halves[1]) / 2, *halves


def make_pair(rng: np.random.Generator, gain: float = 1.0) -> comparison.Pair:
    stored, *halves = picture(rng, gain)
    again, *others = picture(rng)
    return comparison.Pair(AT, stored, again, (*halves, *others))


def worst_z(rng: np.random.Generator, gain: float = 1.0, pairs: int = 1) -> dict[str, float]:
    """The largest z of each statistic, as a share of its bound."""
    found: dict[str, float] = {}
    for check in comparison.compare("it", [make_pair(rng, gain) for _ in range(pairs)], AT):
        found[check.name] = max(found.get(check.name, 0.0), check.strain)
    return found


def test_noise_with_fireflies_raises_no_false_alarm():
    rng = np.random.default_rng(1)
    found = [worst_z(rng) for _ in range(60)]
    assert max(max(strains.values()) for strains in found) < 1


def test_z_is_standard_where_nothing_is_wrong():
    """Its variance is 1 and its tail is within Hoeffding's bound, though the noise has outliers."""
    rng = np.random.default_rng(2)
    found = []
    for _ in range(400):
        d = rng.standard_t(2, size=(20, 20, 1))
        weights = 1 / statistics.local_variance(d)
        found.append(statistics.z_of(weights, d))
    assert np.std(found) == pytest.approx(1, abs=0.1)
    assert np.mean(np.abs(found) > 2.5) <= 2 * np.exp(-(2.5**2) / 2)


def test_half_a_percent_of_gain_is_found():
    rng = np.random.default_rng(3)
    found = [worst_z(rng, gain=1.005, pairs=3)["it: level"] for _ in range(20)]
    assert min(found) > 1


def test_the_gain_is_told():
    rng = np.random.default_rng(4)
    pair = make_pair(rng, gain=1.02)
    gain = statistics.gain_of(pair.weights, pair.stored, pair.again)
    assert gain == pytest.approx(0.02, abs=0.003)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_shift_is_found_and_told(axis: int):
    """Shifted by 0.3 px along x or y: of the two numbers told, that one is right."""
    rng = np.random.default_rng(5)
    x, y = np.meshgrid(np.arange(SIDE), np.arange(SIDE))
    noise = rng.normal(0, 0.02, (2, SIDE, SIDE, 1))
    moved = (x - 0.3 * (axis == 1), y - 0.3 * (axis == 0))
    stored, again = (1 + 0.5 * np.sin(u / 4) * np.sin(v / 5) for u, v in (moved, (x, y)))
    pair = comparison.Pair(AT, stored[..., None] + noise[0], again[..., None] + noise[1])
    failed = {c.name: c for c in comparison.compare("it", [pair], AT) if c.status == "failed"}
    right, down = failed["it: place"].reason.split("shifted by (")[1].split(") px")[0].split(", ")
    assert float((down, right)[axis]) == pytest.approx(0.3, abs=0.05)
    assert float((right, down)[axis]) == pytest.approx(0.0, abs=0.05)


def test_equal_pictures_have_no_difference():
    one = np.random.default_rng(6).random((20, 20, 3))
    found = list(comparison.compare("it", [comparison.Pair(AT, one, one * (1 + 1e-6))], AT))
    assert all(check.figure == 0 and check.status == "passed" for check in found)


def test_the_share_of_a_contrast_is_a_third_whatever_the_noise():
    rng = np.random.default_rng(7)
    halves = np.exp(rng.normal(0, 2, (4, 200, 200, 1)))
    share = statistics.contrast_share(list(halves))
    assert share.mean() == pytest.approx(1 / 3, abs=0.01)
    assert 0 <= share.min() <= share.max() <= 1
    assert statistics.z_of_shares(share, 1 / 3) < 4


def test_the_share_of_a_contrast_is_one_where_pictures_differ():
    a = np.full((4, 4, 1), 1.0)
    share = statistics.contrast_share([a, a + 1e-3, a + 5, a + 5.001])
    assert share == pytest.approx(np.ones((4, 4)), abs=1e-6)
    assert np.isnan(statistics.contrast_share([a, a, a, a])).all()


def estimated(rng: np.random.Generator, level: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance of the mean of four images with skewed noise."""
    images = level * np.exp(rng.normal(0, 0.5, (4, *level.shape)))
    return images.mean(axis=0), images.var(axis=0, ddof=1) / 4


def spread_checks(gain: np.ndarray | float, of_variance: float) -> dict[str, float]:
    """Strains of a picture without halves, times a gain, whose variance is off by a factor."""
    rng, level = np.random.default_rng(8), np.full((64, 48, 3), 0.5)
    (stored, variance), (again, other) = estimated(rng, gain * level), estimated(rng, level)
    pair = comparison.Pair(AT, stored, again, (), (of_variance * variance, other))
    return {check.name: check.strain for check in comparison.compare("it", [pair], AT)}


def test_a_picture_without_halves_is_judged_by_its_variance():
    assert max(spread_checks(1, 1).values()) < 1
    stripes = 1 + 0.5 * (-1) ** np.arange(64)[:, None, None]
    assert spread_checks(stripes, 1)["it: pattern"] > 1
    for factor in (0.25, 4.0):
        assert spread_checks(1, factor)["it: variance"] > 1


def test_the_shares_of_eight_images_are_known_whatever_the_noise():
    rng = np.random.default_rng(9)
    means, variances = zip(*(estimated(rng, np.ones((200, 200, 1))) for _ in range(2)), strict=True)
    spread, share = statistics.spread_share(means, variances), statistics.variance_share(means, variances)
    assert spread.mean() == pytest.approx(1 / 7, abs=0.005)
    assert share.mean() == pytest.approx(1 / 2, abs=0.005)
    assert 0 <= min(spread.min(), share.min()) <= max(spread.max(), share.max()) <= 1
    nothing = [np.zeros((200, 200, 1))] * 2
    assert np.isnan(statistics.spread_share(means, nothing)).all()
    assert np.isnan(statistics.variance_share(means, nothing)).all()


def test_the_bound_is_sidaks_of_hoeffdings():
    alone = 1 - (1 - statistics.FALSE_ALARM / statistics.FAMILIES) ** (1 / 100)
    assert 2 * np.exp(-(statistics.bound_of(100) ** 2) / 2) == pytest.approx(alone)
    assert statistics.bound_of(1) < statistics.bound_of(2) < statistics.bound_of(1000)


@pytest.mark.parametrize("size", [(5, 7), (48, 40), (112, 112), (33, 100)])
def test_tiles_cover_the_image_once_and_are_large_enough(size: tuple[int, int]):
    count = np.zeros(size, int)
    for part in statistics.tiles(*size):
        count[part] += 1
        assert count[part].shape >= tuple(min(side, statistics.TILE) for side in size)
    assert (count == 1).all()
